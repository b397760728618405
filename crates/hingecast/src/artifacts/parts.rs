//! `parts/parts.json`, `parts/trace.json`: what moves, and how, by the depth of all states.

use super::check::{self, read_checked};
use super::write_and_settle;
use crate::failure::Result;
use crate::stage::{read_json, write_json};
use glam::Vec3;
use hingecast_articulate::model::estimate::FitReport;
use hingecast_articulate::shown::Shown;
use hingecast_articulate::{Articulation, Doubt, Information, PassRecord};
use hingecast_geom::{Certainty, KinematicTree, Pose};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// `parts/parts.json`
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Parts {
    /// Parts and joints, with values of all states.
    pub tree: KinematicTree,
    /// camera_from_world as corrected, by frame of the recording.
    pub cameras: BTreeMap<usize, Pose>,
    /// What the last fit knew.
    pub report: FitReport,
    /// Of each joint, in the tree's order.
    pub certainty: Vec<Certainty>,
    /// How sharply the depth holds every part in every state; empty where pictures have nothing to
    /// add to it. `[state][part]`
    pub information: Vec<Vec<Information>>,
    /// As sentences, gravest first.
    pub doubts: Vec<String>,
    /// Lowest corner of the object's box over all states, world frame, scene units.
    pub lo: [f32; 3],
    /// Highest corner.
    pub hi: [f32; 3],
    /// Spacing of the labelled samples, scene units.
    pub voxel: f32,
    /// How views judge the motion of each joint.
    #[serde(default)]
    pub shown: Vec<Shown>,
    /// The doubts again, as data.
    #[serde(default)]
    pub doubted: Vec<Doubt>,
}

impl Parts {
    /// What was found; `frames[state][view]`: the frame of each view; `extent`: the object's box.
    pub fn new(found: &Articulation, frames: &[Vec<usize>], extent: (Vec3, Vec3)) -> Self {
        let cameras = frames.iter().zip(&found.cameras).flat_map(|(f, c)| f.iter().copied().zip(c.iter().copied()));
        Self {
            cameras: cameras.collect(),
            tree: found.tree.clone(),
            voxel: found.voxel,
            report: found.report.clone(),
            certainty: found.certainty.clone(),
            information: found.information.clone(),
            doubts: found.doubts.iter().map(Doubt::to_string).collect(),
            lo: extent.0.into(),
            hi: extent.1.into(),
            shown: found.shown.clone(),
            doubted: found.doubts.clone(),
        }
    }

    /// Writes the files; answers the parts as a reader would have them.
    pub fn write(&self, folder: &Path, trace: &[PassRecord]) -> Result<Self> {
        write_json(&folder.join("trace.json"), &trace)?;
        write_and_settle(&folder.join("parts.json"), self)
    }

    /// Of a finished stage.
    ///
    /// # Errors
    /// When the file is missing or not ours.
    pub fn read(run: &Path) -> Result<Self> {
        read_checked(&run.join("parts").join("parts.json"), |parts: &Self| {
            let n = parts.tree.parts.len();
            check::tree(&parts.tree)?;
            check::as_many("certainties", parts.certainty.len(), "joints", parts.tree.joints.len())?;
            let rows = &parts.information;
            rows.iter().try_for_each(|row| check::as_many("informations of a state", row.len(), "parts", n))?;
            check::finite(
                "the object's box",
                &[parts.lo, parts.hi].concat().into_iter().map(f64::from).collect::<Vec<_>>(),
            )?;
            if parts.voxel.is_finite() && parts.voxel > 0.0 { Ok(()) } else { Err("voxel is not a length".into()) }
        })
    }

    /// What every pass did, if this run says so.
    pub fn read_trace(run: &Path) -> Vec<PassRecord> {
        read_json(&run.join("parts").join("trace.json")).unwrap_or_default()
    }
}
