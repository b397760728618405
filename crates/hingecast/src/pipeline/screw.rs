//! Stages of `--method screw`: `parts` (what moves, and how, from the depth of all states) and `joints` (a person's corrections, doubts).

use super::joints::JointsFile;
use super::{Context, labelled, overrides, placed, splat};
use crate::failure::Result;
use crate::stage::{read_json, write_json};
use glam::Vec3;
use hingecast_articulate::model::estimate::FitReport;
use hingecast_articulate::{BACKGROUND, DepthError, DepthView, Depths, Doubt, Information, OBJECT, UNKNOWN, find};
use hingecast_capture::{Split, View};
use hingecast_geom::{Certainty, KinematicTree, Pose};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// `parts/parts.json`
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PartsFile {
    pub tree: KinematicTree,
    /// camera_from_world as corrected, by frame of the recording.
    pub cameras: BTreeMap<usize, Pose>,
    pub report: FitReport,
    /// Of each joint, in the tree's order.
    pub certainty: Vec<Certainty>,
    /// How sharply the depth holds every part in every state; empty where pictures have nothing to add to it. [state][part]
    pub information: Vec<Vec<Information>>,
    /// As sentences, gravest first.
    pub doubts: Vec<String>,
    /// Box of the object over all states.
    pub lo: [f32; 3],
    pub hi: [f32; 3],
    /// Spacing of the labelled samples, scene units.
    pub voxel: f32,
    /// The doubts again, as data.
    #[serde(default)]
    pub doubted: Vec<Doubt>,
}

pub fn load(run: &Path) -> Result<PartsFile> {
    read_json(&run.join("parts").join("parts.json"))
}

/// Pixels of a view as the search for parts wants them.
fn depth_view(view: &View) -> DepthView {
    let class = |i: usize| match (view.usable[i], view.mask[i], view.depth[i] > 0.0) {
        (1, 1, true) => OBJECT,
        (1, 0, false) => BACKGROUND,
        // A hand, a hole, or depth outside a ragged mask.
        _ => UNKNOWN,
    };
    let class = (0..view.mask.len()).map(class).collect();
    DepthView { camera: view.camera, class, depth: view.depth.clone() }
}

/// The training views of a recording.
struct RecordedDepths<'a> {
    context: &'a Context<'a>,
    /// Frames of every state.
    frames: Vec<Vec<usize>>,
    extent: (Vec3, Vec3),
}

impl Depths for RecordedDepths<'_> {
    fn n_states(&self) -> usize {
        self.frames.len()
    }

    fn extent(&mut self) -> std::result::Result<(Vec3, Vec3), DepthError> {
        Ok(self.extent)
    }

    fn views(&mut self, state: usize) -> std::result::Result<Vec<DepthView>, DepthError> {
        let view = |&f: &usize| -> Result<DepthView> { Ok(depth_view(&*self.context.cache.get(f)?)) };
        self.frames[state].par_iter().map(view).collect::<Result<_>>().map_err(DepthError::from)
    }
}

pub fn run_parts(context: &Context, at: &Path) -> Result<()> {
    let recording = context.recording;
    let progress = context.ui.stage("parts");
    let all: Vec<usize> = (0..recording.n_states).collect();
    let (lo, hi) = splat::extent(context, &all)?;
    let frames: Vec<Vec<usize>> = all.iter().map(|&s| recording.frames_of(s, Split::Train)).collect();
    let extent = (lo.as_vec3(), hi.as_vec3());
    let mut depths = RecordedDepths { context, frames, extent };
    let mut config = context.config.screw.clone();
    (config.seed, config.skip) = (context.config.seed, context.config.passes.skip.clone());
    let found = find(&mut depths, &config, &progress)?;
    labelled::write(at, &found.samples)?;
    write_json(&at.join("trace.json"), &found.trace)?;
    let cameras = depths.frames.iter().zip(&found.cameras).flat_map(|(f, c)| f.iter().copied().zip(c.iter().copied()));
    let file = PartsFile {
        cameras: cameras.collect(),
        tree: found.tree,
        voxel: found.voxel,
        report: found.report,
        certainty: found.certainty,
        information: found.information,
        doubts: found.doubts.iter().map(Doubt::to_string).collect(),
        lo: extent.0.into(),
        hi: extent.1.into(),
        doubted: found.doubts,
    };
    write_json(&at.join("parts.json"), &file)
}

pub fn run_joints(context: &Context, run: &Path, at: &Path) -> Result<()> {
    let (found, placed) = (load(run)?, placed::load(run)?);
    let certainty = found.certainty.into_iter().map(Some).collect();
    let mut file = JointsFile { tree: placed.tree, labels: placed.parts, doubts: found.doubts, certainty };
    overrides::apply(&mut file, &context.config.joint)?;
    write_json(&at.join("joints.json"), &file)
}
