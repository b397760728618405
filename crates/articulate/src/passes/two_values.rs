//! Whether the samples of a part want two values of its joint, and which.

use super::value_search::offsets;
use crate::fit::question::{Question, Worth};
use crate::fit::sweep_values::sweep_joint;
use crate::label::by_likelihood_ratio::agreement_gain;
use crate::model::motions::{in_parent_frame, poses_of, state_to_state};
use crate::model::owners::{ASKING, Owners, subset};
use crate::observe::evidence::Evidence;
use crate::observe::sample::{Motion, Sample};
use crate::score::agreement::{agreement, mean_agreement};
use crate::score::claims::Claims;
use hingecast_geom::{Joint, KinematicTree, Pose};
use rayon::prelude::*;

/// Samples of the part that are asked.
const MOST_SAMPLES: usize = 6000;
/// States that each state is compared with.
const PARTNERS: usize = 4;
/// A sample is for one value if that explains it better by this.
const PREFERENCE: f32 = 0.3;
/// Samples that prefer either value, at least.
const LEAST_SAMPLES: usize = 12;
/// Two values must explain this share of the samples of two states more than one does, or nothing
/// else is asked.
const LEAST_GAIN: f32 = 0.05;
/// Turns of who belongs to which half, and their values.
const TURNS: usize = 4;
/// A part that may be two.
struct Part<'a> {
    evidence: &'a Evidence,
    joint: &'a Joint,
    /// Of the joint's parent.
    parent_poses: Vec<Pose>,
    /// In the parent's frame as of value 0.
    samples: Vec<Sample>,
    /// Values around a held one.
    offsets: Vec<f64>,
    /// States that show the part, one bit each.
    shown: u64,
}

/// Two states, and two changes of the value of the second that explain it better than one.
struct Split {
    gain: f32,
    states: [usize; 2],
    offsets: [f64; 2],
}

/// The values of joint `j` that either half of its part wants, from 0 in the first state, if there
/// seem to be two.
pub fn two_values(
    evidence: &Evidence,
    tree: &KinematicTree,
    owners: &Owners,
    j: usize,
    seed: u64,
) -> Option<[Vec<f64>; 2]> {
    let joint = &tree.joints[j];
    let parent_poses = poses_of(tree, joint.parent, evidence.n_states());
    let mut own: Vec<Sample> = owners.members(evidence, joint.child).iter().map(|m| m.sample).collect();
    fastrand::Rng::with_seed(seed).shuffle(&mut own);
    own.truncate(MOST_SAMPLES);
    if own.is_empty() {
        return None;
    }
    let samples = in_parent_frame(joint, &own, &parent_poses);
    let offsets = offsets(evidence, &joint.screw, &samples);
    let part = Part { evidence, joint, parent_poses, samples, offsets, shown: owners.shown[joint.child] };
    let split = part.best_split()?;
    let mut values = part.values_of(&split);
    for turn in 0..TURNS {
        values = part.improved(&values, seed ^ turn as u64);
    }
    Some(values.map(|values| values.iter().map(|v| v - values[0]).collect()))
}

impl Part<'_> {
    /// Where the joint puts samples in state t at a value.
    fn at(&self, t: usize, value: f64) -> Motion {
        Motion::from(self.parent_poses[t] * self.joint.screw.motion(value))
    }

    fn of_state(&self, a: usize) -> Vec<Sample> {
        self.samples.iter().filter(|s| s.state == a).copied().collect()
    }

    /// The two states where two values gain most.
    fn best_split(&self) -> Option<Split> {
        let n = self.evidence.n_states();
        let apart = n.div_ceil(PARTNERS + 1).max(1);
        let pairs: Vec<[usize; 2]> =
            (0..n).flat_map(|a| (1..n).step_by(apart).map(move |k| [a, (a + k) % n])).collect();
        let found: Vec<Split> = pairs.into_par_iter().filter_map(|states| self.compare(states)).collect();
        found.into_iter().reduce(|a, b| if b.gain > a.gain { b } else { a })
    }

    fn compare(&self, [a, t]: [usize; 2]) -> Option<Split> {
        let samples = self.of_state(a);
        if samples.len() < 2 * LEAST_SAMPLES || self.shown >> t & 1 == 0 {
            return None;
        }
        let offsets: Vec<f64> = [0.0].into_iter().chain(self.offsets.iter().copied()).collect();
        let said = |o: &f64| -> Vec<f32> {
            let m = self.at(t, self.joint.values[t] + o);
            samples.iter().map(|s| agreement(self.evidence, t, s, &m)).collect()
        };
        let table: Vec<Vec<f32>> = offsets.iter().map(said).collect();
        let one = table.iter().map(|row| row.iter().sum::<f32>()).fold(f32::NEG_INFINITY, f32::max);
        let mut best = Split { gain: LEAST_GAIN * samples.len() as f32, states: [a, t], offsets: [0.0; 2] };
        let prefer = |a: &[f32], b: &[f32]| a.iter().zip(b).filter(|(a, b)| **a > **b + PREFERENCE).count();
        for (i, first) in table.iter().enumerate() {
            for (k, second) in table.iter().enumerate().skip(i + 1) {
                let gain = first.iter().zip(second).map(|(a, b)| a.max(*b)).sum::<f32>() - one;
                if gain > best.gain && prefer(first, second) >= LEAST_SAMPLES && prefer(second, first) >= LEAST_SAMPLES
                {
                    best = Split { gain, offsets: [offsets[i], offsets[k]], ..best };
                }
            }
        }
        (best.offsets != [0.0; 2]).then_some(best)
    }

    /// Values of both halves in all states, by the samples of one that tell the halves apart.
    fn values_of(&self, split: &Split) -> [Vec<f64>; 2] {
        let [a, t] = split.states;
        let at = split.offsets.map(|o| self.at(t, self.joint.values[t] + o));
        let lead = |s: &Sample| agreement(self.evidence, t, s, &at[1]) - agreement(self.evidence, t, s, &at[0]);
        let own = self.of_state(a);
        let question = Question { evidence: self.evidence, claims: &Claims::none(), worth: Worth::ANY };
        [-1.0, 1.0].map(|sign: f32| {
            let half: Vec<Sample> = own.iter().filter(|s| sign * lead(s) > PREFERENCE).copied().collect();
            let found = sweep_joint(&question, self.joint, &half, &self.parent_poses).values;
            let mut held = self.joint.values.clone();
            held[t] += split.offsets[usize::from(sign > 0.0)];
            let value =
                |u: usize| if split.states.contains(&u) { held[u] } else { self.best(u, [held[u], found[u]], &half) };
            (0..held.len()).into_par_iter().map(value).collect()
        })
    }

    /// The values of both halves by the samples that each explains better.
    fn improved(&self, values: &[Vec<f64>; 2], seed: u64) -> [Vec<f64>; 2] {
        let between = [0, 1].map(|k: usize| {
            let poses = self.parent_poses.iter().zip(&values[k]).map(|(p, v)| *p * self.joint.screw.motion(*v));
            state_to_state(&poses.collect::<Vec<_>>())
        });
        let ahead = |s: &Sample| {
            let s = s.moved(&self.at(s.state, self.joint.values[s.state]));
            agreement_gain(self.evidence, &s, [0, 1].map(|k: usize| &between[k][s.state][..]))
        };
        let leads: Vec<f32> = self.samples.par_iter().map(ahead).collect();
        [(0, -1.0), (1, 1.0)].map(|(k, sign): (usize, f32)| {
            let own = self.samples.iter().zip(&leads).filter(|(_, lead)| sign * **lead > PREFERENCE);
            // Where this half's own values have it at value 0.
            let back = |(s, _): (&Sample, &f32)| {
                s.moved(&self.joint.screw.motion(self.joint.values[s.state] - values[k][s.state]).into())
            };
            let own = subset(own.map(back), ASKING, seed);
            let value = |u: usize| self.best(u, [values[k][u]; 2], &own);
            (0..values[k].len()).into_par_iter().map(value).collect()
        })
    }

    /// The value near one of two that state `t` agrees with best; the first unless another is
    /// better, or if the state hides the part.
    fn best(&self, t: usize, held: [f64; 2], samples: &[Sample]) -> f64 {
        if self.shown >> t & 1 == 0 {
            return held[0];
        }
        let asked = |q: f64| (mean_agreement(self.evidence, t, samples, &self.at(t, q)), q);
        let near = held.iter().flat_map(|v| [0.0].iter().chain(&self.offsets).map(move |o| v + o));
        near.map(asked).reduce(|a, b| if b.0 > a.0 + 1e-4 { b } else { a }).expect("some values").1
    }
}
