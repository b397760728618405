//! Polycam (iPhone, iPad), export "raw data" (developer mode):
//! `keyframes/corrected_cameras/<t>.json` (fx fy cx cy width height, t_00 .. t_23: three rows of
//! camera-to-world, OpenGL axes, y up, metres), `corrected_images/<t>.jpg`, `depth/<t>.png` (16
//! bits, millimetres, smaller), `confidence/<t>.png` (0, 127, 255). Sessions that were too large to
//! be optimised have only `cameras` and `images`: ARKit's own poses.

use super::grid::Grid;
use super::numbers::{files, json, pose_from_gl, wrong};
use super::{Shot, Source};
use crate::CaptureError;
use glam::DVec3;
use hingecast_geom::Camera;
use std::path::Path;

pub(super) fn read(src: &Path) -> Result<Source, CaptureError> {
    let root = if src.join("keyframes").is_dir() { src.join("keyframes") } else { src.to_path_buf() };
    let mut source = Source { metric: true, up: DVec3::Y, ..Vec::new().into() };
    let corrected = root.join("corrected_cameras").is_dir();
    let (cameras, images) = if corrected { ("corrected_cameras", "corrected_images") } else { ("cameras", "images") };
    if !corrected {
        source.notes.push("no corrected_cameras: the phone's own poses are taken, with their drift".into());
    }
    let (mut without_picture, mut without_depth) = (0, 0);
    for file in files(&root.join(cameras), &["json"]) {
        let about = json(&file)?;
        let number = |key: &str| {
            about[key].as_f64().filter(|x| x.is_finite()).ok_or_else(|| wrong(&file, key, "a finite number"))
        };
        let mut rows = [[0.0, 0.0, 0.0, 1.0]; 4];
        for (r, row) in rows[..3].iter_mut().enumerate() {
            for (c, slot) in row.iter_mut().enumerate() {
                *slot = number(&format!("t_{r}{c}"))?;
            }
        }
        let camera = Camera {
            width: number("width")? as usize,
            height: number("height")? as usize,
            fx: number("fx")?,
            fy: number("fy")?,
            cx: number("cx")?,
            cy: number("cy")?,
            camera_from_world: pose_from_gl(&rows, &file, "t_00 .. t_23")?,
        };
        let stem = file.file_stem().unwrap_or_default();
        let in_folder = |folder: &str, ending: &str| {
            Some(root.join(folder).join(stem).with_extension(ending)).filter(|p| p.is_file())
        };
        let Some(color) = in_folder(images, "jpg").or_else(|| in_folder(images, "png")) else {
            without_picture += 1;
            continue;
        };
        let depth = in_folder("depth", "png").map(Grid::File);
        without_depth += usize::from(depth.is_none());
        source.shots.push(Shot {
            depth,
            confidence: in_folder("confidence", "png").map(Grid::File),
            ..Shot::of(camera, color)
        });
    }
    if without_picture > 0 {
        source.notes.push(format!("{without_picture} cameras have no picture in {images}: left out"));
    }
    if without_depth > 0 {
        source.notes.push(format!("{without_depth} of {} pictures have no depth", source.shots.len()));
    }
    Ok(source)
}
