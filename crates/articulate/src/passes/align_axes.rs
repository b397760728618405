//! Axes along their part's own faces, or square to them, as in nearly everything that people build,
//! where the recording does not contradict that.
//!
//! A closed drawer shows its front alone, and in two states nothing else tells whether it rises by
//! a degree on its way. A closed door's front may turn in its own plane by as much without leaving
//! it.

use super::pass::Round;
use crate::config::MANY_STATES;
use crate::fit::axis_odds::nats_against;
use crate::fit::gauss_newton::{Settings, cost, gauss_newton};
use crate::model::estimate::Estimate;
use crate::model::faces::{ASKEW_RAD, along_faces};
use crate::model::motions::poses_of;
use crate::model::owners::Owners;
use crate::observe::evidence::Evidence;
use crate::score::compare::{bic_of_two_unknowns, nats_behind};
use hingecast_geom::{KinematicTree, Pose};

/// Faces within this angle of the axis, or of square to it, radians, say where it points; first
/// roughly, then without those that are curved or meant otherwise.
const NEARLY_RAD: [f64; 2] = [0.15, 0.04];
/// Faces do not know their directions better than this, radians.
const KNOWN_RAD: f64 = 0.001;
/// With many states, an axis that is nearly along the faces stays unless along them it explains the
/// recording better by this many nats.
const CLEARLY_NATS: f64 = 1.0;
/// With many states, an axis that speaks against the faces by this many nats is believed: temples of
/// glasses taper, and their faces are a degree askew of their hinges.
const CONTRADICTED_NATS: f64 = 2.0;

/// Axes go along their parts' faces, where the recording does not contradict that.
pub fn align_axes(round: &Round, estimate: &mut Estimate) {
    straighten(round.evidence, &mut estimate.tree, &estimate.owners, round.seed);
}

/// Turns axes to where their part's faces say, one joint after another. With few states, and where
/// the axis is far from there, they may explain the recording a little worse: two unknowns less are
/// worth their share of evidence.
fn straighten(evidence: &Evidence, tree: &mut KinematicTree, owners: &Owners, seed: u64) {
    let voxel = evidence.lattice.voxel as f64;
    let fit = Settings { gates: [1.0 * voxel, 0.6 * voxel], rounds: 4, partners: 6 };
    let few_states = evidence.n_states() < MANY_STATES;
    for j in 0..tree.joints.len() {
        let (child, screw) = (tree.joints[j].child, tree.joints[j].screw);
        let own = owners.members(evidence, child);
        let parent: Vec<Pose> = poses_of(tree, tree.joints[j].parent, evidence.n_states());
        let axis = along_faces(&parent, own.iter().map(|m| &m.sample), screw.axis, &NEARLY_RAD);
        let Some(axis) = axis.filter(|a| a.angle_between(screw.axis) > KNOWN_RAD) else {
            continue;
        };
        let worth = bic_of_two_unknowns(own.len());
        let objection = if few_states { worth } else { CONTRADICTED_NATS };
        if nats_against(evidence, tree, &own, j, axis, &fit, seed) > objection {
            continue;
        }
        let free: Vec<bool> = (0..tree.joints.len()).map(|k| k == j).collect();
        let cost = |tree: &KinematicTree| cost(evidence, tree, &own, 0.6 * voxel, 6, seed);
        let mut straight = tree.clone();
        straight.joints[j].screw.axis = axis;
        if screw.kind.turns() {
            // Where it lies and how far it turns follow the new direction.
            gauss_newton(evidence, &mut straight, &own, &free, &fit, seed);
            straight.joints[j].screw.axis = axis;
        }
        let nats = nats_behind(own.len(), cost(&straight), cost(tree));
        let doubtful = few_states || axis.angle_between(screw.axis) > ASKEW_RAD;
        let most = if doubtful { worth } else { -CLEARLY_NATS };
        if nats < most {
            *tree = straight;
        }
    }
}
