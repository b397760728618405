//! Stage `parts` of `--method screw`: what moves, and how, from the depth of all states.

use super::inputs::Inputs;
use crate::artifacts::Parts;
use crate::failure::Result;
use glam::Vec3;
use hingecast_articulate::{
    BACKGROUND, DepthError, DepthView, Depths, Labelled, OBJECT, OTHER, PassRecord, UNKNOWN, find,
};
use hingecast_capture::View;
use hingecast_geom::Progress;
use rayon::prelude::*;

/// Pixels of a view as the search for parts wants them.
pub(crate) fn depth_view(view: &View) -> DepthView {
    let class = |i: usize| match (view.usable[i], view.mask[i], view.depth[i] > 0.0) {
        (1, 1, true) => OBJECT,
        (1, 0, false) => BACKGROUND,
        // The room, or what a ragged mask leaves out.
        (1, 0, true) => OTHER,
        // A hand, or a hole.
        _ => UNKNOWN,
    };
    let class = (0..view.mask.len()).map(class).collect();
    DepthView { camera: view.camera, class, depth: view.depth.clone() }
}

/// The training views of a recording.
struct RecordedDepths<'a> {
    inputs: &'a Inputs<'a>,
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
        let view = |&f: &usize| -> Result<DepthView> { Ok(depth_view(&*self.inputs.cache.get(f)?)) };
        self.frames[state].par_iter().map(view).collect::<Result<_>>().map_err(DepthError::from)
    }
}

/// What the search found: its parts, the labelled surface, and what every pass did.
pub fn run(inputs: &Inputs, progress: &Progress) -> Result<(Parts, Vec<Labelled>, Vec<PassRecord>)> {
    let all: Vec<usize> = (0..inputs.recording.n_states).collect();
    let (lo, hi) = inputs.extent(&all)?;
    let extent = (lo.as_vec3(), hi.as_vec3());
    let mut depths = RecordedDepths { inputs, frames: inputs.training_frames(), extent };
    let mut config = inputs.config.screw.clone();
    config.film = inputs.recording.film;
    (config.seed, config.skip) = (inputs.config.seed, inputs.config.passes.skip.clone());
    config.held = inputs.recording.settled;
    let found = find(&mut depths, &config, progress)?;
    Ok((Parts::new(&found, &depths.frames, extent), found.samples, found.trace))
}
