//! PARIS: `{start,end}/camera_{train,val,test}.json` = {"K": 3x3, "0000": 4x4 camera-to-world
//! OpenGL, ...} and RGBA images in `{start,end}/{train,val,test}/`. Its reader forces the principal
//! point to the middle, so does this one.

use super::numbers::{image_size, json, matrix, pose_from_gl, with_image_ending, wrong};
use super::{Lens, MaskFrom, Shot};
use crate::{CaptureError, Split};
use hingecast_geom::Camera;
use std::path::Path;

pub(super) fn read(src: &Path) -> Result<Vec<Shot>, CaptureError> {
    let mut shots = Vec::new();
    for (state, name) in ["start", "end"].into_iter().enumerate() {
        for (part, split) in [("train", Split::Train), ("val", Split::Test), ("test", Split::Test)] {
            let file = src.join(name).join(format!("camera_{part}.json"));
            if !file.is_file() {
                continue;
            }
            let value = json(&file)?;
            let k = matrix::<3>(&value["K"]).ok_or_else(|| wrong(&file, "K", "a 3x3 matrix of finite numbers"))?;
            let frames = value.as_object().ok_or_else(|| wrong(&file, "the file", "an object"))?;
            // Keys of the JSON map are sorted: 0000, 0001, ...
            for (key, m) in frames.iter().filter(|(key, _)| *key != "K") {
                let m = matrix::<4>(m).ok_or_else(|| wrong(&file, key, "a 4x4 matrix of finite numbers"))?;
                let camera_from_world = pose_from_gl(&m, &file, key)?;
                let color = with_image_ending(src.join(name).join(part).join(key));
                let (width, height) = image_size(&color)?;
                let (cx, cy) = (0.5 * width as f64, 0.5 * height as f64);
                shots.push(Shot {
                    state,
                    split,
                    camera: Camera { width, height, fx: k[0][0], fy: k[1][1], cx, cy, camera_from_world },
                    lens: Lens::default(),
                    color,
                    depth: None,
                    depth_scale: 1e-3,
                    depth_least: 0.0,
                    confidence: None,
                    film_frame: None,
                    mask: MaskFrom::Alpha,
                    occluder: None,
                    mask_ids: Vec::new(),
                    occluded: false,
                    time: None,
                });
            }
        }
    }
    Ok(shots)
}
