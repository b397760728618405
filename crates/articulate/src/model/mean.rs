//! Means of points and of small motions.

use glam::{DVec3, Vec3};
use hingecast_geom::Pose;
use hingecast_geom::pose::{quat_from_rotation_vector, rotation_vector};

/// Mean position; the origin for no points.
pub fn mean_point(points: impl Iterator<Item = Vec3>) -> DVec3 {
    let (sum, n) = points.fold((DVec3::ZERO, 0.0), |(sum, n), x| (sum + x.as_dvec3(), n + 1.0));
    sum / f64::max(n, 1.0)
}

/// Takes the mean rotation, and the mean shift of the object's centre, out of the corrections.
pub fn without_mean(corrections: &[Pose], centre: DVec3) -> Vec<Pose> {
    let n = corrections.len() as f64;
    let turn = corrections.iter().map(|c| rotation_vector(c.rot)).sum::<DVec3>() / n;
    let shift = corrections.iter().map(|c| c.apply(centre) - centre).sum::<DVec3>() / n;
    let rot = quat_from_rotation_vector(turn);
    let back = Pose::new(rot, centre + shift - rot * centre).inverse();
    corrections.iter().map(|c| back * *c).collect()
}
