//! Parts and joints alone, without meshes: minutes instead of hours for a whole grid of protocols.

use super::joints::{JointErrors, errors};
use super::matching::{POINTS, match_points, surface_points};
use super::{recording_of, reference_meshes, tree_accuracy};
use crate::artifacts::{Joints, Parts, samples};
use crate::failure::Result;
use crate::stage::RunFolder;
use hingecast_capture::Truth;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// One recording of one object.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PartsEvaluation {
    /// Name of the object.
    pub object: String,
    /// The base counts.
    pub true_parts: usize,
    /// The base counts.
    pub found_parts: usize,
    /// Share of true parts whose parent is right.
    pub tree_accuracy: f64,
    /// One of each true joint.
    pub joints: Vec<JointErrors>,
    /// Of the stages that ran.
    pub secs: f64,
    /// Gravest first.
    pub doubts: Vec<String>,
}

/// Evaluates the stage `parts` of `run` (method `screw`), or `joints` if that is done too.
///
/// # Errors
/// When the stage is not done, or the truth is not of this recording.
pub fn evaluate_parts(run: &Path, truth: &Path) -> Result<PartsEvaluation> {
    let folder = RunFolder::open(run)?;
    let mut truth = Truth::open(truth)?;
    recording_of(&folder, &mut truth)?;
    let found = Parts::read(run)?;
    // Where pictures had a say, theirs is the last word.
    let tree = if folder.has("joints") { Joints::read(run)?.tree } else { found.tree };
    let meshes = reference_meshes(&truth)?;
    let true_points = surface_points(&meshes);
    let found_points = samples::canonical_points(&samples::read(run, &tree)?, &tree, POINTS);
    let matching = match_points(&found_points, &true_points, &tree, &truth.tree);
    Ok(PartsEvaluation {
        object: truth.object.clone(),
        true_parts: truth.tree.parts.len(),
        found_parts: tree.parts.len(),
        tree_accuracy: tree_accuracy(&tree, &truth.tree, &matching),
        joints: errors(&tree, &truth.tree, &matching, &meshes, truth.diagonal),
        secs: folder.record.total_secs(),
        doubts: found.doubts,
    })
}
