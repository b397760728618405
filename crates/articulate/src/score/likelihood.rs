//! How well a finished tree explains what moved, finer than the grid.
//!
//! E = sum over samples of the best part's sum over states of
//! [`agreement`](super::agreement::agreement). On the grid a motion that is a voxel off is as good
//! as the right one.

use super::agreement::total_agreement;
use super::compare::CORRELATED;
use super::verdict::Verdict;
use crate::model::motions::motions_of;
use crate::observe::evidence::Evidence;
use crate::observe::sample::Sample;
use hingecast_geom::KinematicTree;
use rayon::prelude::*;

/// Most samples that are asked.
const MOST_SAMPLES: usize = 4000;

/// Some of the samples that moved.
pub struct Likelihood {
    /// Indices of samples of the evidence.
    samples: Vec<usize>,
    /// Samples that each stands for.
    weight: f64,
}

impl Likelihood {
    /// `still`: the verdicts if nothing moved.
    pub fn new(still: &[Verdict], seed: u64) -> Self {
        Self::of_some(still, seed, MOST_SAMPLES)
    }

    /// The same by no more than `most` samples.
    pub fn of_some(still: &[Verdict], seed: u64, most: usize) -> Self {
        let mut samples: Vec<usize> = (0..still.len()).filter(|&i| still[i].against != 0).collect();
        let all = samples.len();
        fastrand::Rng::with_seed(seed).shuffle(&mut samples);
        samples.truncate(most);
        Self { weight: all as f64 / samples.len().max(1) as f64, samples }
    }

    /// E of a tree, in nats.
    pub fn nats(&self, evidence: &Evidence, tree: &KinematicTree) -> f64 {
        let between = motions_of(tree, evidence.n_states());
        let best = |s: &Sample| {
            let each = between.iter().map(|b| total_agreement(evidence, s, &b[s.state]));
            each.fold(f32::NEG_INFINITY, f32::max)
        };
        // Summed in a fixed order.
        let all: Vec<f32> = self.samples.par_iter().map(|&i| best(&evidence.samples[i])).collect();
        all.iter().map(|e| *e as f64).sum::<f64>() * self.weight / CORRELATED
    }
}
