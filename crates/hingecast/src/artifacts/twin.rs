//! `twin/twin.json` and its meshes, as other verbs need them.

use crate::failure::Result;
use crate::stage::read_json;
use glam::DVec3;
use hingecast_geom::{Certainty, KinematicTree, Pose, TriMesh};
use serde::Deserialize;
use std::path::Path;

/// The parts of `twin.json` that other verbs need.
#[derive(Clone, Debug, Deserialize)]
pub struct TwinFile {
    pub name: String,
    pub diagonal: f64,
    pub tree: KinematicTree,
    pub doubts: Vec<String>,
    /// Of each joint, in the tree's order; older runs do not say.
    #[serde(default)]
    pub certainty: Vec<Option<Certainty>>,
    pub parts: Vec<PartFile>,
}

#[derive(Clone, Debug, Deserialize)]
pub struct PartFile {
    pub name: String,
    pub link_origin: [f64; 3],
    pub visual: String,
    pub collision: Vec<String>,
    pub mass: f64,
    pub volume: f64,
    pub open_edges: usize,
    pub faces: usize,
}

impl TwinFile {
    /// Of a finished run.
    ///
    /// # Errors
    /// When the file is missing or not ours.
    pub fn read(run: &Path) -> Result<Self> {
        read_json(&run.join("twin").join("twin.json"))
    }

    /// Visual meshes in the canonical world frame.
    pub fn meshes(&self, folder: &Path) -> Result<Vec<TriMesh>> {
        self.parts
            .iter()
            .map(|p| {
                let mesh = TriMesh::read_ply(&folder.join(&p.visual).with_extension("ply"))?;
                Ok(mesh.transformed(&Pose::from_trans(DVec3::from(p.link_origin))))
            })
            .collect()
    }
}
