//! Decodes the pictures of a source, undistorts them, and writes the native recording.

use super::{MaskFrom, Shot, Source};
use crate::recording::{images, mask};
use crate::synth::Staging;
use crate::{CaptureError, Frame, Recording, Split};
use glam::DVec2;
use hingecast_geom::{Camera, Progress};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

pub(super) fn store(source: &Source, name: &str, out: &Path, progress: &Progress) -> Result<Recording, CaptureError> {
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
    let frames: Vec<Frame> = shots
        .par_iter()
        .zip(&views)
        .map(|(shot, &view)| {
            let frame = one(shot, view, &work.path)?;
            progress.report(done.fetch_add(1, Ordering::Relaxed) + 1, shots.len(), "pictures")?;
            Ok(frame)
        })
        .collect::<Result<_, CaptureError>>()?;
    let train_states = frames.iter().filter(|f| f.split == Split::Train).map(|f| f.state + 1).max().unwrap_or(0);
    let recording = Recording {
        root: work.path.clone(),
        name: name.to_string(),
        frames,
        n_states: train_states,
        metric: source.metric,
        up: source.up,
        registered: source.registered,
    };
    recording.write()?;
    // Folders that this source did not need; those with files refuse to go.
    for folder in ["depth", "mask", "occluder"] {
        let _ = std::fs::remove_dir(work.path.join(folder));
    }
    work.finish()?;
    // What was written should open; if not, the source has gaps in its states.
    Recording::open(&out)
}

fn one(shot: &Shot, view: usize, root: &Path) -> Result<Frame, CaptureError> {
    let image = images::read(&shot.color)?;
    let (w, h) = (image.width() as usize, image.height() as usize);
    let mut camera = shot.camera;
    if (camera.width, camera.height) == (0, 0) {
        (camera.width, camera.height) = (w, h);
    }
    if (camera.width, camera.height) != (w, h) {
        return Err(CaptureError::new(
            format!("an image is {w} x {h}, but its camera says {} x {}", camera.width, camera.height),
            shot.color.display().to_string(),
            "import the pictures of the size that the cameras were computed for",
        ));
    }
    let has_alpha = image.color().has_alpha();
    let rgba = image.into_rgba8().into_raw();
    let mask: Option<Vec<u8>> = match &shot.mask {
        MaskFrom::File(path) => Some(mask_file(path, w, h)?),
        MaskFrom::Alpha if has_alpha => Some(rgba.chunks_exact(4).map(|p| if p[3] > 127 { 255 } else { 0 }).collect()),
        MaskFrom::Alpha => None,
    };
    let depth = shot.depth.as_ref().map(|path| depth_file(shot, path, w, h)).transpose()?;
    let hidden = shot.occluder.as_ref().map(|path| mask_file(path, w, h)).transpose()?;
    let picture = Picture { rgba, mask, depth, hidden };
    let picture = if shot.lens.is_ideal() { picture } else { undistorted(shot, &camera, picture) };

    let name = format!("s{:03}_v{view:03}.png", shot.state);
    let file = |folder: &str| root.join(folder).join(&name);
    let rgb: Vec<u8> = picture.rgba.chunks_exact(4).flat_map(over_white).collect();
    images::write_rgb(&file("rgb"), &rgb, w, h)?;
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
    Ok(Frame {
        state: shot.state,
        view,
        split: shot.split,
        camera,
        color: file("rgb"),
        depth: picture.depth.as_ref().map(|_| file("depth")),
        depth_scale,
        mask: picture.mask.as_ref().map(|_| file("mask")),
        occluded: shot.occluded,
        occluder_mask: picture.hidden.as_ref().map(|_| file("occluder")),
        time: shot.time,
    })
}

struct Picture {
    rgba: Vec<u8>,
    /// 0 or 255.
    mask: Option<Vec<u8>>,
    /// Scene units, 0 = unknown.
    depth: Option<Vec<f64>>,
    /// 255 where a hand hides the object, or the lens saw nothing.
    hidden: Option<Vec<u8>>,
}

/// 0 or 255; resized by nearest pixel when it has another size than the colour.
fn mask_file(path: &Path, w: usize, h: usize) -> Result<Vec<u8>, CaptureError> {
    let (mask, mw, mh) = mask::read(path)?;
    Ok(nearest(mw, mh, w, h).map(|i| 255 * mask[i]).collect())
}

fn depth_file(shot: &Shot, path: &Path, w: usize, h: usize) -> Result<Vec<f64>, CaptureError> {
    let (stored, dw, dh) = images::read_depth(path)?;
    let z = |i: usize| f64::from(stored[i]) * shot.depth_scale;
    let valid = |z: f64| if z.is_finite() && z > 0.0 && z >= shot.depth_least { z } else { 0.0 };
    Ok(nearest(dw, dh, w, h).map(|i| valid(z(i))).collect())
}

/// For each pixel of a w x h image the nearest one of an image of size sw x sh.
fn nearest(sw: usize, sh: usize, w: usize, h: usize) -> impl Iterator<Item = usize> {
    (0..w * h).map(move |i| ((i / w) * sh / h) * sw + (i % w) * sw / w)
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
    let mut rgba = vec![255u8; 4 * n];
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
            f64::from(from.rgba[4 * (y as usize * w + x as usize) + c])
        };
        for c in 0..4 {
            let top = at(0.0, 0.0, c) * (1.0 - tx) + at(1.0, 0.0, c) * tx;
            let bottom = at(0.0, 1.0, c) * (1.0 - tx) + at(1.0, 1.0, c) * tx;
            rgba[4 * i + c] = (top * (1.0 - ty) + bottom * ty).round() as u8;
        }
    }
    let hidden = (from.hidden.is_some() || unseen.contains(&255)).then_some(unseen);
    Picture { rgba, mask, depth, hidden }
}

fn over_white(p: &[u8]) -> [u8; 3] {
    let a = u32::from(p[3]);
    [0, 1, 2].map(|c| ((u32::from(p[c]) * a + 255 * (255 - a) + 127) / 255) as u8)
}
