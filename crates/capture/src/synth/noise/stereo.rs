//! Depth of a stereo camera as far as neighbouring pixels share its errors: blotches as large as
//! the matching window, which grow with the square of the distance; holes in one piece at depth
//! edges and where surfaces are seen at a grazing angle.
//!
//! z = f b / d: an error of s pixels in the disparity d is one of s z^2 / (f b) in z.

use super::shape::Shape;
use crate::synth::output::Exposure;
use crate::synth::smooth::Smooth;
use hingecast_geom::Camera;
use hingecast_geom::random::normal;

/// Focal length at 1280 x 720 [px] times baseline [m], of a D435.
const FOCAL_TIMES_BASELINE: f64 = 640.0 * 0.050;
/// Size of the blotches, pixels: one size a view.
const BLOTCH: [f64; 2] = [8.0, 20.0];
/// Standard deviations of the disparity [px at 1280 x 720], at the middle of a blotch and pixel by
/// pixel: 2.8 and 0.6 mm at 1 m.
const SHARED: f64 = 0.09;
const OWN: f64 = 0.02;
const STEP: f64 = 1.0 / 32.0;
/// Holes are pieces of about this size, pixels; they reach one pixel from an edge for so many
/// columns of the picture, and take this share of what is there.
const HOLE: f64 = 5.0;
const COLUMNS_PER_EDGE: usize = 320;
const AT_EDGE: f64 = 0.45;
/// Farther than this nothing is matched, m.
const FARTHEST: f64 = 8.0;

pub(super) fn depth(e: &mut Exposure, camera: &Camera, metres_per_unit: f64, rng: &mut fastrand::Rng) {
    let (w, h) = (camera.width, camera.height);
    let exact = e.depth.clone();
    let reach = (w / COLUMNS_PER_EDGE).max(1);
    let size = BLOTCH[0] + (BLOTCH[1] - BLOTCH[0]) * rng.f64();
    let (blotches, holes) = (Smooth::new(w, h, size, rng), Smooth::new(w, h, HOLE, rng));
    let shapes: Vec<Option<Shape>> =
        (0..w * h).map(|i| (exact[i] > 0.0).then(|| Shape::at(&exact, camera, i % w, i / w))).collect();
    for i in 0..w * h {
        let noise = normal(rng);
        let Some(shape) = &shapes[i] else { continue };
        let (x, y) = (i % w, i / w);
        let metres = f64::from(exact[i]) * metres_per_unit;
        let on_edge = |i: usize| shapes[i].as_ref().is_some_and(|s| s.step);
        let beside = |k: usize, n: usize| k.saturating_sub(reach)..(k + reach + 1).min(n);
        let near_edge = beside(y, h).any(|y| beside(x, w).any(|x| on_edge(y * w + x)));
        // The field is about -1 .. 1: a loss of one half takes its upper half.
        let loss = shape.grazing_loss().max(if near_edge { AT_EDGE } else { 0.0 });
        if metres > FARTHEST || loss > 0.0 && loss > 0.5 - 0.5 * holes.at(x, y) {
            e.depth[i] = 0.0;
            continue;
        }
        let disparity = FOCAL_TIMES_BASELINE / metres + SHARED * blotches.at(x, y) + OWN * noise;
        let disparity = (disparity / STEP).round() * STEP;
        e.depth[i] = if disparity > 0.0 { (FOCAL_TIMES_BASELINE / disparity / metres_per_unit) as f32 } else { 0.0 };
    }
}

#[cfg(test)]
mod tests {
    use super::super::scene::{steps, wall};
    use super::*;

    /// Errors of a wall at `z`, and how far those of pixels 3 and 40 apart go together (-1 .. 1).
    fn errors(z: f32) -> (f64, f64, f64) {
        let (mut square, mut near, mut far, mut n) = (0.0, 0.0, 0.0, 0.0);
        for seed in 0..40 {
            let (mut e, camera) = wall(z);
            depth(&mut e, &camera, 1.0, &mut fastrand::Rng::with_seed(seed * 0x9e37_79b9));
            let off = |x: usize, y: usize| f64::from(e.depth[y * 64 + x] - z);
            for (x, y) in (0..24 * 64).map(|k| (k % 24, k / 24)) {
                square += off(x, y).powi(2);
                near += off(x, y) * off(x + 3, y);
                far += off(x, y) * off(x + 40, y);
                n += 1.0;
            }
        }
        ((square / n).sqrt(), near / square, far / square)
    }

    #[test]
    fn noise_comes_in_blotches_and_grows_with_the_square_of_the_distance() {
        let (at_1, near, far) = errors(1.0);
        let (at_2, ..) = errors(2.0);
        assert!((0.001..0.004).contains(&at_1), "{at_1} m at 1 m");
        assert!((3.3..4.7).contains(&(at_2 / at_1)), "{} times as much at 2 m", at_2 / at_1);
        assert!(near > 0.6 && far.abs() < 0.2, "3 pixels apart {near}, 40 apart {far}");
    }

    #[test]
    fn edges_and_grazing_surfaces_have_holes() {
        let (mut e, camera) = steps();
        depth(&mut e, &camera, 1.0, &mut fastrand::Rng::with_seed(5));
        let holes = |x: usize| (0..64).filter(|y| e.depth[y * 64 + x] == 0.0).count();
        assert!(holes(5) > 50, "grazing: {}", holes(5));
        assert!((10..60).contains(&holes(40)) && holes(30) == 0, "edge: {} {}", holes(40), holes(30));
    }
}
