//! ScrewSplat: one folder a state with `images/*.png` (RGBA), `extrinsics/*.npy` (world-to-camera,
//! OpenCV), `intrinsic.npy`, and maybe `depths/` (.npy in scene units, .png in millimetres).

use super::numbers::{camera, files, image_size, pose_from_cv, rows, wrong};
use super::{Grid, Lens, MaskFrom, Shot, subfolders};
use crate::recording::images::read_npy;
use crate::{CaptureError, Split};
use std::path::Path;

pub(super) fn read(src: &Path) -> Result<Vec<Shot>, CaptureError> {
    let mut shots = Vec::new();
    let states = subfolders(src).into_iter().filter(|p| p.join("extrinsics").is_dir());
    for (state, folder) in states.enumerate() {
        let k_file = folder.join("intrinsic.npy");
        let k = rows::<3>(&read_npy(&k_file)?.0).ok_or_else(|| wrong(&k_file, "the array", "3x3 finite numbers"))?;
        let colors = files(&folder.join("images"), &["png", "jpg", "jpeg"]);
        let poses = files(&folder.join("extrinsics"), &["npy"]);
        if colors.len() != poses.len() {
            return Err(CaptureError::new(
                format!("{} images but {} extrinsics", colors.len(), poses.len()),
                folder.display().to_string(),
                "each image needs the pose of the same name",
            ));
        }
        let depths = files(&folder.join("depths"), &["npy", "png"]);
        for (i, (color, pose)) in colors.into_iter().zip(poses).enumerate() {
            let m = rows::<4>(&read_npy(&pose)?.0).ok_or_else(|| wrong(&pose, "the array", "4x4 finite numbers"))?;
            let camera_from_world = pose_from_cv(&m, &pose, "the array")?;
            let depth = depth_of(&depths, &color, i);
            let in_units = depth.as_ref().is_some_and(|d| d.extension().is_some_and(|e| e == "npy"));
            shots.push(Shot {
                state,
                split: Split::Train,
                camera: camera(&k, image_size(&color)?, camera_from_world),
                lens: Lens::default(),
                depth: depth.map(Grid::File),
                depth_scale: if in_units { 1.0 } else { 1e-3 },
                depth_least: 0.0,
                confidence: None,
                film_frame: None,
                mask: MaskFrom::Alpha,
                occluder: None,
                mask_ids: Vec::new(),
                occluded: false,
                time: None,
                color,
            });
        }
    }
    Ok(shots)
}

/// The depth file of the image's name, or else of its place in the list.
fn depth_of(depths: &[std::path::PathBuf], color: &Path, i: usize) -> Option<std::path::PathBuf> {
    depths.iter().find(|d| d.file_stem() == color.file_stem()).or(depths.get(i)).cloned()
}
