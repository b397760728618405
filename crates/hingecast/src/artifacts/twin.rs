//! `twin/twin.json` and its meshes, as other verbs need them.

use super::check::{self, Verdict, checked, read_checked};
use crate::failure::Result;
use glam::DVec3;
use hingecast_geom::{Certainty, KinematicTree, Pose, TriMesh};
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// The parts of `twin.json` that other verbs need.
#[derive(Clone, Debug, Deserialize)]
pub struct TwinFile {
    /// Of the recording.
    pub name: String,
    /// Of the object's box in the first state, scene units.
    pub diagonal: f64,
    /// Unit vector, canonical world; older twins do not say.
    #[serde(default = "z")]
    pub up: DVec3,
    /// Parts and joints, with values of all states.
    pub tree: KinematicTree,
    /// Gravest first.
    pub doubts: Vec<String>,
    /// Of each joint, in the tree's order; older runs do not say.
    #[serde(default)]
    pub certainty: Vec<Option<Certainty>>,
    /// In the tree's order.
    pub parts: Vec<PartFile>,
}

/// One part's files and figures.
#[derive(Clone, Debug, Deserialize)]
pub struct PartFile {
    /// As in the tree.
    pub name: String,
    /// Origin of its link's frame, canonical world, scene units.
    pub link_origin: [f64; 3],
    /// Centre of mass, canonical world, scene units; older twins do not say.
    #[serde(default)]
    pub com: [f64; 3],
    /// OBJ below the twin's folder; a PLY lies beside it.
    pub visual: String,
    /// Convex pieces below the twin's folder.
    pub collision: Vec<String>,
    /// kg, or density times cubed scene units.
    pub mass: f64,
    /// Cubed scene units.
    pub volume: f64,
    /// Edges of the visual mesh with one face; 0 = closed.
    pub open_edges: usize,
    /// Of the visual mesh.
    pub faces: usize,
}

fn z() -> DVec3 {
    DVec3::Z
}

impl TwinFile {
    /// Of a finished run.
    ///
    /// # Errors
    /// When the file is missing or not ours.
    pub fn read(run: &Path) -> Result<Self> {
        Self::read_in(&run.join("twin"))
    }

    /// Of the folder that a twin is in.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn read_in(folder: &Path) -> Result<Self> {
        read_checked(&folder.join("twin.json"), |twin: &Self| {
            check::tree(&twin.tree)?;
            check::as_many("parts", twin.parts.len(), "parts of its tree", twin.tree.parts.len())?;
            check::finite("the diagonal", &[twin.diagonal])?;
            check::finite("which way is up", &twin.up.to_array())?;
            twin.parts.iter().try_for_each(|p| {
                check::finite("a link's origin", &p.link_origin)?;
                check::finite("a centre of mass", &p.com)
            })
        })
    }

    /// Whether it belongs to a recording of so many states, and to the tree that it was built by.
    ///
    /// # Errors
    /// It does not: files of different builds, or a recording that changed.
    pub fn fits(&self, run: &Path, n_states: usize, built_by: &KinematicTree) -> Result<()> {
        let verdict = || -> Verdict {
            check::states(&self.tree, n_states)?;
            check::as_many("parts", self.tree.parts.len(), "parts of joints.json", built_by.parts.len())
        };
        checked(&Self::file(run), verdict())
    }

    fn file(run: &Path) -> PathBuf {
        run.join("twin").join("twin.json")
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
