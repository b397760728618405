//! Demonstrations by a person at the keyboard, 20 control steps a second, into the same file as
//! scripted ones.
//!
//! `keys` turns key events and time into actions, `session` drives the world and the recording,
//! `screen` draws as text, `terminal` connects them with a real terminal. A kept episode is in the
//! file before the next one begins, so a kill costs at most the episode being recorded; the same
//! command goes on with the file.

pub mod keys;
mod screen;
pub mod session;
pub mod terminal;

use super::record::{WorldArgs, world_of};
use hingecast::failure::{Failure, Result};
use hingecast_policy::Demos;
use hingecast_sim::TaskKind;
use std::path::Path;

/// What a person asks for; a file that is there already must be of the same.
pub struct Wanted<'a> {
    /// What shall be done with the joint.
    pub kind: TaskKind,
    /// Model file, as [`object_file`](super::object_file) or [`twin_file`](super::twin_file)
    /// answers it: the path in the file must be the same to the letter.
    pub object: &'a Path,
    /// Name of the joint; `None`: whichever the file has.
    pub joint: Option<&'a str>,
    /// Simulated metres per unit of the object's file; `None`: whatever the file has.
    pub scale: Option<f64>,
}

/// The demonstrations in `file` and their world, to go on from; `None` where there is no such file.
///
/// # Errors
/// When the file is damaged, of another simulator, or of another task, object, joint or size.
pub fn go_on(file: &Path, wanted: &Wanted) -> Result<Option<(Demos, WorldArgs)>> {
    if !file.exists() {
        return Ok(None);
    }
    let demos = hingecast_policy::demos::read(file)?;
    let world = world_of(&demos, file)?;
    let task = &world.task;
    let differs = [
        ("task", task.kind.name().to_string(), wanted.kind.name().to_string()),
        ("object", world.object.display().to_string(), wanted.object.display().to_string()),
        ("joint", task.joint.clone(), wanted.joint.unwrap_or(&task.joint).to_string()),
        ("scale", task.scale.to_string(), wanted.scale.unwrap_or(task.scale).to_string()),
    ];
    match differs.into_iter().find(|(_, there, asked)| there != asked) {
        None => Ok(Some((demos, world))),
        Some((what, there, asked)) => Err(Failure::new(
            format!("the file has demonstrations of another {what}: {there}, not {asked}"),
            format!("{}, data, attribute env_args", file.display()),
            "another file: -o FILE; or the flags that it was begun with",
        )),
    }
}
