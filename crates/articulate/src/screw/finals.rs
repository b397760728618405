//! Finalists refined and judged.

use super::adopt::adopt;
use super::discover::{Node, poses_of};
use super::evidence::{Evidence, Motion, Sample};
use super::jury::Jury;
use super::plausible::plausibility;
use super::propose::{CROWD, Proposal};
use super::scan::Scan;
use super::straight::{ASKEW, along_faces};
use hingecast_geom::{KinematicTree, Pose, Screw};

/// A proposal, refined.
pub struct Final {
    /// Contradictions that it removes, times plausibility, minus what a part costs.
    pub merit: f64,
    pub tree: KinematicTree,
    /// Open samples that it explains.
    pub explained: Vec<Sample>,
}

/// What a new part is added to, and judged by.
pub struct Ground<'a> {
    pub evidence: &'a Evidence,
    pub node: &'a Node,
    /// Of every known part, in every state.
    pub poses: &'a [Vec<Pose>],
    pub jury: &'a Jury,
    pub cost: f64,
    pub seed: u64,
}

/// Faces within this angle of a new axis, or of square to it, say where it could point instead, radians; see [`along_faces`].
const NEARLY: [f64; 3] = [0.3, 0.15, 0.04];

impl Ground<'_> {
    /// Refines a proposal, and once more with its axis along its faces. The better of both.
    pub fn best(&self, p: &Proposal) -> Final {
        let found = self.finish(p);
        let straight = self.straight(p, &found).map(|p| self.finish(&p));
        straight.filter(|f| f.merit > found.merit).unwrap_or(found)
    }

    fn finish(&self, p: &Proposal) -> Final {
        let (evidence, node) = (self.evidence, self.node);
        let mut tree = node.tree.clone();
        adopt(evidence, &mut tree, p, &node.verdicts[p.parent], self.seed);
        let own = poses_of(&tree, tree.parts.len() - 1, evidence.n_states());
        // What it explains now, not what proposed it: refining may have found another piece.
        let verdicts = evidence.judge_some(&own, &node.open);
        let explained = node.open.iter().zip(&verdicts).filter(|(_, v)| v.explains());
        let explained: Vec<Sample> = explained.map(|(&i, _)| evidence.samples[i]).collect();
        let back: Vec<Motion> = self.poses[p.parent].iter().map(|p| p.inverse().into()).collect();
        let stride = explained.len().div_ceil(CROWD).max(1);
        let crowd: Vec<Sample> = explained.iter().step_by(stride).map(|s| s.moved(&back[s.state])).collect();
        let joint = tree.joints.last().expect("a part was added");
        let weight = plausibility(&joint.screw, &joint.values, joint.parent, &crowd, evidence.extent());
        let merit = self.jury.gain(evidence, &own, true) * weight - self.cost;
        Final { merit, tree, explained }
    }

    /// The proposal that `found` was, with the axis that it ended at turned to where the faces say, if that is somewhere else: the
    /// grid is blind to shifts of two voxels, and the bottom of a drawer that rises by 10 deg on its way lands on that of its case.
    fn straight(&self, p: &Proposal, found: &Final) -> Option<Proposal> {
        let joint = found.tree.joints.last().expect("a part was added");
        let axis = along_faces(&self.poses[p.parent], found.explained.iter(), joint.screw.axis, &NEARLY)?;
        let zero = joint.values[p.source];
        let values = joint.values.iter().map(|v| v - zero).collect();
        (axis.angle_between(joint.screw.axis) > ASKEW).then(|| Proposal {
            screw: Screw { axis, ..joint.screw },
            scan: Scan { values, scores: p.scan.scores.clone() },
            crowd: p.crowd.clone(),
            ..*p
        })
    }
}
