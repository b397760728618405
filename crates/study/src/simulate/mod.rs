//! The simulator and policies together: demonstrations recorded, replayed, policies rolled out.

pub mod record;
pub mod replay;
pub mod rollout;
mod strip;
pub mod teleop;

use crate::host::Host;
use hingecast::failure::{Failure, Result};
use hingecast::import_object::{ImportConfig, import};
use hingecast::stage::RunFolder;
use hingecast_capture::object::ArticulatedObject;
use std::path::{Path, PathBuf};

/// The model file behind `--object`: a path, or the name of a sample. A PartNet-Mobility folder is
/// made fit for the simulator first, as `hingecast import-object` does it, in `imported`; `None`:
/// such a folder is refused. Answers an absolute path, or `hinged_blocks` as it is: these blocks
/// need no file.
///
/// # Errors
/// When nothing of that name is there, or it must be imported and cannot be.
pub fn object_file(host: &Host, argument: &str, imported: Option<&Path>) -> Result<PathBuf> {
    if argument == hingecast_sim::object::HINGED_BLOCKS {
        return Ok(PathBuf::from(argument));
    }
    let path = ArticulatedObject::resolve(argument)?;
    RunFolder::refuse_unfinished(&path)?;
    let raw = path.join("mobility.urdf").is_file() || path.file_name().is_some_and(|n| n == "mobility.urdf");
    if !raw {
        return absolute(&hingecast_sim::object::model_file(&path)?);
    }
    let Some(imported) = imported else {
        let hint = format!("hingecast import-object {argument} -o FOLDER, then --object FOLDER");
        return Err(Failure::new("a PartNet-Mobility object must be imported first", path.display().to_string(), hint));
    };
    let made = import(&path, imported, &ImportConfig::default(), &host.watcher.stage("import"))?;
    host.watcher.say(&format!("{} was imported into {}", path.display(), imported.display()));
    made.changes.iter().for_each(|c| host.watcher.say(&format!("  changed: {c}")));
    absolute(&imported.join("robot.xml"))
}

/// Where [`object_file`] imports to, beside a file of demonstrations: `d.hdf5` -> `d.object`.
pub fn imported_beside(demos: &Path) -> PathBuf {
    demos.with_extension("object")
}

/// The model file behind `--twin`: of a run, of its twin folder, or the file itself. An absolute
/// path.
///
/// # Errors
/// When no twin is there, or it is of an earlier build than the run.
pub fn twin_file(run: &Path) -> Result<PathBuf> {
    RunFolder::refuse_unfinished(run)?;
    absolute(&hingecast_sim::object::model_file(run)?)
}

/// Demonstrations remember the object by its whole path.
fn absolute(path: &Path) -> Result<PathBuf> {
    path.canonicalize().map_err(Failure::io(path))
}

/// A folder in which `file` cannot be written is noticed before the work and not after it.
///
/// # Errors
/// When it cannot.
pub fn may_write(file: &Path) -> Result<()> {
    hingecast_geom::staging::probe(file).map_err(Failure::io(file))
}

/// Whether demonstrations may take the place of `file`: it is new, or demonstrations of ours.
///
/// # Errors
/// Something else is there.
pub fn may_replace(file: &Path) -> Result<()> {
    let ours = || {
        let demos = hingecast_policy::demos::read(file).ok()?;
        Some(demos.env_args["env_name"].as_str()?.starts_with(record::ENV_NAME))
    };
    if file.symlink_metadata().is_ok() && ours() != Some(true) {
        let what = "a file of this name is there, and not demonstrations that hingecast recorded";
        return Err(Failure::new(what, file.display().to_string(), "another name: -o FILE.hdf5"));
    }
    Ok(())
}

/// A factor as people write it: six digits at most, without what powers of two add to them.
pub fn short(x: f64) -> f64 {
    format!("{x:.5e}").parse().unwrap_or(x)
}

#[cfg(test)]
mod tests {
    /// `demos` once said "size x 0.8200000000000001".
    #[test]
    fn factors_are_short() {
        assert_eq!(
            format!("{} {} {}", super::short(0.8200000000000001), super::short(1.0), super::short(1e-3)),
            "0.82 1 0.001"
        );
    }
}
