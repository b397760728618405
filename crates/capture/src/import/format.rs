//! The layouts that can be imported: their names, and how each is told from the others.

use super::numbers::numbered;
use super::subfolders;
use super::{colmap, foreign};
use crate::CaptureError;
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
    /// Record3D's "EXR + RGBD" or .r3d: `metadata.json`, `rgb/`, `depth/`; or `metadata`, `rgbd/`.
    Record3d,
    /// 3D Scanner App's "All Data": `frame_00000.json`, `depth_00000.png`.
    Scanner3d,
    /// Stray Scanner: `odometry.csv`, `rgb.mp4`, `depth/`.
    Stray,
    /// Polycam's raw data: `keyframes/`.
    Polycam,
    /// COLMAP's sparse model, text or binary, with `images/` and `depth/`.
    Colmap,
    /// A scene of BOP: `scene_camera.json`.
    Bop,
    /// TUM RGB-D: `rgb.txt`, `depth.txt`, `groundtruth.txt`.
    Tum,
}

impl Format {
    /// Every format with its name on the command line.
    pub const ALL: [(&'static str, Format); 14] = [
        ("auto", Format::Auto),
        ("nerfstudio", Format::Nerfstudio),
        ("artgs", Format::Artgs),
        ("dta", Format::Dta),
        ("paris", Format::Paris),
        ("screwsplat", Format::Screwsplat),
        ("dynamic3dgs", Format::Dynamic3dgs),
        ("record3d", Format::Record3d),
        ("scanner3d", Format::Scanner3d),
        ("stray", Format::Stray),
        ("polycam", Format::Polycam),
        ("colmap", Format::Colmap),
        ("bop", Format::Bop),
        ("tum", Format::Tum),
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

/// The layout of a folder, by the files that only it has.
///
/// # Errors
/// When none fits.
pub fn detect(src: &Path) -> Result<Format, CaptureError> {
    known(src).ok_or_else(|| {
        let parts: Vec<_> = subfolders(src).into_iter().filter(|p| known(p).is_some()).collect();
        if parts.len() > 1 {
            let list = parts.iter().take(3).map(|p| p.display().to_string()).collect::<Vec<_>>().join(" ");
            let more = if parts.len() > 3 { " ..." } else { "" };
            return CaptureError::new(
                format!("the folder holds {} recordings", parts.len()),
                src.display().to_string(),
                format!(
                    "give each as a source, in the order of the states: hingecast import {list}{more} -o RECORDING"
                ),
            );
        }
        if let Some(error) = foreign::inside(src) {
            return error;
        }
        let names: Vec<&str> = Format::ALL[1..].iter().map(|(name, _)| *name).collect();
        CaptureError::new(
            "the layout is not recognised",
            src.display().to_string(),
            format!("known layouts: {}; point at the folder that holds their files", names.join(", ")),
        )
    })
}

pub(super) fn known(src: &Path) -> Option<Format> {
    let has = |name: &str| src.join(name).exists();
    let subfolders = subfolders(src);
    let any_sub = |name: &str| subfolders.iter().any(|p| p.join(name).exists());
    if has("transforms_train_start.json") || has("transforms_train_end.json") {
        Some(Format::Artgs)
    } else if has("cam_K.txt") || has("init_keyframes.yml") {
        Some(Format::Dta)
    } else if has("start/camera_train.json") || has("end/camera_train.json") {
        Some(Format::Paris)
    } else if has("train_meta.json") {
        Some(Format::Dynamic3dgs)
    } else if any_sub("extrinsics") {
        Some(Format::Screwsplat)
    } else if has("metadata.json") && has("rgb") || has("metadata") && has("rgbd") {
        Some(Format::Record3d)
    } else if has("frame_00000.json") || !numbered_frames(src).is_empty() {
        Some(Format::Scanner3d)
    } else if has("odometry.csv") {
        Some(Format::Stray)
    } else if has("keyframes/corrected_cameras") || has("keyframes/cameras") || has("corrected_cameras") {
        Some(Format::Polycam)
    } else if has("scene_camera.json") {
        Some(Format::Bop)
    } else if has("groundtruth.txt") && (has("rgb.txt") || has("associations.txt")) {
        Some(Format::Tum)
    } else if has("transforms.json") || any_sub("transforms.json") || src.is_file() {
        Some(Format::Nerfstudio)
    } else if colmap::model_folder(src).is_some() {
        Some(Format::Colmap)
    } else {
        None
    }
}

/// 3D Scanner App's descriptions of frames; the first ones may have been taken away.
fn numbered_frames(src: &Path) -> Vec<(usize, PathBuf)> {
    let mut frames = numbered(src, &["json"]);
    let ours = |p: &Path| p.file_name().and_then(|n| n.to_str()).is_some_and(|n| n.starts_with("frame_"));
    frames.retain(|(_, p)| ours(p) && p.with_extension("jpg").is_file());
    frames
}
