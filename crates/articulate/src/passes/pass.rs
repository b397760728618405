//! What all passes share: what they are given, and the two steps that keep labels and verdicts up
//! to date.

use crate::label::by_verdicts::label;
use crate::model::estimate::Estimate;
use crate::model::motions::poses_of;
use crate::model::tree_edit::{leaves, without};
use crate::observe::evidence::Evidence;
use crate::score::verdict::contradictions;

/// What a pass is given.
pub struct Round<'a> {
    /// What was seen, in the states' frames as they are believed now.
    pub evidence: &'a Evidence,
    /// Seed of everything random.
    pub seed: u64,
    /// Which of the repeated rounds this is, from 0.
    pub number: usize,
}

/// A step from one estimate to a better one.
pub struct Pass {
    /// As in `parts/trace.json` and `--set passes.skip`.
    pub name: &'static str,
    /// What it does.
    pub run: fn(&Round, &mut Estimate),
    /// Whether the rest makes sense without it.
    pub optional: bool,
}

/// The verdicts on every sample under every part.
pub fn judge_all(evidence: &Evidence, estimate: &mut Estimate) {
    let n_parts = estimate.tree.parts.len();
    estimate.verdicts =
        (0..n_parts).map(|p| evidence.judge(&poses_of(&estimate.tree, p, evidence.n_states()))).collect();
}

/// Labels by verdicts of the tree as it is now.
pub fn relabel(round: &Round, estimate: &mut Estimate) {
    judge_all(round.evidence, estimate);
    label_by_verdicts(round, estimate);
}

/// Every sample goes to the part that the states contradict least.
pub fn label_by_verdicts(round: &Round, estimate: &mut Estimate) {
    estimate.owners.labels = label(round.evidence, &estimate.verdicts);
}

/// Drops parts that the others make superfluous: those without children that explain less than they
/// cost. The verdicts follow.
pub fn prune_parts(estimate: &mut Estimate) {
    loop {
        let Estimate { tree, verdicts, cost, .. } = &*estimate;
        let left = |without: usize| -> f64 {
            let some: Vec<_> = (0..verdicts.len()).filter(|p| *p != without).map(|p| &verdicts[p][..]).collect();
            (0..some[0].len()).map(|i| contradictions(&some, i)).sum()
        };
        let with = left(usize::MAX);
        // What it removes beyond its cost.
        let gain = |p: usize| {
            let without = left(p);
            without - with - cost.of(without)
        };
        let weakest = leaves(tree).map(|p| (gain(p), p)).min_by(|a, b| a.0.total_cmp(&b.0));
        let Some((_, part)) = weakest.filter(|w| w.0 < 0.0) else { return };
        take_out(estimate, part);
    }
}

/// The estimate without a part that carries no other. Labels are for who calls to make anew.
pub fn take_out(estimate: &mut Estimate, part: usize) {
    estimate.tree = without(&estimate.tree, part);
    estimate.verdicts.remove(part);
    estimate.owners.shown.remove(part);
}
