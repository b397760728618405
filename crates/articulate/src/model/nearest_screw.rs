//! The screw nearest to a rigid motion.

use glam::DVec3;
use hingecast_geom::pose::rotation_vector;
use hingecast_geom::{JointKind, Pose, Screw};

/// Rotation and translation of a pose as the screw of the given kind that is nearest to it, and its
/// value.
pub fn nearest_screw(pose: &Pose, kind: JointKind, about: DVec3) -> Option<(Screw, f64)> {
    let w = rotation_vector(pose.rot);
    let shift = pose.apply(about) - about;
    match kind {
        JointKind::Prismatic => {
            let axis = shift.try_normalize()?;
            Some((Screw { kind, axis, pivot: about }, shift.length()))
        }
        _ => {
            let angle = w.length();
            let axis = w.try_normalize().filter(|_| angle > 0.02)?;
            let flat = shift - axis * shift.dot(axis);
            let pivot = about + 0.5 * flat + axis.cross(flat) / (2.0 * (0.5 * angle).tan());
            Some((Screw { kind, axis, pivot }, angle))
        }
    }
}
