//! AVX2 + FMA: eight lanes.
//!
//! Safety: values of this type are only made inside kernels that `kernels.rs` hands out after the
//! CPU was asked.

use super::{EXP2_ROUND, LOG2_SERIES, Lanes};
use core::arch::x86_64::*;
use std::ops::{Add, Div, Mul, Sub};

/// Eight lanes in one AVX register.
#[derive(Clone, Copy)]
pub struct Avx2(__m256);

macro_rules! operator {
    ($name:ident, $f:ident, $intrinsic:ident) => {
        impl $name for Avx2 {
            type Output = Self;
            #[inline(always)]
            fn $f(self, b: Self) -> Self {
                unsafe { Avx2($intrinsic(self.0, b.0)) }
            }
        }
    };
}
operator!(Add, add, _mm256_add_ps);
operator!(Sub, sub, _mm256_sub_ps);
operator!(Mul, mul, _mm256_mul_ps);
operator!(Div, div, _mm256_div_ps);

impl Lanes for Avx2 {
    const N: usize = 8;
    type Mask = __m256;

    #[inline(always)]
    fn splat(x: f32) -> Self {
        unsafe { Avx2(_mm256_set1_ps(x)) }
    }
    #[inline(always)]
    unsafe fn load_ptr(p: *const f32) -> Self {
        unsafe { Avx2(_mm256_loadu_ps(p)) }
    }
    #[inline(always)]
    unsafe fn store_ptr(self, p: *mut f32) {
        unsafe { _mm256_storeu_ps(p, self.0) }
    }
    #[inline(always)]
    fn fma(self, b: Self, c: Self) -> Self {
        unsafe { Avx2(_mm256_fmadd_ps(self.0, b.0, c.0)) }
    }
    #[inline(always)]
    fn fnma(self, b: Self, c: Self) -> Self {
        unsafe { Avx2(_mm256_fnmadd_ps(self.0, b.0, c.0)) }
    }
    #[inline(always)]
    fn min(self, b: Self) -> Self {
        unsafe { Avx2(_mm256_min_ps(self.0, b.0)) }
    }
    #[inline(always)]
    fn max(self, b: Self) -> Self {
        unsafe { Avx2(_mm256_max_ps(self.0, b.0)) }
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        unsafe { Avx2(_mm256_sqrt_ps(self.0)) }
    }
    #[inline(always)]
    fn ge(self, b: Self) -> __m256 {
        unsafe { _mm256_cmp_ps::<_CMP_GE_OQ>(self.0, b.0) }
    }
    #[inline(always)]
    fn and(a: __m256, b: __m256) -> __m256 {
        unsafe { _mm256_and_ps(a, b) }
    }
    #[inline(always)]
    fn bits(m: __m256) -> u32 {
        unsafe { _mm256_movemask_ps(m) as u32 }
    }
    #[inline(always)]
    fn keep(self, m: __m256) -> Self {
        unsafe { Avx2(_mm256_and_ps(self.0, m)) }
    }
    #[inline(always)]
    fn select(self, m: __m256, other: Self) -> Self {
        unsafe { Avx2(_mm256_blendv_ps(other.0, self.0, m)) }
    }
    #[inline(always)]
    fn rough_recip(self) -> Self {
        // 12 bits, then one Newton step.
        unsafe {
            let r = _mm256_rcp_ps(self.0);
            Avx2(_mm256_mul_ps(r, _mm256_fnmadd_ps(self.0, r, _mm256_set1_ps(2.0))))
        }
    }
    #[inline(always)]
    fn exp2(self) -> Self {
        unsafe {
            let x = _mm256_max_ps(self.0, _mm256_set1_ps(-64.0));
            let n = _mm256_round_ps::<{ _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC }>(x);
            let f = _mm256_sub_ps(x, n);
            let mut p = _mm256_set1_ps(EXP2_ROUND[5]);
            p = _mm256_fmadd_ps(p, f, _mm256_set1_ps(EXP2_ROUND[4]));
            p = _mm256_fmadd_ps(p, f, _mm256_set1_ps(EXP2_ROUND[3]));
            p = _mm256_fmadd_ps(p, f, _mm256_set1_ps(EXP2_ROUND[2]));
            p = _mm256_fmadd_ps(p, f, _mm256_set1_ps(EXP2_ROUND[1]));
            p = _mm256_fmadd_ps(p, f, _mm256_set1_ps(EXP2_ROUND[0]));
            let exponent = _mm256_slli_epi32::<23>(_mm256_cvtps_epi32(n));
            Avx2(_mm256_castsi256_ps(_mm256_add_epi32(exponent, _mm256_castps_si256(p))))
        }
    }
    #[inline(always)]
    fn log2(self) -> Self {
        unsafe {
            let bits = _mm256_castps_si256(self.0);
            let e = _mm256_sub_epi32(_mm256_srli_epi32::<23>(bits), _mm256_set1_epi32(127));
            let m =
                _mm256_or_si256(_mm256_and_si256(bits, _mm256_set1_epi32(0x007f_ffff)), _mm256_set1_epi32(0x3f80_0000));
            let (e, m, one) = (Avx2(_mm256_cvtepi32_ps(e)), Avx2(_mm256_castsi256_ps(m)), Self::splat(1.0));
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
        unsafe {
            let s = _mm_add_ps(_mm256_castps256_ps128(self.0), _mm256_extractf128_ps::<1>(self.0));
            let s = _mm_add_ps(s, _mm_movehl_ps(s, s));
            _mm_cvtss_f32(_mm_add_ss(s, _mm_shuffle_ps::<1>(s, s)))
        }
    }
    #[inline(always)]
    unsafe fn store_sums(a: &[Self; 10], row: *mut f32) {
        unsafe {
            // Eight sums by a tree of horizontal adds, the last two alone.
            let p = _mm256_hadd_ps(_mm256_hadd_ps(a[0].0, a[1].0), _mm256_hadd_ps(a[2].0, a[3].0));
            let q = _mm256_hadd_ps(_mm256_hadd_ps(a[4].0, a[5].0), _mm256_hadd_ps(a[6].0, a[7].0));
            let low = _mm256_permute2f128_ps::<0x20>(p, q);
            let high = _mm256_permute2f128_ps::<0x31>(p, q);
            _mm256_storeu_ps(row, _mm256_add_ps(low, high));
            *row.add(8) = a[8].sum();
            *row.add(9) = a[9].sum();
        }
    }
}
