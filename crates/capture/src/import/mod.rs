//! Other layouts of the field into native recordings.
//!
//! Each layout's file lists its pictures as `Shot`s; `store` decodes, undistorts, brings depth and
//! mask to the colour's size and writes them. World frame and scale stay the source's.

mod artgs;
mod dta;
mod dynamic3dgs;
mod lens;
mod nerfstudio;
mod numbers;
mod paris;
mod screwsplat;
mod store;

use crate::{CaptureError, Split};
use glam::DVec3;
use hingecast_geom::{Camera, Progress};
use lens::Lens;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// A layout that can be imported.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Format {
    /// Find out from the files.
    #[default]
    Auto,
    /// `transforms.json`, also of Polycam, Record3D and KIRI; folders with one each are states.
    Nerfstudio,
    /// ArtGS, GEAR, REArtGS++, MPArt-90: `transforms_train_start.json` and so on.
    Artgs,
    /// `cam_K.txt`, `init_keyframes.yml`.
    Dta,
    /// `start/camera_train.json` and so on.
    Paris,
    /// `<state>/{images,extrinsics,intrinsic.npy}`.
    Screwsplat,
    /// `train_meta.json`, `ims/`, `seg/`.
    Dynamic3dgs,
}

impl Format {
    /// Every format with its name on the command line.
    pub const ALL: [(&'static str, Format); 7] = [
        ("auto", Format::Auto),
        ("nerfstudio", Format::Nerfstudio),
        ("artgs", Format::Artgs),
        ("dta", Format::Dta),
        ("paris", Format::Paris),
        ("screwsplat", Format::Screwsplat),
        ("dynamic3dgs", Format::Dynamic3dgs),
    ];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(_, f)| *f == self).map_or("auto", |(name, _)| name)
    }

    /// The format of a name on the command line.
    ///
    /// # Errors
    /// When there is no such format.
    pub fn from_name(name: &str) -> Result<Self, CaptureError> {
        let known = Self::ALL.iter().find(|(n, _)| *n == name).map(|(_, f)| *f);
        known.ok_or_else(|| {
            let names = Self::ALL.map(|(n, _)| n).join(", ");
            CaptureError::new("there is no such format", format!("--format {name}"), format!("use one of {names}"))
        })
    }
}

/// What was imported.
#[derive(Clone, Debug)]
pub struct ImportReport {
    /// Folder of the native recording.
    pub recording: PathBuf,
    /// The layout that was read; never [`Format::Auto`].
    pub format: Format,
    /// How many joint states it has.
    pub states: usize,
    /// How many frames it has, over all states.
    pub frames: usize,
}

/// One picture of a source, geometry converted to our conventions, pixels not read yet.
#[derive(Clone, Debug)]
pub(crate) struct Shot {
    pub state: usize,
    pub split: Split,
    /// Pinhole part, OpenCV axes. Width and height 0: take the colour image's.
    pub camera: Camera,
    pub lens: Lens,
    pub color: PathBuf,
    pub depth: Option<PathBuf>,
    /// Scene units per stored unit; depths below `depth_least` (scene units) are invalid.
    pub depth_scale: f64,
    pub depth_least: f64,
    pub mask: MaskFrom,
    /// Pixels that a hand hides.
    pub occluder: Option<PathBuf>,
    /// The person hides the object.
    pub occluded: bool,
    pub time: Option<f64>,
}

/// All pictures of a source, and what it says about its world.
pub(crate) struct Source {
    pub shots: Vec<Shot>,
    /// Lengths are metres.
    pub metric: bool,
    /// Unit vector.
    pub up: DVec3,
}

impl From<Vec<Shot>> for Source {
    /// Layouts that say nothing of scale and up.
    fn from(shots: Vec<Shot>) -> Self {
        Self { shots, metric: false, up: DVec3::Z }
    }
}

/// Where the object's mask comes from.
#[derive(Clone, Debug)]
pub(crate) enum MaskFrom {
    /// The colour image's alpha, if it has one.
    Alpha,
    File(PathBuf),
}

/// Converts `src` into a native recording at `out`.
///
/// # Errors
/// When the layout is not recognised, or a file of it is missing or broken.
pub fn import(src: &Path, out: &Path, format: Format, progress: &Progress) -> Result<ImportReport, CaptureError> {
    let format = if format == Format::Auto { detect(src)? } else { format };
    let source: Source = match format {
        Format::Auto | Format::Nerfstudio => nerfstudio::read(src)?,
        Format::Artgs => artgs::read(src)?.into(),
        Format::Dta => dta::read(src)?.into(),
        Format::Paris => paris::read(src)?.into(),
        Format::Screwsplat => screwsplat::read(src)?.into(),
        Format::Dynamic3dgs => dynamic3dgs::read(src)?.into(),
    };
    if !source.shots.iter().any(|s| s.split == Split::Train) {
        let hint = "check that the folder is complete, or name another --format";
        return Err(CaptureError::new(
            format!("no training pictures were found for the layout {}", format.name()),
            src.display().to_string(),
            hint,
        ));
    }
    let name = src.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_else(|| "recording".into());
    let recording = store::store(&source, &name, out, progress)?;
    Ok(ImportReport {
        recording: recording.root.clone(),
        format,
        states: recording.n_states,
        frames: recording.frames.len(),
    })
}

/// The layout of a folder, by the files that only it has.
///
/// # Errors
/// When none fits.
pub fn detect(src: &Path) -> Result<Format, CaptureError> {
    let has = |name: &str| src.join(name).exists();
    let subfolders = subfolders(src);
    let any_sub = |name: &str| subfolders.iter().any(|p| p.join(name).exists());
    if has("transforms_train_start.json") || has("transforms_train_end.json") {
        Ok(Format::Artgs)
    } else if has("cam_K.txt") || has("init_keyframes.yml") {
        Ok(Format::Dta)
    } else if has("start/camera_train.json") || has("end/camera_train.json") {
        Ok(Format::Paris)
    } else if has("train_meta.json") {
        Ok(Format::Dynamic3dgs)
    } else if any_sub("extrinsics") {
        Ok(Format::Screwsplat)
    } else if has("transforms.json") || any_sub("transforms.json") || src.is_file() {
        Ok(Format::Nerfstudio)
    } else {
        Err(CaptureError::new(
            "the layout is not recognised",
            src.display().to_string(),
            "known layouts: nerfstudio, ArtGS, DTA, PARIS, ScrewSplat, Dynamic 3D Gaussians; point at the folder that holds their json",
        ))
    }
}

/// Folders inside `src`; those named by numbers in numeric order, then the others by name.
fn subfolders(src: &Path) -> Vec<PathBuf> {
    let mut found: Vec<PathBuf> =
        std::fs::read_dir(src).into_iter().flatten().flatten().map(|e| e.path()).filter(|p| p.is_dir()).collect();
    let number = |p: &PathBuf| {
        let name = p.file_name()?.to_str()?;
        name.trim_start_matches(|c: char| !c.is_ascii_digit()).parse::<u64>().ok()
    };
    found.sort_by_key(|p| (number(p).unwrap_or(u64::MAX), p.clone()));
    found
}
