//! One screw against a scan and the pictures of a film after it: a smooth path of values.
//!
//! A picture shows little of a part, and a lid seen edge-on nothing. So both ways are asked: whether the
//! part's samples, put where they would be in a picture, are seen there; and whether what moved in the
//! picture, put where it would be in the scan, could be there.

use super::path::smooth_path;
use super::question::{Question, Sweep, Worth, agreement_above, grid_agreement};
use crate::observe::occupancy::Answer;
use crate::observe::sample::{Motion, Sample};
use hingecast_geom::{Pose, Screw};

/// Scores so far below the best of a picture need not be exact.
const PRUNED: f32 = 0.5;
/// What a usual step from one picture to the next costs, share of the samples, and how far such a step
/// moves a part, share of the object's longest side.
const STEP: f64 = 0.01;
const USUAL: f64 = 0.05;
/// Samples of a picture that are carried back, and how many of them count whole.
const BACK: usize = 200;
const WHOLE: f32 = 50.0;

/// As [`sweep_values`](super::sweep_values::sweep_values), over the values of `grid`. `reach`: how far a unit of the
/// screw's value moves a sample, scene units.
pub(super) fn sweep_film(
    question: &Question,
    samples: &[Sample],
    parent_poses: &[Pose],
    screw: &Screw,
    grid: &[f64],
    reach: f64,
) -> Sweep {
    let motions: Vec<Pose> = grid.iter().map(|q| screw.motion(*q)).collect();
    let forth = |t: usize| -> Vec<f32> {
        let mut best = f32::NEG_INFINITY;
        let each = |motion: &Pose| {
            let m = Motion::from(parent_poses[t] * *motion);
            let score = agreement_above(question, t, samples, &m, best - PRUNED);
            best = best.max(score);
            score
        };
        motions.iter().map(each).collect()
    };
    let of_scan = forth(0);
    // A screw's value is 0 in the state that it was found in; of equals the nearest to that.
    let nearest = (0..grid.len()).fold(0, |a, b| if grid[b].abs() < grid[a].abs() { b } else { a });
    let closer = |a: usize, b: usize| of_scan[b] == of_scan[a] && b.abs_diff(nearest) < a.abs_diff(nearest);
    let scan = (0..grid.len()).fold(0, |a, b| if of_scan[b] > of_scan[a] || closer(a, b) { b } else { a });
    let anything = Question { worth: Worth::ANY, ..*question };
    let both = |t: usize| {
        let mut scores = forth(t);
        let own = moved_in(question, parent_poses, t);
        let highest = scores.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        let weight = (own.len() as f32 / WHOLE).min(1.0);
        for (score, motion) in
            scores.iter_mut().zip(&motions).filter(|(s, _)| !own.is_empty() && **s > highest - PRUNED)
        {
            let m = parent_poses[0] * motions[scan] * (parent_poses[t] * *motion).inverse();
            *score += weight * grid_agreement(&anything, 0, &own, &m.into());
        }
        scores
    };
    let of_film: Vec<Vec<f32>> = (1..parent_poses.len()).map(both).collect();
    let apart = (grid[grid.len() - 1] - grid[0]) / (grid.len() - 1).max(1) as f64 * reach;
    let cost = STEP * (apart / (USUAL * f64::from(question.evidence.extent()))).powi(2);
    let path = smooth_path(&of_film, cost);
    let scores = std::iter::once(of_scan[scan]).chain(path.iter().zip(&of_film).map(|(k, own)| own[*k])).collect();
    Sweep { values: std::iter::once(scan).chain(path).map(|k| grid[k]).collect(), scores }
}

/// Samples of picture `t` that the scan saw empty where they would be had they moved with the parent, and
/// that no known part claims.
fn moved_in(question: &Question, parent_poses: &[Pose], t: usize) -> Vec<Sample> {
    let (evidence, claims) = (question.evidence, question.claims);
    let still = Motion::from(parent_poses[0] * parent_poses[t].inverse());
    let (first, last) =
        (evidence.samples.partition_point(|s| s.state < t), evidence.samples.partition_point(|s| s.state <= t));
    let moved = |s: &&Sample| {
        let there = evidence.spaces[0].ask(still.apply(s.point), still.rot * s.normal);
        there == Answer::Free && claims.at_place(evidence, t, s.point) == 0
    };
    let all: Vec<Sample> = evidence.samples[first..last].iter().filter(moved).copied().collect();
    all.iter().step_by(all.len().div_ceil(BACK).max(1)).copied().collect()
}
