//! 3D Scanner App (iPhone, iPad), export "All Data": per frame N `frame_N.json` (`intrinsics`, nine
//! numbers row by row, of the jpg; `cameraPoseARFrame`, sixteen numbers row by row,
//! camera-to-world, OpenGL axes, y up, metres; `time`), `depth_N.png` (16 bits, millimetres) and
//! `conf_N.png` (0, 1, 2). Only every third or so has a picture, `frame_N.jpg`.
//!
//! Other keys and files of the export hold where the scan was made (GPS): none of them is read.

use super::grid::Grid;
use super::numbers::{camera, image_size, json, matrix, numbered, pose_from_gl, wrong};
use super::{Shot, Source};
use crate::CaptureError;
use glam::DVec3;
use std::path::Path;

pub(super) fn read(src: &Path) -> Result<Source, CaptureError> {
    let mut source = Source { metric: true, up: DVec3::Y, ..Vec::new().into() };
    let frames: Vec<_> = numbered(src, &["json"]).into_iter().filter(|(_, p)| starts_with(p, "frame_")).collect();
    let mut without_picture = 0;
    let mut without_depth = 0;
    for (_, file) in &frames {
        let color = file.with_extension("jpg");
        if !color.is_file() {
            without_picture += 1;
            continue;
        }
        let about = json(file)?;
        let k = matrix::<3>(&about["intrinsics"]).ok_or_else(|| wrong(file, "intrinsics", "nine numbers"))?;
        let key = "cameraPoseARFrame";
        let pose = matrix::<4>(&about[key]).ok_or_else(|| wrong(file, key, "sixteen numbers"))?;
        let camera = camera(&k, image_size(&color)?, pose_from_gl(&pose, file, key)?);
        let beside = |kind: &str| {
            let name = file.file_name()?.to_str()?.replacen("frame_", kind, 1);
            Some(Grid::File(src.join(name).with_extension("png"))).filter(|g| g.path().is_file())
        };
        let depth = beside("depth_");
        without_depth += usize::from(depth.is_none());
        source.shots.push(Shot {
            depth,
            confidence: beside("conf_"),
            time: about["time"].as_f64(),
            ..Shot::of(camera, color)
        });
    }
    if without_picture > 0 {
        source.notes.push(format!(
            "{without_picture} of {} frames have depth but no picture (the app stores every third or so): left out",
            frames.len()
        ));
    }
    if without_depth > 0 {
        source.notes.push(format!("{without_depth} of {} pictures have no depth", source.shots.len()));
    }
    Ok(source)
}

fn starts_with(path: &Path, start: &str) -> bool {
    path.file_name().and_then(|n| n.to_str()).is_some_and(|n| n.starts_with(start))
}
