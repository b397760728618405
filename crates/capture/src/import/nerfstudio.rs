//! nerfstudio: `transforms.json`; for several states one folder each with a `transforms.json`, or
//! frames with our `state` or a `time` of a few values. `applied_transform` is in the poses
//! already.

use super::{Grid, Lens, MaskFrom, Shot, Source, numbers, subfolders};
use crate::CaptureError;
use crate::recording::camera_from_gl;
use crate::recording::transforms::{self, DefaultState, Document};
use glam::DVec3;
use hingecast_geom::Camera;
use std::collections::BTreeMap;
use std::path::Path;

/// More different times than this are a film, not states: no method takes more states.
const MOST_STATES: usize = 64;
/// With fewer pictures a time than this, the times are those of a film, too.
const LEAST_VIEWS: usize = 3;

/// `one_state`: the source is one of several; a film is then one state.
pub(super) fn read(src: &Path, one_state: bool) -> Result<Source, CaptureError> {
    let single = if src.is_file() { src.to_path_buf() } else { src.join("transforms.json") };
    let documents: Vec<Document> = if single.is_file() {
        vec![transforms::parse(src, &single, DefaultState::Is(0))?]
    } else {
        let files = subfolders(src).into_iter().map(|p| p.join("transforms.json")).filter(|p| p.is_file());
        files.enumerate().map(|(s, f)| transforms::parse(src, &f, DefaultState::Is(s))).collect::<Result<_, _>>()?
    };
    let mut shots = Vec::new();
    for d in &documents {
        if let Some(problem) = d.problems.first() {
            return Err(problem.error.clone());
        }
        let says_state = d.value["frames"].as_array().is_some_and(|f| f.iter().any(|f| f.get("state").is_some()));
        let times = match states_by_time(d) {
            _ if says_state || documents.len() > 1 => BTreeMap::new(),
            Err(_) if one_state => BTreeMap::new(),
            times => times?,
        };
        for e in &d.entries {
            let i = &e.intrinsics;
            let camera_from_world = camera_from_gl(&e.world_from_camera, &e.place)?;
            let [k1, k2, k3, k4, p1, p2] = i.distortion;
            let (width, height, fx, fy, cx, cy) = (i.width, i.height, i.fx, i.fy, i.cx, i.cy);
            shots.push(Shot {
                state: e.time.and_then(|t| times.get(&t.to_bits()).copied()).unwrap_or(e.state),
                split: e.split,
                camera: Camera { width, height, fx, fy, cx, cy, camera_from_world },
                lens: Lens { k: [k1, k2, k3, k4], p: [p1, p2], fisheye: i.fisheye },
                color: numbers::with_image_ending(e.color.clone()),
                depth: e.depth.clone().map(Grid::File),
                depth_scale: e.depth_scale,
                depth_least: 0.0,
                confidence: None,
                film_frame: None,
                mask: e.mask.clone().map_or(MaskFrom::Alpha, MaskFrom::File),
                mask_ids: e.mask_ids.clone(),
                occluder: e.occluder_mask.clone(),
                occluded: e.occluded,
                time: e.time,
            });
        }
    }
    let mut source = Source {
        shots,
        metric: documents.iter().any(|d| d.metric),
        up: documents.first().map_or(DVec3::Z, |d| d.up),
        registered: documents.iter().all(|d| d.registered),
        film: false,
        name: documents.first().and_then(|d| d.name.clone()),
        doubts: documents.iter().flat_map(|d| d.doubts.clone()).collect(),
        notes: Vec::new(),
    };
    if documents.iter().all(is_nerf_capture) {
        (source.metric, source.up) = (true, DVec3::Y);
        source.notes.push("depth_path with names without ending is NeRFCapture's: metres and y up are taken".into());
    }
    Ok(source)
}

/// NeRFCapture (a phone's app) writes instant-ngp's keys and leaves the endings of pictures away.
/// Its world is ARKit's: metres, y up.
fn is_nerf_capture(d: &Document) -> bool {
    let has = |key: &str| d.value.get(key).is_some();
    let without_ending = |f: &serde_json::Value| {
        let name = f["file_path"].as_str().unwrap_or(".");
        f.get("depth_path").is_some() && Path::new(name).extension().is_none()
    };
    let frames = d.value["frames"].as_array();
    !has("up") && !has("metric") && frames.is_some_and(|f| !f.is_empty() && f.iter().all(without_ending))
}

/// States in the order of time, when there are few times. Keys are bit patterns: times >= 0 sort
/// like their bits.
///
/// # Errors
/// When every picture has its own time, or nearly so: a film, in which nobody says what stood still.
fn states_by_time(d: &Document) -> Result<BTreeMap<u64, usize>, CaptureError> {
    let mut times: Vec<f64> = d.entries.iter().filter_map(|e| e.time).collect();
    times.sort_by(f64::total_cmp);
    times.dedup();
    let pictures = d.entries.iter().filter(|e| e.time.is_some()).count();
    if times.len() > MOST_STATES || times.len() > 1 && pictures < LEAST_VIEWS * times.len() {
        return Err(CaptureError::new(
            format!("{pictures} pictures with {} times are a film, not states", times.len()),
            format!("{}: frames[].time", d.file.display()),
            "say which picture shows which joint configuration: a \"state\" a frame, or a folder a state",
        ));
    }
    Ok(times.into_iter().enumerate().map(|(s, t)| (t.to_bits(), s)).collect())
}
