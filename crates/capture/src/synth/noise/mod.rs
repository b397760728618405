//! Imitated sensors: what they do to a perfect picture.
//!
//! A D435 comes with all that is usual around it: ragged masks and poses that are off, each by
//! itself. `stereo` and `tof` do depth and colour alone, with the errors that neighbouring pixels
//! share; masks and drift are settings of their own (`world`).

mod color;
mod d435;
mod shape;
mod stereo;
mod tof;

use super::Noise;
use super::output::Exposure;
use hingecast_geom::Camera;

/// Replaces a perfect exposure and camera by what would have been recorded.
pub(super) fn sense(
    noise: Noise,
    e: &mut Exposure,
    camera: &mut Camera,
    metres_per_unit: f64,
    rng: &mut fastrand::Rng,
) {
    match noise {
        Noise::None => {}
        Noise::D435 => d435::record(e, camera, metres_per_unit, rng),
        Noise::Stereo => {
            stereo::depth(e, camera, metres_per_unit, rng);
            color::noise(e, rng);
        }
        Noise::Tof => {
            tof::depth(e, camera, metres_per_unit, rng);
            color::noise(e, rng);
        }
    }
}

#[cfg(test)]
pub(super) mod scene {
    use super::*;
    use glam::DVec3;

    /// A wall seen straight on at `z` metres, 64 x 64 pixels.
    pub fn wall(z: f32) -> (Exposure, Camera) {
        let camera = Camera::look_at(DVec3::ZERO, DVec3::X, DVec3::Z, 64, 64, 0.7);
        let n = 64 * 64;
        let e = Exposure {
            rgb: vec![128; 3 * n],
            depth: vec![z; n],
            mask: vec![255; n],
            labels: vec![1; n],
            occluder: None,
            occluded: false,
        };
        (e, camera)
    }

    /// A wall at 85 degrees, from column 20 on one at 1 m, from column 40 on one at 1.5 m.
    pub fn steps() -> (Exposure, Camera) {
        let (mut e, camera) = wall(1.0);
        for i in 0..64 * 64 {
            let x = i % 64;
            e.depth[i] = if x < 20 {
                1.0 + 0.15 * x as f32
            } else if x < 40 {
                1.0
            } else {
                1.5
            };
        }
        (e, camera)
    }
}
