//! Stages `parts` and `joints` of the classical way.

use super::{Context, motion, splat, surface};
use crate::failure::Result;
use crate::stage::{read_json, write_json};
use glam::{DVec3, Vec3};
use hingecast_articulate::classical::{joints, segment};
use hingecast_geom::icp::{self, Surface};
use hingecast_geom::{Certainty, KinematicTree, PointTree, Pose};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// `parts/parts.json`
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PartsFile {
    /// Part of each gaussian.
    pub labels: Vec<u8>,
    /// World at state s from world at state 0. [part][state]
    pub motions: Vec<Vec<Pose>>,
    /// Part count tried, mean silhouette.
    pub silhouettes: Vec<(usize, f64)>,
}

/// `joints/joints.json`
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct JointsFile {
    pub tree: KinematicTree,
    pub labels: Vec<u8>,
    pub doubts: Vec<String>,
    /// Of each joint, in the tree's order; `None` where the method does not know, or a person has decided.
    pub certainty: Vec<Option<Certainty>>,
}

pub fn load(run: &Path) -> Result<JointsFile> {
    read_json(&run.join("joints").join("joints.json"))
}

/// Gaussians below this opacity say little about where the surface is.
const OPAQUE: f32 = 0.3;

pub fn run_parts(context: &Context, run: &Path, at: &Path) -> Result<()> {
    let (gaussians, extent) = splat::load(run)?;
    let tracks = motion::load(&run.join("motion"))?;
    let reliable: Vec<bool> = (0..gaussians.len()).map(|i| gaussians.opacity(i) > OPAQUE).collect();
    let progress = context.ui.stage("parts");
    let config = &context.config.parts;
    let found = segment::run(&tracks, &reliable, extent.diagonal, config, context.config.seed, &progress)?;
    let file = PartsFile { labels: found.labels, motions: found.motions, silhouettes: found.silhouettes };
    write_json(&at.join("parts.json"), &file)
}

pub fn run_joints(context: &Context, run: &Path, at: &Path) -> Result<()> {
    let (gaussians, extent) = splat::load(run)?;
    let mut parts: PartsFile = read_json(&run.join("parts").join("parts.json"))?;
    let progress = context.ui.stage("joints");
    let diagonal = extent.diagonal;

    // The first state's surface, each point with the part of the gaussian that lies on it.
    let first = surface::of_state(context, 0, 60_000)?;
    let members = split(&first, &gaussians.means, &parts.labels, parts.motions.len(), 0.02 * diagonal);
    for state in 1..context.recording.n_states {
        progress.report(state - 1, context.recording.n_states - 1, "icp")?;
        let target = surface::of_state(context, state, 60_000)?;
        for (part, (points, normals)) in members.iter().enumerate() {
            let gates: Vec<f64> =
                [0.03, 0.03, 0.02, 0.02, 0.01, 0.01, 0.01, 0.005, 0.005, 0.005].map(|g| g * diagonal).to_vec();
            let start = parts.motions[part][state];
            let (pose, report) = icp::align(points, normals, &target, start, &gates);
            // ICP may lose its way where little of the part is in sight: then the tracks have the last word.
            let strayed = (pose.inverse() * start).angle() > 0.2 || report.inliers < 0.15;
            if !strayed {
                parts.motions[part][state] = pose;
            }
        }
    }
    let points: Vec<Vec<DVec3>> = (0..parts.motions.len())
        .map(|p| {
            let own = (0..gaussians.len()).filter(|&i| parts.labels[i] as usize == p && gaussians.opacity(i) > OPAQUE);
            own.map(|i| Vec3::from(gaussians.means[i]).as_dvec3()).collect()
        })
        .collect();
    let segmentation =
        segment::Segmentation { labels: parts.labels.clone(), motions: parts.motions, silhouettes: parts.silhouettes };
    let (tree, mut doubts) = joints::run(&segmentation, &points, diagonal, &context.config.joints, context.config.seed);
    let best = segmentation.silhouettes.iter().max_by(|a, b| a.1.total_cmp(&b.1));
    if let Some((k, best)) = best.filter(|b| b.1 < 0.5) {
        doubts.push(format!("the grouping into {k} parts is weak (silhouette {best:.2} of 1)"));
    }
    let certainty = vec![None; tree.joints.len()];
    write_json(&at.join("joints.json"), &JointsFile { tree, labels: segmentation.labels, doubts, certainty })
}

/// Points and normals of `surface` per part: the part of the nearest gaussian within `reach`.
fn split(
    surface: &Surface,
    means: &[[f32; 3]],
    labels: &[u8],
    n_parts: usize,
    reach: f64,
) -> Vec<(Vec<Vec3>, Vec<Vec3>)> {
    let centres: Vec<Vec3> = means.iter().map(|m| Vec3::from(*m)).collect();
    let tree = PointTree::new(&centres);
    let mut out = vec![(Vec::new(), Vec::new()); n_parts];
    for (x, n) in surface.points.iter().zip(&surface.normals) {
        if let Some((i, squared)) = tree.nearest(*x)
            && (squared as f64) < reach * reach
        {
            out[labels[i] as usize].0.push(*x);
            out[labels[i] as usize].1.push(*n);
        }
    }
    out
}
