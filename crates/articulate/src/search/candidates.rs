//! Candidates for a new part on one parent: pairs of states, hypotheses, alignment, and a question
//! to all states.

use super::align_hypotheses::{Frames, align};
use super::pairs::varied_pairs;
use super::state_pair::StatePair;
use crate::config::MANY_STATES;
use crate::fit::question::{Question, Sweep, Worth};
use crate::fit::sweep_values::{full_range, sweep_values};
use crate::model::owners::subset;
use crate::observe::evidence::Evidence;
use crate::observe::sample::{Motion, Sample};
use crate::score::claims::{Claims, POSSIBLE, TAKEN};
use crate::score::consensus::Consensus;
use crate::score::verdict::Verdict;
use hingecast_geom::{Pose, Screw};
use rayon::prelude::*;

/// Hypotheses per pair that are aligned.
const ALIGNED: usize = 180;
/// Poses per parent that are asked in all states, each as a hinge and as a slide.
const ASKED: usize = 36;
/// Samples that ask.
pub const CANDIDATE_SAMPLES: usize = 200;
/// A first sweep's steps move no sample farther than this.
const SWEEP_STEP_VOXELS: f32 = 1.5;

/// How hypotheses of a pair of states are sought.
struct Rule {
    /// Surface with one of these claims is no place to land.
    explained: u8,
    /// Voxels between hypotheses.
    apart: f32,
    /// Whether they are moved uphill before they are aligned.
    climbs: bool,
}

const DENSE: Rule = Rule { explained: TAKEN, apart: 3.0, climbs: false };
/// What an opened door shows for the first time stands still as far as anybody knows, but in two
/// states it attracts so many wrong motions that the right one is lost. So with few states all is
/// sought once more without it, and wider apart.
const WIDE: Rule = Rule { explained: TAKEN | POSSIBLE, apart: 7.0, climbs: true };

/// A screw on a parent, ready to become a part.
pub struct Candidate {
    /// Index of the part that it would hang on.
    pub parent: usize,
    /// State whose samples suggested it.
    pub source: usize,
    /// In the parent's canonical frame.
    pub screw: Screw,
    /// Its values.
    pub sweep: Sweep,
    /// Contradictions of open samples that it removes.
    pub gain: f64,
    /// Source samples that take part, in the parent's canonical frame as of the source state.
    pub samples: Vec<Sample>,
}

/// Screws of a new part on `parent`, whose poses are `parent_poses` (world from its canonical
/// frame).
pub fn candidates(
    evidence: &Evidence,
    claims: &Claims,
    parent: usize,
    parent_poses: &[Pose],
    open: &[usize],
    verdicts: &[Vec<Verdict>],
    consensus: &Consensus,
    seed: u64,
) -> Vec<Candidate> {
    let n = evidence.n_states();
    let verdict = &verdicts[parent];
    // Open samples of state b that the parent's motion would put into empty space of state a.
    let mut counts = vec![0usize; n * n];
    for &i in open {
        let b = evidence.samples[i].state;
        (0..n).filter(|a| verdict[i].against >> a & 1 == 1).for_each(|a| counts[b * n + a] += 1);
    }
    let pairs = varied_pairs(&counts, n);
    let back: Vec<Pose> = parent_poses.iter().map(Pose::inverse).collect();
    let frames = Frames { parent, parent_poses, back: &back };
    let question = Question { evidence, claims, worth: Worth::SOUGHT };
    let mut all = Vec::new();
    for (k, &pair) in pairs.iter().enumerate() {
        let (b, a) = (pair / n, pair % n);
        // Open samples of one state that the parent's motion would put into emptiness of the other.
        let moving = |from: usize, to: usize| -> Vec<Sample> {
            let own = |i: &&usize| evidence.samples[**i].state == from && verdict[**i].against >> to & 1 == 1;
            open.iter().filter(own).map(|&i| evidence.samples[i].moved(&back[from].into())).collect()
        };
        let (source, reverse) = (moving(b, a), moving(a, b));
        let cloud = &evidence.clouds[a];
        let m = Motion::from(back[a]);
        let space = &evidence.spaces[a];
        let mut states = StatePair {
            source,
            targets: Vec::new(),
            reverse,
            target: a,
            space,
            claims,
            explained: 0,
            apart: 0.0,
            place: Motion::from(parent_poses[a]),
        };
        let mut hypotheses = Vec::new();
        for rule in if n < MANY_STATES { &[DENSE, WIDE][..] } else { &[DENSE][..] } {
            let free = |i: &usize| claims.at_place(evidence, a, cloud.points[*i]) & rule.explained == 0;
            let targets = (0..cloud.points.len()).filter(free);
            states.targets = targets.map(|i| (m.apply(cloud.points[i]), m.rot * cloud.normals[i])).collect();
            (states.explained, states.apart) = (rule.explained, rule.apart);
            let found = states.one_point_screws(ALIGNED / pairs.len().min(3), seed ^ ((k as u64 + 1) << 8));
            hypotheses.extend(found.into_iter().map(|h| (h, rule.climbs)));
        }
        states.explained = TAKEN;
        let keep = (ASKED / pairs.len()).max(6);
        let aligned = align(evidence, &states, &hypotheses, b, &frames, keep, seed);
        let asked: Vec<Candidate> = aligned
            .into_par_iter()
            .map(|(h, samples)| {
                let samples = subset(samples.into_iter(), CANDIDATE_SAMPLES, seed);
                let range = full_range(&h.screw, evidence.extent());
                let step = SWEEP_STEP_VOXELS * evidence.lattice.voxel;
                let sweep = sweep_values(&question, &samples, parent_poses, &h.screw, range, step);
                let own: Vec<Pose> = (0..n).map(|s| parent_poses[s] * h.screw.motion(sweep.values[s])).collect();
                let gain = consensus.gain(evidence, claims, &own, false);
                Candidate { parent, source: b, screw: h.screw, sweep, gain, samples }
            })
            .collect();
        all.extend(asked);
    }
    all
}
