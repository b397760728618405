//! Folders that programs fill: nothing of a person's may be in there, since finished work replaces what is there.

use crate::InputError;
use std::path::Path;

/// Whether the `what` ("run folder") may be written at `folder`: it is new, empty, or holds a file of one of the names `ours`.
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
}
