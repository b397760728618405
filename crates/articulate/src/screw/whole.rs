//! How well a finished tree explains what moved, finer than the grid.
//!
//! E = sum over samples of the best part's sum over states of 1 / (1 + (h / tolerance)^2), h the height over the surface that the state measured
//! where the part's motion puts the sample; -1.5 where it was seen empty. On the grid a motion that is a voxel off is as good as the right one.

use super::discover::motions_of;
use super::doubts::CORRELATED;
use super::evidence::{Evidence, Motion, Sample, Verdict};
use super::scan::EMPTY;
use super::space::Answer;
use hingecast_geom::KinematicTree;
use rayon::prelude::*;

/// Most samples that are asked.
const ASKED: usize = 4000;

/// What state t says about a sample there: 1 on surface that faces the same way, -1.5 where it was seen empty.
pub fn word(evidence: &Evidence, t: usize, s: &Sample, m: &Motion) -> f32 {
    let (x, normal) = (m.apply(s.point), m.rot * s.normal);
    if matches!(evidence.spaces[t].ask(x, normal), Answer::Free) { -EMPTY } else { evidence.nearness(t, x, normal) }
}

/// What all other states say about a sample together; `from[t]`: world at t from world at its state.
pub fn words(evidence: &Evidence, s: &Sample, from: &[Motion]) -> f32 {
    (0..from.len()).filter(|t| *t != s.state).map(|t| word(evidence, t, s, &from[t])).sum()
}

/// Some of the samples that moved.
pub struct Whole {
    samples: Vec<Sample>,
    /// Samples that each stands for.
    weight: f64,
}

impl Whole {
    /// `still`: the verdicts if nothing moved.
    pub fn new(evidence: &Evidence, still: &[Verdict], seed: u64) -> Self {
        let moved = evidence.samples.iter().zip(still).filter(|(_, v)| v.against != 0);
        let mut samples: Vec<Sample> = moved.map(|(s, _)| *s).collect();
        let all = samples.len();
        fastrand::Rng::with_seed(seed).shuffle(&mut samples);
        samples.truncate(ASKED);
        Self { weight: all as f64 / samples.len().max(1) as f64, samples }
    }

    /// E of a tree, in nats.
    pub fn nats(&self, evidence: &Evidence, tree: &KinematicTree) -> f64 {
        let between = motions_of(evidence, tree);
        let best = |s: &Sample| {
            let each = between.iter().map(|b| words(evidence, s, &b[s.state]));
            each.fold(f32::NEG_INFINITY, f32::max)
        };
        // Summed in a fixed order.
        let all: Vec<f32> = self.samples.par_iter().map(best).collect();
        all.iter().map(|e| *e as f64).sum::<f64>() * self.weight / CORRELATED
    }
}
