//! Which files of a run folder are hingecast's, and whether those of a finished stage are still
//! what the stage wrote.

use crate::failure::{Failure, Result};
use hingecast_geom::folder::may_be_emptied;
use hingecast_geom::staging::is_temporary;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use xxhash_rust::xxh3::xxh3_128;

/// Holds the stamp that the folder's files belong to, while the stage is at work and after.
pub const STAMP: &str = "stamp";
/// A fit that is not over.
const CHECKPOINT: &str = "checkpoint.bin";
/// Locked by the build that is at work. It stays: to remove it would let two builds lock two files
/// of one name.
const LOCK: &str = ".lock";
const HINT: &str = "move it elsewhere, or give a new folder: hingecast build RECORDING -o RUN";

/// A file that a finished stage left.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FileRecord {
    /// From the stage's folder, with slashes.
    pub name: String,
    /// Length of the file.
    pub bytes: u64,
    /// XXH3 of the content, 32 hex digits. The whole of it: 60 MB take some 10 ms where the system
    /// has just read or written them.
    pub xxh3: String,
}

/// What a stage left in its folder; sorted, without what only serves to go on after a kill.
///
/// # Errors
/// When a file cannot be read.
pub fn files_of(stage: &Path) -> Result<Vec<FileRecord>> {
    let (mut files, mut folders) = (Vec::new(), vec![PathBuf::new()]);
    while let Some(at) = folders.pop() {
        let folder = stage.join(&at);
        for entry in std::fs::read_dir(&folder).map_err(Failure::io(&folder))? {
            let entry = entry.map_err(Failure::io(&folder))?;
            let (path, name) = (at.join(entry.file_name()), entry.file_name());
            if entry.path().is_dir() {
                folders.push(path);
            } else if name != STAMP && name != CHECKPOINT && !is_temporary(&name) {
                files.push(path);
            }
        }
    }
    files.sort();
    files.par_iter().map(|file| hashed(stage, file).map_err(Failure::io(&stage.join(file)))).collect()
}

fn hashed(stage: &Path, file: &Path) -> std::io::Result<FileRecord> {
    let content = std::fs::read(stage.join(file))?;
    let name = file.to_string_lossy().replace('\\', "/");
    Ok(FileRecord { name, bytes: content.len() as u64, xxh3: format!("{:032x}", xxh3_128(&content)) })
}

/// Whether all `files` are in the stage's folder, as they were written.
pub fn unchanged(stage: &Path, files: &[FileRecord]) -> bool {
    // Lengths first: most damage shows there, without reading.
    let long = |f: &FileRecord| std::fs::metadata(stage.join(&f.name)).is_ok_and(|m| m.is_file() && m.len() == f.bytes);
    let same = |f: &FileRecord| hashed(stage, Path::new(&f.name)).is_ok_and(|now| now == *f);
    !files.is_empty() && files.iter().all(long) && files.par_iter().all(same)
}

/// Whether a file of this path is one that hingecast writes into the folder of `stage`.
fn is_stages(stage: &str, path: &Path) -> bool {
    let Some(name) = path.to_str() else { return false };
    let numbered = |start: &str, end: &str| {
        let number = name.strip_prefix(start).and_then(|rest| rest.strip_suffix(end));
        number.is_some_and(|n| !n.is_empty() && n.bytes().all(|b| b.is_ascii_digit()))
    };
    let known: &[&str] = match stage {
        "parts" => &["parts.json", "samples.ply", "trace.json"],
        "splat" => &["gaussians.ply", "extent.json", "placed.json", "fit.json", CHECKPOINT],
        "joints" => &["joints.json"],
        "twin" => &["simulator.json"],
        "report" => &["index.html", "view.html"],
        "prepare" => &["prepare.json", "masks.png"],
        _ => &[],
    };
    let more = match stage {
        "motion" => numbered("state_", ".ply"),
        "twin" => hingecast_twin::is_ours(path),
        "prepare" => is_mask(name.strip_prefix("hand_").unwrap_or(name)),
        "report" => numbered("state_", ".png") || numbered("held_out_", ".png"),
        _ => false,
    };
    more || name == STAMP || known.contains(&name)
}

/// `s003_v012.png`, as the masks are called that a build finds; `hand_` before it: the hands in it.
fn is_mask(name: &str) -> bool {
    let inner = name.strip_prefix('s').and_then(|n| n.strip_suffix(".png"));
    inner.is_some_and(|n| n.contains("_v") && n.bytes().all(|b| b.is_ascii_digit() || b == b'_' || b == b'v'))
}

/// Whether the folder of `stage` may be emptied.
///
/// # Errors
/// It holds a file that hingecast does not write.
pub fn may_empty_stage(root: &Path, stage: &str) -> Result<()> {
    Ok(may_be_emptied(&format!("run's folder '{stage}'"), &root.join(stage), &|path| is_stages(stage, path), HINT)?)
}

/// The folders that hingecast makes in a run.
pub const FOLDERS: [&str; 7] = ["prepare", "parts", "splat", "motion", "joints", "twin", "report"];
/// The files, besides `run.json` and the lock.
pub const FILES: [&str; 2] = ["config.toml", "eval.json"];

/// Whether the whole run may be emptied.
///
/// # Errors
/// It holds a file that hingecast does not write.
pub fn may_empty_run(root: &Path) -> Result<()> {
    let ours = |path: &Path| match path.iter().next().and_then(|top| top.to_str()) {
        Some(top) if FOLDERS.contains(&top) => path.strip_prefix(top).is_ok_and(|rest| is_stages(top, rest)),
        Some(top) => path == Path::new(top) && (FILES.contains(&top) || [LOCK, "run.json"].contains(&top)),
        None => false,
    };
    Ok(may_be_emptied("run folder", root, &ours, HINT)?)
}

/// Whether nothing but the beginning of a build that was killed is in `root`; also where there is
/// no such folder.
///
/// # Errors
/// It is no folder, or one that cannot be read.
pub fn is_bare(root: &Path) -> Result<bool> {
    match std::fs::read_dir(root) {
        Ok(entries) => Ok(entries.flatten().all(|e| e.file_name() == LOCK || is_temporary(&e.file_name()))),
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(true),
        Err(e) => Err(Failure::io(root)(e)),
    }
}

/// Keeps a second build out of a run folder, for as long as it lives; the system lets go of it when
/// the process ends, however it ends.
pub struct RunLock {
    _file: File,
}

impl RunLock {
    /// # Errors
    /// Another build is at work there.
    pub fn take(root: &Path) -> Result<Self> {
        let path = root.join(LOCK);
        let file = File::options().read(true).write(true).create(true).truncate(false).open(&path);
        let file = file.map_err(Failure::io(&path))?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => {
                let hint = "wait until it is done, stop it, or give another folder: -o RUN";
                Err(Failure::new("another build is at work in this run folder", root.display().to_string(), hint))
            }
            // Some network disks know no locks; a single build there is better than none.
            Ok(()) | Err(TryLockError::Error(_)) => Ok(Self { _file: file }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_change_of_a_listed_file_is_noticed() {
        let dir = tempfile::tempdir().unwrap();
        let at = dir.path();
        std::fs::create_dir_all(at.join("meshes/visual")).unwrap();
        std::fs::write(at.join("twin.json"), "{}").unwrap();
        std::fs::write(at.join("meshes/visual/part_0.ply"), [7u8; 5000]).unwrap();
        for name in [STAMP, CHECKPOINT] {
            std::fs::write(at.join(name), "x").unwrap();
        }
        let files = files_of(at).unwrap();
        let names: Vec<&str> = files.iter().map(|f| f.name.as_str()).collect();
        assert_eq!(names, ["meshes/visual/part_0.ply", "twin.json"]);
        assert!(unchanged(at, &files) && !unchanged(at, &[]));
        let mut middle = [7u8; 5000];
        middle[2500] = 8;
        std::fs::write(at.join("meshes/visual/part_0.ply"), middle).unwrap();
        assert!(!unchanged(at, &files), "a byte in the middle");
        std::fs::remove_file(at.join("meshes/visual/part_0.ply")).unwrap();
        assert!(!unchanged(at, &files), "a file less");
    }

    #[test]
    fn one_build_at_a_time() {
        let dir = tempfile::tempdir().unwrap();
        let first = RunLock::take(dir.path()).unwrap();
        let refused = RunLock::take(dir.path()).err().unwrap().to_string();
        assert!(refused.contains("another build") && refused.lines().count() == 3, "{refused}");
        drop(first);
        RunLock::take(dir.path()).unwrap();
        assert!(is_bare(dir.path()).unwrap());
    }
}
