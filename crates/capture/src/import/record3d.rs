//! Record3D (iPhone, iPad), two exports of one recording: "EXR + RGBD" (`metadata.json`,
//! `rgb/N.jpg`, `depth/N.exr`, one channel of half floats) and `.r3d` (a zip with `metadata`,
//! `rgbd/N.jpg`, `N.depth`, `N.conf`, both LZFSE). Depth is in metres; N counts the poses and may
//! have gaps.
//!
//! `K`: nine numbers column by column for w x h; `perFrameIntrinsicCoeffs[N]`: fx fy cx cy, where
//! there is autofocus. `poses[N]`: qx qy qz qw tx ty tz, camera-to-world, OpenGL axes, y up
//! (ARKit).

use super::grid::Grid;
use super::numbers::{image_size, json, numbered, quaternion_pose_from_gl, wrong};
use super::{Shot, Source, resize};
use crate::CaptureError;
use glam::DVec3;
use hingecast_geom::Camera;
use serde_json::Value;
use std::path::Path;

pub(super) fn read(src: &Path) -> Result<Source, CaptureError> {
    let zipped = src.join("rgbd").is_dir();
    let file = src.join(if zipped { "metadata" } else { "metadata.json" });
    let about = json(&file)?;
    let size = |key: &str| about[key].as_u64().filter(|n| *n > 0).map(|n| n as usize);
    let pixels = |key: &str| size(key).ok_or_else(|| wrong(&file, key, "a number of pixels"));
    let (w, h) = (pixels("w")?, pixels("h")?);
    let poses = about["poses"].as_array().ok_or_else(|| wrong(&file, "poses", "a list of poses"))?;

    let colors = numbered(&src.join(if zipped { "rgbd" } else { "rgb" }), &["jpg", "jpeg", "png"]);
    let mut source = Source { metric: true, up: DVec3::Y, ..Vec::new().into() };
    let (mut scaled, mut without_depth) = (None, 0);
    for (n, color) in colors {
        let pose = poses.get(n).ok_or_else(|| {
            let what = format!("a picture has no pose: there are {}, it is number {n}", poses.len());
            CaptureError::new(
                what,
                color.display().to_string(),
                "copy metadata of the same recording, or take the picture away",
            )
        })?;
        let key = format!("poses[{n}]");
        let camera_from_world = quaternion_pose_from_gl(&numbers(pose), &file, &key)?;
        let [fx, fy, cx, cy] = intrinsics(&about, n, &file)?;
        let mut camera = Camera { width: w, height: h, fx, fy, cx, cy, camera_from_world };
        // Pictures may be stored smaller than what K is for.
        let stored = image_size(&color)?;
        if stored != (w, h) && resize::same_shape(stored, (w, h)) {
            camera = camera.resized(stored.0, stored.1);
            scaled = Some(stored);
        }
        let (depth, confidence) = if zipped {
            let of = |ending: &str| lzfse(&color.with_extension(ending), size("dw").zip(size("dh")), &file);
            (of("depth")?, of("conf")?)
        } else {
            let exr = src.join("depth").join(format!("{n}.exr"));
            (Some(Grid::File(exr)).filter(|g| g.path().is_file()), None)
        };
        without_depth += usize::from(depth.is_none());
        source.shots.push(Shot {
            depth,
            depth_scale: 1.0,
            confidence,
            time: about["frameTimestamps"][n].as_f64(),
            ..Shot::of(camera, color)
        });
    }
    if let Some(stored) = scaled {
        source.notes.push(format!(
            "pictures of {} x {} have the intrinsics of {w} x {h}: these were scaled",
            stored.0, stored.1
        ));
    }
    if without_depth > 0 {
        source.notes.push(format!("{without_depth} of {} pictures have no depth", source.shots.len()));
    }
    Ok(source)
}

/// fx fy cx cy of picture `n`, pixels of w x h.
fn intrinsics(about: &Value, n: usize, file: &Path) -> Result<[f64; 4], CaptureError> {
    let own = about["perFrameIntrinsicCoeffs"].get(n).map(numbers);
    if let Some([fx, fy, cx, cy, ..]) = own.as_deref() {
        return Ok([*fx, *fy, *cx, *cy]);
    }
    match numbers(&about["K"])[..] {
        [fx, _, _, _, fy, _, cx, cy, _] => Ok([fx, fy, cx, cy]),
        _ => Err(wrong(file, "K", "nine numbers, column by column")),
    }
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().map(|a| a.iter().filter_map(Value::as_f64).collect()).unwrap_or_default()
}

/// A map of the .r3d, if it is there.
fn lzfse(map: &Path, size: Option<(usize, usize)>, about: &Path) -> Result<Option<Grid>, CaptureError> {
    if !map.is_file() {
        return Ok(None);
    }
    let (width, height) = size.ok_or_else(|| wrong(about, "dw, dh", "the size of the depth maps, pixels"))?;
    Ok(Some(Grid::Lzfse { file: map.to_path_buf(), width, height }))
}
