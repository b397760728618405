//! Stage `parts` of the classical way: gaussians that move together.

use super::OPAQUE;
use crate::artifacts::tracks::read_states;
use crate::artifacts::{Groups, Splats};
use crate::failure::Result;
use crate::stages::inputs::Inputs;
use hingecast_articulate::classical::segment;
use hingecast_geom::Progress;
use std::path::Path;

/// Groups gaussians by how their distances change. `motion`: folder of the tracks.
pub fn run(inputs: &Inputs, splats: &Splats, motion: &Path, progress: &Progress) -> Result<Groups> {
    let tracks = read_states(motion)?;
    let gaussians = &splats.gaussians;
    let reliable: Vec<bool> = (0..gaussians.len()).map(|i| gaussians.opacity(i) > OPAQUE).collect();
    let (config, seed) = (&inputs.config.parts, inputs.config.seed);
    let found = segment::run(&tracks, &reliable, splats.extent.diagonal, config, seed, progress)?;
    Ok(Groups { labels: found.labels, motions: found.motions, silhouettes: found.silhouettes })
}
