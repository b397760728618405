//! The simulator and policies together: demonstrations recorded, replayed, policies rolled out.

pub mod record;
pub mod replay;
pub mod rollout;
mod strip;
pub mod teleop;

use hingecast::failure::{Failure, Result};
use hingecast_capture::object::ArticulatedObject;
use std::path::{Path, PathBuf};

/// The model file behind `--object`: a path, or the name of a sample.
///
/// # Errors
/// When nothing of that name is there.
pub fn object_file(argument: &str) -> Result<PathBuf> {
    if argument == hingecast_sim::object::HINGED_BLOCKS {
        return Ok(PathBuf::from(argument));
    }
    absolute(&hingecast_sim::object::model_file(&ArticulatedObject::resolve(argument)?)?)
}

/// The model file behind `--twin`: a run, its twin folder, or the file itself.
///
/// # Errors
/// When no twin is there.
pub fn twin_file(run: &Path) -> Result<PathBuf> {
    absolute(&hingecast_sim::object::model_file(run)?)
}

/// Demonstrations remember the object by its whole path.
fn absolute(path: &Path) -> Result<PathBuf> {
    path.canonicalize().map_err(Failure::io(path))
}

/// A folder that cannot be written is noticed before the work and not after it.
///
/// # Errors
/// When it cannot.
pub fn may_write(file: &Path) -> Result<()> {
    hingecast_geom::staging::probe(file).map_err(Failure::io(file))
}
