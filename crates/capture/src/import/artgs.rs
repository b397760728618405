//! ArtGS and its family: `transforms_{train,test}_{start,end}.json` in NeRF's older layout, poses
//! camera-to-world with OpenGL axes, principal point in the middle; `rgba/` images with alpha,
//! `depth/` beside them in millimetres.

use super::numbers::{image_size, json, matrix, pose_from_gl, with_image_ending, wrong};
use super::{Grid, Lens, MaskFrom, Shot};
use crate::{CaptureError, Split};
use hingecast_geom::Camera;
use std::path::{Path, PathBuf};

/// Below this depth [m] the layout's own readers call a pixel invalid.
const LEAST_DEPTH: f64 = 0.1;

pub(super) fn read(src: &Path) -> Result<Vec<Shot>, CaptureError> {
    let mut shots = Vec::new();
    for (state, name) in ["start", "end"].into_iter().enumerate() {
        for (part, split) in [("train", Split::Train), ("val", Split::Test), ("test", Split::Test)] {
            let file = src.join(format!("transforms_{part}_{name}.json"));
            if file.is_file() {
                read_file(src, &file, state, split, &mut shots)?;
            }
        }
    }
    Ok(shots)
}

fn read_file(src: &Path, file: &Path, state: usize, split: Split, shots: &mut Vec<Shot>) -> Result<(), CaptureError> {
    let value = json(file)?;
    let angle = |key: &str| value[key].as_f64().filter(|a| *a > 0.0 && *a < std::f64::consts::PI);
    let angle_x = angle("camera_angle_x").ok_or_else(|| wrong(file, "camera_angle_x", "an angle in radians"))?;
    let frames = value["frames"].as_array().ok_or_else(|| wrong(file, "frames", "a list"))?;
    for (i, frame) in frames.iter().enumerate() {
        let key = |name: &str| format!("frames[{i}].{name}");
        let path = frame["file_path"].as_str().ok_or_else(|| wrong(file, &key("file_path"), "a file name"))?;
        let color = with_image_ending(src.join(path.trim_start_matches("./")));
        let m = matrix::<4>(&frame["transform_matrix"])
            .ok_or_else(|| wrong(file, &key("transform_matrix"), "a 4x4 matrix of finite numbers"))?;
        let camera_from_world = pose_from_gl(&m, file, &key("transform_matrix"))?;
        let (width, height) = image_size(&color)?;
        let focal = |size: usize, a: f64| 0.5 * size as f64 / (0.5 * a).tan();
        let fx = focal(width, angle_x);
        let fy = angle("camera_angle_y").map_or(fx, |a| focal(height, a));
        let (cx, cy) = (0.5 * width as f64, 0.5 * height as f64);
        shots.push(Shot {
            // The file name tells start from end; `time` says the same, 0 or 1.
            state: frame["time"].as_f64().filter(|t| *t == 0.0 || *t == 1.0).map_or(state, |t| t as usize),
            split,
            camera: Camera { width, height, fx, fy, cx, cy, camera_from_world },
            lens: Lens::default(),
            depth: beside(&color, "depth").map(Grid::File),
            depth_scale: 1e-3,
            depth_least: LEAST_DEPTH,
            confidence: None,
            film_frame: None,
            mask: beside(&color, "mask").map_or(MaskFrom::Alpha, MaskFrom::File),
            occluder: None,
            mask_ids: Vec::new(),
            occluded: false,
            time: None,
            color,
        });
    }
    Ok(())
}

/// `.../depth/0000.png` of `.../rgba/0000.png`, when it is there.
fn beside(color: &Path, folder: &str) -> Option<PathBuf> {
    let stem = color.file_stem()?;
    let path = color.parent()?.parent()?.join(folder).join(stem).with_extension("png");
    path.is_file().then_some(path)
}
