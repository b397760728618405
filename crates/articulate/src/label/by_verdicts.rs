//! Which part a sample belongs to by its verdicts alone: quick, good enough to refine joints with.

use super::smooth::even_out;
use crate::observe::evidence::Evidence;
use crate::score::verdict::Verdict;

/// What it costs to give a sample to a part with this verdict.
pub fn cost(v: &Verdict) -> f32 {
    2.0 * v.against.count_ones() as f32 - v.support.count_ones() as f32
}

/// The cheapest part; ties go to the lowest, the base.
pub fn cheapest(n_parts: usize, cost: impl Fn(usize) -> f32) -> u8 {
    (0..n_parts).fold(0, |best, p| if cost(p) < cost(best) - 1e-3 { p } else { best }) as u8
}

/// The part of every sample of the evidence.
pub fn label(evidence: &Evidence, verdicts: &[Vec<Verdict>]) -> Vec<u8> {
    let n = verdicts[0].len();
    let mut costs: Vec<Vec<f32>> = verdicts.iter().map(|part| part.iter().map(cost).collect()).collect();
    costs.iter_mut().for_each(|c| even_out(c, &evidence.neighbours));
    (0..n).map(|i| cheapest(costs.len(), |p| costs[p][i])).collect()
}
