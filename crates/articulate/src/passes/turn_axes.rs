//! Axes that were found while the other parts were not known.
//!
//! The fronts of two equal drawers side by side, open nearly as far, are one long board as long as
//! neither is known: a slide 17 deg askew carries the one onto the other, a voxel off. When all
//! parts are found, each axis is tried along its part's faces and along other axes.

use super::pass::{Round, relabel};
use super::value_search::values_beside;
use crate::fit::gauss_newton::{Settings, gauss_newton};
use crate::fit::sweep_values::improved_values;
use crate::model::estimate::Estimate;
use crate::model::faces::{ASKEW_RAD, along_faces};
use crate::model::motions::poses_of;
use crate::model::owners::{ASKING, Owners, subset};
use crate::observe::evidence::Evidence;
use crate::score::claims::Claims;
use crate::score::likelihood::Likelihood;
use crate::score::verdict::Verdict;
use glam::DVec3;
use hingecast_geom::KinematicTree;

/// Other directions are sought within this angle, radians; faces within these then say it better.
/// See [`along_faces`].
const WITHIN_RAD: [f64; 3] = [0.6, 0.15, 0.04];
/// Another direction must explain the recording better by this many nats.
const BETTER_NATS: f64 = 3.0;

/// Axes turn to where faces or other axes point, where that explains the recording better.
pub fn turn_axes(round: &Round, estimate: &mut Estimate) {
    if turn(round.evidence, &mut estimate.tree, &estimate.owners, &estimate.verdicts[0], round.seed) {
        relabel(round, estimate);
    }
}

/// Turns axes to where faces or other axes point, where that explains the recording better.
/// `still`: the verdicts if nothing moved. Whether any was turned.
fn turn(evidence: &Evidence, tree: &mut KinematicTree, owners: &Owners, still: &[Verdict], seed: u64) -> bool {
    let likelihood = Likelihood::new(still, seed);
    let (mut any, mut held) = (false, None);
    for j in 0..tree.joints.len() {
        for axis in directions(evidence, tree, owners, j) {
            let other = along(evidence, tree, owners, j, axis, seed);
            let before = *held.get_or_insert_with(|| likelihood.nats(evidence, tree));
            let after = likelihood.nats(evidence, &other);
            if after > before + BETTER_NATS {
                (*tree, held) = (other, Some(after));
                any = true;
            }
        }
    }
    any
}

/// Where else the axis of joint `j` may point.
fn directions(evidence: &Evidence, tree: &KinematicTree, owners: &Owners, j: usize) -> Vec<DVec3> {
    let joint = &tree.joints[j];
    let (axis, place) = (joint.screw.axis, poses_of(tree, joint.parent, evidence.n_states()));
    let own = owners.members(evidence, joint.child);
    let faces = along_faces(&place, own.iter().map(|m| &m.sample), axis, &WITHIN_RAD);
    let others = tree.joints.iter().filter(|o| o.parent == joint.parent && o.child != joint.child);
    let others = others.map(|o| o.screw.axis * o.screw.axis.dot(axis).signum());
    let mut out: Vec<DVec3> = Vec::new();
    for d in faces.into_iter().chain(others) {
        let differs = |a: &DVec3| a.angle_between(d) > ASKEW_RAD;
        if differs(&axis) && axis.angle_between(d) < WITHIN_RAD[0] && out.iter().all(differs) {
            out.push(d);
        }
    }
    out
}

/// The tree with the axis of joint `j` turned, and everything else about that joint asked again.
fn along(
    evidence: &Evidence,
    tree: &KinematicTree,
    owners: &Owners,
    j: usize,
    axis: DVec3,
    seed: u64,
) -> KinematicTree {
    let mut out = tree.clone();
    out.joints[j].screw.axis = axis;
    let own = owners.members(evidence, out.joints[j].child);
    let parent_poses = poses_of(tree, tree.joints[j].parent, evidence.n_states());
    let claims = Claims::of_others(evidence, tree, j);
    let asking = subset(own.iter().map(|m| m.sample), ASKING, seed ^ j as u64);
    out.joints[j].values = improved_values(evidence, &claims, &out.joints[j], &asking, &parent_poses);
    let free: Vec<bool> = (0..out.joints.len()).map(|k| k == j).collect();
    for gate in [1.0, 0.6] {
        values_beside(evidence, &mut out, owners, seed);
        let settings = Settings::narrowing(gate, 0.5 * gate, evidence.lattice.voxel);
        gauss_newton(evidence, &mut out, &own, &free, &settings, seed);
    }
    out
}
