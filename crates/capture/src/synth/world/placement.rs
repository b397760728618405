//! Where the object stands in each state, and in which frame of reference the state is recorded.

use super::config::{Frames, Push};
use crate::object::ArticulatedObject;
use crate::synth::SynthConfig;
use glam::{DQuat, DVec3};
use hingecast_geom::{Camera, Pose, random::normal};
use std::f64::consts::TAU;

/// How far the origins of the frames of two states may be apart, m.
const FARTHEST_FRAME: f64 = 2.0;
/// A push goes at most this far to either side of straight away from the wall, radians.
const PUSH_SIDEWAYS: f64 = 1.3;

/// Poses per state, held-out states last. Empty: the identity in all states, which is not even
/// multiplied, so that recordings without pushes keep their last bit.
#[derive(Clone, Debug, Default)]
pub(crate) struct Placement {
    pub world_from_object: Vec<Pose>,
    pub recording_from_world: Vec<Pose>,
}

impl Placement {
    /// `times` of all states, in numbers of recorded states; `front`: see [`super::front`].
    pub fn new(
        object: &ArticulatedObject,
        config: &SynthConfig,
        times: &[f64],
        front: DVec3,
        metres_per_unit: f64,
    ) -> Self {
        let pushed = config.world.push.as_ref().map(|push| {
            let done = pushes(object, config, push, front, 1e-3 / metres_per_unit);
            let at = |t: &f64| done.iter().rfind(|(s, _)| *s as f64 <= *t).map_or(Pose::IDENTITY, |p| p.1);
            times.iter().map(at).collect()
        });
        let own = (config.world.frames != Frames::Shared).then(|| {
            let moved = |s: usize| s > 0 && s < config.states;
            // A film is one capture, with one frame.
            let capture = |s: usize| if config.film.is_some() { s.min(1) } else { s };
            let frame =
                |s: usize| if moved(s) { own_frame(config, capture(s), 1.0 / metres_per_unit) } else { Pose::IDENTITY };
            (0..times.len()).map(frame).collect()
        });
        Self { world_from_object: pushed.unwrap_or_default(), recording_from_world: own.unwrap_or_default() }
    }

    /// Poses of the parts with the joints at `q`, in the world of `state`.
    pub fn part_poses(&self, object: &ArticulatedObject, q: &[f64], state: usize) -> Vec<Pose> {
        let mut poses = object.tree.poses(q);
        if let Some(placed) = self.world_from_object.get(state) {
            poses.iter_mut().for_each(|p| *p = *placed * *p);
        }
        poses
    }

    /// Where the object as a whole stands in `state`.
    pub fn of_object(&self, state: usize) -> Pose {
        self.world_from_object.get(state).copied().unwrap_or_default()
    }

    /// A camera of the world as the recording of `state` states it.
    pub fn stated(&self, camera: Camera, state: usize) -> Camera {
        match self.recording_from_world.get(state) {
            None => camera,
            Some(frame) => Camera { camera_from_world: camera.camera_from_world * frame.inverse(), ..camera },
        }
    }
}

/// The first state after each push and where the object stands from then on. `mm`: scene units.
fn pushes(object: &ArticulatedObject, config: &SynthConfig, push: &Push, front: DVec3, mm: f64) -> Vec<(usize, Pose)> {
    let mut rng = fastrand::Rng::with_seed(config.seed ^ 0x7075_7368);
    let mut states = push.states.clone();
    states.sort_unstable();
    if states.is_empty() {
        states.push(rng.usize(1..config.states));
    }
    let (lo, hi) = object.bounds(&vec![0.0; object.tree.joints.len()]);
    let middle = 0.5 * (lo + hi);
    let side = front.cross(DVec3::Z);
    let mut placed = Pose::IDENTITY;
    let one = |state: usize| {
        let (sin, cos) = (PUSH_SIDEWAYS * (2.0 * rng.f64() - 1.0)).sin_cos();
        let turn = DQuat::from_rotation_z(if rng.bool() { push.deg } else { -push.deg }.to_radians());
        let about = placed.apply(middle);
        let shift = (front * cos + side * sin) * (push.mm * mm);
        placed = Pose::new(turn, about - turn * about + shift) * placed;
        (state, placed)
    };
    states.into_iter().map(one).collect()
}

/// `recording_from_world` of a state. `metre`: scene units.
fn own_frame(config: &SynthConfig, state: usize, metre: f64) -> Pose {
    let seed = config.seed ^ 0x6672_616d_6573 ^ ((state as u64) << 40);
    let mut rng = fastrand::Rng::with_seed(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15));
    let mut direction = || DVec3::new(normal(&mut rng), normal(&mut rng), normal(&mut rng)).normalize_or(DVec3::X);
    let (shift, axis) = (direction(), direction());
    // Uniform over the ball.
    let far = rng.f64().cbrt() * FARTHEST_FRAME * metre;
    let yaw = DQuat::from_rotation_z(TAU * rng.f64());
    let tilt = DQuat::from_axis_angle(axis, TAU * rng.f64());
    Pose::new(if config.world.frames == Frames::Tilted { tilt * yaw } else { yaw }, shift * far)
}
