//! Colour of a small sensor: noise of its own and of the light, an exposure per view.

use crate::synth::output::Exposure;
use hingecast_geom::random::normal;

/// sRGB steps of 255: read noise, and photon noise of white.
const READ_NOISE: f64 = 1.2;
const SHOT_NOISE: f64 = 2.0;
const EXPOSURE: f64 = 0.05;
const WHITE_BALANCE: f64 = 0.012;

/// Replaces the colours of a perfect exposure by those of a sensor.
pub(super) fn noise(e: &mut Exposure, rng: &mut fastrand::Rng) {
    let exposure = (EXPOSURE * normal(rng)).exp();
    let gain = [0; 3].map(|_| exposure * (WHITE_BALANCE * normal(rng)).exp());
    for (i, value) in e.rgb.iter_mut().enumerate() {
        let exact = f64::from(*value) * gain[i % 3];
        let std = (READ_NOISE.powi(2) + SHOT_NOISE.powi(2) * exact / 255.0).sqrt();
        *value = (exact + std * normal(rng)).round().clamp(0.0, 255.0) as u8;
    }
}
