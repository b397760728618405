//! Camera poses that tracking left half a degree off, corrected by the depth that they measured
//! together.
//!
//! Per state: every view's points are aligned to the surface that all views of the state agree on
//! (point to plane), the surface is gathered anew, and so on. What all views have in common cannot
//! be seen from within, so the mean correction is taken out again: errors of many cameras average
//! out, errors of one do not.

use super::cloud::merge;
use super::depth_view::DepthView;
use super::occupancy::facing_bit;
use super::robust::deviation;
use crate::model::mean::{mean_point, without_mean};
use glam::Vec3;
use hingecast_geom::Pose;
use hingecast_geom::icp::{self, Surface};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Rounds of aligning and gathering.
const ROUNDS: usize = 7;
/// Points per view that hold an object's cameras.
pub const POINTS: usize = 1200;
/// Fewer points hold no camera.
const FEW: usize = 60;
/// Pull towards the recorded pose, share of the pull towards the surface. Front and back of a box
/// are never in one picture: how thick it is only the recorded poses know.
pub const TETHER: f64 = 0.01;
/// Below this share of a voxel the views agree already.
const SHARP: f32 = 0.04;

/// Corrects the cameras of one state's views in place, by about `count` points of each; leaves them
/// alone where they agree already. `voxel`: edge of the cells that views are compared in, scene units;
/// a cell should hold points of several views. `tether`: [`TETHER`], or more where the recorded poses are good.
pub fn align(views: &mut [DepthView], voxel: f32, count: usize, tether: f64) {
    let planes = planes(views, count);
    let centre = mean_point(planes.iter().flatten().map(|(x, _)| *x));
    // World as corrected from world as recorded.
    let mut corrections = vec![Pose::IDENTITY; views.len()];
    for round in 0..ROUNDS {
        let surface = agreed(&planes, &corrections, voxel);
        if round == 0 && residual(&planes, &surface) < SHARP * voxel {
            return;
        }
        let wide = if round < 2 { 3.0 } else { 1.5 };
        let gates = [wide, wide, 0.7 * wide].map(|g| g * voxel as f64);
        let stepped: Vec<Pose> = planes
            .par_iter()
            .zip(&corrections)
            .map(|(p, c)| {
                if p.len() < FEW {
                    return *c;
                }
                let (points, normals): (Vec<Vec3>, Vec<Vec3>) = p.iter().copied().unzip();
                let (pose, report) = icp::align_tethered(&points, &normals, &surface, *c, &gates, tether);
                if report.inliers < 0.3 { *c } else { pose }
            })
            .collect();
        corrections = without_mean(&stepped, centre);
    }
    for (view, c) in views.iter_mut().zip(&corrections) {
        view.camera.camera_from_world = view.camera.camera_from_world * c.inverse();
    }
}

/// How far the points of one state's views are off the surface that all agree on, scene units: the
/// median. Arguments as for [`align`].
pub fn disagreement(views: &[DepthView], voxel: f32, count: usize) -> f32 {
    let planes = planes(views, count);
    residual(&planes, &agreed(&planes, &vec![Pose::IDENTITY; views.len()], voxel))
}

/// Share of the surface of every other view that lies on what the rest of the views saw, give or take
/// `voxel`, 0..1: near 1 where all that is seen stands still. Facings count alike: a floor lies on itself
/// however it is turned.
pub fn agreement(views: &[DepthView], voxel: f32, count: usize) -> f64 {
    let planes = planes(views, count);
    let side = |odd: usize| planes.iter().skip(odd).step_by(2).flatten().copied();
    let (points, normals): (Vec<Vec3>, Vec<Vec3>) = side(0).unzip();
    let surface = Surface::new(points, normals);
    let mut facings: BTreeMap<u32, (usize, usize)> = BTreeMap::new();
    for (x, n) in side(1) {
        let Some((i, squared)) = surface.nearest(x) else { continue };
        let m = surface.normals[i];
        let lies = squared < (3.0 * voxel).powi(2) && n.dot(m) > 0.8 && m.dot(x - surface.points[i]).abs() < voxel;
        let (on, all) = facings.entry(facing_bit(n)).or_default();
        (*on, *all) = (*on + usize::from(lies), *all + 1);
    }
    let some = facings.values().filter(|(_, all)| *all >= FEW);
    let shares: Vec<f64> = some.map(|(on, all)| *on as f64 / *all as f64).collect();
    shares.iter().sum::<f64>() / shares.len().max(1) as f64
}

/// About `count` points of every view, with their normals.
fn planes(views: &[DepthView], count: usize) -> Vec<Vec<(Vec3, Vec3)>> {
    let of_view = |view: &DepthView| {
        let mut out = Vec::new();
        view.planes(view.stride_for(count), &mut |x, n, _| out.push((x, n)));
        out
    };
    views.par_iter().map(of_view).collect()
}

/// The surface that several views see, each as corrected.
fn agreed(planes: &[Vec<(Vec3, Vec3)>], corrections: &[Pose], voxel: f32) -> Surface {
    let moved = planes.iter().zip(corrections).flat_map(|(p, c)| {
        let (rot, trans) = (c.mat3().as_mat3(), c.trans.as_vec3());
        p.iter().map(move |(x, n)| (rot * *x + trans, rot * *n, 1.0))
    });
    let cloud = merge(moved, voxel, 2);
    Surface::new(cloud.points, cloud.normals)
}

/// Median distance of the planes' points from the surface, as recorded.
fn residual(planes: &[Vec<(Vec3, Vec3)>], surface: &Surface) -> f32 {
    let mut off: Vec<f32> = planes
        .par_iter()
        .flat_map_iter(|p| p.iter().step_by(11))
        .filter_map(|(x, n)| {
            let (i, _) = surface.nearest(*x)?;
            (surface.normals[i].dot(*n) > 0.8).then(|| surface.normals[i].dot(*x - surface.points[i]).abs())
        })
        .collect();
    deviation(&mut off)
}
