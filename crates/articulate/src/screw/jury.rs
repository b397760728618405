//! How much of what is unexplained would a new part explain?

use super::evidence::{Evidence, Motion, Sample, Verdict, contradictions};
use hingecast_geom::Pose;
use rayon::prelude::*;

/// Open samples that judge proposals.
pub struct Jury {
    /// Sample, and the fewest contradictions under a known part.
    members: Vec<(Sample, f64)>,
    /// Open samples per member.
    weight: f64,
}

/// Most samples of the jury.
const SIZE: usize = 4000;
/// What a removed contradiction counts if a surface was only met in the grid, and if nobody saw where the sample went.
const LOOSE: f64 = 0.3;
const UNSEEN: f64 = 0.1;
/// What it counts if the surface met could as well belong to a known part.
const POSSIBLE: f64 = 0.8;
/// States in which a sample's distance to the surface is measured.
const MEASURED: usize = 4;

impl Jury {
    pub fn new(evidence: &Evidence, open: &[usize], verdicts: &[Vec<Verdict>], seed: u64) -> Self {
        let mut chosen = open.to_vec();
        fastrand::Rng::with_seed(seed).shuffle(&mut chosen);
        chosen.truncate(SIZE);
        chosen.sort_unstable();
        let weight = open.len() as f64 / chosen.len().max(1) as f64;
        Self {
            members: chosen.into_iter().map(|i| (evidence.samples[i], contradictions(verdicts, i))).collect(),
            weight,
        }
    }

    /// Contradictions that a part with these poses (world from canonical) removes. With `tight`, surface only counts
    /// whole where it is met within the noise, and is not explained already.
    pub fn gain(&self, evidence: &Evidence, poses: &[Pose], tight: bool) -> f64 {
        let between = evidence.between(poses);
        let each = |(s, fewest): &(Sample, f64)| {
            let v = evidence.ask_all(s, &between[s.state]);
            let removed = (fewest - v.against.count_ones() as f64).max(0.0);
            // A motion that is nearly right everywhere is wrong: what remains weighs on what is removed.
            let removed = removed * (removed / fewest).powi(2);
            let (share, met) = match (v.fresh, v.possible) {
                (0, 0) => return removed * UNSEEN,
                (0, possible) => (POSSIBLE, possible),
                (fresh, _) => (1.0, fresh),
            };
            if removed == 0.0 || !tight {
                return removed * share;
            }
            removed * share * (LOOSE + (1.0 - LOOSE) * closeness(evidence, s, &between[s.state], met))
        };
        // Summed in a fixed order.
        self.members.par_iter().map(each).collect::<Vec<f64>>().iter().sum::<f64>() * self.weight
    }
}

/// Share of some supporting states in which the sample meets the surface within the noise.
fn closeness(evidence: &Evidence, s: &Sample, between: &[Motion], fresh: u64) -> f64 {
    let states: Vec<usize> = (0..between.len()).filter(|t| fresh >> t & 1 == 1).collect();
    let stride = states.len().div_ceil(MEASURED).max(1);
    let (mut met, mut asked) = (0, 0);
    for &t in states.iter().step_by(stride) {
        asked += 1;
        met += usize::from(evidence.meets(t, between[t].apply(s.point), between[t].rot * s.normal));
    }
    met as f64 / asked.max(1) as f64
}
