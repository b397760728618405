//! Values that are a voxel or two beside the right one.
//!
//! On the grid a front meets surface a voxel and a half in front of itself and behind it, and beside it an equal front may stand there.
//! Gauss-Newton takes such a value for what it is near to. So every state is asked by distance for the values around the one that
//! is held, by samples that other states saw: those of its own stand where they are, whatever the value.

use super::adopt::in_parent;
use super::discover::poses_of;
use super::evidence::{Evidence, Motion, Sample};
use super::scan::EMPTY;
use super::settle::{Owners, some};
use super::space::Answer;
use hingecast_geom::KinematicTree;
use rayon::prelude::*;

/// How far beside the held value is looked, and in which steps, voxels that the part moves.
const AROUND: f64 = 3.0;
const STEP: f64 = 0.25;
/// Another value must be better by this share of the samples.
const BETTER: f32 = 0.1;

/// Corrects the values of all joints.
pub fn look_beside(evidence: &Evidence, tree: &mut KinematicTree, owners: &Owners, seed: u64) {
    let steps = (AROUND / STEP) as i32;
    for j in 0..tree.joints.len() {
        let joint = &tree.joints[j];
        let place = poses_of(tree, joint.parent, evidence.n_states());
        let members = owners.members(evidence, joint.child);
        let asking = some(members.iter().map(|m| m.sample), seed ^ j as u64);
        if asking.is_empty() {
            continue;
        }
        let samples = in_parent(joint, &asking, &place);
        let mut reach: Vec<f64> = samples.iter().map(|s| joint.screw.distance(s.point.as_dvec3())).collect();
        reach.sort_by(f64::total_cmp);
        let reach = if joint.screw.kind.turns() { reach[reach.len() * 9 / 10] } else { 1.0 };
        let step = STEP * evidence.lattice.voxel as f64 / reach.max(1e-9);
        let beside = |t: usize| {
            let held = joint.values[t];
            let score = |k: i32| {
                let m = Motion::from(place[t] * joint.screw.motion(held + k as f64 * step));
                agreement(evidence, t, &samples, &m)
            };
            let least = score(0) + BETTER;
            let others = (-steps..=steps).filter(|k| *k != 0);
            let best = others.map(|k| (score(k), k)).max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
            best.filter(|b| b.0 > least).map_or(held, |b| held + b.1 as f64 * step)
        };
        let shown = owners.shown[joint.child];
        let values = (0..place.len()).into_par_iter();
        let values = values.map(|t| if shown >> t & 1 == 1 { beside(t) } else { joint.values[t] }).collect();
        tree.joints[j].values = values;
    }
}

/// How near the samples of other states come to surface that faces the same way, 1 on it, minus what enters empty space; their mean.
fn agreement(evidence: &Evidence, t: usize, samples: &[Sample], m: &Motion) -> f32 {
    let others = samples.iter().filter(|s| s.state != t);
    let (sum, n) = others.fold((0.0, 0), |(sum, n), s| {
        let (x, normal) = (m.apply(s.point), m.rot * s.normal);
        let empty = matches!(evidence.spaces[t].ask(x, normal), Answer::Free);
        (sum + if empty { -EMPTY } else { evidence.nearness(t, x, normal) }, n + 1)
    });
    sum / n.max(1) as f32
}
