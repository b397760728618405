//! Stage `splat` of `--method track`: gaussians of the first state.

use crate::artifacts::{Extent, Splats};
use crate::failure::Result;
use crate::stages::fit_gaussians::fit_gaussians;
use crate::stages::inputs::Inputs;
use crate::stages::targets::target;
use hingecast_capture::Split;
use hingecast_geom::Progress;
use hingecast_splat::{Engine, Target, Views, initialise};
use rayon::prelude::*;
use std::path::Path;
use std::sync::Arc;

/// Training targets of one state.
pub fn targets(inputs: &Inputs, state: usize) -> Result<Vec<Target>> {
    let frames = inputs.recording.frames_of(state, Split::Train);
    frames.par_iter().map(|&f| target(&inputs.view(f)?, inputs.background)).collect()
}

/// Fits gaussians to the first state; a killed fit goes on from its checkpoint in `at`.
pub fn run(inputs: &Inputs, at: &Path, progress: &Progress) -> Result<Splats> {
    let (lo, hi) = inputs.extent(&[0])?;
    let extent = Extent { lo: lo.to_array(), hi: hi.to_array(), diagonal: (hi - lo).length() };
    let targets: Vec<_> = targets(inputs, 0)?.into_iter().map(Arc::new).collect();
    let get = |i: usize| targets[i].clone();
    let views = Views { count: targets.len(), get: &get, poses: None };
    let first = initialise(&views, inputs.config.fit.gaussians, inputs.config.seed)?;
    let engine = Engine::from_gaussians(&first, inputs.threads)?;
    let gaussians = fit_gaussians(inputs, engine, &views, at, progress)?;
    Ok(Splats { gaussians, extent, placed: None })
}
