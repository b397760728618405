//! What the states say about a sample if it moved so.

use crate::model::motions::state_to_state;
use crate::observe::evidence::Evidence;
use crate::observe::occupancy::Answer;
use crate::observe::sample::{Motion, Sample};
use hingecast_geom::Pose;
use rayon::prelude::*;

/// Per sample, one bit a state: where its predicted place was seen empty, and where a surface was
/// found there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Verdict {
    /// States that saw the place empty.
    pub against: u64,
    /// States that have surface there which faces the same way.
    pub support: u64,
}

impl Verdict {
    /// Nothing speaks against the motion, something for it.
    pub fn explains(&self) -> bool {
        self.against == 0 && self.support != 0
    }
}

/// What is left of the base's contradictions when a part moves a sample to where nobody looked:
/// that explains most of it, but another part that can show the sample explains it better.
const UNSEEN_LEFT: f64 = 0.3;

/// Fewest contradictions of sample `i` under any of the parts in `verdicts`, of which the first is
/// the base.
pub fn contradictions(verdicts: &[impl AsRef<[Verdict]>], i: usize) -> f64 {
    contradictions_of_best(verdicts, i).0
}

/// The same, with the part that has fewest.
pub fn contradictions_of_best(verdicts: &[impl AsRef<[Verdict]>], i: usize) -> (f64, usize) {
    let still = verdicts[0].as_ref()[i].against.count_ones() as f64;
    let moved = verdicts.iter().enumerate().skip(1).map(|(part, verdicts)| {
        let v = verdicts.as_ref()[i];
        let left = if v.support == 0 { UNSEEN_LEFT * still } else { 0.0 };
        (left.max(v.against.count_ones() as f64), part)
    });
    moved.fold((still, 0), |best, other| if other.0 < best.0 { other } else { best })
}

impl Evidence {
    /// `raw` with an eye for less than the grid resolves: above the surface that counts as support
    /// a sample would have been seen, and below it nobody saw it.
    pub fn sharpened(&self, raw: Verdict, s: &Sample, from: &[Motion]) -> Verdict {
        let mut v = raw;
        for (t, m) in from.iter().enumerate().filter(|(t, _)| raw.support >> t & 1 == 1) {
            let Some(height) = self.height(t, m.apply(s.point), m.rot * s.normal) else { continue };
            if height.abs() > self.tolerance {
                v.support &= !(1 << t);
                v.against |= u64::from(height > 0.0) << t;
            }
        }
        v
    }

    /// The raw verdict on one sample; `from[t]`: world at t from world at its state.
    pub fn verdict(&self, s: &Sample, from: &[Motion]) -> Verdict {
        let mut v = Verdict::default();
        for (t, m) in from.iter().enumerate().filter(|(t, _)| *t != s.state) {
            match self.spaces[t].ask(m.apply(s.point), m.rot * s.normal) {
                Answer::Free => v.against |= 1 << t,
                Answer::Surface => v.support |= 1 << t,
                Answer::Silent => {}
            }
        }
        v
    }

    /// What all states say about every sample if it moved with `poses` (world from canonical, per
    /// state).
    pub fn judge(&self, poses: &[Pose]) -> Vec<Verdict> {
        let between = state_to_state(poses);
        let raw: Vec<Verdict> = self.samples.par_iter().map(|s| self.verdict(s, &between[s.state])).collect();
        (0..raw.len()).into_par_iter().map(|i| self.without_lone(&raw, i)).collect()
    }

    /// The same for some samples alone.
    pub fn judge_some(&self, poses: &[Pose], which: &[usize]) -> Vec<Verdict> {
        let between = state_to_state(poses);
        let mut needed = vec![false; self.samples.len()];
        for &i in which {
            needed[i] = true;
            self.neighbours[i].iter().for_each(|&j| needed[j as usize] = true);
        }
        let ask = |(s, needed): (&Sample, &bool)| {
            if *needed { self.verdict(s, &between[s.state]) } else { Verdict::default() }
        };
        let raw: Vec<Verdict> = self.samples.par_iter().zip(&needed).map(ask).collect();
        which.par_iter().map(|&i| self.without_lone(&raw, i)).collect()
    }

    /// The verdict on sample `i` without contradictions that most of its neighbours do not share:
    /// these are noise.
    fn without_lone(&self, raw: &[Verdict], i: usize) -> Verdict {
        let mut v = raw[i];
        let mut bits = v.against;
        while bits != 0 {
            let t = bits.trailing_zeros();
            bits &= bits - 1;
            let near = &self.neighbours[i];
            let agree = near.iter().filter(|&&j| raw[j as usize].against >> t & 1 == 1).count();
            if 2 * agree < near.len() {
                v.against &= !(1 << t);
            }
        }
        v
    }
}
