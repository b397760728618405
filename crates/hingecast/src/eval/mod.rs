//! `hingecast eval`: a run against the truth, by the definitions of docs/metrics.md.
//! The only code outside the tests that opens a truth folder.

mod film;
pub mod joints;
pub mod matching;
pub mod parts;
pub mod pictures;
pub mod surfaces;

use crate::artifacts::{Joints, TwinFile};
use crate::failure::{Failure, Result};
use crate::stage::{RunFolder, write_json};
use hingecast_capture::{Recording, Truth, ViewCache};
use hingecast_geom::{KinematicTree, Progress, TriMesh};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// `eval.json`. Lengths in scene units, angles in degrees, Chamfer in 1e-3 square scene units.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Evaluation {
    /// Name of the object.
    pub object: String,
    /// Of the true object, scene units.
    pub diagonal: f64,
    /// The base counts.
    pub true_parts: usize,
    /// The base counts.
    pub found_parts: usize,
    /// Share of true joints whose matched joint has the right type.
    pub joint_type_accuracy: f64,
    /// Share of true parts whose parent is right.
    pub tree_accuracy: f64,
    /// One of each true joint.
    pub joints: Vec<joints::JointErrors>,
    /// One of each true part.
    pub surfaces: Vec<surfaces::SurfaceErrors>,
    /// Held-out pictures of the first state.
    pub first_state: pictures::PictureErrors,
    /// Held-out pictures of all others.
    pub other_states: pictures::PictureErrors,
    /// Sum over the stages.
    pub build_secs: f64,
    /// Peak of the process that built, GB.
    pub peak_memory_gb: f64,
    /// Of the twin, gravest first.
    pub doubts: Vec<String>,
}

impl Evaluation {
    /// Whether as many parts were found as there are.
    pub fn parts_right(&self) -> bool {
        self.true_parts == self.found_parts
    }

    fn over<T>(&self, pick: impl Fn(&joints::JointErrors) -> Option<T>) -> Vec<T> {
        self.joints.iter().filter_map(pick).collect()
    }

    /// The largest angle between a true and a found axis, degrees.
    pub fn axis_max(&self) -> f64 {
        self.over(|j| Some(j.axis_deg)).into_iter().fold(0.0, f64::max)
    }

    /// Largest pivot error of the hinges, share of the diagonal; `None` without hinges.
    pub fn pivot_max(&self) -> Option<f64> {
        self.over(|j| j.pivot).into_iter().map(|p| p / self.diagonal).reduce(f64::max)
    }
}

/// Evaluates `run` and writes `eval.json` into it.
///
/// # Errors
/// When the run is unfinished, or run and truth are not of the same recording.
pub fn evaluate(run: &Path, truth: &Path, progress: &Progress) -> Result<Evaluation> {
    let folder = RunFolder::open_finished(run)?;
    let mut truth = Truth::open(truth)?;
    let twin = TwinFile::read(run)?;
    let recording = recording_of(&folder, &mut truth)?;
    twin.fits(run, recording.n_states, &Joints::read(run)?.tree)?;
    let cache = ViewCache::new(&recording, 512 << 20);

    // Everything in the reference state, world frame: state 0.
    let true_meshes = reference_meshes(&truth)?;
    let found_meshes = twin.meshes(&folder.folder("twin"))?;
    progress.report(1, 10, "")?;

    let seen = surfaces::Seen::new(&recording, &cache)?;
    progress.report(3, 10, "")?;
    let matching = matching::match_parts(&found_meshes, &true_meshes, &twin.tree, &truth.tree);
    let joints = joints::errors(&twin.tree, &truth.tree, &matching, &true_meshes, truth.diagonal);
    let surfaces =
        surfaces::errors(&found_meshes, &true_meshes, &matching, &twin.tree, &truth.tree, truth.diagonal, &seen);
    progress.report(6, 10, "")?;
    let (first_state, other_states) = pictures::errors(&folder, &twin.tree, &recording, &truth, &matching, progress)?;

    let n_joints = truth.tree.joints.len().max(1) as f64;
    let right_types = joints.iter().filter(|j| j.type_right).count() as f64;
    let evaluation = Evaluation {
        object: truth.object.clone(),
        diagonal: truth.diagonal,
        true_parts: truth.tree.parts.len(),
        found_parts: twin.tree.parts.len(),
        joint_type_accuracy: right_types / n_joints,
        tree_accuracy: tree_accuracy(&twin.tree, &truth.tree, &matching),
        joints,
        surfaces,
        first_state,
        other_states,
        build_secs: folder.record.total_secs(),
        peak_memory_gb: folder.record.peak_memory() as f64 / 1e9,
        doubts: twin.doubts.clone(),
    };
    write_json(&run.join("eval.json"), &evaluation)?;
    Ok(evaluation)
}

/// The run's recording, if the truth is of it. The truth of a film gets the recording's states.
fn recording_of(folder: &RunFolder, truth: &mut Truth) -> Result<Recording> {
    let recording = crate::prepare::recording_of(folder)?;
    if recording.film && !truth.film_times.is_empty() {
        film::by_time(truth, &recording)?;
        return Ok(recording);
    }
    if recording.n_states != truth.n_states {
        return Err(Failure::new(
            format!("the recording has {} states, the truth {}", recording.n_states, truth.n_states),
            truth.root.display().to_string(),
            "give the truth of this run's recording: <RECORDING>.truth",
        ));
    }
    if recording.name != truth.object {
        return Err(Failure::new(
            format!("the recording shows '{}', the truth is of '{}'", recording.name, truth.object),
            truth.root.display().to_string(),
            "give the truth of this run's recording: <RECORDING>.truth",
        ));
    }
    Ok(recording)
}

/// The true parts in the reference state, world frame.
fn reference_meshes(truth: &Truth) -> Result<Vec<TriMesh>> {
    let poses = truth.tree.poses_at(0);
    Ok(truth.part_meshes()?.iter().zip(&poses).map(|(mesh, pose)| mesh.transformed(pose)).collect())
}

/// Share of true parts whose matched part hangs on the match of the true parent (roots on nothing).
fn tree_accuracy(found: &KinematicTree, truth: &KinematicTree, matching: &[Option<usize>]) -> f64 {
    let right = (0..truth.parts.len()).filter(|&t| {
        let Some(f) = matching[t] else { return false };
        match (truth.joint_of(t), found.joint_of(f)) {
            (None, None) => true,
            (Some(a), Some(b)) => matching[a.parent] == Some(b.parent),
            _ => false,
        }
    });
    right.count() as f64 / truth.parts.len().max(1) as f64
}
