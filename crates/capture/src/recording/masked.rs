//! Masks that were found for a recording which came without: a folder of their own, and `mask_path`
//! in its `transforms.json`.

use super::{Recording, images, transforms};
use crate::CaptureError;
use serde_json::json;
use std::path::{Path, PathBuf};

/// A folder for masks in the recording that is not there yet: `mask`, or the first of `mask_2`, `mask_3`, ...
/// whose name is free, as is that of the picture beside it, `.png`.
pub fn free_folder(recording: &Recording) -> PathBuf {
    let names = (1..).map(|n| if n == 1 { "mask".to_string() } else { format!("mask_{n}") });
    let mut paths = names.map(|name| recording.root.join(name));
    let free =
        |path: &PathBuf| [path.clone(), path.with_extension("png")].iter().all(|p| p.symlink_metadata().is_err());
    paths.find(free).expect("there are more numbers than files")
}

/// Writes the masks' paths of `recording` into its `transforms.json`, and nothing else; the old file is kept
/// beside (`.bak`).
///
/// # Errors
/// When a file cannot be read or written.
pub fn write(recording: &Recording) -> Result<(), CaptureError> {
    for mut document in transforms::read(&recording.root)? {
        // What was found is one thing, whatever numbers others had.
        document.value.as_object_mut().into_iter().for_each(|top| drop(top.remove("mask_id")));
        let folder = document.file.parent().unwrap_or(Path::new("")).to_path_buf();
        for entry in &document.entries {
            let own = recording.frames.iter().find(|f| f.color == entry.color && f.state == entry.state);
            let Some(mask) = own.and_then(|f| f.mask.as_ref()) else { continue };
            let frame = &mut document.value["frames"][entry.index];
            frame.as_object_mut().into_iter().for_each(|f| drop(f.remove("mask_id")));
            frame["mask_path"] = json!(relative(mask, &folder));
        }
        crate::check::backup(&document.file)?;
        let text = serde_json::to_vec_pretty(&document.value).map_err(|e| CaptureError::write(&document.file, e))?;
        images::write_file(&document.file, &text)?;
    }
    Ok(())
}

/// From a folder to a file in it or beside it.
fn relative(file: &Path, folder: &Path) -> String {
    let inside = file.strip_prefix(folder).map(|p| p.to_string_lossy().into_owned());
    let beside = || Some(format!("../{}", file.strip_prefix(folder.parent()?).ok()?.to_string_lossy()));
    inside.ok().or_else(beside).unwrap_or_else(|| file.to_string_lossy().into_owned()).replace('\\', "/")
}
