//! BOP, one scene: `scene_camera.json` (per picture `cam_K` row by row, `depth_scale`, `cam_R_w2c`,
//! `cam_t_w2c`), `rgb/` or `gray/`, `depth/` (16-bit PNG; value x depth_scale = mm),
//! `mask_visib/<picture>_<object>.png`. World-to-camera, OpenCV axes, mm; pixel centres at whole
//! numbers.
//!
//! Scenes without `cam_R_w2c` hold still objects before a camera that moved: if `scene_gt.json` has
//! one object that is in every picture once - a marker, say -, its frame is the world, and its mask
//! is no part of the object.

use super::grid::Grid;
use super::numbers::{camera, image_size, json, matrix, pose_from_cv, with_image_ending, wrong};
use super::{MaskFrom, Shot, Source};
use crate::CaptureError;
use hingecast_geom::Pose;
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

pub(super) fn read(src: &Path) -> Result<Source, CaptureError> {
    let file = src.join("scene_camera.json");
    let cameras = by_number(&json(&file)?, &file)?;
    let truth_file = src.join("scene_gt.json");
    let truth = if truth_file.is_file() { by_number(&json(&truth_file)?, &truth_file)? } else { BTreeMap::new() };
    let says_pose = cameras.values().all(|c| c.get("cam_R_w2c").is_some());
    let marker = if says_pose { None } else { Some(marker(&cameras, &truth, &file)?) };

    let mut source = Source { metric: true, ..Vec::new().into() };
    for (n, about) in &cameras {
        let key = |name: &str| format!("\"{n}\".{name}");
        let k = matrix::<3>(&about["cam_K"]).ok_or_else(|| wrong(&file, &key("cam_K"), "nine numbers"))?;
        let camera_from_world = match marker {
            None => pose(&about["cam_R_w2c"], &about["cam_t_w2c"], &file, &key("cam_R_w2c, cam_t_w2c"))?,
            Some(id) => {
                let seen = objects(&truth[n]).find(|o| o["obj_id"].as_u64() == Some(id)).unwrap_or(&Value::Null);
                pose(&seen["cam_R_m2c"], &seen["cam_t_m2c"], &truth_file, &key("cam_R_m2c, cam_t_m2c"))?
            }
        };
        let picture =
            |folder: &str| Some(with_image_ending(src.join(folder).join(format!("{n:06}")))).filter(|p| p.is_file());
        let Some(color) = picture("rgb").or_else(|| picture("gray")) else {
            let what = format!("the picture {n:06} is missing");
            return Err(CaptureError::new(
                what,
                src.join("rgb").display().to_string(),
                "PNG and JPEG are read: convert .tif",
            ));
        };
        let mut camera = camera(&k, image_size(&color)?, camera_from_world);
        (camera.cx, camera.cy) = (camera.cx + 0.5, camera.cy + 0.5);
        let units = about["depth_scale"].as_f64().filter(|s| *s > 0.0);
        let depth = picture("depth");
        if depth.is_some() && units.is_none() {
            return Err(wrong(&file, &key("depth_scale"), "millimetres per stored unit"));
        }
        source.shots.push(Shot {
            depth: depth.map(Grid::File),
            depth_scale: 1e-3 * units.unwrap_or(1.0),
            mask: masks(src, *n, truth.get(n), marker),
            ..Shot::of(camera, color)
        });
    }
    if let Some(id) = marker {
        source.notes.push(format!("no cam_R_w2c: the frame of object {id}, which every picture shows, is the world"));
    }
    source.notes.push("BOP does not say what is up: z is taken (\"up\" in transforms.json)".into());
    Ok(source)
}

/// {"0": ..., "1": ...} in the order of the numbers.
fn by_number(value: &Value, file: &Path) -> Result<BTreeMap<usize, Value>, CaptureError> {
    let object: &Map<String, Value> = value.as_object().ok_or_else(|| wrong(file, "the file", "an object"))?;
    let entry = |(key, v): (&String, &Value)| {
        Ok((key.parse().map_err(|_| wrong(file, key, "the number of a picture"))?, v.clone()))
    };
    object.iter().map(entry).collect()
}

/// 3x3 numbers and three, millimetres.
fn pose(rotation: &Value, place: &Value, file: &Path, key: &str) -> Result<Pose, CaptureError> {
    let r = matrix::<3>(rotation).ok_or_else(|| wrong(file, key, "nine numbers and three"))?;
    let t: Vec<f64> = place.as_array().map(|a| a.iter().filter_map(Value::as_f64).collect()).unwrap_or_default();
    let [x, y, z] = t[..] else { return Err(wrong(file, key, "nine numbers and three")) };
    let row = |k: usize, t: f64| [r[k][0], r[k][1], r[k][2], 1e-3 * t];
    pose_from_cv(&[row(0, x), row(1, y), row(2, z), [0.0, 0.0, 0.0, 1.0]], file, key)
}

fn objects(entry: &Value) -> impl Iterator<Item = &Value> {
    entry.as_array().into_iter().flatten()
}

/// The one object that each picture shows once.
fn marker(cameras: &BTreeMap<usize, Value>, truth: &BTreeMap<usize, Value>, file: &Path) -> Result<u64, CaptureError> {
    let mut counts = BTreeMap::<u64, usize>::new();
    let once = |n: &usize, id: u64| {
        truth.get(n).is_some_and(|e| objects(e).filter(|o| o["obj_id"].as_u64() == Some(id)).count() == 1)
    };
    for object in cameras.keys().next().and_then(|n| truth.get(n)).into_iter().flat_map(objects) {
        if let Some(id) = object["obj_id"].as_u64() {
            counts.insert(id, cameras.keys().filter(|n| once(n, id)).count());
        }
    }
    let everywhere: Vec<u64> = counts.into_iter().filter(|(_, c)| *c == cameras.len()).map(|(id, _)| id).collect();
    match everywhere[..] {
        [id] => Ok(id),
        _ => Err(CaptureError::new(
            format!(
                "the cameras have no poses, and {} objects of scene_gt.json could stand for the world",
                everywhere.len()
            ),
            format!("{}: cam_R_w2c, cam_t_w2c", file.display()),
            "leave in scene_gt.json only what stands still and is in every picture, such as a marker",
        )),
    }
}

/// All visible masks of a picture but the marker's.
fn masks(src: &Path, n: usize, truth: Option<&Value>, marker: Option<u64>) -> MaskFrom {
    let is_marker = |k: usize| marker.is_some() && truth.is_some_and(|t| t[k]["obj_id"].as_u64() == marker);
    let mut files: Vec<PathBuf> = Vec::new();
    for k in 0.. {
        let file = src.join("mask_visib").join(format!("{n:06}_{k:06}.png"));
        if !file.is_file() {
            break;
        }
        if !is_marker(k) {
            files.push(file);
        }
    }
    if files.is_empty() { MaskFrom::Alpha } else { MaskFrom::Any(files) }
}
