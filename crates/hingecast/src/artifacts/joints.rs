//! `joints/joints.json`: the tree that the twin is built by, with a person's corrections.

use super::check::{self, Verdict, checked, read_checked};
use super::write_and_settle;
use crate::failure::Result;
use hingecast_articulate::Doubt;
use hingecast_geom::{Certainty, KinematicTree};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// `joints/joints.json`
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Joints {
    /// Parts and joints.
    pub tree: KinematicTree,
    /// Part of every gaussian.
    pub labels: Vec<u8>,
    /// Gravest first.
    pub doubts: Vec<Doubt>,
    /// Of each joint, in the tree's order; `None` where the method does not know, or a person has
    /// decided.
    pub certainty: Vec<Option<Certainty>>,
}

impl Joints {
    /// Writes the file; answers the joints as a reader would have them.
    pub fn write(&self, folder: &Path) -> Result<Self> {
        write_and_settle(&folder.join("joints.json"), self)
    }

    /// Of a finished stage.
    ///
    /// # Errors
    /// When the file is missing or not ours.
    pub fn read(run: &Path) -> Result<Self> {
        read_checked(&Self::file(run), |joints: &Self| {
            check::tree(&joints.tree)?;
            check::labels(&joints.labels, joints.tree.parts.len())
        })
    }

    /// Whether they belong to a recording of so many states and to so many gaussians.
    ///
    /// # Errors
    /// They do not: files of different builds, or a recording that changed.
    pub fn fit(&self, run: &Path, n_states: usize, n_gaussians: usize) -> Result<()> {
        let verdict = || -> Verdict {
            check::states(&self.tree, n_states)?;
            check::as_many("labels", self.labels.len(), "gaussians", n_gaussians)
        };
        checked(&Self::file(run), verdict())
    }

    fn file(run: &Path) -> PathBuf {
        run.join("joints").join("joints.json")
    }
}
