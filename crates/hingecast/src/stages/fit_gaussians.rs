//! The fit that both methods' stage `splat` ends in.

use super::inputs::Inputs;
use crate::failure::Result;
use crate::stage::write_json;
use hingecast_geom::{Gaussians, Progress};
use hingecast_splat::{Engine, FitConfig, Views};
use std::path::Path;

/// Fits the engine's gaussians to the views; a killed fit goes on from its checkpoint in `at`.
pub fn fit_gaussians(
    inputs: &Inputs,
    mut engine: Engine,
    views: &Views,
    at: &Path,
    progress: &Progress,
) -> Result<Gaussians> {
    let checkpoint = at.join("checkpoint.bin");
    let config = FitConfig {
        iterations: inputs.config.fit.steps,
        seed: inputs.config.seed,
        checkpoint: Some(checkpoint.clone()),
        ..Default::default()
    };
    let report = hingecast_splat::fit(&mut engine, views, &config, progress)?;
    write_json(&at.join("fit.json"), &serde_json::json!({ "training_psnr": report.psnr, "steps": report.iterations }))?;
    let _ = std::fs::remove_file(checkpoint);
    Ok(engine.gaussians())
}
