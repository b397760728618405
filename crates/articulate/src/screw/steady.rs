//! Cameras aligned once more, view by view, to what stands still in all states.
//!
//! Within one state, front and back of a box are never in one picture: how thick the box is only the recorded poses know, and with
//! poses half a degree off it breathes from state to state. A drawer is measured in the pictures of the front, its cabinet mostly in
//! those of the back. The base is the same in all states, so each view is aligned to the base as all states together measured it.

use super::cloud::{DepthView, merge};
use super::evidence::{Evidence, Motion};
use crate::icp::{self, Surface};
use glam::Vec3;
use hingecast_geom::Pose;
use rayon::prelude::*;

/// Points per view.
const POINTS: usize = 2500;
/// Fewer points of the base hold no camera.
const FEW: usize = 120;
/// Gates of the rounds, voxels.
const GATES: [f64; 6] = [1.5, 1.5, 1.0, 1.0, 0.7, 0.7];
/// Pull towards the pose that the view's own state gave it, share of the pull towards the surface.
const TETHER: f64 = 0.003;
/// A point's label is that of the nearest sample of its state within this many voxels.
const NEAR: f32 = 1.5;

/// The base of all states as one surface. `labels`: the part of every point of every state's cloud.
pub fn base(evidence: &Evidence, labels: &[Vec<u8>]) -> Surface {
    let still = evidence.clouds.iter().zip(labels).flat_map(|(cloud, labels)| {
        let own = (0..labels.len()).filter(|&i| labels[i] == 0);
        own.map(|i| (cloud.points[i], cloud.normals[i]))
    });
    let cloud = merge(still, evidence.lattice.voxel, 2);
    Surface::new(cloud.points, cloud.normals)
}

/// Corrects the cameras of one state's views in place. `labels`: the part of every point of this state's cloud.
pub fn align(views: &mut [DepthView], evidence: &Evidence, state: usize, labels: &[u8], base: &Surface) {
    let (cloud, voxel) = (&evidence.clouds[state], evidence.lattice.voxel);
    let stands = |x: Vec3| {
        let near = cloud.nearest(x).filter(|(_, squared)| *squared < (NEAR * voxel).powi(2));
        near.is_some_and(|(i, _)| labels[i] == 0)
    };
    views.par_iter_mut().for_each(|view| {
        let pixels = view.class.iter().filter(|c| **c == super::cloud::OBJECT).count();
        let stride = ((pixels as f64 / POINTS as f64).sqrt().round() as usize).max(1);
        let (mut points, mut normals) = (Vec::new(), Vec::new());
        view.planes(stride, &mut |x, n| {
            if stands(x) {
                points.push(x);
                normals.push(n);
            }
        });
        if points.len() < FEW {
            return;
        }
        let gates = GATES.map(|g| g * voxel as f64);
        let (pose, report) = icp::align_tethered(&points, &normals, base, Pose::IDENTITY, &gates, TETHER);
        let moved = Motion::from(pose);
        let far = points.iter().map(|x| moved.apply(*x).distance(*x)).fold(0.0, f32::max);
        if report.inliers > 0.3 && far < 2.0 * voxel {
            view.camera.camera_from_world = view.camera.camera_from_world * pose.inverse();
        }
    });
}
