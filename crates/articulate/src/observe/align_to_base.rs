//! Cameras aligned once more, view by view, to what stands still in all states.
//!
//! Within one state, front and back of a box are never in one picture: how thick the box is only
//! the recorded poses know, and with poses half a degree off it breathes from state to state. A
//! drawer is measured in the pictures of the front, its cabinet mostly in those of the back. The
//! base is the same in all states, so each view is aligned to the base as all states together
//! measured it.

use super::cloud::merge;
use super::depth_view::DepthView;
use super::evidence::Evidence;
use super::sample::Motion;
use crate::config::MANY_STATES;
use glam::Vec3;
use hingecast_geom::Pose;
use hingecast_geom::icp::{self, Surface};
use rayon::prelude::*;

/// Points per view.
const POINTS: usize = 2500;
/// Fewer points of the base hold no camera.
const FEW: usize = 120;
/// Gates of the rounds, voxels.
const GATES: [f64; 6] = [1.5, 1.5, 1.0, 1.0, 0.7, 0.7];
/// Pull towards the pose that the view's own state gave it, share of the pull towards the surface.
pub const TETHER: f64 = 0.003;
/// A point's label is that of the nearest sample of its state within this many voxels.
const NEAR: f32 = 1.5;

/// The base of all states as one surface. `labels`: the part of every point of every state's cloud.
pub fn base(evidence: &Evidence, labels: &[Vec<u8>]) -> Surface {
    let still = evidence.clouds.iter().zip(labels).flat_map(|(cloud, labels)| {
        let own = (0..labels.len()).filter(|&i| labels[i] == 0);
        own.map(|i| (cloud.points[i], cloud.normals[i], 1.0))
    });
    // What one state alone has may be mislabelled.
    let least = if evidence.n_states() < MANY_STATES { 1 } else { 2 };
    let cloud = merge(still, evidence.lattice.voxel, least);
    Surface::new(cloud.points, cloud.normals)
}

/// Corrects the cameras of one state's views in place. `labels`: the part of every point of this
/// state's cloud; `tether`: [`TETHER`], or more where the recorded poses are good.
pub fn align(views: &mut [DepthView], evidence: &Evidence, state: usize, labels: &[u8], base: &Surface, tether: f64) {
    let (cloud, voxel) = (&evidence.clouds[state], evidence.lattice.voxel);
    let stands = |x: Vec3| {
        let near = cloud.nearest(x).filter(|(_, squared)| *squared < (NEAR * voxel).powi(2));
        near.is_some_and(|(i, _)| labels[i] == 0)
    };
    views.par_iter_mut().for_each(|view| {
        let stride = view.stride_for(POINTS);
        let (mut points, mut normals) = (Vec::new(), Vec::new());
        view.planes(stride, &mut |x, n, _| {
            if stands(x) {
                points.push(x);
                normals.push(n);
            }
        });
        if points.len() < FEW {
            return;
        }
        let gates = GATES.map(|g| g * voxel as f64);
        let (pose, report) = icp::align_tethered(&points, &normals, base, Pose::IDENTITY, &gates, tether);
        let moved = Motion::from(pose);
        let far = points.iter().map(|x| moved.apply(*x).distance(*x)).fold(0.0, f32::max);
        if report.inliers > 0.3 && far < 2.0 * voxel {
            view.camera.camera_from_world = view.camera.camera_from_world * pose.inverse();
        }
    });
}

#[cfg(test)]
mod tests {
    use super::super::depth_view::{BACKGROUND, OBJECT};
    use super::super::lattice::Lattice;
    use super::*;
    use glam::{DVec2, DVec3};
    use hingecast_geom::{Camera, Cancelled};

    /// The depth of the box [-1, 1] x [-0.6, 0.6] x [-0.4, 0.4].
    fn picture(camera: &Camera) -> DepthView {
        let (w, h) = (camera.width, camera.height);
        let (eye, half) = (camera.centre(), DVec3::new(1.0, 0.6, 0.4));
        let mut view = DepthView { camera: *camera, depth: vec![0.0; w * h], class: vec![BACKGROUND; w * h] };
        for i in 0..w * h {
            let ray = camera.ray(DVec2::new((i % w) as f64 + 0.5, (i / w) as f64 + 0.5));
            // Slabs: enter the last, leave the first.
            let (a, b) = ((-half - eye) / ray, (half - eye) / ray);
            let (enter, leave) = (a.min(b).max_element(), a.max(b).min_element());
            if enter < leave {
                let (_, z) = camera.project(eye + ray * enter);
                (view.depth[i], view.class[i]) = (z as f32, OBJECT);
            }
        }
        view
    }

    #[test]
    fn a_camera_that_is_off_comes_back_to_what_stands_still() {
        let around = |k: usize| {
            let turn = k as f64 / 12.0 * std::f64::consts::TAU;
            let eye = DVec3::new(4.0 * turn.cos(), 4.0 * turn.sin(), if k.is_multiple_of(2) { 2.0 } else { -1.5 });
            Camera::look_at(eye, DVec3::ZERO, DVec3::Z, 96, 72, 0.7)
        };
        let cameras: Vec<Camera> = (0..12).map(around).collect();
        let exact: Vec<DepthView> = cameras.iter().map(picture).collect();
        let off = Pose::new(glam::DQuat::from_rotation_z(0.006), DVec3::new(0.01, -0.008, 0.005));
        let disturbed = || {
            let mut views: Vec<DepthView> = cameras.iter().map(picture).collect();
            views[1].camera.camera_from_world = views[1].camera.camera_from_world * off;
            views
        };
        let lattice = Lattice::new(Vec3::splat(-1.1), Vec3::splat(1.1), 48);
        let gathered = |views: &dyn Fn() -> Vec<DepthView>| {
            Evidence::gather::<Cancelled>(1, lattice, &mut |_| Ok(views()), 1).expect("nobody stops it")
        };
        let whole = gathered(&|| exact.iter().map(|v| picture(&v.camera)).collect());
        let base = base(&whole, &[vec![0; whole.clouds[0].points.len()]]);
        let here = gathered(&disturbed);
        let mut views = disturbed();
        align(&mut views, &here, 0, &vec![0; here.clouds[0].points.len()], &base, TETHER);
        // This one sees three faces of the box: nothing is open.
        let error = |view: &DepthView| {
            let back = view.camera.camera_from_world.inverse() * cameras[1].camera_from_world;
            back.apply(DVec3::ZERO).length()
        };
        let before = error(&disturbed()[1]);
        assert!(error(&views[1]) < 0.25 * before, "{} of {before}", error(&views[1]));
        // Nothing that stands still in sight: the camera stays.
        let mut views = disturbed();
        align(&mut views, &here, 0, &vec![1; here.clouds[0].points.len()], &base, TETHER);
        assert_eq!(error(&views[1]), before);
    }
}
