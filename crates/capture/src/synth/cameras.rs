//! Cameras on the upper hemisphere around the object, all at one distance, looking at its centre.

use super::world::Placement;
use crate::object::ArticulatedObject;
use glam::DVec3;
use hingecast_geom::Camera;
use std::f64::consts::TAU;

/// Sines of the lowest and highest elevation: from just above the horizon to almost straight down.
const LOWEST: f64 = 0.04;
const HIGHEST: f64 = 0.985;
/// The object reaches at most this share of the half frame, in the view where it is largest: about
/// 80 % on average.
const FILL: f64 = 0.94;

/// `n` unit vectors from the centre to the cameras: a Fibonacci spiral, uniform over the area,
/// turned and jittered.
pub(crate) fn directions(n: usize, rng: &mut fastrand::Rng) -> Vec<DVec3> {
    let golden = TAU * (2.0 / (1.0 + 5f64.sqrt()));
    let turn = rng.f64() * TAU;
    // Up to 40 % of the distance between neighbours: enough to break the pattern, too little to
    // open holes.
    let jitter = 0.4 / (n.max(1) as f64).sqrt();
    (0..n)
        .map(|i| {
            let z = LOWEST + (HIGHEST - LOWEST) * (i as f64 + 0.5) / n as f64;
            let z = (z + jitter * (rng.f64() - 0.5)).clamp(LOWEST, HIGHEST);
            let azimuth = turn + golden * i as f64 + 2.0 * jitter * (rng.f64() - 0.5);
            let r = (1.0 - z * z).sqrt();
            DVec3::new(r * azimuth.cos(), r * azimuth.sin(), z)
        })
        .collect()
}

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

    /// Smallest distance of cameras in `directions` at which all points stay within the frame.
    pub fn distance(&self, directions: &[DVec3], fov: f64) -> f64 {
        let slope = FILL * (0.5 * fov).tan();
        let mut distance = 0.0f64;
        for &d in directions {
            let unit = Camera::look_at(self.centre + d, self.centre, DVec3::Z, 2, 2, fov);
            for &p in &self.points {
                // In camera axes, with the camera at distance D: |x| / (D - depth towards camera)
                // <= slope.
                let x = unit.camera_from_world.rotate(p - self.centre);
                distance = distance.max(x.x.abs().max(x.y.abs()) / slope - x.z);
            }
        }
        distance
    }

    pub fn camera(&self, direction: DVec3, distance: f64, size: usize, fov: f64) -> Camera {
        Camera::look_at(self.centre + direction * distance, self.centre, DVec3::Z, size, size, fov)
    }
}
