//! Do the pictures show that a part moves at all?
//!
//! What a fit gains by a motion says little: where scans see different places, or cameras drift, a motion
//! explains the difference. So every view is asked by itself. A part that has moved away is looked
//! through where it was (at rest), by nearly all cameras that see the place; it is not looked through
//! where it now is (moved); and no camera of its own state looks through it (own). A phantom is
//! contradicted as much where it is said to be as where it is said to have left.

use crate::observe::evidence::Evidence;
use crate::observe::sample::Motion;
use crate::observe::witness::{Witness, counted};
use glam::Vec3;
use hingecast_geom::{KinematicTree, Pose};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Points of a part's surface in one state that are looked for in the others.
const POINTS: usize = 300;
/// Fewer points of a state that views can judge say nothing.
const FEW: usize = 15;
/// Two states tell when the part's farthest point is so many tolerances apart in them.
const APART: f32 = 3.0;
/// A state's value is wrong when in its pairs views look through so much of where the part is said to be, and
/// so many times what they do in the others.
const CONTRADICTED: f64 = 0.08;
const CLEARLY: f64 = 4.0;
/// A part that moved is looked through where it was by more than this share; pairs of states that must say
/// that it is not. Real parts had 0.35 and more, blotches taken for parts 0.012 at most.
const LEFT: f64 = 0.02;
const MANY_PAIRS: usize = 6;
/// What is off by less may be depth's own error: voxels.
const SLACK: f32 = 0.75;

/// How views judge a joint's part: shares of the places that they can judge which they look through.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Shown {
    /// Where the part would be in other states had it not moved.
    pub at_rest: f64,
    /// Where it is said to be in other states.
    pub moved: f64,
    /// Where its own state measured it.
    pub own: f64,
    /// Pairs of states that were compared.
    pub pairs: usize,
    /// States that have enough of the part's surface to be compared with others.
    pub states: usize,
    /// States whose value views contradict though they bear the others out.
    pub contradicted: Vec<usize>,
}

impl Shown {
    /// What speaks against the motion over what speaks for it: near 0 when it is real, near 1 when as much
    /// contradicts it as contradicts rest.
    pub fn against(&self) -> f64 {
        // What one state alone shows is in no other: nothing tells where it went.
        if self.at_rest > 0.0 && self.states > 1 { (self.own + self.moved) / self.at_rest } else { f64::INFINITY }
    }

    /// Whether hardly any camera looks through where the part would be at rest, though many could: what
    /// has not left has not moved.
    pub fn never_left(&self) -> bool {
        self.states > 1 && self.pairs >= MANY_PAIRS && self.at_rest < LEFT && self.moved + self.own >= self.at_rest
    }
}

/// Of every joint of `tree`. `witnesses`: some views of every state, cameras as corrected. `labels`: the part
/// of every point of every state's cloud.
pub fn shown(evidence: &Evidence, tree: &KinematicTree, labels: &[Vec<u8>], witnesses: &[Vec<Witness>]) -> Vec<Shown> {
    let slack = slack(evidence);
    let n = witnesses.len();
    (0..tree.joints.len())
        .map(|j| {
            let of_state = |s: usize| of_state(evidence, tree, j, s, labels, witnesses, slack);
            let by_state: Vec<Vec<Pair>> = (0..n).into_par_iter().map(of_state).collect();
            let pairs: Vec<&Pair> = by_state.iter().flatten().collect();
            let states = by_state.iter().filter(|s| !s.is_empty()).count();
            let over = |of: fn(&Pair) -> f64| mean(pairs.iter().map(|p| of(p)));
            let (at_rest, moved, own) = (over(|p| p.at_rest), over(|p| p.moved), over(|p| p.own));
            let contradicted = contradicted(&pairs, n);
            Shown { at_rest, moved, own, pairs: pairs.len(), states, contradicted }
        })
        .collect()
}

/// What a place may be off by, scene units.
pub(crate) fn slack(evidence: &Evidence) -> f32 {
    (SLACK * evidence.lattice.voxel).max(evidence.tolerance)
}

/// At most about `count` points of a part's surface in one state, world frame.
pub(crate) fn some_points(
    evidence: &Evidence,
    labels: &[Vec<u8>],
    state: usize,
    part: usize,
    count: usize,
) -> Vec<Vec3> {
    let own = evidence.clouds[state].points.iter().zip(&labels[state]);
    let all: Vec<Vec3> = own.filter(|(_, l)| **l as usize == part).map(|(x, _)| *x).collect();
    all.iter().step_by(all.len().div_ceil(count.max(1)).max(1)).copied().collect()
}

/// Two states that are compared: shares that are looked through.
struct Pair {
    states: [usize; 2],
    at_rest: f64,
    moved: f64,
    own: f64,
}

/// The mean of some values; 0 of none.
pub(crate) fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values.fold((0.0, 0usize), |(sum, n), x| (sum + x, n + 1));
    sum / n.max(1) as f64
}

/// States in whose pairs views look through where the part is said to be, and in the other pairs not.
fn contradicted(pairs: &[&Pair], n: usize) -> Vec<usize> {
    let wrong = |k: &usize| {
        let (with, without): (Vec<&Pair>, Vec<&Pair>) = pairs.iter().copied().partition(|p| p.states.contains(k));
        let [own, others] = [with, without].map(|some| (some.len(), mean(some.iter().map(|p| p.moved))));
        own.0 > 0 && others.0 > 0 && own.1 > CONTRADICTED && own.1 > CLEARLY * others.1
    };
    (0..n).filter(wrong).collect()
}

/// Of every state that the part of joint `j` is elsewhere in than in state `s`.
fn of_state(
    evidence: &Evidence,
    tree: &KinematicTree,
    j: usize,
    s: usize,
    labels: &[Vec<u8>],
    witnesses: &[Vec<Witness>],
    slack: f32,
) -> Vec<Pair> {
    let joint = &tree.joints[j];
    let points = some_points(evidence, labels, s, joint.child, POINTS);
    let Some(own) = looked_through(&witnesses[s], &points, &Motion::from(Pose::IDENTITY), slack) else {
        return Vec::new();
    };
    let back = tree.poses_at(s)[joint.child].inverse();
    let mut out = Vec::new();
    for t in (0..witnesses.len()).filter(|t| *t != s) {
        let here = tree.poses_at(t);
        let moved = Motion::from(here[joint.child] * back);
        let at_rest = Motion::from(here[joint.parent] * joint.screw.motion(joint.values[s]) * back);
        let far = points.iter().map(|x| moved.apply(*x).distance(at_rest.apply(*x))).fold(0.0, f32::max);
        if far < APART * slack {
            continue;
        }
        let through = |m: &Motion| looked_through(&witnesses[t], &points, m, slack);
        if let (Some(at_rest), Some(moved)) = (through(&at_rest), through(&moved)) {
            out.push(Pair { states: [s, t], at_rest, moved, own });
        }
    }
    out
}

/// Share of what a state's views can judge that they look through; `None` where that is hardly anything.
fn looked_through(witnesses: &[Witness], points: &[Vec3], motion: &Motion, slack: f32) -> Option<f64> {
    let counts = points.iter().map(|x| counted(witnesses, motion.apply(*x), slack));
    let (mut judged, mut share) = (0usize, 0.0);
    for (through, on) in counts.filter(|(through, on)| through + on > 0) {
        judged += 1;
        share += through as f64 / (through + on) as f64;
    }
    (judged >= FEW).then(|| share / judged as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The lid of a thin laptop was 35 deg off in one state of seven, without a doubt.
    #[test]
    fn a_value_that_views_contradict_is_named() {
        let pair = |a: usize, b: usize| {
            let moved = if a == 2 || b == 2 { 0.3 } else { 0.01 };
            Pair { states: [a, b], at_rest: 0.9, moved, own: 0.0 }
        };
        let all: Vec<Pair> = (0..5).flat_map(|a| (0..5).filter(move |b| *b != a).map(move |b| pair(a, b))).collect();
        assert_eq!(contradicted(&all.iter().collect::<Vec<_>>(), 5), [2]);
        // Where all are, it is the motion that is in doubt and no value.
        let even: Vec<Pair> = all.into_iter().map(|p| Pair { moved: 0.4, ..p }).collect();
        assert_eq!(contradicted(&even.iter().collect::<Vec<_>>(), 5), [0usize; 0]);
    }

    #[test]
    fn what_no_camera_saw_leave_is_no_part() {
        let blotch = Shown { at_rest: 0.012, moved: 0.113, own: 0.011, pairs: 28, states: 5, ..Shown::default() };
        assert!(blotch.never_left());
        assert!(Shown { at_rest: 0.0, moved: 0.0, own: 0.0, ..blotch.clone() }.never_left());
        // A door, and one that few pairs of states can judge.
        assert!(!Shown { at_rest: 0.57, moved: 0.004, own: 0.002, ..blotch.clone() }.never_left());
        assert!(!Shown { pairs: 2, ..blotch.clone() }.never_left() && !Shown { states: 1, ..blotch }.never_left());
    }
}
