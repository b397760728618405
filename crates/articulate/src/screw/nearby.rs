//! Values that are a voxel or two beside the right one.
//!
//! On the grid a front meets surface a voxel and a half in front of itself and behind it, and beside it an equal front may stand there.
//! Gauss-Newton takes such a value for what it is near to. So every state is asked by distance for the values around the one that
//! is held, by samples that other states saw: those of its own stand where they are, whatever the value.

use super::adopt::in_parent;
use super::discover::poses_of;
use super::evidence::{Evidence, Motion, Sample};
use super::settle::{Owners, some};
use super::whole::word;
use hingecast_geom::{KinematicTree, Screw};
use rayon::prelude::*;

/// How far beside the held value is looked, and in which steps, voxels that the part moves.
const AROUND: f64 = 3.0;
const STEP: f64 = 0.25;
/// Another value must be better by this share of the samples.
const BETTER: f32 = 0.1;

/// Corrects the values of all joints.
pub fn look_beside(evidence: &Evidence, tree: &mut KinematicTree, owners: &Owners, seed: u64) {
    for j in 0..tree.joints.len() {
        let joint = &tree.joints[j];
        let place = poses_of(tree, joint.parent, evidence.n_states());
        let members = owners.members(evidence, joint.child);
        let asking = some(members.iter().map(|m| m.sample), seed ^ j as u64);
        if asking.is_empty() {
            continue;
        }
        let samples = in_parent(joint, &asking, &place);
        let offsets = offsets(evidence, &joint.screw, &samples);
        let beside = |t: usize| {
            let held = joint.values[t];
            let score = |q: f64| agreement(evidence, t, &samples, &Motion::from(place[t] * joint.screw.motion(q)));
            // Of equals the first.
            let others = offsets.iter().map(|o| (score(held + o), held + o));
            let best = others.reduce(|a, b| if b.0 > a.0 { b } else { a });
            best.filter(|b| b.0 > score(held) + BETTER).map_or(held, |b| b.1)
        };
        let shown = owners.shown[joint.child];
        let values = (0..place.len()).into_par_iter();
        let values = values.map(|t| if shown >> t & 1 == 1 { beside(t) } else { joint.values[t] }).collect();
        tree.joints[j].values = values;
    }
}

/// Changes of a value that move most `samples` (in the screw's frame) by up to three voxels, without none.
pub fn offsets(evidence: &Evidence, screw: &Screw, samples: &[Sample]) -> Vec<f64> {
    let mut reach: Vec<f64> = samples.iter().map(|s| screw.distance(s.point.as_dvec3())).collect();
    reach.sort_by(f64::total_cmp);
    let reach = if screw.kind.turns() { reach[reach.len() * 9 / 10] } else { 1.0 };
    let step = STEP * evidence.lattice.voxel as f64 / reach.max(1e-9);
    let steps = (AROUND / STEP) as i32;
    (-steps..=steps).filter(|k| *k != 0).map(|k| k as f64 * step).collect()
}

/// What state `t` says about samples of other states in the mean.
pub fn agreement(evidence: &Evidence, t: usize, samples: &[Sample], m: &Motion) -> f32 {
    let others = samples.iter().filter(|s| s.state != t);
    let (sum, n) = others.fold((0.0, 0), |(sum, n), s| (sum + word(evidence, t, s, m), n + 1));
    sum / n.max(1) as f32
}
