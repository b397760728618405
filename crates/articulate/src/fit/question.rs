//! What a sweep over the values of a screw asks, and how well a state agrees with one of them.

use crate::observe::evidence::Evidence;
use crate::observe::occupancy::Answer;
use crate::observe::sample::{Motion, Sample};
use crate::score::agreement::EMPTY_COST;
use crate::score::claims::{Claims, POSSIBLE};

/// Value per state and how well the states agree.
#[derive(Clone, Debug)]
pub struct Sweep {
    /// Relative to the source state.
    pub values: Vec<f64>,
    /// Per state: surface met minus emptiness entered, shares of the samples.
    pub scores: Vec<f32>,
}

/// What surface counts that known parts claim, against 1 for surface that none does.
#[derive(Clone, Copy)]
pub struct Worth {
    /// A known part explains it already.
    pub taken: f32,
    /// A known part could explain it.
    pub possible: f32,
}

impl Worth {
    /// For parts that are sought.
    pub const SOUGHT: Self = Self { taken: 0.25, possible: 0.8 };
    /// Surface that another part explains, or could explain, says nothing.
    pub const OWN: Self = Self { taken: 0.0, possible: 0.0 };
    /// Everything that is there may be the part.
    pub const ANY: Self = Self { taken: 1.0, possible: 1.0 };

    fn of(&self, claim: u8) -> f32 {
        match claim {
            0 => 1.0,
            POSSIBLE => self.possible,
            _ => self.taken,
        }
    }
}

/// What a sweep asks.
#[derive(Clone, Copy)]
pub struct Question<'a> {
    /// What was seen.
    pub evidence: &'a Evidence,
    /// Of the parts that are known.
    pub claims: &'a Claims,
    /// What claimed surface counts.
    pub worth: Worth,
}

/// Share of the samples that meet surface in the grid, minus what enters empty space.
pub fn grid_agreement(question: &Question, state: usize, samples: &[Sample], m: &Motion) -> f32 {
    agreement_above(question, state, samples, m, f32::NEG_INFINITY)
}

/// The agreement, or little once it is sure to stay below `floor`.
pub(super) fn agreement_above(question: &Question, state: usize, samples: &[Sample], m: &Motion, floor: f32) -> f32 {
    let n = samples.len() as f32;
    let space = &question.evidence.spaces[state];
    let mut sum = 0.0;
    for (k, s) in samples.iter().enumerate() {
        match space.ask_cell(m.apply(s.point), m.rot * s.normal) {
            (Answer::Surface, cell) => sum += question.worth.of(question.claims.at(state, cell)),
            (Answer::Free, _) => sum -= EMPTY_COST,
            (Answer::Silent, _) => {}
        }
        if k % 16 == 15 && sum + (n - 1.0 - k as f32) < floor * n {
            return -EMPTY_COST;
        }
    }
    sum / n
}
