//! What a part costs, in contradictions that it has to remove to be worth having.

use super::verdict::Verdict;
use crate::config::MANY_STATES;

/// Share of all contradictions that a single rigid thing would have: a part's screw and its values
/// have to be paid for by what they explain.
const SHARE_OF_ALL: f64 = 0.015;
/// With few states more is explained by chance: share of what is left, times the number of states.
/// Below [`MANY_STATES`] of all: there leftovers of parts that are right invite further ones (three
/// drawers).
const SHARE_BY_CHANCE: f64 = 0.06;

/// The price of one more part.
#[derive(Clone, Copy, Debug)]
pub struct PartCost {
    /// For its screw and its values, contradictions.
    part: f64,
    /// For what is explained by chance, share of what is left to explain.
    chance: f64,
}

impl PartCost {
    /// `still`: the verdicts if nothing moved.
    pub fn new(still: &[Verdict], n_states: usize) -> Self {
        let all: f64 = still.iter().map(|v| v.against.count_ones() as f64).sum();
        let chance = SHARE_BY_CHANCE / n_states as f64;
        if n_states < MANY_STATES {
            return Self { part: (SHARE_OF_ALL + chance) * all, chance: 0.0 };
        }
        Self { part: SHARE_OF_ALL * all, chance }
    }

    /// Of a part where so many contradictions are left without it.
    pub fn of(&self, left: f64) -> f64 {
        self.part + self.chance * left
    }
}
