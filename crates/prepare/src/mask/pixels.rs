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
/// Beyond this share of z, times pixels, depth around a pixel has an edge.
const EDGE: f32 = 4.0;
/// A pixel that is half in front of an edge measures as far behind the front as it is before the
/// back, on a bar of one pixel twice as far: how far is looked, and in how many steps.
const NEARER: f32 = 2.0;
const STEPS: usize = 12;
/// Pixels without depth that hang together are void from this share of the picture on.
const VOID: f64 = 0.02;
/// Blobs of fewer pixels are specks.
const SPECK: usize = 12;
/// What moves reaches at most so far beyond where it rested, diagonals of the object.
const REACH: f32 = 0.75;
/// An object that touches the border in this share of the views is cut off.
const CUT: f64 = 0.5;

/// The masks of a state's views: 1 = object.
pub(super) fn masks(views: &[DepthView], object: &Object, supports: &[Plane]) -> Vec<Vec<u8>> {
    views.par_iter().map(|view| mask(view, object, supports, &|x, _| object.has(x))).collect()
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
    views.par_iter().map(|view| mask(view, object, supports, &|x, i| own(view, x, i))).collect()
}

/// `has`: whether a place, world frame, that a pixel shows is the object's.
fn mask(view: &DepthView, object: &Object, supports: &[Plane], has: &(dyn Fn(Vec3, usize) -> bool + Sync)) -> Vec<u8> {
    let world_from_camera = view.camera.camera_from_world.inverse();
    let (rot, trans) = (world_from_camera.mat3().as_mat3(), world_from_camera.trans.as_vec3());
    let (w, h) = (view.camera.width, view.camera.height);
    let is_object = |i: usize| {
        let x = place(view, &rot, trans, i)?;
        Some(!supports.iter().any(|p| p.holds(x, view.depth[i])) && has(x, i))
    };
    let plain: Vec<Option<bool>> = (0..w * h).map(is_object).collect();
    // Time-of-flight cameras mix front and back at edges: what is nearer to the front is the front's.
    let known: Vec<Option<bool>> = (0..w * h)
        .map(|i| {
            let own = plain[i]?;
            let Some(Edge { front, back }) = Edge::at(view, i).filter(|_| !own) else { return Some(own) };
            let x = place(view, &rot, trans, i)?;
            // What lies on floor or wall does not fly.
            if supports.iter().any(|p| p.holds(x, view.depth[i])) {
                return Some(false);
            }
            let (z, near, far) = (view.depth[i], view.depth[front], view.depth[back]);
            if z - near > far - z {
                return Some(false);
            }
            Some(plain[front] == Some(true) || in_front(object, supports, trans, x, z, NEARER * (far - z)))
        })
        .collect();
    // Where nothing comes back from far around, in a large piece, there is sky, or a room beyond reach.
    let mut void = vec![false; w * h];
    for blob in blobs(w * h, w, |i| known[i].is_none()).filter(|b| b.len() as f64 > VOID * (w * h) as f64) {
        let deep = blob.into_iter().filter(|i| around(*i, AROUND, w, h).all(|j| known[j].is_none()));
        deep.for_each(|i| void[i] = true);
    }
    // Where depth is missing, the neighbours decide.
    let filled = |i: usize| {
        if let Some(own) = known[i] {
            return u8::from(own);
        }
        let (mut yes, mut no) = (0, 0);
        for j in around(i, AROUND, w, h) {
            match known[j] {
                Some(true) => yes += 1,
                Some(false) => no += 1,
                None => no += usize::from(void[j]),
            }
        }
        u8::from(yes > no)
    };
    let mut mask: Vec<u8> = (0..w * h).map(filled).collect();
    without_blobs(&mut mask, w, 1, SPECK);
    without_blobs(&mut mask, w, 0, SPECK);
    mask
}

/// Whether the object is on the way from the camera at `eye` to `x`, at most `reach` of z before its `z`.
fn in_front(object: &Object, supports: &[Plane], eye: Vec3, x: Vec3, z: f32, reach: f32) -> bool {
    (1..=STEPS).map(|k| z - reach * k as f32 / STEPS as f32).filter(|nearer| *nearer > 0.0).any(|nearer| {
        let x = eye + nearer / z * (x - eye);
        object.has(x) && !supports.iter().any(|p| p.holds(x, nearer))
    })
}

/// An edge of the depth around a pixel: the pixels that are in front and at the back of it.
struct Edge {
    front: usize,
    back: usize,
}

impl Edge {
    /// `None` where the surface goes on all around.
    fn at(view: &DepthView, i: usize) -> Option<Self> {
        let (w, h) = (view.camera.width, view.camera.height);
        let (mut front, mut back) = (i, i);
        for j in around(i, 1, w, h).filter(|j| view.class[*j] == OBJECT) {
            front = if view.depth[j] < view.depth[front] { j } else { front };
            back = if view.depth[j] > view.depth[back] { j } else { back };
        }
        let jump = EDGE / view.camera.fx as f32 * view.depth[i];
        (view.depth[back] - view.depth[front] > jump).then_some(Self { front, back })
    }
}

/// Pixels at most `reach` away along both axes, row by row.
pub(crate) fn around(i: usize, reach: isize, w: usize, h: usize) -> impl Iterator<Item = usize> {
    let (x, y) = ((i % w) as isize, (i / w) as isize);
    let rows = (y - reach).max(0)..=(y + reach).min(h as isize - 1);
    rows.flat_map(move |v| {
        ((x - reach).max(0)..=(x + reach).min(w as isize - 1)).map(move |u| v as usize * w + u as usize)
    })
}

/// Turns connected blobs of `value` with fewer pixels than `least` into the other value.
pub(crate) fn without_blobs(mask: &mut [u8], w: usize, value: u8, least: usize) {
    let old = mask.to_vec();
    for blob in blobs(old.len(), w, |i| old[i] == value).filter(|b| b.len() < least) {
        blob.into_iter().for_each(|i| mask[i] = 1 - value);
    }
}

/// Connected pixels that are `wanted`, of a picture of `n` pixels and width `w`; in the order of their first
/// ones.
fn blobs(n: usize, w: usize, wanted: impl Fn(usize) -> bool) -> impl Iterator<Item = Vec<usize>> {
    let mut seen = vec![false; n];
    (0..n).filter_map(move |start| {
        if seen[start] || !wanted(start) {
            return None;
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
                Some(i + w).filter(|j| *j < n),
            ];
            for j in beside.into_iter().flatten() {
                if !seen[j] && wanted(j) {
                    seen[j] = true;
                    blob.push(j);
                }
            }
        }
        Some(blob)
    })
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

#[cfg(test)]
mod tests {
    use super::*;
    use hingecast_articulate::UNKNOWN;
    use hingecast_articulate::observe::lattice::Lattice;
    use hingecast_geom::{Camera, Pose};

    const W: usize = 64;

    /// A camera at the origin that looks along z; depth as given, 0 = nothing came back.
    fn view(depth: Vec<f32>) -> DepthView {
        let c = W as f64 / 2.0;
        let camera =
            Camera { width: W, height: W, fx: 80.0, fy: 80.0, cx: c, cy: c, camera_from_world: Pose::default() };
        let class = depth.iter().map(|z| if *z > 0.0 { OBJECT } else { UNKNOWN }).collect();
        DepthView { camera, depth, class }
    }

    /// All that is nearer than 1.2.
    fn object() -> Object {
        let lattice = Lattice::new(Vec3::new(-2.0, -2.0, 0.0), Vec3::new(2.0, 2.0, 3.0), 100);
        let cells = (0..lattice.len()).map(|i| lattice.centre(lattice.coords(i)).z < 1.2).collect();
        Object { lattice, cells }
    }

    fn of(view: &DepthView) -> Vec<u8> {
        let object = object();
        mask(view, &object, &[], &|x, _| object.has(x))
    }

    /// Bars of one, two and six pixels, 1 away before a wall 2 away, every pixel the mean of those beside it.
    #[test]
    fn flying_pixels_go_with_what_they_are_nearer_to() {
        let is_bar = |x: usize| x == 10 || (20..22).contains(&x) || (40..46).contains(&x);
        let exact = |x: usize| if is_bar(x) { 1.0f32 } else { 2.0 };
        let mixed = |x: usize| 0.25 * (exact(x.max(1) - 1) + 2.0 * exact(x) + exact((x + 1).min(W - 1)));
        let flown = view((0..W * W).map(|i| mixed(i % W)).collect());
        let found = of(&flown);
        let row: Vec<usize> = (0..W).filter(|x| found[30 * W + x] == 1).collect();
        assert_eq!(row, (0..W).filter(|x| is_bar(*x)).collect::<Vec<_>>());
    }

    /// The object before the sky: its mask grows by a pixel at most, as many as an edge loses.
    #[test]
    fn sky_around_the_object_is_not_the_object() {
        let before = |x: usize, y: usize| (20..40).contains(&x) && (20..40).contains(&y);
        let sky = view((0..W * W).map(|i| if before(i % W, i / W) { 1.0 } else { 0.0 }).collect());
        let found = of(&sky);
        let count: usize = found.iter().map(|m| usize::from(*m)).sum();
        assert!((400..=22 * 22).contains(&count), "{count}");
        // A hole in the object is filled.
        let hole = |x: usize, y: usize| (25..28).contains(&x) && (25..28).contains(&y);
        let holed = view((0..W * W).map(|i| if hole(i % W, i / W) { 0.0 } else { 1.0 }).collect());
        assert!(of(&holed).iter().all(|m| *m == 1));
    }
}
