//! Dynamic 3D Gaussians: `{train,test}_meta.json` = {w, h, k[t][c] 3x3, w2c[t][c] 4x4 (OpenCV),
//! fn[t][c]}, `ims/<fn>`, `seg/<fn>.png` with 1 = object. Each time step is a state.

use super::numbers::{camera, json, matrix, pose_from_cv, wrong};
use super::{Lens, MaskFrom, Shot};
use crate::{CaptureError, Split};
use std::path::Path;

pub(super) fn read(src: &Path) -> Result<Vec<Shot>, CaptureError> {
    let mut shots = Vec::new();
    for (name, split) in [("train_meta.json", Split::Train), ("test_meta.json", Split::Test)] {
        let file = src.join(name);
        if !file.is_file() {
            continue;
        }
        let value = json(&file)?;
        let size = |key: &str| value[key].as_u64().ok_or_else(|| wrong(&file, key, "a number of pixels"));
        let size = (size("w")? as usize, size("h")? as usize);
        let steps = value["fn"].as_array().ok_or_else(|| wrong(&file, "fn", "a list of lists of file names"))?;
        for (t, names) in steps.iter().enumerate() {
            let names = names.as_array().ok_or_else(|| wrong(&file, &format!("fn[{t}]"), "a list of file names"))?;
            for (c, name) in names.iter().enumerate() {
                let key = |what: &str| format!("{what}[{t}][{c}]");
                let name = name.as_str().ok_or_else(|| wrong(&file, &key("fn"), "a file name"))?;
                let k = matrix::<3>(&value["k"][t][c]).ok_or_else(|| wrong(&file, &key("k"), "a 3x3 matrix"))?;
                let m = matrix::<4>(&value["w2c"][t][c]).ok_or_else(|| wrong(&file, &key("w2c"), "a 4x4 matrix"))?;
                let camera_from_world = pose_from_cv(&m, &file, &key("w2c"))?;
                let seg = src.join("seg").join(name).with_extension("png");
                shots.push(Shot {
                    state: t,
                    split,
                    camera: camera(&k, size, camera_from_world),
                    lens: Lens::default(),
                    color: src.join("ims").join(name),
                    depth: None,
                    depth_scale: 1e-3,
                    depth_least: 0.0,
                    confidence: None,
                    film_frame: None,
                    mask: if seg.is_file() { MaskFrom::File(seg) } else { MaskFrom::Alpha },
                    occluder: None,
                    mask_ids: Vec::new(),
                    occluded: false,
                    time: Some(t as f64),
                });
            }
        }
    }
    Ok(shots)
}
