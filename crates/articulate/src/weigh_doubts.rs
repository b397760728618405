//! Looks for doubts: rivals that explain the recording nearly as well, what the depth hardly
//! determines, pieces that always moved together.

use crate::doubt::Doubt;
use crate::fit::rival::rival;
use crate::model::estimate::Estimate;
use crate::model::motions::{poses_of, state_to_state};
use crate::model::owners::Member;
use crate::observe::evidence::Evidence;
use crate::score::compare::REFUTED_NATS;
use crate::shadow::{reach, shadows};
use crate::shown::Shown;
use glam::{DVec3, IVec3, Vec3};
use hingecast_geom::{Certainty, Joint};
use std::collections::HashMap;

/// Standard deviations worth mentioning: axis `[deg]`, pivot [share of the object's extent].
const LOOSE_AXIS_DEG: f64 = 1.0;
const LOOSE_PIVOT_SHARE: f64 = 0.01;
/// Where nothing was resampled: the covariance of a fit counts rows that share noise and correspondences as
/// if they did not.
const SIGMA_OPTIMISM: f64 = 5.0;
/// A second piece of at least this share of its part is mentioned.
const PIECE_SHARE: f64 = 0.2;
/// Pieces farther apart than one to two cells of this many voxels are separate.
const GAP_VOXELS: f32 = 1.5;
/// A motion is believed when no more speaks against it than this share of what speaks for it: real parts
/// had 0.1 at most, phantoms 0.35 and more.
const MOVES: f64 = 0.25;
/// Share of samples that may stay unexplained silently.
const UNEXPLAINED_SHARE: f64 = 0.005;
/// Share of the part's samples that a state must confirm.
const SEEN_SHARE: f64 = 0.05;

/// What single views say.
pub struct Believed<'a> {
    /// How views judge the motion of each joint.
    pub shown: &'a [Shown],
    /// Standard deviations of each joint without some of the views; empty where that was not tried.
    pub resampled: &'a [[f64; 3]],
}

/// Doubts, gravest first, and how sure one may be of each joint. `clouds`: the part of every point
/// of every state's cloud; `believed`: what was tried with single views.
pub fn weigh_doubts(
    evidence: &Evidence,
    found: &Estimate,
    clouds: &[Vec<u8>],
    believed: &Believed,
    seed: u64,
) -> (Vec<Doubt>, Vec<Certainty>) {
    let (mut out, mut certainty) = (Vec::new(), Vec::new());
    let tree = &found.tree;
    if tree.joints.is_empty() {
        out.push(Doubt::NothingMoves);
    }
    let pairs: Vec<usize> = believed.shown.iter().map(|s| s.pairs).collect();
    let reach =
        |j: usize, from: DVec3, line: DVec3| reach(&found.owners.members(evidence, tree.joints[j].child), from, line);
    let shadows = shadows(&tree.joints, &reach, &pairs, evidence.lattice.voxel);
    for (j, joint) in tree.joints.iter().enumerate() {
        let name = || joint.name.clone();
        if let Some((_, of)) = shadows.iter().find(|(own, _)| *own == j) {
            out.push(Doubt::MayBeOneWith { joint: name(), other: tree.joints[*of].name.clone() });
        }
        let Shown { at_rest, moved, own, .. } = &believed.shown[j];
        if believed.shown[j].against() > MOVES {
            out.push(Doubt::MayNotMove { joint: name(), at_rest: *at_rest, moved: moved.max(*own) });
        }
        let states = believed.shown[j].contradicted.clone();
        if !states.is_empty() {
            out.push(Doubt::Contradicted { joint: name(), states });
        }
        let members = found.owners.members(evidence, joint.child);
        let (rival, nats) = rival(evidence, tree, j, &members, seed);
        let rival = rival.joints[j].screw.kind;
        if nats < REFUTED_NATS {
            out.push(Doubt::Undecidable { joint: name(), rival, nats });
        }
        let fitted = found.report.sigmas[j].map(|sigma| SIGMA_OPTIMISM * sigma);
        let [axis, pivot, value] = believed.resampled.get(j).copied().unwrap_or(fitted);
        let axis = axis.to_degrees();
        certainty.push(Certainty { axis_deg: axis, pivot, value, rival, nats });
        if axis > LOOSE_AXIS_DEG {
            out.push(Doubt::LooseAxis { joint: name(), deg: axis });
        }
        if pivot > LOOSE_PIVOT_SHARE * evidence.extent() as f64 {
            out.push(Doubt::LoosePivot { joint: name(), units: pivot });
        }
        if let Some(share) = second_piece(evidence, found, clouds, joint) {
            out.push(Doubt::TwoPieces { part: tree.parts[joint.child].clone(), share });
        }
        let states = unseen_states(evidence, found, joint, &members);
        if !states.is_empty() {
            out.push(Doubt::Unseen { joint: name(), states });
        }
    }
    if found.unexplained > UNEXPLAINED_SHARE {
        out.push(Doubt::Unexplained { share: found.unexplained });
    }
    if evidence.n_states() == 2 && !tree.joints.is_empty() {
        out.push(Doubt::TwoStates);
    }
    (out, certainty)
}

/// Share of the second largest piece of a part, when it is large and apart from the largest.
fn second_piece(evidence: &Evidence, found: &Estimate, clouds: &[Vec<u8>], joint: &Joint) -> Option<f64> {
    // All points where the first state has them.
    let cell = GAP_VOXELS * evidence.lattice.voxel;
    let mut cells: HashMap<IVec3, usize> = HashMap::new();
    for (state, labels) in clouds.iter().enumerate() {
        let back = found.tree.poses_at(state)[joint.child].inverse();
        let own = evidence.clouds[state].points.iter().zip(labels).filter(|(_, l)| **l as usize == joint.child);
        for (x, _) in own {
            let x: Vec3 = back.apply(x.as_dvec3()).as_vec3();
            *cells.entry((x / cell).floor().as_ivec3()).or_insert(0) += 1;
        }
    }
    // A cell that only one state in five fills holds stray labels.
    let least = clouds.len().div_ceil(5);
    cells.retain(|_, n| *n >= least);
    let total: usize = cells.values().sum();
    let mut sizes = Vec::new();
    while let Some(start) = cells.keys().copied().min_by_key(|c| c.to_array()) {
        let (mut stack, mut size) = (vec![start], 0);
        size += cells.remove(&start).unwrap_or(0);
        while let Some(at) = stack.pop() {
            for k in 0..27 {
                let next = at + IVec3::new(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
                if let Some(n) = cells.remove(&next) {
                    size += n;
                    stack.push(next);
                }
            }
        }
        sizes.push(size);
    }
    sizes.sort_unstable_by(|a, b| b.cmp(a));
    let share = *sizes.get(1)? as f64 / total as f64;
    (share > PIECE_SHARE).then_some(share)
}

/// States in which too little of the part is confirmed.
fn unseen_states(evidence: &Evidence, found: &Estimate, joint: &Joint, members: &[Member]) -> Vec<usize> {
    let n = evidence.n_states();
    let between = state_to_state(&poses_of(&found.tree, joint.child, n));
    let stride = members.len().div_ceil(2000).max(1);
    let (mut confirmed, mut asked) = (vec![0usize; n], vec![0usize; n]);
    for Member { sample: s, .. } in members.iter().step_by(stride) {
        let v = evidence.verdict(s, &between[s.state]);
        for t in (0..n).filter(|t| *t != s.state) {
            asked[t] += 1;
            confirmed[t] += (v.support >> t & 1) as usize;
        }
    }
    let shown = found.owners.shown[joint.child];
    (0..n).filter(|&t| shown >> t & 1 == 0 || (confirmed[t] as f64) < SEEN_SHARE * asked[t] as f64).collect()
}
