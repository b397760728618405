//! Axes along their part's own faces, or square to them, as in nearly everything that people build, where the recording does not
//! contradict that.
//!
//! A closed drawer shows its front alone, and in two states nothing else tells whether it rises by a degree on its way. A closed
//! door's front may turn in its own plane by as much without leaving it.

use super::discover::poses_of;
use super::doubts::{behind, two_unknowns};
use super::evidence::{Evidence, Sample};
use super::propose::MANY_STATES;
use super::refine::{Settings, cost, refine};
use super::settle::Owners;
use glam::DVec3;
use hingecast_geom::{KinematicTree, Pose};
use nalgebra::{Matrix3, Vector3};

/// Faces within this angle of the axis, or of square to it, radians, say where it points; first roughly, then without those that are
/// curved or meant otherwise.
const NEARLY: [f64; 2] = [0.15, 0.04];
/// Share of a part's samples that must tell a direction from all others.
const ENOUGH: f64 = 0.01;
/// Faces do not know their directions better than this, radians.
const KNOWN: f64 = 0.001;
/// With many states, an axis that is nearly along the faces stays unless along them it explains the recording better by this many nats.
const CLEARLY: f64 = 1.0;
/// Axes less askew than this are left to refining, radians.
pub const ASKEW: f64 = 0.01;

/// Turns axes to where their part's faces say, one joint after another. With few states, and where the axis is far from there, they may
/// explain the recording a little worse: two unknowns less are worth their share of evidence.
pub fn straighten(evidence: &Evidence, tree: &mut KinematicTree, owners: &Owners, seed: u64) {
    let voxel = evidence.lattice.voxel as f64;
    let fit = Settings { gates: [1.0 * voxel, 0.6 * voxel], rounds: 4, partners: 6 };
    for j in 0..tree.joints.len() {
        let (child, screw) = (tree.joints[j].child, tree.joints[j].screw);
        let own = owners.members(evidence, child);
        let parent: Vec<Pose> = poses_of(tree, tree.joints[j].parent, evidence.n_states());
        let axis = along_faces(&parent, own.iter().map(|m| &m.sample), screw.axis, &NEARLY);
        let Some(axis) = axis.filter(|a| a.angle_between(screw.axis) > KNOWN) else {
            continue;
        };
        let free: Vec<bool> = (0..tree.joints.len()).map(|k| k == j).collect();
        let cost = |tree: &KinematicTree| cost(evidence, tree, &own, 0.6 * voxel, 6, seed);
        let mut straight = tree.clone();
        straight.joints[j].screw.axis = axis;
        if screw.kind.turns() {
            // Where it lies and how far it turns follow the new direction.
            refine(evidence, &mut straight, &own, &free, &fit, seed);
            straight.joints[j].screw.axis = axis;
        }
        let nats = behind(own.len(), cost(&straight), cost(tree));
        let doubtful = evidence.n_states() < MANY_STATES || axis.angle_between(screw.axis) > ASKEW;
        let most = if doubtful { two_unknowns(own.len()) } else { -CLEARLY };
        if nats < most {
            *tree = straight;
        }
    }
}

/// The direction that the faces nearly along `axis` and nearly square to it are along and square to, as well as they can be all at
/// once: the smallest eigenvector of the sum of n n' over the second minus that over the first. In the frame of the parent, whose poses
/// are `parent`; none where the faces leave it open. `nearly`: radians, from the first time to the last.
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
        if gap < ENOUGH * own.len() as f64 || d.dot(axis) < widest.cos() {
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
        let found = along_faces(&still, walls.iter(), askew, &NEARLY).expect("four walls know");
        assert!(found.angle_between(DVec3::Z) < 1e-6, "{found}");
        // One wall leaves a plane of directions open, none leaves all.
        assert_eq!(along_faces(&still, faces(&[Vec3::X; 5]).iter(), askew, &NEARLY), None);
        assert_eq!(along_faces(&still, faces(&[Vec3::new(1.0, 1.0, 1.0); 5]).iter(), askew, &NEARLY), None);
        // A front alone does say where a slide goes.
        let front = along_faces(&still, faces(&[Vec3::Z; 5]).iter(), askew, &NEARLY).expect("a front knows");
        assert!(front.angle_between(DVec3::Z) < 1e-6, "{front}");
    }
}
