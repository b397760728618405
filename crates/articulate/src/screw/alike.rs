//! Parts that moved nearly alike: two drawers open to within a voxel or two of each other in every state.
//!
//! The grid takes them for one thing. Measured within the noise, what one says about a state contradicts the other. Where the samples of a
//! part want two values of its joint ([`super::halves`]) and that explains the recording clearly better, the part is two.

use super::connected::{among, divide};
use super::discover::poses_of;
use super::evidence::{Evidence, Sample, Verdict};
use super::halves::halves;
use super::refine::{Member, Settings, refine};
use super::settle::{Owners, without};
use super::whole::{Whole, words};
use hingecast_geom::{Joint, KinematicTree};
use rayon::prelude::*;
use std::cmp::Ordering;

/// Each of two parts has at least this share of the samples.
const SHARE: f64 = 0.1;
/// Two parts must explain the recording better by this many nats, and by this share of what the one explains.
const BETTER: f64 = 15.0;
const GAIN: f64 = 0.1;
/// A part that explains fewer nats beside two new ones than this goes.
const WORTH: f64 = 3.0;

/// Splits parts that are two. `owners` follow; whether any was split.
pub fn split(evidence: &Evidence, tree: &mut KinematicTree, owners: &mut Owners, still: &[Verdict], seed: u64) -> bool {
    let whole = Whole::new(evidence, still, seed);
    let (mut j, mut any) = (0, false);
    while j < tree.joints.len() {
        let leaf = tree.joints.iter().all(|o| o.parent != tree.joints[j].child);
        let values = if leaf { halves(evidence, tree, owners, j, seed) } else { None };
        let two = values.and_then(|values| apart(evidence, tree, owners, j, values, &whole, seed));
        let Some((other, labels)) = two else {
            j += 1;
            continue;
        };
        (*tree, owners.labels) = (other, labels);
        owners.shown.push(owners.shown[tree.joints[j].child]);
        any = true;
        if superfluous(evidence, tree, owners, &whole) {
            j = 0;
        }
    }
    any
}

/// The tree with the part of joint `j` in two, with these values, and all labels; none if one part explains nearly as much.
fn apart(
    evidence: &Evidence,
    tree: &KinematicTree,
    owners: &Owners,
    j: usize,
    [values, others]: [Vec<f64>; 2],
    whole: &Whole,
    seed: u64,
) -> Option<(KinematicTree, Vec<u8>)> {
    let (mut out, child, part) = (tree.clone(), tree.joints[j].child, tree.parts.len());
    out.parts.push(format!("part_{part}"));
    out.joints.push(Joint { name: format!("joint_{part}"), child: part, values: others, ..tree.joints[j].clone() });
    out.joints[j].values = values;
    let mine: Vec<usize> = (0..owners.labels.len()).filter(|&i| owners.labels[i] as usize == child).collect();
    let points: Vec<Sample> = mine.iter().map(|&i| evidence.samples[i]).collect();
    let near = among(&mine, &evidence.neighbours);
    let labels = divide(evidence, &out, [child, part], &points, &near);
    let member = |(&i, part): (&usize, &u8)| Member {
        sample: evidence.samples[i],
        part: *part as usize,
        shown: owners.shown[child],
    };
    let members: Vec<Member> = mine.iter().zip(&labels).map(member).collect();
    let free: Vec<bool> = (0..out.joints.len()).map(|k| k == j || k + 1 == out.joints.len()).collect();
    let voxel = evidence.lattice.voxel as f64;
    let settings = Settings { gates: [0.5 * voxel, 0.3 * voxel], rounds: 6, partners: 6 };
    refine(evidence, &mut out, &members, &free, &settings, seed);
    let labels = divide(evidence, &out, [child, part], &points, &near);
    let share = labels.iter().filter(|l| **l as usize == part).count() as f64 / mine.len().max(1) as f64;
    if share.min(1.0 - share) < SHARE {
        return None;
    }
    let held = whole.nats(evidence, tree);
    let own = held - whole.nats(evidence, &without(tree, child));
    if whole.nats(evidence, &out) < held + BETTER.max(GAIN * own) {
        return None;
    }
    let mut all = owners.labels.clone();
    mine.iter().zip(&labels).for_each(|(&i, l)| all[i] = *l);
    Some((out, all))
}

/// Drops parts that the others make superfluous; their samples go to whatever explains them best. Whether any was dropped.
fn superfluous(evidence: &Evidence, tree: &mut KinematicTree, owners: &mut Owners, whole: &Whole) -> bool {
    let mut any = false;
    loop {
        let held = whole.nats(evidence, tree);
        let leaf = |p: &usize| tree.joints.iter().all(|j| j.parent != *p);
        let loss = |p: usize| held - whole.nats(evidence, &without(tree, p));
        let least = (1..tree.parts.len()).filter(leaf).map(|p| (loss(p), p)).min_by(|a, b| a.0.total_cmp(&b.0));
        let Some((_, part)) = least.filter(|l| l.0 < WORTH) else { return any };
        any = true;
        *tree = without(tree, part);
        owners.shown.remove(part);
        let between: Vec<_> =
            (0..tree.parts.len()).map(|p| evidence.between(&poses_of(tree, p, evidence.n_states()))).collect();
        let best = |s: &Sample| {
            let each = between.iter().map(|b| words(evidence, s, &b[s.state])).enumerate();
            each.fold((f32::NEG_INFINITY, 0), |best, (p, w)| if w > best.0 { (w, p) } else { best }).1 as u8
        };
        owners.labels.par_iter_mut().zip(&evidence.samples).for_each(|(l, s)| match (*l as usize).cmp(&part) {
            Ordering::Less => {}
            Ordering::Equal => *l = best(s),
            Ordering::Greater => *l -= 1,
        });
    }
}
