//! Objects that others wrote: URDF by our own reader, MJCF by MuJoCo itself where it is built in.

use crate::failure::Result;
use hingecast_capture::object::ArticulatedObject;
use std::path::Path;

/// Loads the object at `path`: a file, or a folder as `ArticulatedObject::load` takes it.
///
/// # Errors
/// When nothing is found, the file or one of its meshes cannot be read, or it says what a tree of
/// hinges and slides cannot.
pub fn load(path: &Path) -> Result<ArticulatedObject> {
    #[cfg(feature = "mujoco")]
    if let Some(file) = ArticulatedObject::mjcf_at(path)? {
        return Ok(hingecast_sim::compiled::load(&file)?);
    }
    Ok(ArticulatedObject::load(path)?)
}
