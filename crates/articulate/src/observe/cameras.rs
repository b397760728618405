//! Camera poses that tracking left half a degree off, corrected by the depth that they measured
//! together.
//!
//! Per state: every view's points are aligned to the surface that all views of the state agree on
//! (point to plane), the surface is gathered anew, and so on. What all views have in common cannot
//! be seen from within, so the mean correction is taken out again: errors of many cameras average
//! out, errors of one do not.

use super::cloud::merge;
use super::depth_view::DepthView;
use super::robust::deviation;
use crate::model::mean::{mean_point, without_mean};
use glam::Vec3;
use hingecast_geom::Pose;
use hingecast_geom::icp::{self, Surface};
use rayon::prelude::*;

/// Rounds of aligning and gathering.
const ROUNDS: usize = 7;
/// Points per view that hold an object's cameras.
pub const POINTS: usize = 1200;
/// Fewer points hold no camera.
const FEW: usize = 60;
/// Pull towards the recorded pose, share of the pull towards the surface. Front and back of a box
/// are never in one picture: how thick it is only the recorded poses know.
const TETHER: f64 = 0.01;
/// Below this share of a voxel the views agree already.
const SHARP: f32 = 0.04;

/// Corrects the cameras of one state's views in place, by about `count` points of each; leaves them
/// alone where they agree already. `voxel`: edge of the cells that views are compared in, scene units;
/// a cell should hold points of several views.
pub fn align(views: &mut [DepthView], voxel: f32, count: usize) {
    let planes: Vec<Vec<(Vec3, Vec3)>> = views
        .par_iter()
        .map(|view| {
            let stride = view.stride_for(count);
            let mut out = Vec::new();
            view.planes(stride, &mut |x, n, _| out.push((x, n)));
            out
        })
        .collect();
    let centre = mean_point(planes.iter().flatten().map(|(x, _)| *x));
    // World as corrected from world as recorded.
    let mut corrections = vec![Pose::IDENTITY; views.len()];
    for round in 0..ROUNDS {
        let cloud = merge(
            planes.iter().zip(&corrections).flat_map(|(p, c)| {
                let (rot, trans) = (c.mat3().as_mat3(), c.trans.as_vec3());
                p.iter().map(move |(x, n)| (rot * *x + trans, rot * *n, 1.0))
            }),
            voxel,
            2,
        );
        let surface = Surface::new(cloud.points, cloud.normals);
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
                let (pose, report) = icp::align_tethered(&points, &normals, &surface, *c, &gates, TETHER);
                if report.inliers < 0.3 { *c } else { pose }
            })
            .collect();
        corrections = without_mean(&stepped, centre);
    }
    for (view, c) in views.iter_mut().zip(&corrections) {
        view.camera.camera_from_world = view.camera.camera_from_world * c.inverse();
    }
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
