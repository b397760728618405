//! Parts that moved nearly alike: two drawers open to within a voxel or two of each other in every
//! state.
//!
//! The grid takes them for one thing. Measured within the noise, what one says about a state
//! contradicts the other. Where the samples of a part want two values of its joint
//! ([`super::two_values`]) and that explains the recording clearly better, the part is two.

use super::align_axes::align_axes;
use super::pass::{Round, judge_all};
use super::refine_joints::refine_all;
use super::two_values::two_values;
use crate::fit::gauss_newton::{Settings, gauss_newton};
use crate::label::by_likelihood_ratio::{divide, restrict_neighbours};
use crate::model::estimate::Estimate;
use crate::model::motions::motions_of;
use crate::model::owners::{Member, Owners};
use crate::model::tree_edit::{leaves, without};
use crate::observe::evidence::Evidence;
use crate::observe::sample::Sample;
use crate::score::agreement::total_agreement;
use crate::score::likelihood::Likelihood;
use crate::score::verdict::Verdict;
use hingecast_geom::{Joint, KinematicTree};
use rayon::prelude::*;

/// Each of two parts has at least this share of the samples.
const LEAST_SHARE: f64 = 0.1;
/// Two parts must explain the recording better by this many nats, and by this share of what the one
/// explains.
const BETTER_NATS: f64 = 15.0;
const BETTER_SHARE: f64 = 0.1;
/// A part that explains fewer nats beside two new ones than this goes.
const WORTH_NATS: f64 = 3.0;

/// Splits parts that are two, and settles the joints of what was split.
pub fn split_coupled(round: &Round, estimate: &mut Estimate) {
    let Estimate { tree, owners, verdicts, .. } = estimate;
    if split(round.evidence, tree, owners, &verdicts[0], round.seed) {
        // Not labelled by the grid again: that takes the new parts for one.
        refine_all(round, estimate, 0.6);
        align_axes(round, estimate);
        judge_all(round.evidence, estimate);
    }
}

/// Splits parts that are two. `owners` follow; whether any was split.
fn split(evidence: &Evidence, tree: &mut KinematicTree, owners: &mut Owners, still: &[Verdict], seed: u64) -> bool {
    let likelihood = Likelihood::new(still, seed);
    let (mut j, mut any) = (0, false);
    while j < tree.joints.len() {
        let (bare, own, at) = without_children(tree, owners, j);
        let values = two_values(evidence, &bare, &own, at, seed);
        let held = || likelihood.nats(evidence, tree);
        let two =
            values.and_then(|values| split_in_two(evidence, &bare, &own, at, values, (&likelihood, held()), seed));
        let Some((other, labels)) = two else {
            j += 1;
            continue;
        };
        let mut shown = own.shown;
        shown.push(shown[bare.joints[at].child]);
        (*tree, *owners) = (other, Owners { labels, shown });
        any = true;
        let dropped = superfluous(evidence, tree, owners, &likelihood);
        j = if dropped || at != j { 0 } else { j };
    }
    any
}

/// The tree without what hangs on the part of joint `j`, whose samples become that part's, and
/// where that joint is then. A second part, found as if it hung on the first, is no third.
fn without_children(tree: &KinematicTree, owners: &Owners, j: usize) -> (KinematicTree, Owners, usize) {
    let (mut out, mut child) = (tree.clone(), tree.joints[j].child);
    let mut own = owners.clone();
    let below = |tree: &KinematicTree, child: usize| {
        let hangs = |p: &usize| tree.ancestry(*p).iter().any(|k| tree.joints[*k].child == child);
        leaves(tree).find(|p| *p != child && hangs(p))
    };
    while let Some(part) = below(&out, child) {
        out = drop_part(&out, &mut own, part, |_| child as u8);
        child -= usize::from(child > part);
    }
    let at = out.joints.iter().position(|o| o.child == child).expect("it stays");
    (out, own, at)
}

/// The tree without a part that carries no other; `goes(i)`: the part, as counted before, that its
/// i-th sample goes to.
fn drop_part(
    tree: &KinematicTree,
    owners: &mut Owners,
    part: usize,
    goes: impl Fn(usize) -> u8 + Sync,
) -> KinematicTree {
    owners.shown.remove(part);
    owners.labels.par_iter_mut().enumerate().for_each(|(i, l)| {
        if *l as usize == part {
            *l = goes(i);
        }
        *l -= u8::from(*l as usize > part);
    });
    without(tree, part)
}

/// The tree with the part of joint `j` in two, with these values, and all labels; none unless that
/// explains the recording clearly better than the `held` nats of before.
fn split_in_two(
    evidence: &Evidence,
    tree: &KinematicTree,
    owners: &Owners,
    j: usize,
    [values, others]: [Vec<f64>; 2],
    (likelihood, held): (&Likelihood, f64),
    seed: u64,
) -> Option<(KinematicTree, Vec<u8>)> {
    let (mut out, child, part) = (tree.clone(), tree.joints[j].child, tree.parts.len());
    out.parts.push(format!("part_{part}"));
    out.joints.push(Joint { name: format!("joint_{part}"), child: part, values: others, ..tree.joints[j].clone() });
    out.joints[j].values = values;
    let mine: Vec<usize> = (0..owners.labels.len()).filter(|&i| owners.labels[i] as usize == child).collect();
    let points: Vec<Sample> = mine.iter().map(|&i| evidence.samples[i]).collect();
    let near = restrict_neighbours(&mine, &evidence.neighbours);
    let labels = divide(evidence, &out, [child, part], &points, &near);
    let member = |(&i, part): (&usize, &u8)| Member {
        sample: evidence.samples[i],
        part: *part as usize,
        shown: owners.shown[child],
    };
    let members: Vec<Member> = mine.iter().zip(&labels).map(member).collect();
    let free: Vec<bool> = (0..out.joints.len()).map(|k| k == j || k + 1 == out.joints.len()).collect();
    let settings = Settings::narrowing(0.5, 0.3, evidence.lattice.voxel);
    gauss_newton(evidence, &mut out, &members, &free, &settings, seed);
    let labels = divide(evidence, &out, [child, part], &points, &near);
    let share = labels.iter().filter(|l| **l as usize == part).count() as f64 / mine.len().max(1) as f64;
    if share.min(1.0 - share) < LEAST_SHARE {
        return None;
    }
    let own = held - likelihood.nats(evidence, &without(tree, child));
    if likelihood.nats(evidence, &out) < held + BETTER_NATS.max(BETTER_SHARE * own) {
        return None;
    }
    let mut all = owners.labels.clone();
    mine.iter().zip(&labels).for_each(|(&i, l)| all[i] = *l);
    Some((out, all))
}

/// Drops parts that the others make superfluous; their samples go to whatever explains them best.
/// Whether any was dropped.
fn superfluous(evidence: &Evidence, tree: &mut KinematicTree, owners: &mut Owners, likelihood: &Likelihood) -> bool {
    let mut any = false;
    loop {
        let held = likelihood.nats(evidence, tree);
        let loss = |p: usize| held - likelihood.nats(evidence, &without(tree, p));
        let least = leaves(tree).map(|p| (loss(p), p)).min_by(|a, b| a.0.total_cmp(&b.0));
        let Some((_, part)) = least.filter(|l| l.0 < WORTH_NATS) else { return any };
        any = true;
        let between = motions_of(tree, evidence.n_states());
        let best = |i: usize| {
            let s = &evidence.samples[i];
            let each = between
                .iter()
                .map(|b| total_agreement(evidence, s, &b[s.state]))
                .enumerate()
                .filter(|(p, _)| *p != part);
            each.fold((f32::NEG_INFINITY, 0), |best, (p, w)| if w > best.0 { (w, p) } else { best }).1 as u8
        };
        *tree = drop_part(tree, owners, part, best);
    }
}
