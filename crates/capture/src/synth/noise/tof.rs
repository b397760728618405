//! Depth of a time-of-flight sensor, such as a phone's LiDAR: smoothed; pixels at edges fly between
//! what is in front and what is behind; dark and steep surfaces read too far.

use super::shape::Shape;
use crate::synth::output::Exposure;
use crate::synth::smooth::Smooth;
use hingecast_geom::Camera;
use hingecast_geom::random::normal;

/// Black reads this much farther than white, m.
const DARK: f64 = 0.008;
/// A surface at 60 degrees reads this much too far, m: the bias grows as 1 / cos - 1, up to twice
/// that.
const STEEP: f64 = 0.004;
/// Standard deviation at 0 m, and what each square metre of distance adds, m; for white, black has
/// three times that.
const NOISE: f64 = 0.001;
const NOISE_PER_SQUARE: f64 = 0.001;
/// Neighbours share most of it: the depth is interpolated from fewer points. Pixels.
const POINTS: f64 = 5.0;
/// Share of the pixels at an edge that the sensor gives up, not sure of either side.
const GIVEN_UP: f64 = 0.25;
/// Farther than this nothing comes back, m.
const FARTHEST: f64 = 5.0;
/// Steeper than this nothing comes back: the tangent of 83 degrees.
const STEEPEST: f64 = 8.0;

pub(super) fn depth(e: &mut Exposure, camera: &Camera, metres_per_unit: f64, rng: &mut fastrand::Rng) {
    let (w, h) = (camera.width, camera.height);
    let exact = e.depth.clone();
    let shared = Smooth::new(w, h, POINTS, rng);
    // What each pixel alone would read, m; 0: nothing.
    let mut alone = vec![0.0; w * h];
    let mut given_up = vec![false; w * h];
    for i in 0..w * h {
        let (own, luck) = (normal(rng), rng.f64());
        if exact[i] == 0.0 {
            continue;
        }
        let shape = Shape::at(&exact, camera, i % w, i / w);
        let metres = f64::from(exact[i]) * metres_per_unit;
        let gray = e.rgb[3 * i..3 * i + 3].iter().map(|c| f64::from(*c)).sum::<f64>() / (3.0 * 255.0);
        let slant = (shape.steep.hypot(1.0) - 1.0).min(2.0);
        let noise = (NOISE + NOISE_PER_SQUARE * metres * metres) * (3.0 - 2.0 * gray);
        let bias = DARK * (0.5 - gray) + STEEP * slant;
        alone[i] = metres + bias + noise * (shared.at(i % w, i / w) + 0.3 * own);
        given_up[i] = metres > FARTHEST || shape.steep > STEEPEST || shape.step && luck < GIVEN_UP;
    }
    for i in 0..w * h {
        e.depth[i] = if exact[i] == 0.0 || given_up[i] {
            0.0
        } else {
            (around(&alone, w, h, i % w, i / w) / metres_per_unit) as f32
        };
    }
}

/// Mean over 3 x 3 pixels, the middle counts most: 1 2 1 both ways.
fn around(alone: &[f64], w: usize, h: usize, x: usize, y: usize) -> f64 {
    let (mut sum, mut weights) = (0.0, 0.0);
    for v in y.saturating_sub(1)..(y + 2).min(h) {
        for u in x.saturating_sub(1)..(x + 2).min(w) {
            let weight = (1 + usize::from(u == x)) as f64 * (1 + usize::from(v == y)) as f64;
            if alone[v * w + u] > 0.0 {
                sum += weight * alone[v * w + u];
                weights += weight;
            }
        }
    }
    sum / weights
}

#[cfg(test)]
mod tests {
    use super::super::scene::{steps, wall};
    use super::*;

    #[test]
    fn pixels_at_edges_fly_between_front_and_back() {
        let (mut e, camera) = steps();
        depth(&mut e, &camera, 1.0, &mut fastrand::Rng::with_seed(1));
        let flying = |x: usize| (0..64).filter(|y| (1.06..1.44).contains(&e.depth[y * 64 + x])).count();
        assert!(flying(39) > 30 && flying(40) > 30, "{} {}", flying(39), flying(40));
        assert!(flying(30) == 0 && flying(50) == 0);
        let lost = (0..64).filter(|y| e.depth[y * 64 + 40] == 0.0).count();
        assert!((4..32).contains(&lost), "{lost} of 64 given up");
    }

    #[test]
    fn dark_and_steep_surfaces_read_too_far() {
        let mean = |gray: u8, slope: f32| {
            let (mut e, camera) = wall(1.0);
            e.rgb.fill(gray);
            let exact: Vec<f32> = (0..64 * 64).map(|i| 1.0 + slope * ((i % 64) as f32 - 31.5) / 87.7).collect();
            e.depth = exact.clone();
            depth(&mut e, &camera, 1.0, &mut fastrand::Rng::with_seed(2));
            let inner = (0..64 * 64).filter(|i| (8..56).contains(&(i % 64)));
            inner.map(|i| f64::from(e.depth[i] - exact[i])).sum::<f64>() / (48.0 * 64.0)
        };
        let (white, black) = (mean(255, 0.0), mean(0, 0.0));
        assert!((0.006..0.010).contains(&(black - white)), "white {white}, black {black}");
        let (gray, steep) = (mean(128, 0.0), mean(128, 1.0));
        assert!(gray.abs() < 0.001 && (0.0008..0.004).contains(&(steep - gray)), "straight {gray}, steep {steep}");
    }

    #[test]
    fn noise_is_smooth() {
        let (mut e, camera) = wall(1.0);
        depth(&mut e, &camera, 1.0, &mut fastrand::Rng::with_seed(3));
        let off = |x: usize, y: usize| f64::from(e.depth[y * 64 + x] - 1.0);
        let inner = || (0..60 * 64).map(|k| (k % 60, k / 60));
        let square: f64 = inner().map(|(x, y)| off(x, y).powi(2)).sum();
        let along: f64 = inner().map(|(x, y)| off(x, y) * off(x + 1, y)).sum();
        let std = (square / (60.0 * 64.0)).sqrt();
        assert!((0.0008..0.005).contains(&std) && along / square > 0.8, "{std} m, together {}", along / square);
    }
}
