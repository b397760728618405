//! Plain arrays, vectorised by the compiler for whatever the target's baseline is (SSE2, NEON).

use super::{EXP2_ROUND, LOG2_SERIES, Lanes};
use std::ops::{Add, Div, Mul, Sub};

/// Eight lanes in an array, for compilers to make of it what they can.
#[derive(Clone, Copy)]
#[repr(align(32))]
pub struct Plain([f32; 8]);

macro_rules! each {
    ($i:ident, $e:expr) => {{
        let mut out = [0f32; 8];
        for $i in 0..8 {
            out[$i] = $e;
        }
        Plain(out)
    }};
}

macro_rules! operator {
    ($name:ident, $f:ident, $op:tt) => {
        impl $name for Plain {
            type Output = Self;
            #[inline(always)]
            fn $f(self, b: Self) -> Self {
                each!(i, self.0[i] $op b.0[i])
            }
        }
    };
}
operator!(Add, add, +);
operator!(Sub, sub, -);
operator!(Mul, mul, *);
operator!(Div, div, /);

#[inline(always)]
fn exp2(x: f32) -> f32 {
    // Adding 1.5 * 2^23 rounds to the nearest integer and leaves it in the low mantissa bits.
    const ROUND: f32 = 12_582_912.0;
    let x = if x > -64.0 { x } else { -64.0 };
    let t = x + ROUND;
    let f = x - (t - ROUND);
    let c = EXP2_ROUND;
    let p = c[0] + f * (c[1] + f * (c[2] + f * (c[3] + f * (c[4] + f * c[5]))));
    f32::from_bits((t.to_bits() << 23).wrapping_add(p.to_bits()))
}

#[inline(always)]
fn log2(x: f32) -> f32 {
    let bits = x.to_bits();
    let e = (bits >> 23) as i32 - 127;
    let m = f32::from_bits(bits & 0x007f_ffff | 0x3f80_0000);
    let t = (m - 1.0) / (m + 1.0);
    let u = t * t;
    let c = LOG2_SERIES;
    e as f32 + t * (c[0] + u * (c[1] + u * (c[2] + u * (c[3] + u * c[4]))))
}

impl Lanes for Plain {
    const N: usize = 8;
    type Mask = [u32; 8];

    #[inline(always)]
    fn splat(x: f32) -> Self {
        Plain([x; 8])
    }
    #[inline(always)]
    unsafe fn load_ptr(p: *const f32) -> Self {
        unsafe { Plain(p.cast::<[f32; 8]>().read_unaligned()) }
    }
    #[inline(always)]
    unsafe fn store_ptr(self, p: *mut f32) {
        unsafe { p.cast::<[f32; 8]>().write_unaligned(self.0) }
    }
    // Not `mul_add`: without FMA in the target that is a call into libm.
    #[inline(always)]
    fn fma(self, b: Self, c: Self) -> Self {
        each!(i, self.0[i] * b.0[i] + c.0[i])
    }
    #[inline(always)]
    fn fnma(self, b: Self, c: Self) -> Self {
        each!(i, c.0[i] - self.0[i] * b.0[i])
    }
    #[inline(always)]
    fn min(self, b: Self) -> Self {
        each!(i, if self.0[i] < b.0[i] { self.0[i] } else { b.0[i] })
    }
    #[inline(always)]
    fn max(self, b: Self) -> Self {
        each!(i, if self.0[i] > b.0[i] { self.0[i] } else { b.0[i] })
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        each!(i, self.0[i].sqrt())
    }
    #[inline(always)]
    fn ge(self, b: Self) -> [u32; 8] {
        let mut out = [0u32; 8];
        for i in 0..8 {
            out[i] = if self.0[i] >= b.0[i] { !0 } else { 0 };
        }
        out
    }
    #[inline(always)]
    fn and(a: [u32; 8], b: [u32; 8]) -> [u32; 8] {
        let mut out = [0u32; 8];
        for i in 0..8 {
            out[i] = a[i] & b[i];
        }
        out
    }
    #[inline(always)]
    fn bits(m: [u32; 8]) -> u32 {
        let mut out = 0;
        for i in 0..8 {
            out |= (m[i] & 1) << i;
        }
        out
    }
    #[inline(always)]
    fn keep(self, m: [u32; 8]) -> Self {
        each!(i, f32::from_bits(self.0[i].to_bits() & m[i]))
    }
    #[inline(always)]
    fn select(self, m: [u32; 8], other: Self) -> Self {
        each!(i, f32::from_bits(self.0[i].to_bits() & m[i] | other.0[i].to_bits() & !m[i]))
    }
    #[inline(always)]
    fn exp2(self) -> Self {
        each!(i, exp2(self.0[i]))
    }
    #[inline(always)]
    fn log2(self) -> Self {
        each!(i, log2(self.0[i]))
    }
    #[inline(always)]
    fn sum(self) -> f32 {
        let a = self.0;
        ((a[0] + a[4]) + (a[2] + a[6])) + ((a[1] + a[5]) + (a[3] + a[7]))
    }
}
