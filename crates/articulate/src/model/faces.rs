//! Where the faces of a part say that its axis points: nearly everything that people build turns
//! and slides along or square to faces.

use crate::observe::sample::Sample;
use glam::DVec3;
use hingecast_geom::Pose;
use nalgebra::{Matrix3, Vector3};

/// Share of a part's samples that must tell a direction from all others.
const TELLING_SHARE: f64 = 0.01;
/// Axes less askew than this are left to Gauss and Newton, radians.
pub const ASKEW_RAD: f64 = 0.01;

/// The direction that the faces nearly along `axis` and nearly square to it are along and square
/// to, as well as they can be all at once: the smallest eigenvector of the sum of n n' over the
/// second minus that over the first. In the frame of the parent, whose poses are `parent`; none
/// where the faces leave it open. `nearly`: radians, from the first time to the last.
pub fn along_faces<'a>(
    parent: &[Pose],
    own: impl ExactSizeIterator<Item = &'a Sample> + Clone,
    axis: DVec3,
    nearly: &[f64],
) -> Option<DVec3> {
    let back: Vec<Pose> = parent.iter().map(Pose::inverse).collect();
    let (widest, mut d) = (nearly[0], axis);
    for nearly in nearly {
        let mut spread = Matrix3::zeros();
        for s in own.clone() {
            let n = back[s.state].rotate(s.normal.as_dvec3());
            let (along, n) = (n.dot(d).abs(), Vector3::new(n.x, n.y, n.z));
            if along > nearly.cos() {
                spread -= n * n.transpose();
            } else if along < nearly.sin() {
                spread += n * n.transpose();
            }
        }
        let eigen = spread.symmetric_eigen();
        let mut order = [0, 1, 2];
        order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
        let gap = eigen.eigenvalues[order[1]] - eigen.eigenvalues[order[0]];
        let least = eigen.eigenvectors.column(order[0]);
        let least = DVec3::new(least[0], least[1], least[2]);
        d = least * least.dot(axis).signum();
        if gap < TELLING_SHARE * own.len() as f64 || d.dot(axis) < widest.cos() {
            return None;
        }
    }
    Some(d)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn faces(normals: &[Vec3]) -> Vec<Sample> {
        normals.iter().map(|n| Sample { state: 0, point: Vec3::ZERO, normal: n.normalize() }).collect()
    }

    #[test]
    fn an_axis_goes_where_the_faces_say_and_nowhere_else() {
        let still = [Pose::IDENTITY];
        let askew = DVec3::new(0.08, -0.05, 1.0).normalize();
        // Walls square to z, and one that leans by 6 deg and is forgotten the second time.
        let walls = faces(&[Vec3::X, Vec3::Y, Vec3::X, Vec3::Y, Vec3::new(1.0, 0.0, 0.1)]);
        let found = along_faces(&still, walls.iter(), askew, &[0.15, 0.04]).expect("four walls know");
        assert!(found.angle_between(DVec3::Z) < 1e-6, "{found}");
        // One wall leaves a plane of directions open, none leaves all.
        assert_eq!(along_faces(&still, faces(&[Vec3::X; 5]).iter(), askew, &[0.15, 0.04]), None);
        assert_eq!(along_faces(&still, faces(&[Vec3::new(1.0, 1.0, 1.0); 5]).iter(), askew, &[0.15, 0.04]), None);
        // A front alone does say where a slide goes.
        let front = along_faces(&still, faces(&[Vec3::Z; 5]).iter(), askew, &[0.15, 0.04]).expect("a front knows");
        assert!(front.angle_between(DVec3::Z) < 1e-6, "{front}");
    }
}
