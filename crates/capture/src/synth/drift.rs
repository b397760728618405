//! Drift of a tracker: along the way, the stated poses wander off from the true ones, smoothly.

use super::world::Drift;
use glam::{DQuat, DVec3};
use hingecast_geom::{Camera, Pose, random::normal};

/// How much of its pace the drift keeps from one view to the next.
const KEPT: f64 = 0.8;

/// How far each of `n` views is off: turn and shift in the world's axes, about and of the camera's
/// centre. The first is right; the worst of each is off by exactly what `drift` says. `mm`: scene
/// units.
pub(super) fn along(n: usize, drift: &Drift, mm: f64, rng: &mut fastrand::Rng) -> Vec<(DQuat, DVec3)> {
    let (turns, shifts) = (wander(n, rng), wander(n, rng));
    let pair = |(turn, shift): (DVec3, DVec3)| {
        (DQuat::from_scaled_axis(turn * drift.deg.to_radians()), shift * (drift.mm * mm))
    };
    turns.into_iter().zip(shifts).map(pair).collect()
}

/// A random walk with momentum from 0, of which the farthest place is 1 away.
fn wander(n: usize, rng: &mut fastrand::Rng) -> Vec<DVec3> {
    let (mut x, mut pace) = (DVec3::ZERO, DVec3::ZERO);
    let mut way = Vec::with_capacity(n);
    for _ in 0..n {
        way.push(x);
        pace = pace * KEPT + DVec3::new(normal(rng), normal(rng), normal(rng));
        x += pace;
    }
    let farthest = way.iter().map(|x| x.length()).fold(0.0, f64::max);
    way.into_iter().map(|x| x / farthest.max(1e-12)).collect()
}

/// The camera as a tracker that has drifted states it.
pub(super) fn stated(camera: Camera, (turn, shift): (DQuat, DVec3)) -> Camera {
    let world_from_camera = camera.camera_from_world.inverse();
    let off = Pose::new((turn * world_from_camera.rot).normalize(), world_from_camera.trans + shift);
    Camera { camera_from_world: off.inverse(), ..camera }
}
