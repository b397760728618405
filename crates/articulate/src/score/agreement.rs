//! How well the states agree that a sample moved so, finer than the grid.
//!
//! One state's word on one sample is 1 / (1 + (h / tolerance)^2), h the height over the surface
//! that it measured where the motion puts the sample, 0 where nothing is known, and [`EMPTY_COST`]
//! below it where it was seen empty.

use crate::observe::evidence::Evidence;
use crate::observe::occupancy::Answer;
use crate::observe::sample::{Motion, Sample};

/// What entering space that was seen empty costs against meeting one surface.
pub const EMPTY_COST: f32 = 1.5;

/// What state t says about a sample there: 1 on surface that faces the same way, -1.5 where it was
/// seen empty.
pub fn agreement(evidence: &Evidence, t: usize, s: &Sample, m: &Motion) -> f32 {
    let (x, normal) = (m.apply(s.point), m.rot * s.normal);
    if matches!(evidence.spaces[t].ask(x, normal), Answer::Free) {
        -EMPTY_COST
    } else {
        evidence.nearness(t, x, normal)
    }
}

/// What all other states say about a sample together; `from[t]`: world at t from world at its
/// state.
pub fn total_agreement(evidence: &Evidence, s: &Sample, from: &[Motion]) -> f32 {
    (0..from.len()).filter(|t| *t != s.state).map(|t| agreement(evidence, t, s, &from[t])).sum()
}

/// What state `t` says about samples of other states in the mean.
pub fn mean_agreement(evidence: &Evidence, t: usize, samples: &[Sample], m: &Motion) -> f32 {
    let others = samples.iter().filter(|s| s.state != t);
    let (sum, n) = others.fold((0.0, 0), |(sum, n), s| (sum + agreement(evidence, t, s, m), n + 1));
    sum / n.max(1) as f32
}
