//! Candidates fitted and judged.

use super::candidates::{CANDIDATE_SAMPLES, Candidate};
use super::fit_candidate::fit_candidate;
use super::partial::Partial;
use crate::fit::question::Sweep;
use crate::model::faces::{ASKEW_RAD, along_faces};
use crate::model::motions::poses_of;
use crate::observe::evidence::Evidence;
use crate::observe::sample::{Motion, Sample};
use crate::score::claims::Claims;
use crate::score::consensus::Consensus;
use crate::score::prior::prior;
use hingecast_geom::{KinematicTree, Pose, Screw};

/// A candidate, fitted.
pub struct Ranked {
    /// Contradictions that it removes, times the prior, minus what a part costs.
    pub merit: f64,
    /// With the candidate as its last part.
    pub tree: KinematicTree,
    /// Open samples that it explains.
    pub explained: Vec<Sample>,
}

/// What a new part is added to, and judged by.
pub struct Ranking<'a> {
    /// What was seen.
    pub evidence: &'a Evidence,
    /// The parts so far.
    pub partial: &'a Partial,
    /// Of every known part, in every state.
    pub poses: &'a [Vec<Pose>],
    /// Of the parts so far.
    pub claims: &'a Claims,
    /// Who judges.
    pub consensus: &'a Consensus,
    /// What a part costs, contradictions.
    pub cost: f64,
    /// Seed of everything random.
    pub seed: u64,
}

/// Faces within this angle of a new axis, or of square to it, say where it could point instead,
/// radians; see [`along_faces`].
const NEARLY_RAD: [f64; 3] = [0.3, 0.15, 0.04];

impl Ranking<'_> {
    /// Refines a candidate, and once more with its axis along its faces. The better of both.
    pub fn best(&self, p: &Candidate) -> Ranked {
        let found = self.finish(p);
        let straight = self.straight(p, &found).map(|p| self.finish(&p));
        straight.filter(|f| f.merit > found.merit).unwrap_or(found)
    }

    fn finish(&self, p: &Candidate) -> Ranked {
        let (evidence, partial) = (self.evidence, self.partial);
        let mut tree = partial.tree.clone();
        fit_candidate(evidence, self.claims, &mut tree, p, &partial.verdicts[p.parent], self.seed);
        let own = poses_of(&tree, tree.parts.len() - 1, evidence.n_states());
        // What it explains now, not what suggested it: refining may have found another piece.
        let verdicts = evidence.judge_some(&own, &partial.open);
        let explained = partial.open.iter().zip(&verdicts).filter(|(_, v)| v.explains());
        let explained: Vec<Sample> = explained.map(|(&i, _)| evidence.samples[i]).collect();
        let back: Vec<Motion> = self.poses[p.parent].iter().map(|p| p.inverse().into()).collect();
        let stride = explained.len().div_ceil(CANDIDATE_SAMPLES).max(1);
        let samples: Vec<Sample> = explained.iter().step_by(stride).map(|s| s.moved(&back[s.state])).collect();
        let joint = tree.joints.last().expect("a part was added");
        let weight = prior(&joint.screw, &joint.values, joint.parent, &samples, evidence.extent());
        let merit = self.consensus.gain(evidence, self.claims, &own, true) * weight - self.cost;
        Ranked { merit, tree, explained }
    }

    /// The candidate that `found` was, with the axis that it ended at turned to where the faces
    /// say, if that is somewhere else: the grid is blind to shifts of two voxels, and the bottom of
    /// a drawer that rises by 10 deg on its way lands on that of its case.
    fn straight(&self, p: &Candidate, found: &Ranked) -> Option<Candidate> {
        let joint = found.tree.joints.last().expect("a part was added");
        let axis = along_faces(&self.poses[p.parent], found.explained.iter(), joint.screw.axis, &NEARLY_RAD)?;
        let zero = joint.values[p.source];
        let values = joint.values.iter().map(|v| v - zero).collect();
        (axis.angle_between(joint.screw.axis) > ASKEW_RAD).then(|| Candidate {
            screw: Screw { axis, ..joint.screw },
            sweep: Sweep { values, scores: p.sweep.scores.clone() },
            samples: p.samples.clone(),
            ..*p
        })
    }
}
