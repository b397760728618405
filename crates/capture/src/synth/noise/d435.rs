//! What an Intel RealSense D435 and a hand-held camera do to a perfect picture.
//!
//! Depth comes from disparity d = f b / z, so an error of s pixels in d is an error of s z^2 / (f
//! b) in z (Keselman et al. 2017, "Intel RealSense Stereoscopic Depth Cameras"). Disparity is
//! quantised. Stereo finds nothing at grazing angles and beside depth edges. Colours get noise and
//! each view its own exposure; masks, which a network made, are off by 1 to 3 pixels along the
//! edge; camera poses, which tracking made, by 0.5 deg and 3 mm.

use super::color;
use super::shape::Shape;
use crate::synth::output::Exposure;
use crate::synth::smooth::Smooth;
use crate::synth::world::masks::wander;
use glam::{DQuat, DVec3};
use hingecast_geom::random::normal;
use hingecast_geom::{Camera, Pose};

/// Focal length at 1280 x 720 [px] times baseline [m].
const FOCAL_TIMES_BASELINE: f64 = 640.0 * 0.050;
/// Standard deviations of the disparity [px at 1280 x 720]: pixel by pixel, and over patches (the
/// matching window). Together they give about 2 mm at 1 m, as measured on a textured wall.
const DISPARITY_FINE: f64 = 0.05;
const DISPARITY_PATCH: f64 = 0.04;
const DISPARITY_STEP: f64 = 1.0 / 32.0;
/// Chance that a pixel beside an edge is lost.
const EDGE_LOSS: f64 = 0.5;
const POSE_DEG: f64 = 0.5;
const POSE_METRES: f64 = 0.003;

/// Replaces a perfect exposure and camera by what would have been recorded.
pub(super) fn record(e: &mut Exposure, camera: &mut Camera, metres_per_unit: f64, rng: &mut fastrand::Rng) {
    depth(e, camera, metres_per_unit, rng);
    color::noise(e, rng);
    wander(&mut e.mask, camera.width, camera.height, rng);
    pose(camera, metres_per_unit, rng);
}

fn depth(e: &mut Exposure, camera: &Camera, metres_per_unit: f64, rng: &mut fastrand::Rng) {
    let (w, h) = (camera.width, camera.height);
    let exact = e.depth.clone();
    let patches = Smooth::new(w, h, 6.0, rng);
    for y in 0..h {
        for x in 0..w {
            let i = y * w + x;
            let z = exact[i];
            // Drawn for every pixel, so that one hole does not shift the noise of the rest.
            let (noise, luck) = (normal(rng), rng.f64());
            if z == 0.0 {
                continue;
            }
            let shape = Shape::at(&exact, camera, x, y);
            let grazing_loss = shape.grazing_loss();
            let loss = if shape.edge { EDGE_LOSS.max(grazing_loss) } else { grazing_loss };
            if luck < loss {
                e.depth[i] = 0.0;
                continue;
            }
            let metres = f64::from(z) * metres_per_unit;
            let disparity = FOCAL_TIMES_BASELINE / metres + DISPARITY_FINE * noise + DISPARITY_PATCH * patches.at(x, y);
            let disparity = (disparity / DISPARITY_STEP).round() * DISPARITY_STEP;
            e.depth[i] =
                if disparity > 0.0 { (FOCAL_TIMES_BASELINE / disparity / metres_per_unit) as f32 } else { 0.0 };
        }
    }
}

/// Root mean square over the three axes together: 0.5 deg and 3 mm.
fn pose(camera: &mut Camera, metres_per_unit: f64, rng: &mut fastrand::Rng) {
    let per_axis = 1.0 / 3f64.sqrt();
    let mut vector = |std: f64| DVec3::new(normal(rng), normal(rng), normal(rng)) * (std * per_axis);
    let (turn, shift) = (vector(POSE_DEG.to_radians()), vector(POSE_METRES / metres_per_unit));
    // In the camera's own frame: turning about the camera, not about the world's origin.
    camera.camera_from_world = Pose::new(DQuat::from_scaled_axis(turn), shift) * camera.camera_from_world;
}

#[cfg(test)]
mod tests {
    use super::super::scene::{steps, wall};
    use super::*;

    #[test]
    fn depth_noise_grows_with_the_square_of_the_distance() {
        let std = |z: f32| {
            let (mut e, camera) = wall(z);
            depth(&mut e, &camera, 1.0, &mut fastrand::Rng::with_seed(1));
            (e.depth.iter().map(|d| f64::from(d - z).powi(2)).sum::<f64>() / e.depth.len() as f64).sqrt()
        };
        let (near, far) = (std(1.0), std(2.0));
        assert!((0.001..0.004).contains(&near), "{near}");
        assert!((3.2..4.8).contains(&(far / near)), "{}", far / near);
    }

    #[test]
    fn poses_are_off_by_half_a_degree_and_three_millimetres() {
        let (mut angle, mut shift) = (0.0, 0.0);
        let n = 2000;
        for seed in 0..n {
            let (_, mut camera) = wall(1.0);
            let before = camera.camera_from_world;
            pose(&mut camera, 0.5, &mut fastrand::Rng::with_seed(seed));
            let off = camera.camera_from_world * before.inverse();
            angle += off.angle().to_degrees().powi(2);
            shift += (off.trans.length() * 0.5).powi(2);
        }
        let (angle, shift) = ((angle / n as f64).sqrt(), (shift / n as f64).sqrt());
        assert!((angle - 0.5).abs() < 0.02 && (shift - 0.003).abs() < 1.2e-4, "{angle} deg, {shift} m");
    }

    #[test]
    fn edges_and_grazing_surfaces_have_holes() {
        let (mut e, camera) = steps();
        depth(&mut e, &camera, 1.0, &mut fastrand::Rng::with_seed(5));
        let holes = |x: usize| (0..64).filter(|y| e.depth[y * 64 + x] == 0.0).count();
        assert!(holes(5) > 50, "grazing: {}", holes(5));
        assert!((15..50).contains(&holes(40)) && holes(30) == 0, "edge: {} {}", holes(40), holes(30));
    }
}
