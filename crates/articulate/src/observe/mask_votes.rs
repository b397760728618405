//! What the views of a state say about each other's masks.
//!
//! A pixel without mask and without depth says that its whole ray is empty. If a mask lacks a piece of
//! the object, and depth was cut to it, that is wrong; and a mask may hold a piece of floor or wall. Both
//! ways one view speaks against others that look at the same place, and most are believed.

use super::cloud::Cloud;
use super::depth_view::{BACKGROUND, DepthView, OBJECT, OTHER, UNKNOWN};
use glam::Vec3;
use hingecast_geom::{Camera, Pose, Projection};
use rayon::prelude::*;

/// A view measured a sample if its depth there is within so many voxels of it.
const SAME: f32 = 2.0;
/// So many views against one: cameras that are a little off miss a thin bar now and then.
const OUTVOTED: u32 = 2;

/// A view whose mask lacks so large a share of what the object's surface covers is corrected. Less may be
/// gaps between thin bars.
const LACKS: f32 = 0.1;
/// Where so large a share of a state's samples is outvoted, its masks are ragged. Exact ones: 0.0001.
const RAGGED: f32 = 0.003;
/// Of so many views two must bear out what could be one's mistake: a sample by its pixels, or an empty
/// cell where masks are ragged. Of fewer each sees much alone.
pub(super) const MANY_VIEWS: usize = 8;
/// Half a sample's square, shares of the distance between samples: squares of neighbours overlap.
const HALF: f32 = 0.6;

/// What a state's views said of each other's masks.
pub struct MaskVotes {
    /// Of every view: pixels that look like background and are none.
    pub silent: Vec<Vec<u32>>,
    /// Masks held what is not the object.
    pub too_much: bool,
    /// Views that must look through a cell before it is free.
    pub least: u32,
}

/// Lets the views of a state vote: takes what is outvoted out of `cloud`, and hushes pixels of `views`.
pub fn vote(cloud: &mut Cloud, views: &mut [DepthView], voxel: f32) -> MaskVotes {
    let samples = cloud.points.len();
    drop_outvoted(cloud, views, voxel);
    let too_much = (samples - cloud.points.len()) as f32 > RAGGED * samples as f32;
    let of_view = |view: &DepthView| contradicted(&view.camera, &cloud.points, voxel, &|i| view.class[i] == BACKGROUND);
    let silent: Vec<Vec<u32>> = views.par_iter().map(of_view).collect();
    hush(views, &silent);
    let ragged = too_much || silent.iter().any(|pixels| !pixels.is_empty());
    let least = if ragged && views.len() >= MANY_VIEWS { 2 } else { 1 };
    MaskVotes { silent, too_much, least }
}

/// Takes samples out that are no surface of the object by what most views say: their masks leave the
/// place out, and nothing hides it from them.
fn drop_outvoted(cloud: &mut Cloud, views: &[DepthView], voxel: f32) {
    let projections: Vec<Projection> = views.iter().map(|v| Projection::new(&v.camera, &Pose::IDENTITY)).collect();
    let stays = |x: &Vec3| {
        let said = |(view, projection): (&DepthView, &Projection)| {
            let x = projection.to_camera(*x);
            projection.pixel(x).and_then(|i| is_object(view, i, x.z, SAME * voxel))
        };
        let (mut yes, mut no) = (0u32, 0u32);
        for answer in views.iter().zip(&projections).filter_map(said) {
            *(if answer { &mut yes } else { &mut no }) += 1;
        }
        no <= OUTVOTED * yes
    };
    let stays: Vec<bool> = cloud.points.par_iter().map(stays).collect();
    let all = cloud.points.iter().zip(&cloud.normals).zip(&stays);
    (cloud.points, cloud.normals) = all.filter(|(_, stays)| **stays).map(|((x, n), _)| (*x, *n)).unzip();
}

/// Whether depth `z` at pixel `i` is the object's: measured there or beside it; or no mask is around,
/// and what is seen is not before it. `None`: the view cannot tell.
fn is_object(view: &DepthView, i: usize, z: f32, same: f32) -> Option<bool> {
    let (w, h) = (view.camera.width, view.camera.height);
    let (x, y) = (i % w, i / w);
    let rows = y.saturating_sub(1)..(y + 2).min(h);
    let around = rows.flat_map(|y| (x.saturating_sub(1)..(x + 2).min(w)).map(move |x| y * w + x));
    let mut not = true;
    for j in around {
        match view.class[j] {
            OBJECT if (view.depth[j] - z).abs() < same => return Some(true),
            OTHER => not &= view.depth[j] > z - same,
            class => not &= class == BACKGROUND,
        }
    }
    not.then_some(false)
}

/// Pixels that `silent` calls background and on whose rays `points` lie: surface that other views of
/// the state measured, world frame, `spacing` scene units apart. A rim of a pixel along the outline of
/// the points is never among them, so that exact masks lose nothing. None at all if the mask lacks less
/// than a tenth.
pub fn contradicted(camera: &Camera, points: &[Vec3], spacing: f32, silent: &dyn Fn(usize) -> bool) -> Vec<u32> {
    let (w, h) = (camera.width, camera.height);
    let projection = Projection::new(camera, &Pose::IDENTITY);
    let seen: Vec<(f32, usize)> = points
        .iter()
        .filter_map(|x| {
            let x = projection.to_camera(*x);
            (x.z > 0.0).then(|| projection.pixel(x).map(|i| (x.z, i))).flatten()
        })
        .collect();
    // No square around any of them reaches further.
    let Some(nearest) = seen.iter().map(|s| s.0).reduce(f32::min) else { return Vec::new() };
    let reach = |z: f32| (HALF * spacing * camera.fx.max(camera.fy) as f32 / z).ceil() as usize;
    let mut on = vec![false; w * h];
    for (z, i) in seen {
        let (x, y, r) = (i % w, i / w, reach(z));
        for row in y.saturating_sub(r)..(y + r + 1).min(h) {
            on[row * w + x.saturating_sub(r)..row * w + (x + r + 1).min(w)].fill(true);
        }
    }
    let inner = shrunk(&on, w, h, reach(nearest) + 1);
    let covered = inner.iter().filter(|on| **on).count();
    let found: Vec<u32> = (0..w * h).filter(|i| inner[*i] && silent(*i)).map(|i| i as u32).collect();
    if found.len() as f32 > LACKS * covered as f32 { found } else { Vec::new() }
}

/// The pixels all of whose neighbours within `r` along rows and columns are on; beyond the picture all
/// is.
fn shrunk(on: &[bool], w: usize, h: usize, r: usize) -> Vec<bool> {
    let along = |on: &[bool], n: usize, of: &dyn Fn(usize) -> usize, out: &mut [bool]| {
        // Distance to the last pixel that was off, forwards and backwards.
        let mut run = usize::MAX;
        for k in 0..n {
            run = if on[of(k)] { run.saturating_add(1) } else { 0 };
            out[of(k)] = run > r;
        }
        run = usize::MAX;
        for k in (0..n).rev() {
            run = if on[of(k)] { run.saturating_add(1) } else { 0 };
            out[of(k)] &= run > r;
        }
    };
    let (mut rows, mut both) = (vec![false; w * h], vec![false; w * h]);
    (0..h).for_each(|y| along(on, w, &|k| y * w + k, &mut rows));
    (0..w).for_each(|x| along(&rows, h, &|k| k * w + x, &mut both));
    both
}

/// These pixels say nothing.
pub fn hush(views: &mut [DepthView], pixels: &[Vec<u32>]) {
    for (view, pixels) in views.iter_mut().zip(pixels) {
        pixels.iter().for_each(|i| view.class[*i as usize] = UNKNOWN);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    /// A plate of 2 x 2 before a camera, whose mask lacks a quarter of it: the quarter is named, but for
    /// the rim; of the true background nothing is.
    #[test]
    fn a_hole_of_a_mask_is_no_background() {
        let camera = Camera::look_at(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y, 120, 90, 0.8);
        let spacing = 0.04;
        let n = 50;
        let points: Vec<Vec3> = (0..n * n)
            .map(|k| Vec3::new((k % n) as f32 + 0.5, (k / n) as f32 + 0.5, 0.0) * spacing - Vec3::new(1.0, 1.0, 0.0))
            .collect();
        let plate = |i: usize| {
            let ray = camera.ray(glam::DVec2::new((i % 120) as f64 + 0.5, (i / 120) as f64 + 0.5));
            let x = ray * (5.0 / -ray.z);
            (x.x.abs() < 1.0 && x.y.abs() < 1.0, x.x > 0.0 && x.y > 0.0)
        };
        let all = contradicted(&camera, &points, spacing, &|i| !plate(i).0);
        assert!(all.is_empty(), "true background: {}", all.len());
        let hole: Vec<usize> = (0..120 * 90).filter(|i| plate(*i) == (true, true)).collect();
        let found = contradicted(&camera, &points, spacing, &|i| !plate(i).0 || plate(i).1);
        assert!(found.len() > hole.len() * 7 / 10 && found.len() <= hole.len(), "{} of {}", found.len(), hole.len());
        assert!(found.iter().all(|i| hole.contains(&(*i as usize))));
    }

    /// Eight cameras around a table's corner: one mask holds a piece of floor, and another lacks a quarter
    /// of the table. Most are believed, and from then on two must look through.
    #[test]
    fn most_views_are_believed() {
        let looks = |k: usize| {
            let turn = k as f64 * std::f64::consts::TAU / 8.0;
            let eye = DVec3::new(3.0 * turn.cos(), 3.0 * turn.sin(), 4.0);
            Camera::look_at(eye, DVec3::ZERO, DVec3::Z, 120, 90, 0.8)
        };
        let view = |k: usize| {
            let camera = looks(k);
            let (mut depth, mut class) = (vec![0.0; 120 * 90], vec![BACKGROUND; 120 * 90]);
            for i in 0..120 * 90 {
                let ray = camera.ray(glam::DVec2::new((i % 120) as f64 + 0.5, (i / 120) as f64 + 0.5));
                let eye = camera.camera_from_world.inverse().trans;
                let on = |height: f64| eye + ray * ((height - eye.z) / ray.z);
                let (top, floor) = (on(0.5), on(-0.5));
                let lacks = k == 1 && top.x > 0.0 && top.y > 0.0;
                let on_top = top.x.abs() < 0.8 && top.y.abs() < 0.8;
                let held = k == 2 && floor.x > 1.2 && floor.x < 1.8 && floor.y.abs() < 0.5;
                if on_top && !lacks || held && !on_top {
                    let x = if on_top { top } else { floor };
                    (depth[i], class[i]) = (camera.project(x).1 as f32, OBJECT);
                }
            }
            DepthView { camera, depth, class }
        };
        let mut views: Vec<DepthView> = (0..8).map(view).collect();
        let mut cloud = super::super::cloud::gather(&views, 0.06, 1, 1);
        let low = |cloud: &Cloud| cloud.points.iter().filter(|x| x.z < 0.0).count();
        let (floor, all) = (low(&cloud), cloud.points.len());
        assert!(floor > 50, "{floor} samples of the floor");
        let votes = vote(&mut cloud, &mut views, 0.06);
        assert_eq!(low(&cloud), 0, "the floor is outvoted");
        assert_eq!(cloud.points.len(), all - floor, "and nothing else is");
        assert!(votes.too_much && votes.least == 2);
        let hushed: Vec<usize> = votes.silent.iter().map(Vec::len).collect();
        assert!(hushed[1] > 100 && hushed.iter().sum::<usize>() == hushed[1], "{hushed:?}");
        // The same without a fault: nothing happens.
        let mut views: Vec<DepthView> = (3..8).chain(3..8).map(view).collect();
        let mut cloud = super::super::cloud::gather(&views, 0.06, 1, 1);
        let votes = vote(&mut cloud, &mut views, 0.06);
        assert!(!votes.too_much && votes.least == 1 && votes.silent.iter().all(Vec::is_empty));
    }
}
