//! Zip files (.zip, Record3D's .r3d) as folders, for as long as an import takes.

use crate::CaptureError;
use hingecast_geom::staging;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use zip::ZipArchive;

/// A place for what is unpacked: beside the recording, made when it is first needed, gone when the
/// import ends.
pub(super) struct Scratch {
    out: PathBuf,
    made: Option<staging::Staging>,
    folders: usize,
}

impl Scratch {
    pub fn new(out: &Path) -> Self {
        Self { out: out.to_path_buf(), made: None, folders: 0 }
    }

    /// A new, empty folder.
    pub fn folder(&mut self) -> Result<PathBuf, CaptureError> {
        let failed = |e| CaptureError::write(&self.out, e);
        if self.made.is_none() {
            self.made = Some(staging::Staging::new(&self.out).map_err(failed)?);
        }
        let root = self.made.as_ref().map(|m| m.path()).unwrap_or_default();
        let folder = root.join(self.folders.to_string());
        self.folders += 1;
        std::fs::create_dir_all(&folder).map_err(failed)?;
        Ok(folder)
    }
}

/// Whether the file is a zip, whatever its name.
pub(super) fn is_zip(path: &Path) -> bool {
    let mut start = [0u8; 4];
    let read = File::open(path).and_then(|mut f| std::io::Read::read_exact(&mut f, &mut start));
    read.is_ok() && start == *b"PK\x03\x04"
}

/// Unpacks a zip file into `to`; the notes of macOS stay out.
///
/// # Errors
/// When it is damaged or locked, or an entry is a link or wants to be written elsewhere.
pub(super) fn unpack(file: &Path, to: &Path) -> Result<(), CaptureError> {
    let bad = |e: &dyn std::fmt::Display| {
        let hint = "copy it again from the phone, or unpack it yourself and give the folder";
        CaptureError::new(format!("the zip file cannot be unpacked: {e}"), file.display().to_string(), hint)
    };
    let open = File::open(file).map_err(|e| CaptureError::read(file, e))?;
    let mut archive = ZipArchive::new(BufReader::new(open)).map_err(|e| bad(&e))?;
    for i in 0..archive.len() {
        let mut entry = archive.by_index(i).map_err(|e| bad(&e))?;
        let name = entry.enclosed_name().ok_or_else(|| bad(&"an entry has the name of a file elsewhere"))?;
        if entry.is_symlink() {
            return Err(bad(&format!("{} is a link", name.display())));
        }
        if name.starts_with("__MACOSX") {
            continue;
        }
        let target = to.join(name);
        let folder = if entry.is_dir() { Some(target.as_path()) } else { target.parent() };
        folder.map_or(Ok(()), std::fs::create_dir_all).map_err(|e| CaptureError::write(&target, e))?;
        if entry.is_file() {
            let mut out = File::create(&target).map_err(|e| CaptureError::write(&target, e))?;
            std::io::copy(&mut entry, &mut out).map_err(|e| bad(&e))?;
        }
    }
    Ok(())
}
