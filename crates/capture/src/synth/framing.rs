//! Cameras that have the object in the middle of the picture, and the distance at which all of it
//! is in the picture.

use super::trajectory::Stand;
use super::world::{Lens, Placement};
use crate::object::ArticulatedObject;
use glam::{DQuat, DVec3};
use hingecast_geom::{Camera, Pose};

/// The object reaches at most this share of the half frame, in the view where it is largest: about
/// 80 % on average.
const FILL: f64 = 0.94;

/// Everything that the cameras must keep in the frame.
pub(crate) struct Subject {
    pub centre: DVec3,
    /// A thinned set of surface points over all states.
    points: Vec<DVec3>,
}

impl Subject {
    /// The object in the joint configurations `states`, where it stands in them.
    pub fn new(object: &ArticulatedObject, states: &[Vec<f64>], placement: &Placement) -> Self {
        let mut points = Vec::new();
        for (state, q) in states.iter().enumerate() {
            let poses = placement.part_poses(object, q, state);
            let count = object.parts.iter().map(|p| p.vertices.len()).sum::<usize>();
            // 4000 of the vertices; a prime stride does not fall into step with a mesh's rows.
            let stride = [1, 3, 7, 13, 29, 61, 127].into_iter().find(|s| count / s <= 4000).unwrap_or(257);
            points.extend(object.posed_vertices(&poses).step_by(stride));
        }
        let first = points.first().copied().unwrap_or_default();
        let (lo, hi) = points.iter().fold((first, first), |(lo, hi), &x| (lo.min(x), hi.max(x)));
        Self { centre: 0.5 * (lo + hi), points }
    }

    /// Smallest distance of cameras at `stands` at which all points stay within the frame, were
    /// each held upright.
    pub fn distance<'a>(&self, stands: impl Iterator<Item = &'a Stand>, optics: &Optics) -> f64 {
        let [across, down] = optics.slopes;
        let mut distance = 0.0f64;
        for stand in stands {
            let unit = optics.camera(self.centre + stand.direction, self.centre);
            for &p in &self.points {
                // In camera axes, with the camera at distance D: |x| / (D - depth towards camera)
                // <= slope.
                let x = unit.camera_from_world.rotate(p - self.centre);
                distance = distance.max((x.x.abs() / across).max(x.y.abs() / down) - x.z);
            }
        }
        distance
    }

    pub fn camera(&self, stand: &Stand, distance: f64, optics: &Optics) -> Camera {
        let camera = optics.camera(self.centre + stand.direction * (distance * stand.farther), self.centre);
        if stand.held == DVec3::ZERO {
            return camera;
        }
        let held = Pose::new(DQuat::from_scaled_axis(stand.held), DVec3::ZERO);
        Camera { camera_from_world: held * camera.camera_from_world, ..camera }
    }
}

/// The lens of all cameras.
pub(super) struct Optics {
    lens: Lens,
    /// Largest |x / z| and |y / z| of what must be in the frame, on its narrower side.
    slopes: [f64; 2],
}

impl Optics {
    /// Square pictures of `size` pixels with a field of view in radians.
    pub fn square(size: usize, fov: f64) -> Self {
        let c = Camera::look_at(DVec3::X, DVec3::ZERO, DVec3::Z, size, size, fov);
        let lens = Lens { width: size, height: size, fx: c.fx, fy: c.fy, cx: c.cx, cy: c.cy };
        Self { lens, slopes: [FILL * (0.5 * fov).tan(); 2] }
    }

    pub fn of(lens: Lens) -> Self {
        let slope = |n: usize, f: f64, c: f64| FILL * c.min(n as f64 - c) / f;
        let Lens { width, height, fx, fy, cx, cy } = lens;
        Self { lens, slopes: [slope(width, fx, cx), slope(height, fy, cy)] }
    }

    /// The camera at `eye` that has `target` on its axis.
    fn camera(&self, eye: DVec3, target: DVec3) -> Camera {
        let Lens { width, height, fx, fy, cx, cy } = self.lens;
        Camera { width, height, fx, fy, cx, cy, ..Camera::look_at(eye, target, DVec3::Z, width, height, 1.0) }
    }
}
