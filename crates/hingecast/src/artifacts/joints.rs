//! `joints/joints.json`: the tree that the twin is built by, with a person's corrections.

use super::write_and_settle;
use crate::failure::Result;
use crate::stage::read_json;
use hingecast_articulate::Doubt;
use hingecast_geom::{Certainty, KinematicTree};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// `joints/joints.json`
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Joints {
    /// Parts and joints.
    pub tree: KinematicTree,
    /// Part of every gaussian.
    pub labels: Vec<u8>,
    /// Gravest first.
    pub doubts: Vec<Doubt>,
    /// Of each joint, in the tree's order; `None` where the method does not know, or a person has decided.
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
        read_json(&run.join("joints").join("joints.json"))
    }
}
