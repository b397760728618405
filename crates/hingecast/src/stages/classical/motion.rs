//! Stage `motion`: the gaussians of the first state carried through all states. One file per state,
//! so that a killed run goes on at the state where it stopped.

use crate::artifacts::Splats;
use crate::artifacts::tracks::{read_states, save_state};
use crate::failure::{Failure, Result};
use crate::stages::classical::splat;
use crate::stages::inputs::Inputs;
use hingecast_articulate::classical::track;
use hingecast_geom::Progress;
use std::path::Path;

/// Tracks all gaussians; what is there in `at` already is kept.
pub fn run(inputs: &Inputs, splats: &Splats, at: &Path, progress: &Progress) -> Result<()> {
    let targets = |state: usize| splat::targets(inputs, state);
    let mut keep = |state: usize, means: &[[f32; 3]], quats: &[[f32; 4]]| save_state(at, state, means, quats);
    track::run::<Failure>(
        &splats.gaussians,
        inputs.recording.n_states,
        splats.extent.diagonal,
        &targets,
        read_states(at)?,
        &mut keep,
        &inputs.config.track,
        inputs.config.seed,
        inputs.threads,
        progress,
    )?;
    Ok(())
}
