//! All states asked once more for the value of every joint, now that all parts are known.

use super::pass::Round;
use crate::fit::sweep_values::improved_values;
use crate::model::estimate::Estimate;
use crate::model::motions::poses_of;
use crate::model::owners::{ASKING, subset};
use crate::score::claims::Claims;

/// Asks for the values of all joints by surface that the other parts do not explain.
pub fn ask_values(round: &Round, estimate: &mut Estimate) {
    let (evidence, tree, labels) = (round.evidence, &mut estimate.tree, &estimate.owners.labels);
    for j in 0..tree.joints.len() {
        let child = tree.joints[j].child;
        let own = evidence.samples.iter().zip(labels).filter(|(_, l)| **l as usize == child);
        let asking = subset(own.map(|(s, _)| *s), ASKING, round.seed ^ j as u64);
        if !asking.is_empty() {
            let claims = Claims::of_others(evidence, tree, j);
            let parent_poses = poses_of(tree, tree.joints[j].parent, evidence.n_states());
            tree.joints[j].values = improved_values(evidence, &claims, &tree.joints[j], &asking, &parent_poses);
        }
    }
}
