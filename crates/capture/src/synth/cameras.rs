//! Directions to cameras on the upper hemisphere.

use glam::DVec3;
use std::f64::consts::TAU;

/// Sines of the lowest and highest elevation: from just above the horizon to almost straight down.
pub(super) const LOWEST: f64 = 0.04;
const HIGHEST: f64 = 0.985;

/// `n` unit vectors from the centre to the cameras: a Fibonacci spiral, uniform over the area,
/// turned and jittered.
pub(crate) fn directions(n: usize, rng: &mut fastrand::Rng) -> Vec<DVec3> {
    let golden = TAU * (2.0 / (1.0 + 5f64.sqrt()));
    let turn = rng.f64() * TAU;
    // Up to 40 % of the distance between neighbours: enough to break the pattern, too little to
    // open holes.
    let jitter = 0.4 / (n.max(1) as f64).sqrt();
    (0..n)
        .map(|i| {
            let z = LOWEST + (HIGHEST - LOWEST) * (i as f64 + 0.5) / n as f64;
            let z = (z + jitter * (rng.f64() - 0.5)).clamp(LOWEST, HIGHEST);
            let azimuth = turn + golden * i as f64 + 2.0 * jitter * (rng.f64() - 0.5);
            let r = (1.0 - z * z).sqrt();
            DVec3::new(r * azimuth.cos(), r * azimuth.sin(), z)
        })
        .collect()
}
