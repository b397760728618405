//! How much of what is unexplained would a new part explain?

use super::claims::{Claims, POSSIBLE};
use super::verdict::{Verdict, contradictions};
use crate::model::motions::state_to_state;
use crate::observe::evidence::Evidence;
use crate::observe::occupancy::Answer;
use crate::observe::sample::{Motion, Sample};
use hingecast_geom::Pose;
use rayon::prelude::*;

/// Open samples that judge candidates, all states together.
pub struct Consensus {
    /// Sample, and the fewest contradictions under a known part.
    members: Vec<(Sample, f64)>,
    /// Open samples per member.
    weight: f64,
}

/// What the states say about a sample, one bit each.
#[derive(Default)]
struct Met {
    against: u64,
    /// Surface that no known part claims.
    fresh: u64,
    /// Surface that a known part could explain as well.
    possible: u64,
}

impl Met {
    /// `from[t]`: world at t from world at the sample's state.
    fn new(evidence: &Evidence, claims: &Claims, s: &Sample, from: &[Motion]) -> Self {
        let mut out = Self::default();
        for (t, m) in from.iter().enumerate().filter(|(t, _)| *t != s.state) {
            match evidence.spaces[t].ask_cell(m.apply(s.point), m.rot * s.normal) {
                (Answer::Free, _) => out.against |= 1 << t,
                (Answer::Surface, cell) => match claims.at(t, cell) {
                    0 => out.fresh |= 1 << t,
                    POSSIBLE => out.possible |= 1 << t,
                    _ => {}
                },
                (Answer::Silent, _) => {}
            }
        }
        out
    }
}

/// Most samples that judge.
const MOST_MEMBERS: usize = 4000;
/// What a removed contradiction counts if a surface was only met in the grid, and if nobody saw
/// where the sample went.
const MET_LOOSELY: f64 = 0.3;
const UNSEEN_SHARE: f64 = 0.1;
/// What it counts if the surface met could as well belong to a known part.
const POSSIBLE_SHARE: f64 = 0.8;
/// States in which a sample's distance to the surface is measured.
const MEASURED_STATES: usize = 4;

impl Consensus {
    /// `open`: samples that every known part contradicts; `verdicts`: of the known parts
    /// `[part][sample]`.
    pub fn new(evidence: &Evidence, open: &[usize], verdicts: &[Vec<Verdict>], seed: u64) -> Self {
        let mut chosen = open.to_vec();
        fastrand::Rng::with_seed(seed).shuffle(&mut chosen);
        chosen.truncate(MOST_MEMBERS);
        chosen.sort_unstable();
        let weight = open.len() as f64 / chosen.len().max(1) as f64;
        Self {
            members: chosen.into_iter().map(|i| (evidence.samples[i], contradictions(verdicts, i))).collect(),
            weight,
        }
    }

    /// Contradictions that a part with these poses (world from canonical) removes. With `tight`,
    /// surface only counts whole where it is met within the noise, and is not explained already.
    pub fn gain(&self, evidence: &Evidence, claims: &Claims, poses: &[Pose], tight: bool) -> f64 {
        let between = state_to_state(poses);
        let each = |(s, fewest): &(Sample, f64)| {
            let v = Met::new(evidence, claims, s, &between[s.state]);
            let removed = (fewest - v.against.count_ones() as f64).max(0.0);
            // A motion that is nearly right everywhere is wrong: what remains weighs on what is
            // removed.
            let removed = removed * (removed / fewest).powi(2);
            let (share, met) = match (v.fresh, v.possible) {
                (0, 0) => return removed * UNSEEN_SHARE,
                (0, possible) => (POSSIBLE_SHARE, possible),
                (fresh, _) => (1.0, fresh),
            };
            if removed == 0.0 || !tight {
                return removed * share;
            }
            removed * share * (MET_LOOSELY + (1.0 - MET_LOOSELY) * closeness(evidence, s, &between[s.state], met))
        };
        // Summed in a fixed order.
        self.members.par_iter().map(each).collect::<Vec<f64>>().iter().sum::<f64>() * self.weight
    }
}

/// Share of some supporting states in which the sample meets the surface within the noise.
fn closeness(evidence: &Evidence, s: &Sample, between: &[Motion], fresh: u64) -> f64 {
    let states: Vec<usize> = (0..between.len()).filter(|t| fresh >> t & 1 == 1).collect();
    let stride = states.len().div_ceil(MEASURED_STATES).max(1);
    let (mut met, mut asked) = (0, 0);
    for &t in states.iter().step_by(stride) {
        asked += 1;
        met += usize::from(evidence.meets(t, between[t].apply(s.point), between[t].rot * s.normal));
    }
    met as f64 / asked.max(1) as f64
}
