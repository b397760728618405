//! AVX-512 (F, VL, DQ, BW): sixteen lanes.
//!
//! Safety: values of this type are only made inside kernels that `kernels.rs` hands out after the
//! CPU was asked.

use super::{LOG2_SERIES, Lanes};
use core::arch::x86_64::*;
use std::ops::{Add, Div, Mul, Sub};

/// Sixteen lanes in one AVX-512 register.
#[derive(Clone, Copy)]
pub struct Avx512(__m512);

macro_rules! operator {
    ($name:ident, $f:ident, $intrinsic:ident) => {
        impl $name for Avx512 {
            type Output = Self;
            #[inline(always)]
            fn $f(self, b: Self) -> Self {
                unsafe { Avx512($intrinsic(self.0, b.0)) }
            }
        }
    };
}
operator!(Add, add, _mm512_add_ps);
operator!(Sub, sub, _mm512_sub_ps);
operator!(Mul, mul, _mm512_mul_ps);
operator!(Div, div, _mm512_div_ps);

/// Minimax polynomial of 2^f on [0, 1), relative error 1e-7.
const EXP2_FLOOR: [f32; 6] = [0.999_999_93, 0.693_152_97, 0.240_154_53, 0.055_823_605, 0.008_992_584, 0.001_876_232_9];

impl Lanes for Avx512 {
    const N: usize = 16;
    type Mask = __mmask16;

    #[inline(always)]
    fn splat(x: f32) -> Self {
        unsafe { Avx512(_mm512_set1_ps(x)) }
    }
    #[inline(always)]
    unsafe fn load_ptr(p: *const f32) -> Self {
        unsafe { Avx512(_mm512_loadu_ps(p)) }
    }
    #[inline(always)]
    unsafe fn store_ptr(self, p: *mut f32) {
        unsafe { _mm512_storeu_ps(p, self.0) }
    }
    #[inline(always)]
    fn fma(self, b: Self, c: Self) -> Self {
        unsafe { Avx512(_mm512_fmadd_ps(self.0, b.0, c.0)) }
    }
    #[inline(always)]
    fn fnma(self, b: Self, c: Self) -> Self {
        unsafe { Avx512(_mm512_fnmadd_ps(self.0, b.0, c.0)) }
    }
    #[inline(always)]
    fn min(self, b: Self) -> Self {
        unsafe { Avx512(_mm512_min_ps(self.0, b.0)) }
    }
    #[inline(always)]
    fn max(self, b: Self) -> Self {
        unsafe { Avx512(_mm512_max_ps(self.0, b.0)) }
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        unsafe { Avx512(_mm512_sqrt_ps(self.0)) }
    }
    #[inline(always)]
    fn ge(self, b: Self) -> __mmask16 {
        unsafe { _mm512_cmp_ps_mask::<_CMP_GE_OQ>(self.0, b.0) }
    }
    #[inline(always)]
    fn and(a: __mmask16, b: __mmask16) -> __mmask16 {
        a & b
    }
    #[inline(always)]
    fn bits(m: __mmask16) -> u32 {
        u32::from(m)
    }
    #[inline(always)]
    fn keep(self, m: __mmask16) -> Self {
        unsafe { Avx512(_mm512_maskz_mov_ps(m, self.0)) }
    }
    #[inline(always)]
    fn select(self, m: __mmask16, other: Self) -> Self {
        unsafe { Avx512(_mm512_mask_blend_ps(m, other.0, self.0)) }
    }
    #[inline(always)]
    fn rough_recip(self) -> Self {
        unsafe { Avx512(_mm512_rcp14_ps(self.0)) }
    }
    #[inline(always)]
    fn rough_rsqrt(self) -> Self {
        unsafe { Avx512(_mm512_rsqrt14_ps(self.0)) }
    }
    #[inline(always)]
    fn exp2(self) -> Self {
        unsafe {
            // scalef into the denormal range costs a microcode assist per vector: twice the time of
            // the whole kernel.
            let x = _mm512_max_ps(self.0, _mm512_set1_ps(-64.0));
            let f = _mm512_reduce_ps::<0x09>(x); // x - floor(x)
            let mut p = _mm512_set1_ps(EXP2_FLOOR[5]);
            p = _mm512_fmadd_ps(p, f, _mm512_set1_ps(EXP2_FLOOR[4]));
            p = _mm512_fmadd_ps(p, f, _mm512_set1_ps(EXP2_FLOOR[3]));
            p = _mm512_fmadd_ps(p, f, _mm512_set1_ps(EXP2_FLOOR[2]));
            p = _mm512_fmadd_ps(p, f, _mm512_set1_ps(EXP2_FLOOR[1]));
            p = _mm512_fmadd_ps(p, f, _mm512_set1_ps(EXP2_FLOOR[0]));
            Avx512(_mm512_scalef_ps(p, x))
        }
    }
    #[inline(always)]
    fn log2(self) -> Self {
        unsafe {
            let e = Avx512(_mm512_getexp_ps(self.0));
            let m = Avx512(_mm512_getmant_ps::<0, 0>(self.0));
            let one = Self::splat(1.0);
            let t = (m - one) / (m + one);
            let u = t * t;
            let mut p = Self::splat(LOG2_SERIES[4]);
            p = p.fma(u, Self::splat(LOG2_SERIES[3]));
            p = p.fma(u, Self::splat(LOG2_SERIES[2]));
            p = p.fma(u, Self::splat(LOG2_SERIES[1]));
            p = p.fma(u, Self::splat(LOG2_SERIES[0]));
            p.fma(t, e)
        }
    }
    #[inline(always)]
    fn sum(self) -> f32 {
        unsafe { _mm512_reduce_add_ps(self.0) }
    }

    const SUM_AT: [usize; 10] = [0, 4, 8, 12, 1, 5, 9, 13, 2, 6];
    #[inline(always)]
    unsafe fn store_sums(a: &[Self; 10], row: *mut f32) {
        unsafe { _mm512_storeu_ps(row, sum_tree(a)) }
    }
    #[inline(always)]
    fn transpose(from: &[[f32; 16]; 16], to: &mut [[f32; 16]]) {
        unsafe { transpose16(from, to) }
    }
}

/// Ten lane sums by one tree of shuffles: fold halves, fold quarters, then transpose-and-add inside
/// 128-bit lanes.
#[inline(always)]
unsafe fn sum_tree(a: &[Avx512; 10]) -> __m512 {
    unsafe {
        let zero = _mm512_setzero_ps();
        macro_rules! halves {
            ($a:expr, $b:expr) => {
                _mm512_add_ps(_mm512_shuffle_f32x4::<0x44>($a, $b), _mm512_shuffle_f32x4::<0xEE>($a, $b))
            };
        }
        macro_rules! quarters {
            ($a:expr, $b:expr) => {
                _mm512_add_ps(_mm512_shuffle_f32x4::<0x88>($a, $b), _mm512_shuffle_f32x4::<0xDD>($a, $b))
            };
        }
        let p0 = halves!(a[0].0, a[1].0);
        let p1 = halves!(a[2].0, a[3].0);
        let p2 = halves!(a[4].0, a[5].0);
        let p3 = halves!(a[6].0, a[7].0);
        let p4 = halves!(a[8].0, a[9].0);
        // Each 128-bit lane of q holds four partial sums of one input: q0 = inputs 0..4, q1 = 4..8,
        // q2 = 8, 9, 0, 0.
        let q0 = quarters!(p0, p1);
        let q1 = quarters!(p2, p3);
        let q2 = quarters!(p4, zero);
        let t0 = _mm512_add_ps(_mm512_unpacklo_ps(q0, q1), _mm512_unpackhi_ps(q0, q1));
        let t1 = _mm512_add_ps(_mm512_unpacklo_ps(q2, zero), _mm512_unpackhi_ps(q2, zero));
        _mm512_add_ps(_mm512_shuffle_ps::<0x44>(t0, t1), _mm512_shuffle_ps::<0xEE>(t0, t1))
    }
}

#[inline(always)]
unsafe fn transpose16(from: &[[f32; 16]; 16], to: &mut [[f32; 16]]) {
    assert!(to.len() >= 16);
    unsafe {
        let mut r = [_mm512_setzero_ps(); 16];
        let mut t = r;
        for i in 0..16 {
            r[i] = _mm512_loadu_ps(from[i].as_ptr());
        }
        for i in 0..8 {
            t[2 * i] = _mm512_unpacklo_ps(r[2 * i], r[2 * i + 1]);
            t[2 * i + 1] = _mm512_unpackhi_ps(r[2 * i], r[2 * i + 1]);
        }
        for i in 0..4 {
            let a = _mm512_castps_pd(t[4 * i]);
            let b = _mm512_castps_pd(t[4 * i + 1]);
            let c = _mm512_castps_pd(t[4 * i + 2]);
            let d = _mm512_castps_pd(t[4 * i + 3]);
            r[4 * i] = _mm512_castpd_ps(_mm512_unpacklo_pd(a, c));
            r[4 * i + 1] = _mm512_castpd_ps(_mm512_unpackhi_pd(a, c));
            r[4 * i + 2] = _mm512_castpd_ps(_mm512_unpacklo_pd(b, d));
            r[4 * i + 3] = _mm512_castpd_ps(_mm512_unpackhi_pd(b, d));
        }
        for j in 0..4 {
            let x0 = _mm512_shuffle_f32x4::<0x88>(r[j], r[4 + j]);
            let x1 = _mm512_shuffle_f32x4::<0xdd>(r[j], r[4 + j]);
            let y0 = _mm512_shuffle_f32x4::<0x88>(r[8 + j], r[12 + j]);
            let y1 = _mm512_shuffle_f32x4::<0xdd>(r[8 + j], r[12 + j]);
            _mm512_storeu_ps(to[j].as_mut_ptr(), _mm512_shuffle_f32x4::<0x88>(x0, y0));
            _mm512_storeu_ps(to[4 + j].as_mut_ptr(), _mm512_shuffle_f32x4::<0x88>(x1, y1));
            _mm512_storeu_ps(to[8 + j].as_mut_ptr(), _mm512_shuffle_f32x4::<0xdd>(x0, y0));
            _mm512_storeu_ps(to[12 + j].as_mut_ptr(), _mm512_shuffle_f32x4::<0xdd>(x1, y1));
        }
    }
}
