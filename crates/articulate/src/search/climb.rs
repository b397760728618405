//! A pose moved uphill.

use crate::model::mean::mean_point;
use crate::observe::sample::Sample;
use glam::DVec3;
use hingecast_geom::{JointKind, Pose, Screw};

/// Steps of the climb, voxels.
const STEPS_VOXELS: [f64; 3] = [4.0, 2.0, 1.0];

/// Moves a pose uphill in six directions: shifts along the axes of the coordinates and turns about
/// the samples' centre. ICP alone leaves a plate where it lies in its own plane.
pub fn climb(start: Pose, samples: &[Sample], voxel: f64, score: &dyn Fn(Pose) -> f32) -> Pose {
    let centre = start.apply(mean_point(samples.iter().map(|s| s.point)));
    let far = samples.iter().map(|s| start.apply(s.point.as_dvec3()).distance_squared(centre)).sum::<f64>();
    let radius = (far / samples.len() as f64).sqrt().max(voxel);
    let mut best = (score(start), start);
    for step in STEPS_VOXELS {
        // Up to a few steps of this length.
        for _ in 0..3 {
            let before = best.0;
            for k in 0..12 {
                let axis = DVec3::AXES[k % 3] * if k % 6 < 3 { 1.0 } else { -1.0 } * step * voxel;
                let about = best.1.apply(start.inverse().apply(centre));
                let moved = if k < 6 {
                    Pose { trans: best.1.trans + axis, ..best.1 }
                } else {
                    let turn = Screw { kind: JointKind::Revolute, axis: axis.normalize(), pivot: about };
                    turn.motion(step * voxel / radius) * best.1
                };
                let there = score(moved);
                if there > best.0 + 1e-4 {
                    best = (there, moved);
                }
            }
            if best.0 <= before {
                break;
            }
        }
    }
    best.1
}
