//! TUM RGB-D and what is stored like it: `rgb.txt`, `depth.txt` (time, file), `groundtruth.txt`
//! (time, tx ty tz, qx qy qz qw: camera-to-world, OpenCV axes, z up, metres); depth is 16-bit PNG,
//! 5000 a metre. `associations.txt` (time, file, time, file), where there is one, says which depth
//! belongs to which picture.
//!
//! Intrinsics are in no file of TUM's own: `calibration.txt` (fx fy cx cy, as OpenCV has them:
//! pixel centres at whole numbers), else, for the `freiburg` sequences, the values that their page
//! recommends.

use super::grid::Grid;
use super::numbers::{image_size, rigid, wrong};
use super::{Shot, Source};
use crate::CaptureError;
use hingecast_geom::{Camera, Pose};
use std::path::{Path, PathBuf};

/// Depth and pose belong to a picture of at most so many seconds before or after, as in TUM's own
/// tool.
const APART: f64 = 0.02;
const METRES_PER_UNIT: f64 = 1.0 / 5000.0;
/// fx fy cx cy of Kinect as ROS has them: depth was aligned with these.
const FREIBURG: [f64; 4] = [525.0, 525.0, 319.5, 239.5];

pub(super) fn read(src: &Path) -> Result<Source, CaptureError> {
    let truth = src.join("groundtruth.txt");
    let mut path = Vec::new();
    for (i, words) in table(&truth)?.iter().enumerate() {
        let numbers: Vec<f64> = words.iter().filter_map(|w| w.parse().ok()).collect();
        let [t, x, y, z, qx, qy, qz, qw] = numbers[..] else {
            return Err(wrong(&truth, &format!("line {i} of poses"), "eight numbers: t tx ty tz qx qy qz qw"));
        };
        path.push((t, rigid(&[qx, qy, qz, qw, x, y, z], &truth, &format!("t = {t}"))?));
    }
    path.sort_by(|a, b| a.0.total_cmp(&b.0));

    let mut source = Source { metric: true, ..Vec::new().into() };
    let pairs = pairs(src)?;
    let ([fx, fy, cx, cy], note) = intrinsics(src)?;
    source.notes.extend(note);
    let (mut without_pose, mut without_depth) = (0, 0);
    for (t, color, depth) in pairs {
        let Some(world_from_camera) = pose_at(&path, t) else {
            without_pose += 1;
            continue;
        };
        without_depth += usize::from(depth.is_none());
        let (width, height) = image_size(&color)?;
        // Ours have pixel centres at +0.5.
        let (cx, cy) = (cx + 0.5, cy + 0.5);
        let camera = Camera { width, height, fx, fy, cx, cy, camera_from_world: world_from_camera.inverse() };
        source.shots.push(Shot {
            depth: depth.map(Grid::File),
            depth_scale: METRES_PER_UNIT,
            time: Some(t),
            ..Shot::of(camera, color)
        });
    }
    if without_pose > 0 {
        source.notes.push(format!("{without_pose} pictures have no pose within {APART} s: left out"));
    }
    if without_depth > 0 {
        source.notes.push(format!("{without_depth} pictures have no depth within {APART} s"));
    }
    Ok(source)
}

/// Lines of words; `#` begins a comment.
fn table(file: &Path) -> Result<Vec<Vec<String>>, CaptureError> {
    let text = std::fs::read_to_string(file).map_err(|e| CaptureError::read(file, e))?;
    let lines = text.lines().map(|l| l.split('#').next().unwrap_or(""));
    let words = |l: &str| {
        l.split(|c: char| c.is_whitespace() || c == ',').filter(|w| !w.is_empty()).map(String::from).collect()
    };
    Ok(lines.map(words).filter(|w: &Vec<String>| !w.is_empty()).collect())
}

/// Times and files of `rgb.txt` or `depth.txt`, by time.
fn list(src: &Path, name: &str) -> Result<Vec<(f64, PathBuf)>, CaptureError> {
    let file = src.join(name);
    let mut out = Vec::new();
    for words in table(&file)? {
        let (Some(Ok(t)), Some(path)) = (words.first().map(|w| w.parse()), words.get(1)) else {
            return Err(wrong(&file, &words.join(" "), "a time in seconds and a file"));
        };
        out.push((t, src.join(path)));
    }
    out.sort_by(|a: &(f64, PathBuf), b| a.0.total_cmp(&b.0));
    Ok(out)
}

type Pair = (f64, PathBuf, Option<PathBuf>);

/// Pictures with the depth that belongs to them.
fn pairs(src: &Path) -> Result<Vec<Pair>, CaptureError> {
    let names = ["associations.txt", "associate.txt", "associated.txt"];
    let Some(file) = names.map(|n| src.join(n)).into_iter().find(|p| p.is_file()) else {
        let depths = list(src, "depth.txt")?;
        let near = |t: f64| {
            let best = depths.iter().min_by(|a, b| (a.0 - t).abs().total_cmp(&(b.0 - t).abs()))?;
            ((best.0 - t).abs() <= APART).then(|| best.1.clone())
        };
        return Ok(list(src, "rgb.txt")?.into_iter().map(|(t, color)| (t, color, near(t))).collect());
    };
    let mut out = Vec::new();
    for words in table(&file)? {
        let [ta, a, tb, b] = &words[..] else {
            return Err(wrong(&file, &words.join(" "), "time, file, time, file"));
        };
        // Both orders are about.
        let depth_first = a.starts_with("depth");
        let (t, color, depth) = if depth_first { (tb, b, a) } else { (ta, a, b) };
        let t = t.parse().map_err(|_| wrong(&file, &words.join(" "), "a time in seconds"))?;
        out.push((t, src.join(color), Some(src.join(depth))));
    }
    Ok(out)
}

/// The pose at a time: between its neighbours, if one of them is near.
fn pose_at(path: &[(f64, Pose)], t: f64) -> Option<Pose> {
    let after = path.partition_point(|(time, _)| *time < t);
    let (a, b) = (path.get(after.wrapping_sub(1)), path.get(after));
    let near = |p: &&(f64, Pose)| (p.0 - t).abs() <= APART;
    match (a, b) {
        (Some(a), Some(b)) if near(&a) || near(&b) => {
            // Longer gaps are holes of the tracking: no pose is made up in them.
            if b.0 - a.0 > 5.0 * APART {
                return Some(if t - a.0 < b.0 - t { a.1 } else { b.1 });
            }
            let s = (t - a.0) / (b.0 - a.0);
            Some(Pose::new(a.1.rot.slerp(b.1.rot, s).normalize(), a.1.trans.lerp(b.1.trans, s)))
        }
        (Some(p), None) | (None, Some(p)) => near(&p).then_some(p.1),
        _ => None,
    }
}

fn intrinsics(src: &Path) -> Result<([f64; 4], Option<String>), CaptureError> {
    let file = src.join("calibration.txt");
    if file.is_file() {
        let words = table(&file)?.concat();
        let numbers: Vec<f64> = words.iter().filter_map(|w| w.parse().ok()).filter(|x: &f64| x.is_finite()).collect();
        return match numbers[..] {
            [fx, fy, cx, cy] => Ok(([fx, fy, cx, cy], None)),
            [fx, _, cx, _, fy, cy, _, _, _] => Ok(([fx, fy, cx, cy], None)),
            _ => Err(wrong(&file, "the file", "fx fy cx cy of undistorted pictures, or 3x3 numbers")),
        };
    }
    let whole = std::path::absolute(src).unwrap_or_else(|_| src.to_path_buf());
    if whole.to_string_lossy().to_lowercase().contains("freiburg") {
        let [fx, fy, cx, cy] = FREIBURG;
        let note = format!("no calibration.txt: the {fx} {fy} {cx} {cy} that TUM recommends are taken");
        return Ok((FREIBURG, Some(note)));
    }
    Err(CaptureError::new(
        "the intrinsics are unknown: TUM's layout has no file of them",
        file.display().to_string(),
        "write fx fy cx cy (pixels, as OpenCV or ROS calibrate) into calibration.txt",
    ))
}
