//! Hypotheses of a pair of states aligned to the surface.

use super::climb::climb;
use super::distinct::{Hypothesis, distinct};
use super::pairs::LEAST_SAMPLES;
use super::state_pair::StatePair;
use crate::config::MANY_STATES;
use crate::fit::question::{Question, Worth, grid_agreement};
use crate::model::mean::mean_point;
use crate::model::nearest_screw::nearest_screw;
use crate::model::owners::subset;
use crate::observe::evidence::Evidence;
use crate::observe::sample::{Motion, Sample};
use crate::score::claims::TAKEN;
use crate::score::prior::prior;
use glam::Vec3;
use hingecast_geom::icp;
use hingecast_geom::{JointKind, Pose};
use rayon::prelude::*;

/// Samples that align and judge a hypothesis.
const JUDGING: usize = 400;
/// Samples of each state that judge a step of the climb.
const CLIMBING: usize = 150;

/// The frames that a pair of states is compared in.
pub struct Frames<'a> {
    /// Index of the parent part.
    pub parent: usize,
    /// World from the parent's canonical frame, per state, and its inverse.
    pub parent_poses: &'a [Pose],
    /// The inverse of these poses.
    pub back: &'a [Pose],
}

/// Aligns hypotheses by ICP and answers, of the best that differ, hinge and slide with the samples
/// that fit.
pub fn align(
    evidence: &Evidence,
    pair: &StatePair,
    hypotheses: &[(Hypothesis, bool)],
    source: usize,
    frames: &Frames,
    keep: usize,
    seed: u64,
) -> Vec<(Hypothesis, Vec<Sample>)> {
    let voxel = evidence.lattice.voxel as f64;
    let gates = [3.0, 2.5, 2.0, 1.5, 1.5, 1.0, 1.0, 1.0].map(|g| g * voxel);
    let (a, b, parent_poses) = (pair.target, source, frames.parent_poses);
    let some = |samples: &[Sample]| subset(samples.iter().copied(), JUDGING, seed);
    let (forth, reverse) = (some(&pair.source), some(&pair.reverse));
    let question = Question { evidence, claims: pair.claims, worth: Worth::SOUGHT };
    // Met within the noise, where nothing known is.
    let met = |samples: &[Sample], m: Motion, t: usize| {
        let meets = |s: &&Sample| {
            let x = m.apply(s.point);
            pair.claims.at_place(evidence, t, x) & TAKEN == 0 && evidence.meets(t, x, m.rot * s.normal)
        };
        samples.iter().filter(meets).count()
    };
    let mut all: Vec<(Hypothesis, Pose)> = hypotheses
        .par_iter()
        .filter_map(|(h, climbs)| {
            let start = h.screw.motion(h.q);
            let near = some(&pair.fitting(&start.into(), 1));
            if near.len() < LEAST_SAMPLES {
                return None;
            }
            let uphill = |pose: Pose| {
                let (forth, back) = (&forth[..forth.len().min(CLIMBING)], &reverse[..reverse.len().min(CLIMBING)]);
                grid_agreement(&question, a, forth, &pose.into())
                    + grid_agreement(&question, b, back, &(parent_poses[b] * pose.inverse()).into())
            };
            let start = parent_poses[a] * start;
            let start = if *climbs { climb(start, &near, voxel, &uphill) } else { start };
            let (pose, _) = icp::align(&points(&near), &normals(&near), &evidence.clouds[a], start, &gates);
            let score = met(&forth, pose.into(), a) * pair.source.len() / forth.len().max(1)
                + met(&reverse, (parent_poses[b] * pose.inverse()).into(), b) * pair.reverse.len()
                    / reverse.len().max(1);
            Some((Hypothesis { score, ..*h }, frames.back[a] * pose))
        })
        .collect();
    all.sort_by_key(|h| std::cmp::Reverse(h.0.score));
    // Each pose as a hinge and as a slide, where that is what it is.
    let mut screws: Vec<(f64, Hypothesis, Vec<Sample>)> = Vec::new();
    for (h, pose) in all {
        let samples = pair.fitting(&pose.into(), 0);
        if samples.len() < LEAST_SAMPLES {
            continue;
        }
        for kind in [JointKind::Revolute, JointKind::Prismatic] {
            let Some((screw, q)) = nearest_screw(&pose, kind, mean_point(samples.iter().map(|s| s.point))) else {
                continue;
            };
            let (exact, near) = (Motion::from(pose), Motion::from(screw.motion(q)));
            let off = |s: &Sample| exact.apply(s.point).distance(near.apply(s.point)) > 3.0 * evidence.lattice.voxel;
            if 2 * samples.iter().filter(|s| off(s)).count() > samples.len() {
                continue;
            }
            let merit = h.score as f64 * prior(&screw, &[0.0, q], frames.parent, &samples, evidence.extent());
            screws.push((merit, Hypothesis { screw, q, score: h.score }, samples.clone()));
        }
    }
    screws.sort_by(|a, b| b.0.total_cmp(&a.0));
    let extent = points(&forth);
    let mut kept: Vec<Hypothesis> = Vec::new();
    let mut out = Vec::new();
    // First what differs much, then, with few states, what differs little.
    let tiers = if evidence.n_states() < MANY_STATES { &[(1, 4.0), (2, 2.0)][..] } else { &[(1, 4.0)][..] };
    for (share, apart) in tiers {
        let mut rest = Vec::new();
        for screw in screws {
            let with: Vec<Hypothesis> = kept.iter().copied().chain([screw.1]).collect();
            let new = distinct(with, &extent, apart * voxel as f32, usize::MAX).len() > kept.len();
            if new && out.len() < share * keep {
                kept.push(screw.1);
                out.push((screw.1, screw.2));
            } else {
                rest.push(screw);
            }
        }
        screws = rest;
    }
    out
}

fn points(samples: &[Sample]) -> Vec<Vec3> {
    samples.iter().map(|s| s.point).collect()
}

fn normals(samples: &[Sample]) -> Vec<Vec3> {
    samples.iter().map(|s| s.normal).collect()
}
