//! Finalists refined and judged.

use super::adopt::{adopt, unslip};
use super::discover::{Node, poses_of};
use super::evidence::{Evidence, Motion, Sample, Verdict};
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
    /// Open samples that some states confirm, and not more contradict.
    torn: Vec<Sample>,
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
/// One torn sample in so many that are explained may be chance.
const TORN: usize = 50;

impl Ground<'_> {
    /// Refines a proposal, once more with its axis along its faces, and once more where it has slipped along them. The best of these.
    pub fn best(&self, p: &Proposal) -> Final {
        let found = self.finish(p);
        let straight = self.straight(p, &found).map(|p| self.finish(&p));
        let found = straight.filter(|f| f.merit > found.merit).unwrap_or(found);
        let back = self.unslipped(&found);
        back.filter(|f| f.merit > found.merit).unwrap_or(found)
    }

    fn finish(&self, p: &Proposal) -> Final {
        let mut tree = self.node.tree.clone();
        adopt(self.evidence, &mut tree, p, &self.node.verdicts[p.parent], self.seed);
        self.judged(tree)
    }

    fn unslipped(&self, found: &Final) -> Option<Final> {
        if found.torn.len() * TORN < found.explained.len() || found.merit < 0.0 {
            return None;
        }
        let mut tree = found.tree.clone();
        let parent = tree.joints.last().expect("a part was added").parent;
        unslip(self.evidence, &mut tree, &found.torn, &self.node.verdicts[parent], self.seed);
        Some(self.judged(tree))
    }

    /// What the last joint of a tree is worth.
    fn judged(&self, tree: KinematicTree) -> Final {
        let (evidence, node) = (self.evidence, self.node);
        let own = poses_of(&tree, tree.parts.len() - 1, evidence.n_states());
        let parent = tree.joints.last().expect("a part was added").parent;
        // What it explains now, not what proposed it: refining may have found another piece.
        let verdicts = evidence.judge_some(&own, &node.open);
        let those = |which: &dyn Fn(&Verdict) -> bool| -> Vec<Sample> {
            node.open.iter().zip(&verdicts).filter(|(_, v)| which(v)).map(|(&i, _)| evidence.samples[i]).collect()
        };
        let explained = those(&Verdict::explains);
        let torn = those(&|v| v.against != 0 && v.support.count_ones() >= v.against.count_ones());
        let back: Vec<Motion> = self.poses[parent].iter().map(|p| p.inverse().into()).collect();
        let stride = explained.len().div_ceil(CROWD).max(1);
        let crowd: Vec<Sample> = explained.iter().step_by(stride).map(|s| s.moved(&back[s.state])).collect();
        let joint = tree.joints.last().expect("a part was added");
        let weight = plausibility(&joint.screw, &joint.values, joint.parent, &crowd, evidence.extent());
        let merit = self.jury.gain(evidence, &own, true) * weight - self.cost;
        Final { merit, tree, explained, torn }
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
