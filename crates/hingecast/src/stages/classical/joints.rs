//! Stage `joints` of the classical way.

use super::OPAQUE;
use super::surface::of_state;
use crate::artifacts::{Groups, Joints, Splats};
use crate::failure::Result;
use crate::stages::inputs::Inputs;
use glam::{DVec3, Vec3};
use hingecast_articulate::Doubt;
use hingecast_articulate::classical::{joints, segment};
use hingecast_geom::icp::{self, Surface};
use hingecast_geom::{PointTree, Progress};

/// Aligns every group to every state's depth, and fits axes to the motions.
pub fn run(inputs: &Inputs, splats: &Splats, groups: &Groups, progress: &Progress) -> Result<Joints> {
    let (gaussians, diagonal) = (&splats.gaussians, splats.extent.diagonal);
    let mut parts = groups.clone();

    // The first state's surface, each point with the part of the gaussian that lies on it.
    let first = of_state(inputs, 0, 60_000)?;
    let members = split(&first, &gaussians.means, &parts.labels, parts.motions.len(), 0.02 * diagonal);
    for state in 1..inputs.recording.n_states {
        progress.report(state - 1, inputs.recording.n_states - 1, "icp")?;
        let target = of_state(inputs, state, 60_000)?;
        for (part, (points, normals)) in members.iter().enumerate() {
            let gates: Vec<f64> =
                [0.03, 0.03, 0.02, 0.02, 0.01, 0.01, 0.01, 0.005, 0.005, 0.005].map(|g| g * diagonal).to_vec();
            let start = parts.motions[part][state];
            let (pose, report) = icp::align(points, normals, &target, start, &gates);
            // ICP may lose its way where little of the part is in sight: then the tracks have the
            // last word.
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
    let (tree, mut doubts) = joints::run(&segmentation, &points, diagonal, &inputs.config.joints, inputs.config.seed);
    let best = segmentation.silhouettes.iter().max_by(|a, b| a.1.total_cmp(&b.1));
    if let Some((k, best)) = best.filter(|b| b.1 < 0.5) {
        doubts.push(format!("the grouping into {k} parts is weak (silhouette {best:.2} of 1)"));
    }
    let certainty = vec![None; tree.joints.len()];
    let doubts = doubts.into_iter().map(|sentence| Doubt::Other { sentence }).collect();
    Ok(Joints { tree, labels: segmentation.labels, doubts, certainty })
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
