//! States that do not show a part: a rack behind a closed door.
//!
//! Asked for the value there, the states answer all the same: the front of the rack fits the inside
//! of any board. What tells is surface that no other part explains. Where nearly none of it is the
//! part's, the states are asked once more with that surface alone, and where that finds nothing,
//! the value is that of the nearest state that shows the part, where nothing of it would be seen.

use super::pass::{Round, relabel};
use crate::fit::question::{Question, Worth, grid_agreement};
use crate::fit::sweep_values::sweep_joint;
use crate::model::estimate::Estimate;
use crate::model::motions::{in_parent_frame, poses_of};
use crate::model::owners::{ASKING, subset};
use crate::observe::evidence::Evidence;
use crate::score::claims::Claims;
use crate::score::verdict::Verdict;
use hingecast_geom::KinematicTree;

/// A state with less than this share of the surface of its own that a part has in the state that
/// shows most of it may not show it.
const WEAK_SHARE: f64 = 0.1;
/// Share of a part's samples that must meet surface of its own where it is shown.
const SEEN_SHARE: f32 = 0.02;
/// Where a part is hidden, fewer of its samples than this enter space that was seen empty.
const ENTERED_SHARE: f32 = 0.05;
/// ... and fewer than this lie near any surface that faces alike: boards of what hides it.
const NEAR_SHARE: f32 = 0.3;

/// Finds the states that do not show a part, and lets its value there be that of a state which
/// does.
pub fn find_hidden(round: &Round, estimate: &mut Estimate) {
    let Estimate { tree, owners, verdicts, .. } = estimate;
    let hidden = hidden(round.evidence, tree, &owners.labels, verdicts, round.seed);
    for (joint, states) in tree.joints.iter().zip(&hidden) {
        states.iter().for_each(|(t, _)| owners.shown[joint.child] &= !(1 << t));
    }
    let any = hidden.iter().any(|states| !states.is_empty());
    estimate.hidden = hidden;
    if any {
        relabel(round, estimate);
    }
}

/// What a state does not show stands where the other has it.
pub fn hold_hidden(_: &Round, estimate: &mut Estimate) {
    hold(&mut estimate.tree, &estimate.hidden);
}

/// Of every joint, the states that do not show its part, each with the nearest state whose value
/// may hold there as well. Corrects values: those that only surface of other parts spoke for, and
/// those of hidden parts.
fn hidden(
    evidence: &Evidence,
    tree: &mut KinematicTree,
    labels: &[u8],
    verdicts: &[Vec<Verdict>],
    seed: u64,
) -> Vec<Vec<(usize, usize)>> {
    let n_states = evidence.n_states();
    let mut hidden = vec![Vec::new(); tree.joints.len()];
    for j in 0..tree.joints.len() {
        let child = tree.joints[j].child;
        let mine: Vec<usize> = (0..labels.len()).filter(|&i| labels[i] as usize == child).collect();
        let mut own = vec![0usize; n_states];
        for &i in &mine {
            let alone = (0..verdicts.len()).all(|q| q == child || verdicts[q][i].against != 0);
            own[evidence.samples[i].state] += usize::from(alone);
        }
        let most = own.iter().copied().max().unwrap_or(0) as f64;
        let weak: Vec<usize> = (0..n_states).filter(|&t| (own[t] as f64) < WEAK_SHARE * most).collect();
        if weak.is_empty() {
            continue;
        }
        let parent_poses = poses_of(tree, tree.joints[j].parent, n_states);
        let claims = Claims::of_others(evidence, tree, j);
        let question = |worth: Worth| Question { evidence, claims: &claims, worth };
        let strongly = mine.iter().map(|&i| evidence.samples[i]).filter(|s| !weak.contains(&s.state));
        let asking = subset(strongly, ASKING, seed ^ j as u64);
        let joint = &mut tree.joints[j];
        let samples = in_parent_frame(joint, &asking, &parent_poses);
        let found = sweep_joint(&question(Worth::OWN), joint, &samples, &parent_poses);
        let mut strong: Vec<usize> = (0..n_states).filter(|t| !weak.contains(t)).collect();
        for &t in &weak {
            let asked = |q: f64, worth: Worth| {
                grid_agreement(&question(worth), t, &samples, &(parent_poses[t] * joint.screw.motion(q)).into())
            };
            let at = |q: f64| asked(q, Worth::OWN);
            strong.sort_by_key(|s| s.abs_diff(t));
            let unseen = |s: &&usize| {
                let q = joint.values[**s];
                at(q) > -ENTERED_SHARE && asked(q, Worth::ANY) < NEAR_SHARE
            };
            let Some(&stands) = strong.iter().find(unseen) else {
                // It is seen: another part explains what this one shows as well.
                continue;
            };
            if at(joint.values[t]) >= SEEN_SHARE {
                continue;
            }
            if found.scores[t] >= SEEN_SHARE {
                joint.values[t] = found.values[t];
            } else {
                hidden[j].push((t, stands));
            }
        }
        // How it moved takes two states at least.
        if n_states - hidden[j].len() < 2 {
            hidden[j].clear();
        }
    }
    hold(tree, &hidden);
    hidden
}

/// What a state does not show stands where the other has it.
fn hold(tree: &mut KinematicTree, hidden: &[Vec<(usize, usize)>]) {
    for (joint, hidden) in tree.joints.iter_mut().zip(hidden) {
        for &(state, as_in) in hidden {
            joint.values[state] = joint.values[as_in];
        }
    }
}
