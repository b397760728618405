//! The rival of a joint: the other type, fitted as well as it can be.

use super::gauss_newton::{Settings, gauss_newton};
use crate::model::owners::Member;
use crate::observe::evidence::Evidence;
use crate::score::compare::{REFUTED_NATS, bic_of_two_unknowns, nats_behind};
use glam::DVec3;
use hingecast_geom::{Joint, JointKind, KinematicTree};

/// A hinge that turns less than this in all, radians, moves its part like a slide.
const SAME_AS_SLIDE_RAD: f64 = 0.02;

/// The tree with joint `j` of the other type, fitted as well as it can be, and how many nats it is
/// behind.
pub fn rival(
    evidence: &Evidence,
    tree: &KinematicTree,
    j: usize,
    members: &[Member],
    seed: u64,
) -> (KinematicTree, f64) {
    let voxel = evidence.lattice.voxel as f64;
    let settings = Settings { gates: [0.6 * voxel, 0.6 * voxel], rounds: 4, partners: 6 };
    let mut free = vec![false; tree.joints.len()];
    free[j] = true;
    let own = gauss_newton(evidence, &mut tree.clone(), members, &free, &settings, seed);
    let mut other = tree.clone();
    let kind = imitate(&mut other.joints[j], members);
    // The imitation is coarse: give it room to find its place.
    let wide = Settings { gates: [2.0 * voxel, 0.6 * voxel], rounds: 8, partners: 6 };
    gauss_newton(evidence, &mut other, members, &free, &wide, seed);
    let theirs = gauss_newton(evidence, &mut other, members, &free, &settings, seed);
    // A hinge has two unknowns more than a slide.
    let extra = bic_of_two_unknowns(members.len()) * if kind == JointKind::Prismatic { -1.0 } else { 1.0 };
    // A hinge that hardly turns is the slide in other words, not a rival.
    let turn = other.joints[j].values.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    let same = if kind.turns() && turn < SAME_AS_SLIDE_RAD { REFUTED_NATS } else { 0.0 };
    let nats = nats_behind(members.len(), theirs.cost, own.cost) + extra + same;
    (other, nats)
}

/// Turns a hinge into the slide that moves the part's middle alike, and a slide into a hinge far
/// away.
fn imitate(joint: &mut Joint, members: &[Member]) -> JointKind {
    let n = members.len().max(1) as f64;
    let centre = members.iter().map(|m| m.sample.point.as_dvec3()).sum::<DVec3>() / n;
    let far = joint.values.iter().copied().fold(0.0, |m: f64, v| if v.abs() > m.abs() { v } else { m });
    let screw = &mut joint.screw;
    if screw.kind.turns() {
        let moved = screw.motion(far).apply(centre) - centre;
        let shift = moved.length();
        screw.axis = moved.try_normalize().unwrap_or(DVec3::X);
        screw.kind = JointKind::Prismatic;
        let scale = if far == 0.0 { 0.0 } else { shift / far };
        joint.values.iter_mut().for_each(|v| *v *= scale);
    } else {
        let reach = members.iter().map(|m| m.sample.point.as_dvec3().distance(centre)).fold(0.0, f64::max);
        let radius = 20.0 * (reach + far.abs());
        let side = screw.axis.any_orthonormal_vector();
        // Motion along the axis is a small turn about a line to the side.
        screw.kind = JointKind::Revolute;
        screw.pivot = centre - side * radius;
        screw.axis = side.cross(screw.axis);
        joint.values.iter_mut().for_each(|v| *v /= radius);
    }
    screw.kind
}
