//! Recordings and their truths appear whole or not at all, and replace nothing but recordings and
//! truths.

use crate::CaptureError;
use hingecast_geom::folder::{may_be_emptied, may_become};
use hingecast_geom::staging;
use std::path::{Path, PathBuf};

const HINT: &str = "give a new folder, or empty this one yourself";

/// A folder that is filled under a name of its own and takes its place when all is there.
pub(crate) struct Staging {
    pub path: PathBuf,
    target: PathBuf,
    staging: staging::Staging,
}

impl Staging {
    /// # Errors
    /// When `target` holds something that is no recording: nothing of a person's is ever removed.
    pub fn new(target: &Path) -> Result<Self, CaptureError> {
        may_be_replaced(target)?;
        let staging = staging::Staging::new(target).map_err(|e| CaptureError::write(target, e))?;
        Ok(Self { path: staging.path(), target: target.to_path_buf(), staging })
    }

    pub fn folder(&self, name: &str) -> Result<(), CaptureError> {
        let path = self.path.join(name);
        std::fs::create_dir_all(&path).map_err(|e| CaptureError::write(&path, e))
    }

    /// # Errors
    /// When the disk refuses, or something was put at the target meanwhile.
    pub fn finish(self) -> Result<(), CaptureError> {
        may_be_replaced(&self.target)?;
        self.staging.finish().map_err(|e| CaptureError::write(&self.target, e))
    }
}

/// Whether a recording or a truth may be written at `target`, and what is there deleted: it is new,
/// empty, or what we wrote before.
///
/// # Errors
/// It holds something else. `transforms.json` alone is no proof: captures of people have one as
/// well, beside pictures that nobody can take again.
pub fn may_be_replaced(target: &Path) -> Result<(), CaptureError> {
    may_become("output folder", target, &["transforms.json", "truth.json", "play/transforms.json"], HINT)?;
    may_be_emptied(
        "output folder",
        target,
        &|path| is_ours(path) && (!path.ends_with("transforms.json") || wrote(&target.join(path))),
        HINT,
    )?;
    Ok(())
}

/// Whether we wrote a `transforms.json`: others' do not say what is up and whether it is metric.
fn wrote(transforms: &Path) -> bool {
    let text = std::fs::read(transforms).unwrap_or_default();
    let json: serde_json::Value = serde_json::from_slice(&text).unwrap_or_default();
    ["up", "metric", "frames"].iter().all(|key| json.get(key).is_some())
}

/// Whether a file of this path is one that `synth` or `import` writes into a recording or its
/// truth.
fn is_ours(path: &Path) -> bool {
    let names: Option<Vec<&str>> = path.iter().map(|name| name.to_str()).collect();
    match names.as_deref() {
        Some(["transforms.json" | "truth.json"]) => true,
        Some(["rgb" | "depth" | "mask" | "occluder" | "labels" | "hands", name]) => is_view(name),
        // The two captures of a film.
        Some(["scan" | "play", "transforms.json"]) => true,
        Some(["scan" | "play", "rgb" | "depth", name]) => is_view(name),
        Some(["parts", name]) => name.ends_with(".ply"),
        _ => false,
    }
}

/// `s003_v012.png`.
fn is_view(name: &str) -> bool {
    let number = |text: &str| text.len() >= 3 && text.bytes().all(|b| b.is_ascii_digit());
    let numbers =
        name.strip_prefix('s').and_then(|rest| rest.strip_suffix(".png")).and_then(|rest| rest.split_once("_v"));
    numbers.is_some_and(|(state, view)| number(state) && number(view))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    /// Any folder with a transforms.json once was replaced as a whole, a person's captures
    /// included.
    #[test]
    fn only_what_we_wrote_is_replaced() {
        let dir = tempfile::tempdir().unwrap();
        let target = dir.path().join("rec");
        let refused = || may_be_replaced(&target).err().map(|e| e.what);
        fs::create_dir_all(target.join("rgb")).unwrap();
        fs::write(target.join("transforms.json"), r#"{"frames": [], "up": [0, 0, 1], "metric": true}"#).unwrap();
        fs::write(target.join("rgb/s000_v012.png"), "").unwrap();
        assert_eq!(refused(), None);
        for foreign in ["rgb/IMG_0001.png", "notes.txt", "rgb/s000_v1.jpg", "images/s000_v012.png"] {
            fs::create_dir_all(target.join(foreign).parent().unwrap()).unwrap();
            fs::write(target.join(foreign), "years").unwrap();
            assert!(refused().is_some_and(|what| what.ends_with(foreign)), "{foreign}");
            fs::remove_file(target.join(foreign)).unwrap();
        }
        fs::write(target.join("transforms.json"), r#"{"frames": []}"#).unwrap();
        assert!(refused().is_some());
    }
}
