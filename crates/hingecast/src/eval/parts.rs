//! Parts and joints alone, right after the stage that finds them: minutes instead of hours for a whole grid of protocols.

use super::joints::{JointErrors, errors};
use super::matching::match_points;
use super::tree_accuracy;
use crate::failure::Result;
use crate::pipeline::screw;
use crate::stage::RunFolder;
use glam::Vec3;
use hingecast_capture::Truth;
use hingecast_geom::TriMesh;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// One recording of one object.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PartsEvaluation {
    pub object: String,
    pub true_parts: usize,
    pub found_parts: usize,
    /// Share of true parts whose parent is right.
    pub tree_accuracy: f64,
    pub joints: Vec<JointErrors>,
    pub secs: f64,
    pub doubts: Vec<String>,
}

/// Points per part that it is matched by.
const POINTS: usize = 3000;

/// Evaluates the stage `parts` of `run` (method `screw`).
///
/// # Errors
/// When the stage is not done, or the truth is not of this recording.
pub fn evaluate_parts(run: &Path, truth: &Path) -> Result<PartsEvaluation> {
    let folder = RunFolder::open(run)?;
    let truth = Truth::open(truth)?;
    let found = screw::load(run)?;
    let poses = truth.tree.poses_at(0);
    let meshes: Vec<TriMesh> = truth.part_meshes()?.iter().zip(&poses).map(|(m, p)| m.transformed(p)).collect();
    let sample = |m: &TriMesh| m.sample_surface(POINTS, 1).into_iter().map(|s| s.0).collect::<Vec<Vec3>>();
    let true_points: Vec<Vec<Vec3>> = meshes.iter().map(sample).collect();
    let found_points = screw::canonical_points(run, &found.tree, POINTS)?;
    let matching = match_points(&found_points, &true_points, &found.tree, &truth.tree);
    Ok(PartsEvaluation {
        object: truth.object.clone(),
        true_parts: truth.tree.parts.len(),
        found_parts: found.tree.parts.len(),
        tree_accuracy: tree_accuracy(&found.tree, &truth.tree, &matching),
        joints: errors(&found.tree, &truth.tree, &matching, &meshes, truth.diagonal),
        secs: folder.record.total_secs(),
        doubts: found.doubts,
    })
}
