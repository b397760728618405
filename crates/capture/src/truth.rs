//! What `synth` knows about a recording it made. `build` never reads it: only evaluation and tests
//! do.
//!
//! `<REC>.truth/`: `truth.json`, `parts/<part>.ply` (canonical world pose), `labels/<colour
//! name>.png` (part id + 1).

use crate::{CaptureError, recording::images};
use hingecast_geom::{Camera, KinematicTree, Pose, TriMesh};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// The true object of a synthetic recording.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Truth {
    /// Folder of the truth; not stored.
    #[serde(skip)]
    pub root: PathBuf,
    /// Name of the object.
    pub object: String,
    /// World frame of the recording, canonical at q = 0; `values` per state, held-out states last;
    /// `limits` are the ranges that were played.
    pub tree: KinematicTree,
    /// Length of the canonical bounding box's diagonal, scene units.
    pub diagonal: f64,
    /// Recorded states; states n_states.. are held out and have test frames only.
    pub n_states: usize,
    /// Joint limits of the source file, one pair a joint.
    pub source_limits: Vec<[f64; 2]>,
    /// Exact cameras in the true world, one a frame of `transforms.json` in order (the recording's
    /// own may carry noise, or count in a frame of their state's own).
    pub cameras: Vec<Camera>,
    /// Where the object as a whole stands in each state, held-out states last: part i is at
    /// `world_from_object[s] * tree.poses_at(s)[i]`. Empty: it is never pushed.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub world_from_object: Vec<Pose>,
    /// The frame of reference in which the recording states the cameras of each state, from the
    /// true world. Empty: the true world in all states.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub recording_from_world: Vec<Pose>,
    /// Of a film: when each state but the first, which is the scan, was taken, seconds of the play.
    /// Empty: no film.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub film_times: Vec<f64>,
}

impl Truth {
    /// Opens a truth folder.
    ///
    /// # Errors
    /// When `truth.json` is missing or not what `synth` writes.
    pub fn open(path: &Path) -> Result<Self, CaptureError> {
        let file = path.join("truth.json");
        let text = std::fs::read_to_string(&file).map_err(|e| CaptureError::read(&file, e))?;
        let truth: Truth = serde_json::from_str(&text).map_err(|e| {
            let hint = "record the object again with this version: hingecast synth OBJECT -o RECORDING";
            CaptureError::new(format!("not a truth file: {e}"), file.display().to_string(), hint)
        })?;
        truth
            .tree
            .validate()
            .map_err(|e| CaptureError::new(e, file.display().to_string(), "record the object again"))?;
        Ok(Self { root: path.to_path_buf(), ..truth })
    }

    /// Where the truth of a recording stands: `<REC>.truth`.
    pub fn folder_of(recording: &Path) -> PathBuf {
        let mut name = recording.file_name().unwrap_or_default().to_os_string();
        name.push(".truth");
        recording.with_file_name(name)
    }

    /// Where the object as a whole stands in `state`.
    pub fn world_from_object_at(&self, state: usize) -> Pose {
        self.world_from_object.get(state).copied().unwrap_or_default()
    }

    /// From the true world to the frame in which the recording states the cameras of `state`.
    pub fn recording_from_world_at(&self, state: usize) -> Pose {
        self.recording_from_world.get(state).copied().unwrap_or_default()
    }

    /// Surfaces of the parts in canonical world pose; index = part id.
    ///
    /// # Errors
    /// When a mesh is missing or broken.
    pub fn part_meshes(&self) -> Result<Vec<TriMesh>, CaptureError> {
        let read = |name: &String| {
            let path = self.root.join("parts").join(format!("{name}.ply"));
            TriMesh::read_ply(&path).map_err(|e| CaptureError::read(&path, e))
        };
        self.tree.parts.iter().map(read).collect()
    }

    /// Per pixel part id + 1, 0 = background, of the frame whose colour image is `color`.
    ///
    /// # Errors
    /// When the label image is missing.
    pub fn labels(&self, color: &Path) -> Result<Vec<u8>, CaptureError> {
        let name = color.file_name().unwrap_or_default();
        Ok(images::read(&self.root.join("labels").join(name))?.into_luma8().into_raw())
    }

    pub(crate) fn write(&self) -> Result<(), CaptureError> {
        let file = self.root.join("truth.json");
        let text = serde_json::to_vec_pretty(self).map_err(|e| CaptureError::write(&file, e))?;
        images::write_file(&file, &text)
    }
}
