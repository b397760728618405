//! One small vector trait, three implementations: AVX-512, AVX2+FMA, plain arrays.
//!
//! Kernels are written once, generic over [`Lanes`], and compiled once per implementation inside a
//! `#[target_feature]` wrapper (see `kernels.rs`). Everything here is `inline(always)`: a call that
//! is not inlined, a closure or an array `map` would be compiled without the feature and turn each
//! operation into a function call.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod plain;

#[cfg(target_arch = "x86_64")]
pub use avx2::Avx2;
#[cfg(target_arch = "x86_64")]
pub use avx512::Avx512;
pub use plain::Plain;

use std::ops::{Add, Div, Mul, Sub};

/// `N` f32 side by side, N = 8 or 16.
pub trait Lanes:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + 'static
{
    const N: usize;
    type Mask: Copy;

    fn splat(x: f32) -> Self;
    /// # Safety
    /// `N` floats are readable at `p`.
    unsafe fn load_ptr(p: *const f32) -> Self;
    /// # Safety
    /// `N` floats are writable at `p`.
    unsafe fn store_ptr(self, p: *mut f32);

    /// The first `N` floats of `s`.
    #[inline(always)]
    fn load(s: &[f32]) -> Self {
        assert!(s.len() >= Self::N);
        unsafe { Self::load_ptr(s.as_ptr()) }
    }
    /// Writes the first `N` floats of `s`.
    #[inline(always)]
    fn store(self, s: &mut [f32]) {
        assert!(s.len() >= Self::N);
        unsafe { self.store_ptr(s.as_mut_ptr()) }
    }

    /// self * b + c
    fn fma(self, b: Self, c: Self) -> Self;
    /// c - self * b
    fn fnma(self, b: Self, c: Self) -> Self;
    fn min(self, b: Self) -> Self;
    fn max(self, b: Self) -> Self;
    fn sqrt(self) -> Self;
    /// self >= b; false for NaN.
    fn ge(self, b: Self) -> Self::Mask;
    fn and(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// One bit per lane, lane 0 lowest.
    fn bits(m: Self::Mask) -> u32;
    /// mask ? self : 0
    fn keep(self, m: Self::Mask) -> Self;
    /// mask ? self : other
    fn select(self, m: Self::Mask, other: Self) -> Self;
    /// 2^self, relative error 2e-7, for self in [-64, 126] (smaller counts as -64).
    fn exp2(self) -> Self;
    /// Sum of the lanes.
    fn sum(self) -> f32;

    /// Reciprocal good to 1e-4 relative, for gradients only.
    #[inline(always)]
    fn rough_recip(self) -> Self {
        Self::splat(1.0) / self
    }
    /// 1 / sqrt(self), good to 1e-4 relative, for Adam only.
    #[inline(always)]
    fn rough_rsqrt(self) -> Self {
        Self::splat(1.0) / self.sqrt()
    }
    /// e^self with the argument clamped to [-44, 60].
    #[inline(always)]
    fn exp(self) -> Self {
        (self * Self::splat(std::f32::consts::LOG2_E)).min(Self::splat(87.0)).exp2()
    }
    /// log2(self) for positive normal numbers, absolute error 2e-6.
    fn log2(self) -> Self;

    /// Where [`Lanes::store_sums`] puts sum k inside its 16-float row.
    const SUM_AT: [usize; 10] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9];
    /// Writes the lane sums of ten vectors into a 16-float row, at [`Lanes::SUM_AT`].
    ///
    /// # Safety
    /// 16 floats are writable at `row`.
    #[inline(always)]
    unsafe fn store_sums(a: &[Self; 10], row: *mut f32) {
        for k in 0..10 {
            unsafe { *row.add(k) = a[k].sum() };
        }
    }
    /// `from[k][lane]` -> `to[lane][k]`, the N lanes of 16 vectors.
    #[inline(always)]
    fn transpose(from: &[[f32; 16]; 16], to: &mut [[f32; 16]]) {
        for lane in 0..Self::N {
            for k in 0..16 {
                to[lane][k] = from[k][lane];
            }
        }
    }
    /// 0, 1, 2 ...
    #[inline(always)]
    fn iota() -> Self {
        const I: [f32; 16] = [0., 1., 2., 3., 4., 5., 6., 7., 8., 9., 10., 11., 12., 13., 14., 15.];
        Self::load(&I)
    }
}

/// Minimax polynomial of 2^f on [-0.5, 0.5], relative error 2e-7.
pub(crate) const EXP2_ROUND: [f32; 6] =
    [1.000_000_1, 0.693_146_95, 0.240_221_22, 0.055_507_426, 0.009_675_46, 0.001_326_697];

/// log2(m) = t (L0 + t^2 (L1 + ...)) with t = (m - 1) / (m + 1): the series of 2 atanh(t) / ln 2.
pub(crate) const LOG2_SERIES: [f32; 5] = [2.885_39, 0.961_796_7, 0.577_078, 0.412_198_6, 0.3306];
