//! A value that single views contradict, sought again among all values that the joint may have.
//!
//! A thin lid half open looks, cell by cell, much like one that leans the other way, and every fit stays
//! where it is near to. Views tell: surface that other states saw of the part, put where it would be at a
//! value, is seen there by cameras of the state or looked through.

use crate::model::estimate::Estimate;
use crate::observe::evidence::Evidence;
use crate::observe::sample::Motion;
use crate::observe::witness::{Witness, counted};
use crate::passes::pass::{Round, relabel};
use crate::passes::refine_joints::refine_all;
use crate::shown::{Shown, slack, some_points};
use glam::Vec3;
use hingecast_geom::KinematicTree;
use rayon::prelude::*;

/// Points of a part's surface that are asked about, over all states.
const POINTS: usize = 900;
/// How far beyond the values of the other states is looked, share of their range.
const BEYOND: f64 = 0.3;
/// Most that a hinge is turned beyond them, radians: half a turn covers all.
const TURN: f64 = std::f64::consts::PI;
/// Steps of a sweep at most, and of the second, finer one on either side.
const SWEEP: usize = 240;
const FINE: i32 = 8;
/// Another value must be seen by so much more of the views, share.
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
        refine_all(&round, estimate, GATE_VOXELS);
        relabel(&round, estimate);
    }
    changed
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
    // As they lie with the joint at 0, in its parent's frame.
    let points: Vec<Vec3> = good
        .iter()
        .flat_map(|&s| {
            let parent = Motion::from(joint.screw.motion(0.0) * tree.poses_at(s)[joint.child].inverse());
            let points = some_points(evidence, labels, s, joint.child, POINTS / good.len());
            points.into_iter().map(move |x| parent.apply(x)).collect::<Vec<_>>()
        })
        .collect();
    let place = tree.poses_at(state)[joint.parent];
    let score = |q: f64| {
        let motion = Motion::from(place * joint.screw.motion(q));
        let said = points.iter().map(|x| match counted(&witnesses[state], motion.apply(*x), slack) {
            (0, 0) => 0.0,
            (through, on) => (on as f64 - through as f64) / (on + through) as f64,
        });
        said.sum::<f64>() / points.len().max(1) as f64
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
