//! Random numbers beyond fastrand's uniform ones.

use std::f64::consts::TAU;

/// One draw from N(0, 1) (Box and Muller 1958).
pub fn normal(rng: &mut fastrand::Rng) -> f64 {
    (-2.0 * (1.0 - rng.f64()).ln()).sqrt() * (TAU * rng.f64()).cos()
}
