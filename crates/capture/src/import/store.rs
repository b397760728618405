//! Decodes the pictures of a source, brings them to one size, undistorts them, and writes the
//! native recording.
//!
//! Depth is never enlarged: where it is smaller than the colour (every phone), colour, mask and
//! camera are brought to its size. Where it is larger, it is brought to the colour's.

use super::labels;
use super::resize::{Size, area_average, majority, nearest, nearest_known, same_shape};
use super::{MaskFrom, Shot, Source};
use crate::recording::images;
use crate::recording::mask::{self, Labels};
use crate::synth::Staging;
use crate::{CaptureError, Frame, Recording, Split};
use glam::DVec2;
use hingecast_geom::{Camera, Progress};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// The recording, and what to tell about its pictures.
pub(super) fn store(
    source: &Source,
    name: &str,
    out: &Path,
    min_confidence: u8,
    progress: &Progress,
) -> Result<(Recording, Vec<String>), CaptureError> {
    let shots = &source.shots;
    let out = std::path::absolute(out).map_err(|e| CaptureError::write(out, e))?;
    let work = Staging::new(&out)?;
    for folder in ["rgb", "depth", "mask", "occluder"] {
        work.folder(folder)?;
    }
    // Views count within their state.
    let mut next = BTreeMap::<usize, usize>::new();
    let views: Vec<usize> = shots
        .iter()
        .map(|s| {
            let n = next.entry(s.state).or_default();
            *n += 1;
            *n - 1
        })
        .collect();
    let done = AtomicUsize::new(0);
    let stored: Vec<(Frame, Change)> = shots
        .par_iter()
        .zip(&views)
        .map(|(shot, &view)| {
            let frame = one(shot, view, &work.path, min_confidence)?;
            progress.report(done.fetch_add(1, Ordering::Relaxed) + 1, shots.len(), "pictures")?;
            Ok(frame)
        })
        .collect::<Result<_, CaptureError>>()?;
    let (frames, changes): (Vec<Frame>, Vec<Change>) = stored.into_iter().unzip();
    labels::some_is_object(shots, &changes.iter().map(|c| (c.object, &c.labels)).collect::<Vec<_>>())?;
    let train_states = frames.iter().filter(|f| f.split == Split::Train).map(|f| f.state + 1).max().unwrap_or(0);
    let recording = Recording {
        root: work.path.clone(),
        name: name.to_string(),
        frames,
        n_states: train_states,
        metric: source.metric,
        up: source.up,
        registered: source.registered,
        film: source.film,
        doubts: source.doubts.clone(),
        settled: false,
    };
    recording.write()?;
    // Folders that this source did not need; those with files refuse to go.
    for folder in ["depth", "mask", "occluder"] {
        let _ = std::fs::remove_dir(work.path.join(folder));
    }
    // What was written should open; if not, the source is not in order, and what stood at `out` stays.
    Recording::open_uncut(&work.path)?;
    work.finish()?;
    let mut notes = notes(&changes, min_confidence);
    notes.extend(labels::note(shots, changes.iter().map(|c| &c.labels)));
    Ok((Recording::open_uncut(&out)?, notes))
}

/// What happened to a picture on its way.
struct Change {
    color: Size,
    depth: Option<Size>,
    /// Pixels with depth, and of these those whose confidence was too low.
    known: usize,
    unsure: usize,
    /// Pixels of the object, where there is a mask.
    object: Option<usize>,
    /// Pixels of each number, where the mask has several.
    labels: Labels,
}

fn notes(changes: &[Change], min_confidence: u8) -> Vec<String> {
    let mut resized = BTreeMap::<(Size, Size), usize>::new();
    for c in changes {
        let depth = c.depth.filter(|d| *d != c.color);
        depth.into_iter().for_each(|d| *resized.entry((c.color, d)).or_default() += 1);
    }
    let mut notes: Vec<String> = Vec::new();
    for (((w, h), (dw, dh)), count) in resized {
        notes.push(if smaller((dw, dh), (w, h)) {
            format!("colour of {count} pictures was reduced from {w} x {h} to {dw} x {dh}, the size of their depth")
        } else {
            format!("depth of {count} pictures was reduced from {dw} x {dh} to {w} x {h}, the size of their colour")
        });
    }
    let (known, unsure) = changes.iter().fold((0, 0), |(k, u), c| (k + c.known, u + c.unsure));
    if unsure > 0 {
        notes.push(format!(
            "{:.1} % of the pixels with depth lost it: their confidence is below {min_confidence} (--min-confidence)",
            100.0 * unsure as f64 / known as f64
        ));
    }
    notes
}

fn one(shot: &Shot, view: usize, root: &Path, min_confidence: u8) -> Result<(Frame, Change), CaptureError> {
    let image = images::read(&shot.color)?;
    let size = (image.width() as usize, image.height() as usize);
    let mut camera = shot.camera;
    if (camera.width, camera.height) == (0, 0) {
        (camera.width, camera.height) = size;
    }
    if (camera.width, camera.height) != size {
        let (w, h) = size;
        return Err(CaptureError::new(
            format!("an image is {w} x {h}, but its camera says {} x {}", camera.width, camera.height),
            shot.color.display().to_string(),
            "import the pictures of the size that the cameras were computed for",
        ));
    }
    let mut change = Change { color: size, depth: None, known: 0, unsure: 0, object: None, labels: Labels::new() };
    let mut depth = None;
    if shot.depth.is_some() {
        let (values, depth_size) = depth_map(shot, min_confidence, &mut change)?;
        if !same_shape(depth_size, size) {
            return Err(other_shape(shot, depth_size, size));
        }
        change.depth = Some(depth_size);
        depth = Some(values);
    }
    // One size for all: the smaller of colour and depth.
    let to = change.depth.filter(|d| smaller(*d, size)).unwrap_or(size);
    let (w, h) = to;
    let camera = camera.resized(w, h);
    let depth = depth.zip(change.depth).map(|(z, from)| if from == to { z } else { nearest_known(&z, from, to) });

    let has_alpha = image.color().has_alpha();
    let rgba = image.into_rgba8().into_raw();
    let alpha = || rgba.chunks_exact(4).map(|p| if p[3] > 127 { 255 } else { 0 }).collect::<Vec<u8>>();
    let mask = match &shot.mask {
        MaskFrom::File(path) => {
            let (mask, labels) = mask_file(path, &shot.mask_ids, to)?;
            change.labels = labels;
            Some(mask)
        }
        MaskFrom::Any(paths) => Some(any_mask(paths, &shot.mask_ids, to)?),
        MaskFrom::Alpha if has_alpha => Some(majority(&alpha(), size, to)),
        MaskFrom::Alpha => None,
    };
    change.object = mask.as_ref().map(|m| m.iter().filter(|v| **v > 0).count());
    let hidden = shot.occluder.as_ref().map(|path| mask_file(path, &[], to).map(|(mask, _)| mask)).transpose()?;
    let rgb: Vec<u8> = rgba.chunks_exact(4).flat_map(over_white).collect();
    let rgb = if to == size { rgb } else { area_average::<3>(&rgb, size, to) };
    let picture = Picture { rgb, mask, depth, hidden };
    let picture = if shot.lens.is_ideal() { picture } else { undistorted(shot, &camera, picture) };

    let name = format!("s{:03}_v{view:03}.png", shot.state);
    let file = |folder: &str| root.join(folder).join(&name);
    images::write_rgb(&file("rgb"), &picture.rgb, w, h)?;
    if let Some(mask) = &picture.mask {
        images::write_gray(&file("mask"), mask, w, h)?;
    }
    if let Some(hidden) = &picture.hidden {
        images::write_gray(&file("occluder"), hidden, w, h)?;
    }
    let mut depth_scale = shot.depth_scale;
    if let Some(depth) = &picture.depth {
        depth_scale = fine_scale(depth, shot.depth_scale);
        let unit = |z: &f64| (z / depth_scale).round().clamp(0.0, 65_535.0) as u16;
        images::write_depth(&file("depth"), &depth.iter().map(unit).collect::<Vec<u16>>(), w, h)?;
    }
    let frame = Frame {
        state: shot.state,
        view,
        split: shot.split,
        camera,
        color: file("rgb"),
        depth: picture.depth.as_ref().map(|_| file("depth")),
        depth_scale,
        mask: picture.mask.as_ref().map(|_| file("mask")),
        mask_ids: Vec::new(),
        occluded: shot.occluded,
        occluder_mask: picture.hidden.as_ref().map(|_| file("occluder")),
        time: shot.time,
    };
    Ok((frame, change))
}

fn smaller(depth: Size, color: Size) -> bool {
    depth.0 * depth.1 < color.0 * color.1
}

fn other_shape(shot: &Shot, depth: Size, color: Size) -> CaptureError {
    let path = shot.depth.as_ref().map_or(shot.color.as_path(), |d| d.path());
    CaptureError::new(
        format!("depth is {} x {}, its colour {} x {}: they show different fields", depth.0, depth.1, color.0, color.1),
        path.display().to_string(),
        "bring depth into the colour camera first (the camera's software calls it align), or crop one",
    )
}

struct Picture {
    rgb: Vec<u8>,
    /// 0 or 255.
    mask: Option<Vec<u8>>,
    /// Scene units, 0 = unknown.
    depth: Option<Vec<f64>>,
    /// 255 where a hand hides the object, or the lens saw nothing.
    hidden: Option<Vec<u8>>,
}

/// 0 or 255 at the size wanted: by majority where it is larger, by the nearest pixel where it is
/// smaller. With the pixels of each number, where it has several.
fn mask_file(path: &Path, ids: &[u16], to: Size) -> Result<(Vec<u8>, Labels), CaptureError> {
    let (mask, w, h, labels) = mask::read_with_labels(path, ids)?;
    let from = (w, h);
    let mask = match smaller(to, from) {
        true => majority(&mask, from, to),
        false => nearest(from, to).map(|i| 255 * mask[i]).collect(),
    };
    Ok((mask, labels))
}

/// 255 where one of the files says so.
fn any_mask(paths: &[PathBuf], ids: &[u16], to: Size) -> Result<Vec<u8>, CaptureError> {
    let mut all = vec![0; to.0 * to.1];
    for path in paths {
        all.iter_mut().zip(mask_file(path, ids, to)?.0).for_each(|(a, m)| *a |= m);
    }
    Ok(all)
}

/// Depth in scene units at its own size, 0 where it is unknown or not sure enough.
fn depth_map(shot: &Shot, least: u8, change: &mut Change) -> Result<(Vec<f64>, Size), CaptureError> {
    let Some(grid) = &shot.depth else { return Ok((Vec::new(), (0, 0))) };
    let map = grid.depth()?;
    let size = (map.width, map.height);
    let valid = |stored: f32| {
        let z = f64::from(stored) * shot.depth_scale;
        if z.is_finite() && z > 0.0 && z >= shot.depth_least { z } else { 0.0 }
    };
    let mut depth: Vec<f64> = map.values.into_iter().map(valid).collect();
    change.known = depth.iter().filter(|z| **z > 0.0).count();
    if let Some(grid) = shot.confidence.as_ref().filter(|_| least > 0) {
        let sure = grid.confidence()?;
        let at: Vec<usize> = nearest((sure.width, sure.height), size).collect();
        for (z, i) in depth.iter_mut().zip(at) {
            if *z > 0.0 && sure.values[i] < least {
                *z = 0.0;
                change.unsure += 1;
            }
        }
    }
    Ok((depth, size))
}

/// The source's own unit when 16 bits hold all depths in it, so that nothing is rounded; else a
/// power of ten that does.
fn fine_scale(depth: &[f64], own: f64) -> f64 {
    let farthest = depth.iter().fold(0.0f64, |a, &z| a.max(z));
    let whole = depth.iter().all(|z| (z / own - (z / own).round()).abs() < 1e-3);
    if whole && farthest / own < 65_535.0 {
        return own;
    }
    let mut scale = 1e-6;
    while farthest / scale >= 65_535.0 {
        scale *= 10.0;
    }
    scale
}

/// The picture of the ideal pinhole camera: colour bilinear, the others nearest. Hidden is also
/// where the distorted picture did not reach.
fn undistorted(shot: &Shot, camera: &Camera, from: Picture) -> Picture {
    let (w, h) = (camera.width, camera.height);
    let n = w * h;
    let mut rgb = vec![255u8; 3 * n];
    let mut unseen = vec![0u8; n];
    let mut mask = from.mask.as_ref().map(|_| vec![0u8; n]);
    let mut depth = from.depth.as_ref().map(|_| vec![0.0; n]);
    for i in 0..n {
        let uv = DVec2::new((i % w) as f64 + 0.5, (i / w) as f64 + 0.5);
        let source = shot.lens.distort(camera, uv);
        let (x, y) = (source.x.floor(), source.y.floor());
        if !(x >= 0.0 && y >= 0.0 && x < w as f64 && y < h as f64) {
            unseen[i] = 255;
            continue;
        }
        let pixel = y as usize * w + x as usize;
        if let Some(from) = &from.hidden {
            unseen[i] = from[pixel];
        }
        if let (Some(to), Some(from)) = (&mut mask, &from.mask) {
            to[i] = from[pixel];
        }
        // Depth is z along the camera's axis, which undistortion does not change.
        if let (Some(to), Some(from)) = (&mut depth, &from.depth) {
            to[i] = from[pixel];
        }
        let (fx, fy) = (source.x - 0.5, source.y - 0.5);
        let (x0, y0) = (fx.floor(), fy.floor());
        let (tx, ty) = (fx - x0, fy - y0);
        let at = |dx: f64, dy: f64, c: usize| {
            let (x, y) = ((x0 + dx).clamp(0.0, (w - 1) as f64), (y0 + dy).clamp(0.0, (h - 1) as f64));
            f64::from(from.rgb[3 * (y as usize * w + x as usize) + c])
        };
        for c in 0..3 {
            let top = at(0.0, 0.0, c) * (1.0 - tx) + at(1.0, 0.0, c) * tx;
            let bottom = at(0.0, 1.0, c) * (1.0 - tx) + at(1.0, 1.0, c) * tx;
            rgb[3 * i + c] = (top * (1.0 - ty) + bottom * ty).round() as u8;
        }
    }
    let hidden = (from.hidden.is_some() || unseen.contains(&255)).then_some(unseen);
    Picture { rgb, mask, depth, hidden }
}

fn over_white(p: &[u8]) -> [u8; 3] {
    let a = u32::from(p[3]);
    [0, 1, 2].map(|c| ((u32::from(p[c]) * a + 255 * (255 - a) + 127) / 255) as u8)
}
