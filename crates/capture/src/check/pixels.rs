//! Every image is decoded once: readable, of the right size, not the same bytes twice, masks that
//! make sense.

use super::{Finding, Fix, Severity, address, error, warning};
use crate::recording::mask;
use crate::recording::transforms::Document;
use crate::{CaptureError, Recording, Split, View};
use glam::{DVec2, DVec3};
use hingecast_geom::{Camera, Progress};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use xxhash_rust::xxh3::xxh3_128;

/// Width of the thumbnails (of depth and mask) that the check of space works on, pixels at most.
const THUMBNAIL: usize = 96;
/// Points of a view that are compared with other views.
const POINTS: usize = 150;

/// What is kept of a frame's pixels. Thumbnail pixels are samples of the image, not means.
pub(super) struct Look {
    /// Share of pixels in the mask; of those at the border; of those in the middle quarter.
    pub mask: f64,
    pub border: f64,
    pub middle: f64,
    pub has_mask: bool,
    /// Thumbnail size and the image pixels per thumbnail pixel.
    pub width: usize,
    pub height: usize,
    pub step: f64,
    /// Depth [scene units], 0 = unknown, empty without depth; and object mask.
    pub depth: Vec<f32>,
    pub object: Vec<u8>,
    /// Pixels of each number of a mask that has several, where nobody said which is the object.
    labels: mask::Labels,
    hash: u128,
}

impl Look {
    /// Image position of the centre of thumbnail pixel `i`.
    pub fn uv(&self, i: usize) -> DVec2 {
        DVec2::new((i % self.width) as f64 + 0.5, (i / self.width) as f64 + 0.5) * self.step
    }

    /// Thumbnail pixel at image position `uv`.
    pub fn pixel(&self, uv: DVec2) -> Option<usize> {
        let p = (uv / self.step).floor();
        let inside = p.x >= 0.0 && p.y >= 0.0 && p.x < self.width as f64 && p.y < self.height as f64;
        inside.then(|| p.y as usize * self.width + p.x as usize)
    }

    /// Some of the object's points, in the world, at depth times `scale`.
    pub fn points(&self, camera: &Camera, scale: f64) -> Vec<DVec3> {
        let good: Vec<usize> = (0..self.depth.len()).filter(|&i| self.object[i] == 1 && self.depth[i] > 0.0).collect();
        let n = good.len().min(POINTS);
        let at = |i: usize| camera.unproject(self.uv(i), f64::from(self.depth[i]) * scale);
        (0..n).map(|k| at(good[k * good.len() / n])).collect()
    }
}

/// `None` for frames that cannot be decoded.
pub(super) fn check(
    documents: &[Document],
    recording: &Recording,
    progress: &Progress,
    out: &mut Vec<Finding>,
) -> Result<Vec<Option<Look>>, CaptureError> {
    let done = AtomicUsize::new(0);
    let n = recording.frames.len();
    let looks: Vec<Result<Look, CaptureError>> = (0..n)
        .into_par_iter()
        .map(|i| {
            progress.report(done.fetch_add(1, Ordering::Relaxed) + 1, n, "images")?;
            let view = recording.load(i)?;
            let bytes =
                std::fs::read(&recording.frames[i].color).map_err(|e| CaptureError::read(&recording.root, e))?;
            let has_mask = recording.frames[i].mask.is_some() || view.mask.contains(&0);
            let mut look = Look::new(&view, has_mask, xxh3_128(&bytes));
            let frame = &recording.frames[i];
            if let Some(path) = frame.mask.as_ref().filter(|_| frame.mask_ids.is_empty() || !view.mask.contains(&1)) {
                look.labels = mask::labels(path)?;
            }
            Ok(look)
        })
        .collect();
    progress.check()?;
    let mut kept = Vec::with_capacity(n);
    for (i, look) in looks.into_iter().enumerate() {
        match look {
            Ok(look) => kept.push(Some(look)),
            Err(e) => {
                kept.push(None);
                let (file, index, _) = address(documents, recording, i);
                let code = match () {
                    // Named by the description's check already.
                    () if e.what.contains("missing") => continue,
                    () if e.what.contains("camera says") => "image-size",
                    () if e.what.contains("depth") => "depth-format",
                    () => "image-unreadable",
                };
                out.push(Finding { fix: Some(Fix::DropFrame { file, index }), ..error(code, e) });
            }
        }
    }
    // When every image has another size, the file is wrong, not the images.
    let wrong_size = out.iter().filter(|f| f.code == "image-size").count();
    if wrong_size * 2 > n {
        out.iter_mut().filter(|f| f.code == "image-size").for_each(|f| f.fix = None);
    }
    same_bytes(documents, recording, &kept, out);
    masks(documents, recording, &kept, out);
    Ok(kept)
}

impl Look {
    fn new(view: &View, has_mask: bool, hash: u128) -> Self {
        let (w, h) = (view.camera.width, view.camera.height);
        let share = |wanted: &dyn Fn(usize, usize) -> bool| {
            let (mut inside, mut all) = (0usize, 0usize);
            for i in (0..w * h).filter(|i| wanted(i % w, i / w)) {
                all += 1;
                inside += usize::from(view.mask[i]);
            }
            inside as f64 / all.max(1) as f64
        };
        let step = (w.max(h) as f64 / THUMBNAIL as f64).max(1.0);
        let (width, height) = (((w as f64 / step) as usize).max(1), ((h as f64 / step) as usize).max(1));
        let at = |i: usize| {
            let (x, y) = (((i % width) as f64 + 0.5) * step, ((i / width) as f64 + 0.5) * step);
            (y as usize).min(h - 1) * w + (x as usize).min(w - 1)
        };
        let usable = |i: usize| view.usable[i] == 1;
        let n = if view.depth.is_empty() { 0 } else { width * height };
        Self {
            mask: share(&|_, _| true),
            border: share(&|x, y| x == 0 || y == 0 || x + 1 == w || y + 1 == h),
            middle: share(&|x, y| (x * 4 / w == 1 || x * 4 / w == 2) && (y * 4 / h == 1 || y * 4 / h == 2)),
            has_mask,
            width,
            height,
            step,
            depth: (0..n).map(at).map(|i| if usable(i) { view.depth[i] } else { 0.0 }).collect(),
            object: (0..width * height).map(at).map(|i| view.mask[i] & view.usable[i]).collect(),
            labels: mask::Labels::new(),
            hash,
        }
    }
}

/// Shares of a picture between which a mask shows an object.
const SHOWS: std::ops::RangeInclusive<f64> = 2e-4..=0.995;

/// States of a masked recording of which hardly a mask shows the object: what such a state shows is then taken
/// for the object as a whole, or for nothing.
fn unmasked_states(recording: &Recording, looks: &[Option<Look>]) -> Vec<Finding> {
    let of_state = |state: usize| {
        let frames = recording.frames_of(state, Split::Train);
        let asked: Vec<&Look> =
            frames.iter().filter(|&&i| !recording.frames[i].occluded).filter_map(|&i| looks[i].as_ref()).collect();
        let good = asked.iter().filter(|l| l.has_mask && SHOWS.contains(&l.mask)).count();
        (2 * good < asked.len()).then(|| {
            let what =
                format!("only {good} of the {} pictures of a state have a mask that shows the object", asked.len());
            let place = format!("{}: state {state}: frames[].mask_path", recording.root.display());
            let hint = "give that state masks, too; or take all mask_path out: build then looks for the object itself";
            Finding { state: Some(state), ..error("state-unmasked", CaptureError::new(what, place, hint)) }
        })
    };
    (0..recording.n_states).filter_map(of_state).collect()
}

fn same_bytes(documents: &[Document], recording: &Recording, looks: &[Option<Look>], out: &mut Vec<Finding>) {
    let mut first_of = BTreeMap::<u128, usize>::new();
    for (i, look) in looks.iter().enumerate() {
        let Some(look) = look else { continue };
        let first = *first_of.entry(look.hash).or_insert(i);
        let (a, b) = (&recording.frames[first], &recording.frames[i]);
        // The same camera may see the same: what moved between the states was hidden from it.
        let nothing_moved = a.state != b.state && a.camera == b.camera;
        if first == i || a.color == b.color || nothing_moved {
            continue;
        }
        let (file, index, place) = address(documents, recording, i);
        let place = format!("{place}: {} and {}", a.color.display(), b.color.display());
        // Only within a state is it clear which of the two may go: both show the same.
        let fix = (a.state == b.state).then_some(Fix::DropFrame { file, index });
        let what = "two pictures have identical bytes".to_string();
        out.push(Finding {
            fix,
            ..warning("duplicate-image", what, place, "drop one, or export the right picture again")
        });
    }
}

fn masks(documents: &[Document], recording: &Recording, looks: &[Option<Look>], out: &mut Vec<Finding>) {
    let known: Vec<(usize, &Look)> =
        looks.iter().enumerate().filter_map(|(i, l)| Some((i, l.as_ref()?))).filter(|(_, l)| l.has_mask).collect();
    if known.is_empty() {
        return;
    }
    let numbers = mask::sum(known.iter().map(|(_, l)| &l.labels));
    let chosen = known.iter().map(|(i, _)| &recording.frames[*i].mask_ids).find(|ids| !ids.is_empty());
    if numbers.len() > 1 {
        let place = recording.root.display().to_string();
        match chosen {
            None => {
                let what = format!(
                    "masks have {} numbers, all taken for the object: {}",
                    numbers.len(),
                    mask::listed(&numbers)
                );
                let hint = "right if they are parts of one thing; else name the object's: \"mask_id\": N in transforms.json, \
                            or hingecast import --mask-id N";
                out.push(warning("mask-labels", what, place, hint));
            }
            Some(ids) if known.iter().all(|(_, l)| l.mask == 0.0) => {
                let what = format!("no pixel of any mask is {}", mask::words(ids));
                let hint = format!("the numbers of the masks are {}: correct mask_id", mask::listed(&numbers));
                out.push(error("mask-labels", CaptureError::new(what, format!("{place}: mask_id"), hint)));
                return;
            }
            Some(_) => {}
        }
    }
    out.extend(unmasked_states(recording, looks));
    // An inverted mask covers the border of the picture and spares its middle.
    let inverted: Vec<usize> =
        known.iter().filter(|(_, l)| l.border > 0.8 && l.middle < l.border - 0.2).map(|(i, _)| *i).collect();
    for &i in &inverted {
        let (file, index, place) = address(documents, recording, i);
        let path = recording.frames[i].mask.clone().unwrap_or_else(|| recording.frames[i].color.clone());
        let place = format!("{place}: {}", path.display());
        let hint = "the object should be white, the background black: invert the masks";
        let e = CaptureError::new("a mask seems inverted: it covers the border and spares the middle", place, hint);
        let plain = recording.frames[i].mask.is_some() && recording.frames[i].mask_ids.is_empty();
        let fix = plain.then_some(Fix::InvertMask { file, index });
        out.push(Finding { fix, ..error("mask-inverted", e) });
    }
    for (i, look) in known.into_iter().filter(|(i, _)| !inverted.contains(i)) {
        let occluded = recording.frames[i].occluded;
        let (what, code) = match look.mask {
            m if m < *SHOWS.start() && !occluded => ("a mask is empty: the object is not in the picture", "mask-empty"),
            m if m > *SHOWS.end() => ("a mask covers the whole picture", "mask-full"),
            _ => continue,
        };
        let (file, index, place) = address(documents, recording, i);
        let path = recording.frames[i].mask.as_ref().unwrap_or(&recording.frames[i].color);
        let place = format!("{place}: {}", path.display());
        let fix = Some(Fix::DropFrame { file, index });
        let finding = warning(code, what.into(), place, "segment the object again, or drop the frame");
        out.push(Finding { severity: Severity::Error, fix, ..finding });
    }
}
