//! exp, tanh and sigmoid written so that compilers make vector code of the loops around them.
//!
//! A training step at hidden 400 asks for four million of these; libm's would take longer than the
//! matrix products. Cephes' polynomials (S. Moshier, expf.c and tanhf.c); no fused multiply-add, so
//! every instruction set gives the same bits.

/// e^x; relative error below 2e-7. Saturates outside -87 .. 88.
#[inline(always)]
pub fn exp(x: f32) -> f32 {
    // Adding 1.5 * 2^23 rounds to the nearest whole number and leaves it in the lowest bits.
    const ROUND: f32 = 12_582_912.0;
    let x = x.clamp(-87.0, 88.0);
    let z = x * std::f32::consts::LOG2_E + ROUND;
    let n = z - ROUND;
    // ln 2 in two pieces, the first short enough for n times it to be exact.
    let r = x - n * 0.693_359_4 - n * -2.121_944_4e-4;
    let p = 1.987_569_1e-4;
    let p = p * r + 1.398_199_9e-3;
    let p = p * r + 8.333_452e-3;
    let p = p * r + 4.166_579_6e-2;
    let p = p * r + 1.666_666_5e-1;
    let p = p * r + 5e-1;
    let p = p * r * r + r + 1.0;
    let power = z.to_bits().wrapping_sub(ROUND.to_bits()).wrapping_add(127) << 23;
    p * f32::from_bits(power)
}

/// 1 / (1 + e^-x).
#[inline(always)]
pub fn sigmoid(x: f32) -> f32 {
    1.0 / (1.0 + exp(-x))
}

/// Relative error below 3e-7.
#[inline(always)]
pub fn tanh(x: f32) -> f32 {
    let a = x.abs();
    let large = (1.0 - 2.0 / (exp(2.0 * a) + 1.0)).copysign(x);
    // Near 0 the difference above would lose the last digits.
    let s = x * x;
    let p = -5.704_988_7e-3;
    let p = p * s + 2.063_909e-2;
    let p = p * s - 5.373_971_6e-2;
    let p = p * s + 1.333_144_2e-1;
    let p = p * s - 3.333_328e-1;
    let small = p * s * x + x;
    if a < 0.625 { small } else { large }
}

/// ln(1 + e^x), without overflow and exact for very negative x.
#[inline(always)]
pub fn softplus(x: f32) -> f32 {
    x.max(0.0) + (-x.abs()).exp().ln_1p()
}

/// Compiles `$body` twice, for every CPU and for those with 8-wide vectors, and calls what the CPU
/// has.
macro_rules! vectorised {
    ($(#[$meta:meta])* pub fn $name:ident($($arg:ident: $type:ty),* $(,)?) $body:block) => {
        $(#[$meta])*
        pub fn $name($($arg: $type),*) {
            #[inline(always)]
            fn body($($arg: $type),*) $body
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2")]
                fn wide($($arg: $type),*) { body($($arg),*) }
                if is_x86_feature_detected!("avx2") {
                    // Sound: the CPU was just asked.
                    return unsafe { wide($($arg),*) };
                }
            }
            body($($arg),*)
        }
    };
}
pub(crate) use vectorised;

#[cfg(test)]
mod tests {
    use super::*;

    fn worst(f: fn(f32) -> f32, exact: fn(f64) -> f64, lo: f64, hi: f64) -> f64 {
        (0..200_001)
            .map(|i| lo + (hi - lo) * i as f64 / 200_000.0)
            .map(|x| {
                let x = x as f32;
                let truth = exact(x as f64);
                ((f(x) as f64 - truth) / truth.abs().max(1e-30)).abs()
            })
            .fold(0.0, f64::max)
    }

    #[test]
    fn errors_are_those_of_f32() {
        assert!(worst(exp, f64::exp, -86.0, 87.0) < 2e-7);
        assert!(worst(tanh, f64::tanh, -12.0, 12.0) < 3e-7);
        assert!(worst(tanh, f64::tanh, -1e-3, 1e-3) < 3e-7);
        assert!(worst(sigmoid, |x| 1.0 / (1.0 + (-x).exp()), -80.0, 80.0) < 5e-7);
        assert!(worst(softplus, |x| x.exp().ln_1p(), -80.0, 80.0) < 5e-7);
    }

    #[test]
    fn far_out_they_saturate_and_nan_stays() {
        for x in [-1e30, -100.0, 100.0, 1e30, f32::INFINITY] {
            assert!(exp(x).is_finite() && tanh(x).abs() <= 1.0 && (0.0..=1.0).contains(&sigmoid(x)), "{x}");
        }
        assert!(exp(f32::NAN).is_nan() && tanh(f32::NAN).is_nan() && sigmoid(f32::NAN).is_nan());
    }
}
