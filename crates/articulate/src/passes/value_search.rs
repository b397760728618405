//! Values that are a voxel or two beside the right one.
//!
//! On the grid a front meets surface a voxel and a half in front of itself and behind it, and
//! beside it an equal front may stand there. Gauss-Newton takes such a value for what it is near
//! to. So every state is asked by distance for the values around the one that is held, by samples
//! that other states saw: those of its own stand where they are, whatever the value.

use super::pass::Round;
use crate::model::estimate::Estimate;
use crate::model::motions::{in_parent_frame, poses_of};
use crate::model::owners::{ASKING, Owners, subset};
use crate::observe::evidence::Evidence;
use crate::observe::sample::{Motion, Sample};
use crate::score::agreement::mean_agreement;
use hingecast_geom::{KinematicTree, Screw};
use rayon::prelude::*;

/// How far beside the held value is looked, and in which steps, voxels that the part moves.
const AROUND_VOXELS: f64 = 3.0;
const STEP_VOXELS: f64 = 0.25;
/// Another value must be better by this share of the samples.
const BETTER_SHARE: f32 = 0.1;

/// Values a voxel or two beside the held ones, where these are clearly better.
pub fn search_values(round: &Round, estimate: &mut Estimate) {
    values_beside(round.evidence, &mut estimate.tree, &estimate.owners, round.seed);
}

/// Corrects the values of all joints.
pub fn values_beside(evidence: &Evidence, tree: &mut KinematicTree, owners: &Owners, seed: u64) {
    for j in 0..tree.joints.len() {
        let joint = &tree.joints[j];
        let place = poses_of(tree, joint.parent, evidence.n_states());
        let members = owners.members(evidence, joint.child);
        let asking = subset(members.iter().map(|m| m.sample), ASKING, seed ^ j as u64);
        if asking.is_empty() {
            continue;
        }
        let samples = in_parent_frame(joint, &asking, &place);
        let offsets = offsets(evidence, &joint.screw, &samples);
        let beside = |t: usize| {
            let held = joint.values[t];
            let score = |q: f64| mean_agreement(evidence, t, &samples, &Motion::from(place[t] * joint.screw.motion(q)));
            // Of equals the first.
            let others = offsets.iter().map(|o| (score(held + o), held + o));
            let best = others.reduce(|a, b| if b.0 > a.0 { b } else { a });
            best.filter(|b| b.0 > score(held) + BETTER_SHARE).map_or(held, |b| b.1)
        };
        let shown = owners.shown[joint.child];
        let values = (0..place.len()).into_par_iter();
        let values = values.map(|t| if shown >> t & 1 == 1 { beside(t) } else { joint.values[t] }).collect();
        tree.joints[j].values = values;
    }
}

/// Changes of a value that move most `samples` (in the screw's frame) by up to three voxels,
/// without none.
pub fn offsets(evidence: &Evidence, screw: &Screw, samples: &[Sample]) -> Vec<f64> {
    let mut reach: Vec<f64> = samples.iter().map(|s| screw.distance(s.point.as_dvec3())).collect();
    reach.sort_by(f64::total_cmp);
    let reach = if screw.kind.turns() { reach[reach.len() * 9 / 10] } else { 1.0 };
    let step = STEP_VOXELS * evidence.lattice.voxel as f64 / reach.max(1e-9);
    let steps = (AROUND_VOXELS / STEP_VOXELS) as i32;
    (-steps..=steps).filter(|k| *k != 0).map(|k| k as f64 * step).collect()
}
