//! How much of what is unexplained would a new part explain?

use super::claims::{Claims, POSSIBLE};
use super::verdict::{Verdict, contradictions_of_best};
use crate::model::motions::state_to_state;
use crate::observe::evidence::Evidence;
use crate::observe::occupancy::Answer;
use crate::observe::sample::{Motion, Sample};
use hingecast_geom::Pose;
use rayon::prelude::*;

/// Open samples that judge candidates, all states together.
pub struct Consensus {
    /// One jury; of a film two, the scan's and the others'.
    juries: Vec<Jury>,
}

/// Open samples that count alike.
struct Jury {
    members: Vec<Member>,
    /// Open samples per member.
    weight: f64,
    /// Contradictions that all samples of its states have if nothing moves.
    all: f64,
}

/// An open sample.
struct Member {
    sample: Sample,
    /// Contradictions under the known part with the fewest of them.
    fewest: f64,
    /// The states that they are of.
    against: u64,
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
/// Of the contradictions that a scan has if nothing moves, a part removes at least this share.
const LEAST_OF_SCAN: f64 = 0.03;
/// States in which a sample's distance to the surface is measured.
const MEASURED_STATES: usize = 4;

impl Consensus {
    /// `open`: samples that every known part contradicts; `verdicts`: of the known parts
    /// `[part][sample]`.
    pub fn new(evidence: &Evidence, open: &[usize], verdicts: &[Vec<Verdict>], seed: u64) -> Self {
        let of_scan = |i: &usize| evidence.samples[*i].state == 0;
        if !evidence.film {
            return Self { juries: vec![Jury::new(evidence, open.to_vec(), 0.0, verdicts, seed)] };
        }
        let all = |scan: bool| -> f64 {
            let own = (0..evidence.samples.len()).filter(|i| of_scan(i) == scan);
            own.map(|i| verdicts[0][i].against.count_ones() as f64).sum()
        };
        let jury = |scan: bool| {
            let own = open.iter().copied().filter(|i| of_scan(i) == scan);
            Jury::new(evidence, own.collect(), all(scan), verdicts, seed)
        };
        Self { juries: vec![jury(true), jury(false)] }
    }

    /// Contradictions that a part with these poses (world from canonical) removes. With `tight`,
    /// surface only counts whole where it is met within the noise, and is not explained already.
    ///
    /// Of a film, a part must be seen in it as well as in the other states: the harmonic mean
    /// of what it removes of the scan's and of the others', so that hands, of which the scan has nothing,
    /// are no part.
    pub fn gain(&self, evidence: &Evidence, claims: &Claims, poses: &[Pose], tight: bool) -> f64 {
        let between = state_to_state(poses);
        let removed = |jury: &Jury| jury.gain(evidence, claims, &between, tight);
        let [scan, others] = &self.juries[..] else { return removed(&self.juries[0]) };
        let share = |jury: &Jury| removed(jury) / jury.all.max(1.0);
        let (of_scan, of_others) = (share(scan), share(others));
        if of_scan < LEAST_OF_SCAN {
            return 0.0;
        }
        (scan.all + others.all) * 2.0 * of_scan * of_others / (of_scan + of_others)
    }
}

impl Jury {
    fn new(evidence: &Evidence, open: Vec<usize>, all: f64, verdicts: &[Vec<Verdict>], seed: u64) -> Self {
        let n = open.len();
        let mut chosen = open;
        fastrand::Rng::with_seed(seed).shuffle(&mut chosen);
        chosen.truncate(MOST_MEMBERS);
        chosen.sort_unstable();
        let weight = n as f64 / chosen.len().max(1) as f64;
        let member = |i: usize| {
            let (fewest, part) = contradictions_of_best(verdicts, i);
            Member { sample: evidence.samples[i], fewest, against: verdicts[part][i].against }
        };
        Self { members: chosen.into_iter().map(member).collect(), weight, all }
    }

    fn gain(&self, evidence: &Evidence, claims: &Claims, between: &[Vec<Motion>], tight: bool) -> f64 {
        let each = |Member { sample: s, fewest, against }: &Member| {
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
            // A picture of a film shows little of a thing, and any place that it does not show would do.
            let removed = match evidence.film {
                true => removed * seen(against & !v.against, v.fresh | v.possible),
                false => removed,
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

/// What the states whose contradictions were removed say: 1 where they show the sample.
fn seen(removed: u64, met: u64) -> f64 {
    let share = (met & removed).count_ones() as f64 / removed.count_ones().max(1) as f64;
    UNSEEN_SHARE + (1.0 - UNSEEN_SHARE) * share
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
