//! From the object's cells to its pixels.

use super::pieces::{Object, flies};
use super::place;
use super::planes::Plane;
use glam::Vec3;
use hingecast_articulate::observe::witness::{Witness, counted};
use hingecast_articulate::{DepthView, OBJECT};
use rayon::prelude::*;

/// Pixels around one without depth that say what it is.
const AROUND: isize = 3;
/// Blobs of fewer pixels are specks.
const SPECK: usize = 12;
/// What moves reaches at most so far beyond where it rested, diagonals of the object.
const REACH: f32 = 0.75;
/// An object that touches the border in this share of the views is cut off.
const CUT: f64 = 0.5;

/// The masks of a state's views: 1 = object.
pub(super) fn masks(views: &[DepthView], object: &Object, supports: &[Plane]) -> Vec<Vec<u8>> {
    views.par_iter().map(|view| mask(view, supports, &|x, _| object.has(x))).collect()
}

/// The masks of pictures of a film, of which `scan` shows the object with nobody near: the scan's
/// object, what stands where the scan looked through, not farther off than the object may reach, and what
/// the scan could not see inside the object's box. Hands are in them.
pub(super) fn of_film(views: &[DepthView], object: &Object, supports: &[Plane], scan: &[Witness]) -> Vec<Vec<u8>> {
    let (lo, hi) = object.bounds();
    let (reach, voxel) = (Vec3::splat(REACH * (hi - lo).length()), object.lattice.voxel);
    let within = |x: Vec3, around: Vec3| x.cmpge(lo - around).all() && x.cmple(hi + around).all();
    let own = |view: &DepthView, x: Vec3, i: usize| {
        let (through, on) = counted(scan, x, 0.0);
        let (moved, unseen) = (through >= 2 && through > on, through + on == 0);
        let near = moved && within(x, reach) || unseen && within(x, Vec3::splat(voxel));
        object.has(x) || near && !flies(view, i, view.camera.width)
    };
    views.par_iter().map(|view| mask(view, supports, &|x, i| own(view, x, i))).collect()
}

/// `has`: whether a place, world frame, that a pixel shows is the object's.
fn mask(view: &DepthView, supports: &[Plane], has: &(dyn Fn(Vec3, usize) -> bool + Sync)) -> Vec<u8> {
    let world_from_camera = view.camera.camera_from_world.inverse();
    let (rot, trans) = (world_from_camera.mat3().as_mat3(), world_from_camera.trans.as_vec3());
    let (w, h) = (view.camera.width, view.camera.height);
    let is_object = |i: usize| {
        let x = place(view, &rot, trans, i)?;
        Some(!supports.iter().any(|p| p.holds(x, view.depth[i])) && has(x, i))
    };
    let known: Vec<Option<bool>> = (0..w * h).map(is_object).collect();
    // Where depth is missing, the neighbours decide.
    let filled = |i: usize| {
        if let Some(own) = known[i] {
            return u8::from(own);
        }
        let (x, y) = ((i % w) as isize, (i / w) as isize);
        let (mut yes, mut no) = (0, 0);
        for v in (y - AROUND).max(0)..=(y + AROUND).min(h as isize - 1) {
            for u in (x - AROUND).max(0)..=(x + AROUND).min(w as isize - 1) {
                match known[v as usize * w + u as usize] {
                    Some(true) => yes += 1,
                    Some(false) => no += 1,
                    None => {}
                }
            }
        }
        u8::from(yes > no)
    };
    let mut mask: Vec<u8> = (0..w * h).map(filled).collect();
    without_blobs(&mut mask, w, 1, SPECK);
    without_blobs(&mut mask, w, 0, SPECK);
    mask
}

/// Turns connected blobs of `value` with fewer pixels than `least` into the other value.
pub(crate) fn without_blobs(mask: &mut [u8], w: usize, value: u8, least: usize) {
    let mut seen = vec![false; mask.len()];
    for start in 0..mask.len() {
        if seen[start] || mask[start] != value {
            continue;
        }
        seen[start] = true;
        let (mut blob, mut next) = (vec![start], 0);
        while next < blob.len() {
            let i = blob[next];
            next += 1;
            let beside = [
                (!i.is_multiple_of(w)).then(|| i - 1),
                (i % w + 1 < w).then_some(i + 1),
                i.checked_sub(w),
                Some(i + w).filter(|j| *j < mask.len()),
            ];
            for j in beside.into_iter().flatten() {
                if !seen[j] && mask[j] == value {
                    seen[j] = true;
                    blob.push(j);
                }
            }
        }
        if blob.len() < least {
            blob.iter().for_each(|&i| mask[i] = 1 - value);
        }
    }
}

/// Share of the pixels with depth that are the object's.
pub(super) fn share(views: &[DepthView], masks: &[Vec<u8>]) -> f64 {
    let (mut own, mut all) = (0usize, 0usize);
    for (view, mask) in views.iter().zip(masks) {
        let known = (0..mask.len()).filter(|&i| view.class[i] == OBJECT);
        known.for_each(|i| {
            all += 1;
            own += usize::from(mask[i] == 1);
        });
    }
    own as f64 / all.max(1) as f64
}

/// What the masks themselves give cause to doubt.
pub(super) fn doubts(masks: &[Vec<Vec<u8>>], doubts: &mut Vec<String>) {
    for (state, views) in masks.iter().enumerate() {
        let empty = views.iter().filter(|m| m.iter().all(|v| *v == 0)).count();
        if empty as f64 > CUT * views.len() as f64 {
            doubts.push(format!(
                "state {state}: the object is in {} of {} views only",
                views.len() - empty,
                views.len()
            ));
        }
    }
}
