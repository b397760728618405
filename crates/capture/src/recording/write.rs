//! Writing a native recording's `transforms.json`; the images are written by whoever makes them.

use super::{Frame, Recording, Split, gl_from_camera, images};
use crate::CaptureError;
use serde_json::{Map, Value, json};
use std::path::Path;

impl Recording {
    /// Writes `transforms.json` into `self.root` from the frames; image paths are written relative
    /// to the root. Intrinsics that all frames share stand once at the top, as nerfstudio writes
    /// them.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write(&self) -> Result<(), CaptureError> {
        let shared = self.frames.first().filter(|first| {
            let first = intrinsics(first);
            self.frames.iter().all(|f| intrinsics(f) == first)
        });
        let mut top = shared.map(intrinsics).unwrap_or_default();
        top.insert("camera_model".into(), json!("PINHOLE"));
        top.insert("name".into(), json!(self.name));
        top.insert("metric".into(), json!(self.metric));
        top.insert("up".into(), json!(self.up.to_array()));
        if !self.registered {
            top.insert("registered".into(), json!(false));
        }
        if !self.doubts.is_empty() {
            top.insert("doubts".into(), json!(self.doubts));
        }
        if self.film {
            top.insert("film".into(), json!(true));
        }
        let names =
            |split| self.frames.iter().filter(|f| f.split == split).map(|f| relative(&self.root, &f.color)).collect();
        let (train, test): (Vec<String>, Vec<String>) = (names(Split::Train), names(Split::Test));
        if !test.is_empty() {
            top.insert("train_filenames".into(), json!(train));
            top.insert("test_filenames".into(), json!(test));
        }
        let frames = self.frames.iter().map(|f| frame(&self.root, f, shared.is_none())).collect();
        top.insert("frames".into(), Value::Array(frames));
        let text = serde_json::to_vec_pretty(&top).map_err(|e| CaptureError::write(&self.root, e))?;
        images::write_file(&self.root.join("transforms.json"), &text)
    }
}

fn intrinsics(f: &Frame) -> Map<String, Value> {
    let c = &f.camera;
    let pairs: [(&str, Value); 6] = [
        ("w", json!(c.width)),
        ("h", json!(c.height)),
        ("fl_x", json!(c.fx)),
        ("fl_y", json!(c.fy)),
        ("cx", json!(c.cx)),
        ("cy", json!(c.cy)),
    ];
    pairs.map(|(k, v)| (k.to_string(), v)).into_iter().collect()
}

fn frame(root: &Path, f: &Frame, own_intrinsics: bool) -> Value {
    let mut out = if own_intrinsics { intrinsics(f) } else { Map::new() };
    let rows = gl_from_camera(&f.camera.camera_from_world).transpose().to_cols_array_2d();
    out.insert("file_path".into(), json!(relative(root, &f.color)));
    out.insert("state".into(), json!(f.state));
    out.insert("view".into(), json!(f.view));
    out.insert("transform_matrix".into(), json!(rows));
    let mut path = |key: &str, p: &Option<std::path::PathBuf>| {
        if let Some(p) = p {
            out.insert(key.into(), json!(relative(root, p)));
        }
    };
    path("depth_file_path", &f.depth);
    path("mask_path", &f.mask);
    path("occluder_mask_path", &f.occluder_mask);
    if !f.mask_ids.is_empty() {
        out.insert("mask_id".into(), json!(f.mask_ids));
    }
    if f.depth.is_some() {
        out.insert("depth_unit_scale_factor".into(), json!(f.depth_scale));
    }
    if f.occluded {
        out.insert("occluded".into(), json!(true));
    }
    if let Some(time) = f.time {
        out.insert("time".into(), json!(time));
    }
    Value::Object(out)
}

fn relative(root: &Path, path: &Path) -> String {
    path.strip_prefix(root).unwrap_or(path).to_string_lossy().replace('\\', "/")
}
