//! Folders that programs fill: nothing of a person's may be in there, since finished work replaces
//! what is there.

use crate::InputError;
use crate::staging::is_temporary;
use std::path::{Path, PathBuf};

/// Whether the `what` ("run folder") may be written at `folder`: it is new, empty, or holds a file
/// of one of the names `ours`.
///
/// # Errors
/// It holds something else (`hint` says what to try), or is no folder that can be written.
pub fn may_become(what: &str, folder: &Path, ours: &[&str], hint: &str) -> Result<(), InputError> {
    let mut entries = match std::fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(()),
        Err(e) => return Err(InputError::write(folder, e)),
    };
    if entries.next().is_none() || ours.iter().any(|name| folder.join(name).is_file()) {
        return Ok(());
    }
    Err(InputError::new(format!("the {what} holds something else"), folder.display().to_string(), hint))
}

/// Whether all that is in `folder` may be deleted: every file is, by its path from there, one that
/// this program writes.
///
/// # Errors
/// There is another one, or the folder cannot be read.
pub fn may_be_emptied(what: &str, folder: &Path, ours: &dyn Fn(&Path) -> bool, hint: &str) -> Result<(), InputError> {
    match foreign(folder, ours).map_err(|e| InputError::read(folder, e))? {
        None => Ok(()),
        Some(file) => {
            let what = format!("the {what} holds something else: {}", file.display());
            Err(InputError::new(what, folder.join(file).display().to_string(), hint))
        }
    }
}

/// The first file below `folder`, by its path from there, that is not `ours`. Links are files:
/// nothing behind them is anybody's to delete. Folders without files hold nothing, and half-written
/// files of killed processes are nobody's.
///
/// # Errors
/// When a folder cannot be read.
pub fn foreign(folder: &Path, ours: &dyn Fn(&Path) -> bool) -> std::io::Result<Option<PathBuf>> {
    let mut found: Option<PathBuf> = None;
    let mut folders = vec![PathBuf::new()];
    while let Some(at) = folders.pop() {
        let entries = match std::fs::read_dir(folder.join(&at)) {
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => continue,
            entries => entries?,
        };
        for entry in entries {
            let entry = entry?;
            if is_temporary(&entry.file_name()) {
                continue;
            }
            let path = at.join(entry.file_name());
            if entry.file_type()?.is_dir() {
                folders.push(path);
            } else if !ours(&path) && found.as_ref().is_none_or(|other| path < *other) {
                found = Some(path);
            }
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_new_empty_or_own_folders_are_taken() {
        let dir = tempfile::tempdir().unwrap();
        let asked = |folder: &Path| may_become("run folder", folder, &["run.json"], "give a new folder");
        assert!(asked(&dir.path().join("new")).is_ok());
        assert!(asked(dir.path()).is_ok());
        std::fs::write(dir.path().join("thesis.tex"), "years").unwrap();
        let e = asked(dir.path()).unwrap_err();
        assert_eq!(e.what, "the run folder holds something else");
        assert!(asked(&dir.path().join("thesis.tex")).is_err(), "a file is no folder");
        std::fs::write(dir.path().join("run.json"), "{}").unwrap();
        assert!(asked(dir.path()).is_ok());
    }

    #[test]
    fn one_foreign_file_keeps_a_folder_from_being_emptied() {
        let dir = tempfile::tempdir().unwrap();
        let ours = |path: &Path| path.starts_with("rgb");
        let asked = || may_be_emptied("output folder", dir.path(), &ours, "give a new folder");
        std::fs::create_dir_all(dir.path().join("rgb/deep")).unwrap();
        std::fs::create_dir_all(dir.path().join("src/empty")).unwrap();
        std::fs::write(dir.path().join("rgb/deep/a.png"), "").unwrap();
        assert!(asked().is_ok());
        std::fs::write(dir.path().join("src/thesis.tex"), "years").unwrap();
        let e = asked().unwrap_err();
        assert!(e.what.ends_with("src/thesis.tex") && e.place.ends_with("src/thesis.tex"), "{e:?}");
        assert!(may_be_emptied("output folder", &dir.path().join("nowhere"), &ours, "-").is_ok());
    }
}
