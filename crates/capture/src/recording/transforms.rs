//! Reads `transforms.json` into entries, one a frame, and keeps every problem it meets.

use super::Split;
use super::fields::Fields;
use crate::CaptureError;
use glam::{DMat4, DVec3};
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Pixels, before any check of their sense. Distortion is k1 k2 k3 k4 p1 p2 of OpenCV.
#[derive(Clone, Debug)]
pub(crate) struct Intrinsics {
    pub width: usize,
    pub height: usize,
    pub fx: f64,
    pub fy: f64,
    pub cx: f64,
    pub cy: f64,
    pub distortion: [f64; 6],
    pub fisheye: bool,
}

/// One element of `frames`, paths made absolute.
#[derive(Clone, Debug)]
pub(crate) struct Entry {
    /// Position in `frames`.
    pub index: usize,
    /// "transforms.json: frames[3]", for errors.
    pub place: String,
    pub intrinsics: Intrinsics,
    /// Camera-to-world, OpenGL axes, as the file has it.
    pub world_from_camera: DMat4,
    pub state: usize,
    pub view: Option<usize>,
    pub split: Split,
    pub color: PathBuf,
    pub depth: Option<PathBuf>,
    pub depth_scale: f64,
    pub mask: Option<PathBuf>,
    pub mask_ids: Vec<u16>,
    pub occluded: bool,
    pub occluder_mask: Option<PathBuf>,
    pub time: Option<f64>,
}

/// One `transforms.json`.
#[derive(Clone, Debug)]
pub(crate) struct Document {
    /// Folder of the recording (not of this file, where there is one file per state).
    pub root: PathBuf,
    pub file: PathBuf,
    pub value: Value,
    pub entries: Vec<Entry>,
    pub name: Option<String>,
    pub metric: bool,
    pub up: DVec3,
    pub registered: bool,
    /// What its maker was not sure of.
    pub doubts: Vec<String>,
    pub film: bool,
    pub problems: Vec<Problem>,
}

/// Something wrong, and the frame that it concerns: `check` offers to drop that.
#[derive(Clone, Debug)]
pub(crate) struct Problem {
    pub error: CaptureError,
    /// The `transforms.json` and the position in its `frames`.
    pub frame: Option<(PathBuf, usize)>,
}

/// Where a frame's state comes from when the frame does not say it.
#[derive(Clone, Copy)]
pub(crate) enum DefaultState {
    /// It must say it.
    None,
    Is(usize),
}

/// The documents of a recording: `transforms.json`, or one in each `state_<n>/`.
///
/// # Errors
/// When there is none or it is not JSON; what is wrong inside goes to [`Document::problems`].
pub(crate) fn read(path: &Path) -> Result<Vec<Document>, CaptureError> {
    let root = if path.is_file() { path.parent().unwrap_or(Path::new(".")) } else { path };
    let root = std::path::absolute(root).map_err(|e| CaptureError::read(path, e))?;
    let single = if path.is_file() { std::path::absolute(path).ok() } else { None };
    let single = single.unwrap_or_else(|| root.join("transforms.json"));
    if single.is_file() {
        return Ok(vec![parse(&root, &single, DefaultState::None)?]);
    }
    let folders = state_folders(&root);
    if folders.is_empty() {
        return Err(CaptureError::new(
            "there is no recording here: transforms.json is missing",
            single.display().to_string(),
            "point at a recording folder; other layouts go through: hingecast import SRC -o RECORDING",
        ));
    }
    folders
        .into_iter()
        .map(|(state, folder)| parse(&root, &folder.join("transforms.json"), DefaultState::Is(state)))
        .collect()
}

/// `state_<n>` folders with a transforms.json, by number.
fn state_folders(root: &Path) -> Vec<(usize, PathBuf)> {
    let number = |p: &Path| p.file_name()?.to_str()?.strip_prefix("state_")?.parse().ok();
    let entries = std::fs::read_dir(root).into_iter().flatten().flatten();
    let mut folders: Vec<(usize, PathBuf)> = entries
        .map(|e| e.path())
        .filter(|p| p.join("transforms.json").is_file())
        .filter_map(|p| Some((number(&p)?, p)))
        .collect();
    folders.sort();
    folders
}

pub(crate) fn parse(root: &Path, file: &Path, folder_state: DefaultState) -> Result<Document, CaptureError> {
    let text = std::fs::read_to_string(file).map_err(|e| CaptureError::read(file, e))?;
    let value = read_json(&text, file)?;
    let label = file.strip_prefix(root).unwrap_or(file).display().to_string();
    let Some(object) = value.as_object() else {
        let hint = "the file should be an object with the keys fl_x, fl_y, cx, cy, w, h, frames";
        return Err(CaptureError::new("transforms.json holds no JSON object", label, hint));
    };
    let top = Fields { object, inherits: None, place: label.clone() };
    let Some(list) = object.get("frames") else { return Err(top.missing("frames", "the list of pictures")) };
    let Some(list) = list.as_array() else { return Err(top.wrong("frames", list, "a list of objects")) };

    let mut problems = Vec::new();
    let mut keep = |r: Result<(), CaptureError>| problems.extend(r.err().map(|error| Problem { error, frame: None }));
    let mut document = Document {
        root: root.to_path_buf(),
        file: file.to_path_buf(),
        value: Value::Null,
        entries: Vec::new(),
        name: None,
        metric: false,
        up: DVec3::Z,
        registered: true,
        film: false,
        doubts: Vec::new(),
        problems: Vec::new(),
    };
    keep(top.text("name").map(|t| document.name = t.map(String::from)));
    keep(top.flag("metric").map(|m| document.metric = m.unwrap_or(false)));
    keep(top.flag("film").map(|f| document.film = f.unwrap_or(false)));
    keep(top.texts("doubts").map(|t| document.doubts.extend(t.into_iter().map(String::from))));
    keep(top.flag("registered").map(|r| document.registered = r.unwrap_or(true)));
    keep(top.numbers("up").and_then(|up| match up.map(DVec3::from_array).map(|u| (u, u.try_normalize())) {
        None => Ok(()),
        Some((_, Some(unit))) => {
            document.up = unit;
            Ok(())
        }
        Some(_) => Err(top.wrong("up", &object["up"], "a direction that is not zero")),
    }));
    let mut test = BTreeSet::new();
    keep(top.texts("test_filenames").map(|t| test.extend(t.into_iter().map(normal_name))));

    let folder = file.parent().unwrap_or(root);
    for (index, element) in list.iter().enumerate() {
        let place = format!("{label}: frames[{index}]");
        let result = match element.as_object() {
            Some(object_of_frame) => {
                let fields = Fields { object: object_of_frame, inherits: Some(object), place };
                entry(&fields, index, folder, folder_state, &test)
            }
            None => Err(top.wrong(&format!("frames[{index}]"), element, "an object")),
        };
        match result {
            Ok(e) => document.entries.push(e),
            Err(error) => problems.push(Problem { error, frame: Some((file.to_path_buf(), index)) }),
        }
    }
    document.problems = problems;
    document.value = value;
    Ok(document)
}

/// JSON, forgiving Python's NaN and Infinity: they become null, and the field that holds one is
/// named later.
fn read_json(text: &str, file: &Path) -> Result<Value, CaptureError> {
    let text = text.trim_start_matches('\u{feff}');
    let error = match serde_json::from_str(text) {
        Ok(value) => return Ok(value),
        Err(error) => error,
    };
    let without = text.replace("-Infinity", "null").replace("Infinity", "null").replace("NaN", "null");
    serde_json::from_str(&without).map_err(|_| {
        CaptureError::new(
            format!("the file is not JSON: {error}"),
            file.display().to_string(),
            "look at that line; a file cut short ends in the middle: copy or export it again",
        )
    })
}

fn entry(
    f: &Fields,
    index: usize,
    folder: &Path,
    folder_state: DefaultState,
    test: &BTreeSet<String>,
) -> Result<Entry, CaptureError> {
    let path = |key: &str| Ok::<_, CaptureError>(f.text(key)?.map(|p| resolve(folder, p)));
    let file_path = f.text("file_path")?.ok_or_else(|| f.missing("file_path", "the colour image"))?;
    let color = resolve(folder, file_path);
    let rows = f.matrix("transform_matrix")?.ok_or_else(|| f.missing("transform_matrix", "camera-to-world, 4x4"))?;
    let (depth, depth_scale) = depth(f, folder)?;
    let state = match (f.count("state")?, folder_state) {
        (Some(state), _) => state,
        (None, DefaultState::Is(state)) => state,
        (None, DefaultState::None) => {
            return Err(f.missing(
                "state",
                "which joint configuration the picture shows, from 0; `hingecast import` reads other tools' files",
            ));
        }
    };
    let split = if test.contains(&normal_name(file_path)) { Split::Test } else { Split::Train };
    Ok(Entry {
        index,
        place: f.place.clone(),
        intrinsics: intrinsics(f, &color)?,
        world_from_camera: DMat4::from_cols_array_2d(&rows).transpose(),
        state,
        view: f.count("view")?,
        split,
        depth,
        depth_scale,
        mask: path("mask_path")?,
        mask_ids: f.ids("mask_id")?,
        occluded: f.flag("occluded")?.unwrap_or(false),
        occluder_mask: path("occluder_mask_path")?,
        time: f.number("time")?,
        color,
    })
}

/// The depth file and the scene units of its unit: nerfstudio's keys, or those of instant-ngp and
/// NeRFCapture.
fn depth(f: &Fields, folder: &Path) -> Result<(Option<PathBuf>, f64), CaptureError> {
    let nerfstudio = f.text("depth_file_path")?;
    let scales: &[&str] = match nerfstudio {
        Some(_) => &["depth_unit_scale_factor"],
        None => &["integer_depth_scale", "depth_integer_scale", "depth_unit_scale_factor"],
    };
    let Some(path) = nerfstudio.or(f.text("depth_path")?) else { return Ok((None, 1e-3)) };
    let key = scales.iter().find(|key| f.get(key).is_some());
    let Some(key) = key else {
        // nerfstudio has a default, instant-ngp has none.
        let none = f.missing("integer_depth_scale", "metres per unit of the files of depth_path");
        return if nerfstudio.is_some() { Ok((Some(resolve(folder, path)), 1e-3)) } else { Err(none) };
    };
    let scale = f.number(key)?.unwrap_or(0.0);
    if scale <= 0.0 {
        let value = f.get(key).cloned().unwrap_or_default();
        return Err(f.wrong(key, &value, "a number above 0 (0.001 for millimetres)"));
    }
    Ok((Some(resolve(folder, path)), scale))
}

/// nerfstudio's keys; also `camera_angle_x` of the older NeRF layout. Without w and h the image
/// itself is asked.
fn intrinsics(f: &Fields, color: &Path) -> Result<Intrinsics, CaptureError> {
    let (width, height) = match (f.count("w")?, f.count("h")?) {
        (Some(w), Some(h)) => (w, h),
        _ => {
            let (w, h) = image::image_dimensions(color).map_err(|e| {
                let place = format!("{}: no w and h, and {} does not tell them: {e}", f.place, color.display());
                CaptureError::new("the image size is unknown", place, "add w and h, the image size in pixels")
            })?;
            (w as usize, h as usize)
        }
    };
    let (w, h) = (width as f64, height as f64);
    let from_angle = |angle: Option<f64>, size: f64| angle.map(|a| 0.5 * size / (0.5 * a).tan());
    let fx = match f.number("fl_x")? {
        Some(fx) => fx,
        None => {
            from_angle(f.number("camera_angle_x")?, w).ok_or_else(|| f.missing("fl_x", "focal length in pixels"))?
        }
    };
    let fy = f.number("fl_y")?.or(from_angle(f.number("camera_angle_y")?, h)).unwrap_or(fx);
    let mut distortion = [0.0; 6];
    for (slot, key) in distortion.iter_mut().zip(["k1", "k2", "k3", "k4", "p1", "p2"]) {
        *slot = f.number(key)?.unwrap_or(0.0);
    }
    let model = f.text("camera_model")?.unwrap_or("OPENCV");
    let fisheye = model == "OPENCV_FISHEYE";
    match model {
        // COLMAP's models with one and two radial terms: what else the file holds is not theirs.
        "SIMPLE_RADIAL" => distortion[1..].fill(0.0),
        "RADIAL" => distortion[2..].fill(0.0),
        _ => {}
    }
    let known =
        ["OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "pinhole", "perspective", "OPENCV_FISHEYE"];
    if !known.contains(&model) {
        let wrong = f.wrong("camera_model", &Value::String(model.into()), "PINHOLE or OPENCV");
        return Err(CaptureError { what: format!("the camera model {model} is unknown"), ..wrong });
    }
    let (cx, cy) = (f.number("cx")?.unwrap_or(0.5 * w), f.number("cy")?.unwrap_or(0.5 * h));
    Ok(Intrinsics { width, height, fx, fy, cx, cy, distortion, fisheye })
}

/// Absolute path; the older NeRF layout leaves ".png" away, NeRFCapture either ending.
fn resolve(folder: &Path, name: &str) -> PathBuf {
    let mut path = folder.join(name.strip_prefix("./").unwrap_or(name));
    // Written on Windows, unless a file is really called so.
    if name.contains('\\') && !path.exists() {
        path = folder.join(normal_name(&name.replace('\\', "/")));
    }
    if path.extension().is_some() {
        return path;
    }
    let endings = ["png", "jpg", "jpeg"].map(|ending| path.with_extension(ending));
    let there = endings.iter().find(|p| p.is_file()).unwrap_or(&endings[0]);
    there.clone()
}

/// File names compare without "./" and with forward slashes.
fn normal_name(name: &str) -> String {
    name.strip_prefix("./").unwrap_or(name).replace('\\', "/")
}
