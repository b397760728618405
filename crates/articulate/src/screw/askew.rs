//! Axes that were found while the other parts were not known.
//!
//! The fronts of two equal drawers side by side, open nearly as far, are one long board as long as neither is known: a slide 17 deg askew
//! carries the one onto the other, a voxel off. When all parts are found, each axis is tried along its part's faces and along other axes.

use super::adopt::asked_again;
use super::discover::poses_of;
use super::evidence::{Evidence, Verdict};
use super::nearby::look_beside;
use super::refine::{Settings, refine};
use super::settle::{Owners, mark_others, some};
use super::straight::{ASKEW, along_faces};
use super::whole::Whole;
use glam::DVec3;
use hingecast_geom::KinematicTree;

/// Other directions are sought within this angle, radians; faces within these then say it better. See [`along_faces`].
const WITHIN: [f64; 3] = [0.6, 0.15, 0.04];
/// Another direction must explain the recording better by this many nats.
const BETTER: f64 = 3.0;

/// Turns axes to where faces or other axes point, where that explains the recording better. `still`: the verdicts if nothing moved.
/// Whether any was turned.
pub fn turn(evidence: &mut Evidence, tree: &mut KinematicTree, owners: &Owners, still: &[Verdict], seed: u64) -> bool {
    let whole = Whole::new(evidence, still, seed);
    let (mut any, mut held) = (false, None);
    for j in 0..tree.joints.len() {
        for axis in directions(evidence, tree, owners, j) {
            let other = along(evidence, tree, owners, j, axis, seed);
            let before = *held.get_or_insert_with(|| whole.nats(evidence, tree));
            let after = whole.nats(evidence, &other);
            if after > before + BETTER {
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
    let faces = along_faces(&place, own.iter().map(|m| &m.sample), axis, &WITHIN);
    let others = tree.joints.iter().filter(|o| o.parent == joint.parent && o.child != joint.child);
    let others = others.map(|o| o.screw.axis * o.screw.axis.dot(axis).signum());
    let mut out: Vec<DVec3> = Vec::new();
    for d in faces.into_iter().chain(others) {
        let differs = |a: &DVec3| a.angle_between(d) > ASKEW;
        if differs(&axis) && axis.angle_between(d) < WITHIN[0] && out.iter().all(differs) {
            out.push(d);
        }
    }
    out
}

/// The tree with the axis of joint `j` turned, and everything else about that joint asked again.
fn along(
    evidence: &mut Evidence,
    tree: &KinematicTree,
    owners: &Owners,
    j: usize,
    axis: DVec3,
    seed: u64,
) -> KinematicTree {
    let mut out = tree.clone();
    out.joints[j].screw.axis = axis;
    let own = owners.members(evidence, out.joints[j].child);
    let place = mark_others(evidence, tree, j);
    let asking = some(own.iter().map(|m| m.sample), seed ^ j as u64);
    out.joints[j].values = asked_again(evidence, &out.joints[j], &asking, &place);
    let free: Vec<bool> = (0..out.joints.len()).map(|k| k == j).collect();
    let voxel = evidence.lattice.voxel as f64;
    for gate in [1.0, 0.6] {
        look_beside(evidence, &mut out, owners, seed);
        let settings = Settings { gates: [gate * voxel, 0.5 * gate * voxel], rounds: 6, partners: 6 };
        refine(evidence, &mut out, &own, &free, &settings, seed);
    }
    out
}
