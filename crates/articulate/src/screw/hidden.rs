//! States that do not show a part: a rack behind a closed door.
//!
//! Asked for the value there, the states answer all the same: the front of the rack fits the inside of any board. What tells is surface
//! that no other part explains. Where nearly none of it is the part's, the states are asked once more with that surface alone, and
//! where that finds nothing, the value is that of the nearest state that shows the part, where nothing of it would be seen.

use super::adopt::{in_parent, rescanned};
use super::evidence::{Evidence, Verdict};
use super::scan::{Worth, agreement};
use super::settle::{mark_others, some};
use hingecast_geom::KinematicTree;

/// A state with less than this share of the surface of its own that a part has in the state that shows most of it may not show it.
const WEAK: f64 = 0.1;
/// Share of a part's samples that must meet surface of its own where it is shown.
const SEEN: f32 = 0.02;
/// Where a part is hidden, fewer of its samples than this enter space that was seen empty.
const ENTERED: f32 = 0.05;
/// ... and fewer than this lie near any surface that faces alike: boards of what hides it.
const NEAR: f32 = 0.3;
/// Surface that another part explains, or could explain, says nothing.
const OWN: Worth = Worth { explained: 0.0, possible: 0.0 };
const ANY: Worth = Worth { explained: 1.0, possible: 1.0 };

/// Of every joint, the states that do not show its part, each with the nearest state whose value may hold there as well. Corrects values:
/// those that only surface of other parts spoke for, and those of hidden parts.
pub fn hidden(
    evidence: &mut Evidence,
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
        let weak: Vec<usize> = (0..n_states).filter(|&t| (own[t] as f64) < WEAK * most).collect();
        if weak.is_empty() {
            continue;
        }
        let place = mark_others(evidence, tree, j);
        let strongly = mine.iter().map(|&i| evidence.samples[i]).filter(|s| !weak.contains(&s.state));
        let asking = some(strongly, seed ^ j as u64);
        let joint = &mut tree.joints[j];
        let samples = in_parent(joint, &asking, &place);
        let found = rescanned(evidence, joint, &samples, &place, OWN);
        let mut strong: Vec<usize> = (0..n_states).filter(|t| !weak.contains(t)).collect();
        for &t in &weak {
            let asked = |q: f64, worth: Worth| {
                agreement(evidence, t, &samples, &(place[t] * joint.screw.motion(q)).into(), worth)
            };
            let at = |q: f64| asked(q, OWN);
            strong.sort_by_key(|s| s.abs_diff(t));
            let unseen = |s: &&usize| {
                let q = joint.values[**s];
                at(q) > -ENTERED && asked(q, ANY) < NEAR
            };
            let Some(&stands) = strong.iter().find(unseen) else {
                // It is seen: another part explains what this one shows as well.
                continue;
            };
            if at(joint.values[t]) >= SEEN {
                continue;
            }
            if found.scores[t] >= SEEN {
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
pub fn hold(tree: &mut KinematicTree, hidden: &[Vec<(usize, usize)>]) {
    for (joint, hidden) in tree.joints.iter_mut().zip(hidden) {
        for &(state, as_in) in hidden {
            joint.values[state] = joint.values[as_in];
        }
    }
}
