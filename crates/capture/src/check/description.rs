//! What `transforms.json` alone tells: numbers, counts, duplicates, missing files.

use super::{Finding, Fix, Severity, address, error, warning};
use crate::recording::transforms::{Document, Problem};
use crate::{CaptureError, Recording, Split};
use glam::DMat3;
use hingecast_geom::pose::rigidity_error;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

/// Fewer usable views of a state than this leave surface unseen; fewer than three leave nothing to
/// fit.
const FEW_VIEWS: usize = 12;
const TOO_FEW_VIEWS: usize = 3;
/// Poses that are off by less than this can be made rigid without guessing.
const NEARLY_RIGID: f64 = 0.05;

pub(super) fn check(documents: &[Document], recording: &Recording, problems: Vec<Problem>, out: &mut Vec<Finding>) {
    for problem in problems {
        out.push(explain(documents, problem));
    }
    missing_files(documents, recording, out);
    duplicates(documents, recording, out);
    intrinsics(documents, recording, out);
    counts(recording, out);
}

/// Chooses the code and the repair of a problem that the reader met.
fn explain(documents: &[Document], problem: Problem) -> Finding {
    let what = problem.error.what.clone();
    let code = [
        ("distorted", "distortion"),
        ("mirrored", "pose-mirrored"),
        ("not rigid", "pose-not-rigid"),
        ("not finite", "not-finite"),
        ("a field is missing", "field-missing"),
        ("wrong type", "field-type"),
        ("focal length", "focal-length"),
        ("not numbered", "states-gap"),
        ("no frames", "no-frames"),
        ("held out", "no-training-frames"),
        ("image size", "image-size"),
        ("a camera stands", "camera-far"),
        ("principal point", "principal-point"),
        ("camera model", "camera-model"),
    ]
    .into_iter()
    .find(|(words, _)| what.contains(words))
    .map_or("field", |(_, code)| code);
    let mut finding = error(code, problem.error);
    finding.fix = match (&problem.frame, code) {
        (_, "states-gap") => Some(Fix::RenumberStates),
        // A lens or a whole-file mistake concerns all frames: dropping them is no repair.
        (_, "distortion" | "camera-model" | "focal-length" | "principal-point" | "image-size") | (None, _) => None,
        (Some((file, index)), "pose-not-rigid") => {
            let entry =
                documents.iter().filter(|d| d.file == *file).flat_map(|d| &d.entries).find(|e| e.index == *index);
            let nearly = entry.is_some_and(|e| {
                rigidity_error(&e.world_from_camera) < NEARLY_RIGID
                    && DMat3::from_mat4(e.world_from_camera).determinant() > 0.0
            });
            let (file, index) = (file.clone(), *index);
            Some(if nearly { Fix::Orthonormalise { file, index } } else { Fix::DropFrame { file, index } })
        }
        (Some((file, index)), _) => Some(Fix::DropFrame { file: file.clone(), index: *index }),
    };
    finding
}

fn missing_files(documents: &[Document], recording: &Recording, out: &mut Vec<Finding>) {
    for (i, f) in recording.frames.iter().enumerate() {
        let files = [Some(&f.color), f.depth.as_ref(), f.mask.as_ref(), f.occluder_mask.as_ref()];
        for missing in files.into_iter().flatten().filter(|p| !p.is_file()) {
            let (file, index, place) = address(documents, recording, i);
            let place = format!("{place}: {}", missing.display());
            let e = CaptureError::new("an image is missing", place, "copy the file again, or drop its frame");
            out.push(Finding { fix: Some(Fix::DropFrame { file, index }), ..error("file-missing", e) });
        }
    }
}

/// The same picture twice counts its errors twice and shows nothing new.
fn duplicates(documents: &[Document], recording: &Recording, out: &mut Vec<Finding>) {
    let mut by_path = BTreeMap::<&PathBuf, usize>::new();
    let mut by_pose = BTreeMap::<(usize, Vec<i64>), usize>::new();
    for (i, f) in recording.frames.iter().enumerate() {
        let pose = f.camera.camera_from_world;
        let numbers = pose.rot.to_array().into_iter().chain(pose.trans.to_array());
        let key = (f.state, numbers.map(|x| (x * 1e9).round() as i64).collect());
        let (what, code, first) = match (by_path.get(&f.color), by_pose.get(&key)) {
            (Some(&first), _) => ("a picture is listed twice", "duplicate-file", first),
            (None, Some(&first)) => ("two frames of a state have the very same pose", "duplicate-pose", first),
            (None, None) => {
                by_path.insert(&f.color, i);
                by_pose.insert(key, i);
                continue;
            }
        };
        let (file, index, place) = address(documents, recording, i);
        let (_, _, other) = address(documents, recording, first);
        let place = format!("{place} and {other}: {}", f.color.display());
        let fix = Some(Fix::DropFrame { file, index });
        out.push(Finding { fix, ..warning(code, what.into(), place, "drop one of the two") });
    }
}

fn intrinsics(documents: &[Document], recording: &Recording, out: &mut Vec<Finding>) {
    let mut seen = BTreeSet::new();
    for (i, f) in recording.frames.iter().enumerate() {
        let c = &f.camera;
        // One finding a camera, not one a frame.
        if !seen.insert([c.fx, c.fy, c.cx, c.cy, c.width as f64, c.height as f64].map(f64::to_bits)) {
            continue;
        }
        let (_, _, place) = address(documents, recording, i);
        let (w, h) = (c.width as f64, c.height as f64);
        let off = ((c.cx / w - 0.5).abs()).max((c.cy / h - 0.5).abs());
        if off > 0.25 {
            let place = format!("{place}: cx, cy = {}, {} for {w} x {h} pixels", c.cx, c.cy);
            let hint = "give cx and cy in pixels of these images, about half of w and h";
            let mut finding = warning(
                "principal-point",
                "the principal point is far from the middle of the image".into(),
                place,
                hint,
            );
            if off > 0.5 {
                finding.severity = Severity::Error;
                finding.what = "the principal point lies outside the image".into();
            }
            out.push(finding);
        }
        let fov = 2.0 * (0.5 * w / c.fx).atan().to_degrees();
        if !(5.0..150.0).contains(&fov) || (c.fx / c.fy - 1.0).abs() > 0.2 {
            let place = format!("{place}: fl_x, fl_y = {}, {}: {fov:.1} degrees wide", c.fx, c.fy);
            let hint = "give fl_x and fl_y in pixels of these images (millimetres are a common mistake)";
            out.push(warning("focal-length", "the focal length is unusual".into(), place, hint));
        }
    }
}

fn counts(recording: &Recording, out: &mut Vec<Finding>) {
    if recording.frames.is_empty() {
        return;
    }
    let place = |s: usize| format!("{}: state {s}", recording.root.display());
    if recording.n_states == 1 {
        let hint = "record the object in several joint positions and number them with state";
        let e = CaptureError::new("there is only one state: it shows no motion", place(0), hint);
        out.push(error("one-state", e));
    }
    for s in 0..recording.n_states {
        let usable = recording.frames_of(s, Split::Train).len();
        let occluded =
            recording.frames.iter().filter(|f| f.state == s && f.split == Split::Train && f.occluded).count();
        if usable == 0 && occluded > 0 {
            let hint = "record the state again without hands in the picture, or drop it";
            out.push(error("all-occluded", CaptureError::new("every frame of a state is occluded", place(s), hint)));
        } else if usable < FEW_VIEWS && !recording.is_filmed(s) {
            let what = format!("a state has {usable} usable views; {FEW_VIEWS} or more see the object from all sides");
            let mut finding = warning("few-views", what, place(s), "record more views of it");
            if usable < TOO_FEW_VIEWS {
                finding.severity = Severity::Error;
            }
            out.push(finding);
        }
        if occluded > 0 && usable > 0 {
            let what = format!("{occluded} frames of a state are occluded; {usable} usable frames remain");
            out.push(warning("occluded", what, place(s), "nothing, if that is enough; else record more views"));
        }
    }
    let without_depth = recording.frames.iter().filter(|f| f.depth.is_none()).count();
    if without_depth > 0 {
        let what = format!("{without_depth} of {} frames have no depth", recording.frames.len());
        let place = format!("{}: depth_file_path", recording.root.display());
        let hint = "record with a depth camera; without depth surfaces and scale are doubtful";
        out.push(warning("no-depth", what, place, hint));
    }
}
