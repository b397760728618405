//! Folders that appear whole or not at all.

use crate::CaptureError;
use hingecast_geom::folder::may_become;
use std::path::{Path, PathBuf};

/// A folder that is filled under a temporary name and takes its place when all is there.
pub(crate) struct Staging {
    pub path: PathBuf,
}

impl Staging {
    /// # Errors
    /// When `target` holds something that is no recording: nothing of a person's is ever removed.
    pub fn new(target: &Path) -> Result<Self, CaptureError> {
        let hint = "give a new folder, or empty this one yourself";
        may_become("output folder", target, &["transforms.json", "truth.json"], hint)?;
        let mut name = target.file_name().unwrap_or_default().to_os_string();
        name.push(".part");
        let path = target.with_file_name(name);
        // Left over from a run that was killed.
        let _ = std::fs::remove_dir_all(&path);
        std::fs::create_dir_all(&path).map_err(|e| CaptureError::write(&path, e))?;
        Ok(Self { path })
    }

    pub fn folder(&self, name: &str) -> Result<(), CaptureError> {
        let path = self.path.join(name);
        std::fs::create_dir_all(&path).map_err(|e| CaptureError::write(&path, e))
    }

    pub fn finish(&self, target: &Path) -> Result<(), CaptureError> {
        if target.exists() {
            std::fs::remove_dir_all(target).map_err(|e| CaptureError::write(target, e))?;
        }
        std::fs::rename(&self.path, target).map_err(|e| CaptureError::write(target, e))
    }
}

impl Drop for Staging {
    fn drop(&mut self) {
        // After `finish` there is nothing left under the temporary name.
        let _ = std::fs::remove_dir_all(&self.path);
    }
}
