//! The files of a run folder: one struct, one reader and one writer each.
//!
//! ```text
//! parts/parts.json, samples.ply, trace.json       Parts, samples, what every pass did
//! splat/gaussians.ply, extent.json, placed.json   Splats; placed.json by `--method screw` alone
//! motion/state_<n>.ply, parts/parts.json          tracks and groups, by `--method track` alone
//! joints/joints.json                              Joints: the tree with a person's corrections
//! twin/twin.json and what it names                TwinFile; written by the crate `hingecast-twin`
//! ```
//! A stage hands its artifact on as its file says it (`as_written`), so that a run that was
//! resumed has the same bytes as one that was not. [`Made`] keeps artifacts in memory; files are
//! read back for stages that were kept.

pub mod check;
pub mod joints;
pub mod made;
pub mod parts;
pub mod samples;
pub mod splats;
pub mod tracks;
pub mod twin;

pub use joints::Joints;
pub use made::Made;
pub use parts::Parts;
pub use splats::{Extent, Placed, Splats};
pub use tracks::Groups;
pub use twin::TwinFile;

use crate::failure::Result;
use crate::stage::write_json;
use serde::{Serialize, de::DeserializeOwned};
use std::path::Path;

/// Writes a value and answers it as a reader of the file would have it: serde_json's quick parser
/// is off by one unit in the last place now and then, and a stage that was kept must hand on what a
/// fresh one does.
fn write_and_settle<T: Serialize + DeserializeOwned>(path: &Path, value: &T) -> Result<T> {
    write_json(path, value)?;
    Ok(as_written(value))
}

/// A value as a reader of its file would have it.
fn as_written<T: Serialize + DeserializeOwned>(value: &T) -> T {
    let text = serde_json::to_vec(value).expect("plain data");
    serde_json::from_slice(&text).expect("what was just written")
}
