//! A value that single views contradict, sought again among all values that the joint may have.
//!
//! A thin lid half open looks, cell by cell, much like one that leans the other way, and every fit stays
//! where it is near to. Views tell: surface that other states saw of the part, put where it would be at a
//! value, is seen there by cameras of the state or looked through; and what moved in the state itself, put
//! where it would be in the others, is seen there or looked through.

use crate::model::estimate::Estimate;
use crate::model::tree_edit::leaves;
use crate::observe::evidence::Evidence;
use crate::observe::sample::Motion;
use crate::observe::witness::{Witness, counted};
use crate::passes::pass::{Round, label_by_verdicts, prune_parts, relabel, take_out};
use crate::passes::refine_joints::refine_all;
use crate::shown::{Shown, mean, slack, some_points};
use glam::Vec3;
use hingecast_geom::{Joint, KinematicTree, Pose};
use rayon::prelude::*;

/// Points of a part's surface that are asked about, over all states.
const POINTS: usize = 900;
/// Points of the state's own surface that are asked whether they moved.
const ASKED: usize = 3000;
/// How far beyond the values of the other states is looked, share of their range.
const BEYOND: f64 = 0.3;
/// Most that a hinge is turned beyond them, radians: half a turn covers all.
const TURN: f64 = std::f64::consts::PI;
/// Steps of a sweep at most, and of the second, finer one on either side.
const SWEEP: usize = 240;
const FINE: i32 = 8;
/// Another value must be borne out by so much more of the views, shares of both ways of asking.
const CLEARER: f64 = 0.1;
/// Gate of the fit that follows, voxels.
const GATE_VOXELS: f64 = 0.6;

/// Gives every contradicted value the one that the views bear out, if that is clearly better; fits and labels
/// follow. Whether anything changed.
pub fn correct(
    evidence: &Evidence,
    estimate: &mut Estimate,
    labels: &[Vec<u8>],
    witnesses: &[Vec<Witness>],
    shown: &[Shown],
    seed: u64,
) -> bool {
    let mut changed = false;
    for (j, said) in shown.iter().enumerate() {
        for &state in &said.contradicted {
            if let Some(value) = borne_out(evidence, &estimate.tree, (j, state), labels, witnesses, said) {
                let joint = &mut estimate.tree.joints[j];
                joint.values[state] = value;
                estimate.owners.shown[joint.child] |= 1 << state;
                changed = true;
            }
        }
    }
    if changed {
        let round = Round { evidence, seed, number: 1 };
        relabel(&round, estimate);
        prune(estimate);
        label_by_verdicts(&round, estimate);
        refine_all(&round, estimate, GATE_VOXELS);
        relabel(&round, estimate);
    }
    changed
}

/// Takes out parts that never left where they are said to have been at rest (see [`Shown::never_left`]); fits and
/// labels follow. Whether there were any.
pub fn leave_out(evidence: &Evidence, estimate: &mut Estimate, shown: &[Shown], seed: u64) -> bool {
    let tree = &estimate.tree;
    let stayed = |part: &usize| (0..shown.len()).any(|j| tree.joints[j].child == *part && shown[j].never_left());
    let phantoms: Vec<usize> = leaves(tree).filter(stayed).collect();
    for &part in phantoms.iter().rev() {
        take_out(estimate, part);
    }
    if !phantoms.is_empty() {
        let round = Round { evidence, seed, number: 1 };
        relabel(&round, estimate);
        refine_all(&round, estimate, GATE_VOXELS);
        relabel(&round, estimate);
    }
    !phantoms.is_empty()
}

/// The value of joint `at.0` in state `at.1` that views bear out clearly better than the one held.
fn borne_out(
    evidence: &Evidence,
    tree: &KinematicTree,
    at: (usize, usize),
    labels: &[Vec<u8>],
    witnesses: &[Vec<Witness>],
    said: &Shown,
) -> Option<f64> {
    let ((j, state), slack) = (at, slack(evidence));
    let joint = &tree.joints[j];
    let good: Vec<usize> = (0..joint.values.len()).filter(|s| *s != state && !said.contradicted.contains(s)).collect();
    let stood: Vec<(usize, Pose)> = good.iter().map(|&s| (s, tree.poses_at(s)[joint.child])).collect();
    // As they lie with all joints at 0.
    let points: Vec<Vec3> = stood
        .iter()
        .flat_map(|(s, pose)| {
            let back = Motion::from(pose.inverse());
            let points = some_points(evidence, labels, *s, joint.child, POINTS / good.len());
            points.into_iter().map(move |x| back.apply(x))
        })
        .collect();
    let place = tree.poses_at(state)[joint.parent];
    let gone = moved_away(evidence, tree, at, &good, witnesses);
    let score = |q: f64| {
        let motion = place * joint.screw.motion(q);
        let there = Motion::from(motion);
        let seen = mean(points.iter().map(|x| net(&witnesses[state], there.apply(*x), slack)));
        // The other way round: a lid that is put into its base is seen wherever the base is.
        let from_here = motion.inverse();
        let explained = stood.iter().map(|(s, pose)| {
            let over = Motion::from(*pose * from_here);
            mean(gone.iter().map(|x| net(&witnesses[*s], over.apply(*x), slack)))
        });
        seen + mean(explained)
    };
    let values = good.iter().map(|s| joint.values[*s]);
    let (lo, hi) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)));
    let turns = joint.screw.kind.turns();
    let reach = points.iter().map(|x| if turns { joint.screw.distance(x.as_dvec3()) } else { 1.0 });
    let step = slack as f64 / reach.fold(1e-9, f64::max);
    let beyond = if turns { (BEYOND * (hi - lo)).min(TURN) } else { BEYOND * (hi - lo) };
    let n = (((hi - lo + 2.0 * beyond) / step) as usize).clamp(1, SWEEP);
    let coarse = (hi - lo + 2.0 * beyond) / n as f64;
    let best = |asked: Vec<f64>| {
        let scored: Vec<(f64, f64)> = asked.into_par_iter().map(|q| (score(q), q)).collect();
        // Of equals the first.
        scored.into_iter().reduce(|a, b| if b.0 > a.0 { b } else { a })
    };
    let (_, near) = best((0..=n).map(|k| lo - beyond + k as f64 * coarse).collect())?;
    let (score_there, value) = best((-FINE..=FINE).map(|k| near + k as f64 * coarse / FINE as f64).collect())?;
    (score_there > score(joint.values[state]) + CLEARER).then_some(value)
}

/// Surface of state `at.1` that other states look through where the part that carries joint `at.0` would have
/// it: it has moved.
fn moved_away(
    evidence: &Evidence,
    tree: &KinematicTree,
    (j, state): (usize, usize),
    good: &[usize],
    witnesses: &[Vec<Witness>],
) -> Vec<Vec3> {
    let (parent, slack) = (tree.joints[j].parent, slack(evidence));
    let from_here = tree.poses_at(state)[parent].inverse();
    let still: Vec<Motion> = good.iter().map(|&s| Motion::from(tree.poses_at(s)[parent] * from_here)).collect();
    let all = &evidence.clouds[state].points;
    let some: Vec<Vec3> = all.iter().step_by(all.len().div_ceil(ASKED).max(1)).copied().collect();
    let has_moved =
        |x: &Vec3| mean(good.iter().zip(&still).map(|(&s, m)| net(&witnesses[s], m.apply(*x), slack))) < 0.0;
    some.into_par_iter().filter(has_moved).collect()
}

/// What a state's views say about a place: 1 all see surface there, -1 all look through, 0 none can tell.
fn net(witnesses: &[Witness], x: Vec3, slack: f32) -> f64 {
    match counted(witnesses, x, slack) {
        (0, 0) => 0.0,
        (through, on) => (on as f64 - through as f64) / (on + through) as f64,
    }
}

/// Drops parts that only the wrong value had made; what is known of the joints stays with them.
fn prune(estimate: &mut Estimate) {
    let (before, hidden) = (estimate.tree.joints.clone(), std::mem::take(&mut estimate.hidden));
    prune_parts(estimate);
    let of = |j: &Joint| before.iter().position(|b| b.screw == j.screw && b.values == j.values);
    let kept = estimate.tree.joints.iter().map(|j| of(j).and_then(|k| hidden.get(k).cloned()).unwrap_or_default());
    estimate.hidden = kept.collect();
}
