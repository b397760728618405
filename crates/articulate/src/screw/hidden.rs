//! States that do not show a part: a rack behind a closed door.
//!
//! Asked for the value there, the states answer all the same: the front of the rack fits the inside of any board. What tells is surface
//! that no other part explains. Where nearly none of it is the part's, the states are asked once more with that surface alone, and
//! where that finds nothing, the value is that of the nearest state that shows the part, which holds whatever nobody touched.

use super::adopt::{in_parent, rescanned};
use super::discover::poses_of;
use super::evidence::{Evidence, Sample, Verdict};
use super::scan::{Worth, agreement};
use super::settle::ASKING;
use hingecast_geom::{KinematicTree, Pose};

/// A state with less than this share of the surface of its own that a part has in the state that shows most of it may not show it.
const WEAK: f64 = 0.1;
/// Share of a part's samples that must meet surface of its own where it is shown.
const SEEN: f32 = 0.02;
/// Another value must agree this much better than the one that is held.
const BETTER: f32 = 0.01;
/// Surface that another part explains, or could explain, says nothing.
const OWN: Worth = Worth { explained: 0.0, possible: 0.0 };

/// Of every part, the states that show it, one bit each. Corrects values: those that only surface of other parts spoke for, and those
/// in states that do not show the part.
pub fn shown(
    evidence: &mut Evidence,
    tree: &mut KinematicTree,
    labels: &[u8],
    verdicts: &[Vec<Verdict>],
    seed: u64,
) -> Vec<u64> {
    let n_states = evidence.n_states();
    let mut shown = vec![u64::MAX; tree.parts.len()];
    for j in 0..tree.joints.len() {
        let (child, parent) = (tree.joints[j].child, tree.joints[j].parent);
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
        let poses: Vec<Vec<Pose>> = (0..tree.parts.len()).map(|p| poses_of(tree, p, n_states)).collect();
        let others: Vec<Vec<Pose>> = (0..poses.len()).filter(|p| *p != child).map(|p| poses[p].clone()).collect();
        evidence.mark_taken(&others);
        let mut asking: Vec<Sample> =
            mine.iter().map(|&i| evidence.samples[i]).filter(|s| !weak.contains(&s.state)).collect();
        fastrand::Rng::with_seed(seed ^ j as u64).shuffle(&mut asking);
        asking.truncate(ASKING);
        let joint = &mut tree.joints[j];
        let samples = in_parent(joint, &asking, &poses[parent]);
        let found = rescanned(evidence, joint, &samples, &poses[parent], OWN);
        for &t in &weak {
            let at = |q: f64| agreement(evidence, t, &samples, &(poses[parent][t] * joint.screw.motion(q)).into(), OWN);
            let held = at(joint.values[t]);
            if found.scores[t] > held + BETTER {
                joint.values[t] = found.values[t];
            }
            if found.scores[t].max(held) < SEEN {
                shown[child] &= !(1 << t);
            }
        }
    }
    hold(tree, &shown);
    shown
}

/// What a state does not show stays where the nearest state that shows it has it.
pub fn hold(tree: &mut KinematicTree, shown: &[u64]) {
    for joint in &mut tree.joints {
        let shows = |t: &usize| shown[joint.child] >> t & 1 == 1;
        let states = 0..joint.values.len();
        for t in states.clone().filter(|t| !shows(t)) {
            if let Some(nearest) = states.clone().filter(shows).min_by_key(|s| s.abs_diff(t)) {
                joint.values[t] = joint.values[nearest];
            }
        }
    }
}
