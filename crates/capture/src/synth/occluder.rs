//! The hand and forearm of the person who moves the object, made of capsules. Here it grips the
//! part that moves most around a state and comes from outside, anew in every state; `player` holds
//! on.

use crate::object::{ArticulatedObject, PartGeometry, shapes};
use glam::{DQuat, DVec3};
use hingecast_geom::Pose;

/// Metres, of a grown-up: forearm radius and length, palm radius and half length, finger radius and
/// length.
pub(super) const FOREARM: [f64; 2] = [0.042, 0.45];
const PALM: [f64; 2] = [0.035, 0.03];
const FINGER: [f64; 2] = [0.009, 0.075];
/// sRGB.
pub(super) const SKIN: [f32; 3] = [0.78, 0.57, 0.46];

/// The hand in world coordinates. Its material index is one past the object's materials.
pub(super) fn hand(
    object: &ArticulatedObject,
    states: &[Vec<f64>],
    state: usize,
    metres_per_unit: f64,
    seed: u64,
) -> PartGeometry {
    let mut rng = fastrand::Rng::with_seed(seed ^ 0x68_616e_6400 ^ ((state as u64) << 40));
    let skin = object.materials.len() as u32;
    let unit = 1.0 / metres_per_unit;
    let poses = object.tree.poses(&states[state]);
    let part = held_part(object, states, state);
    let (lo, hi) = object.bounds(&states[state]);
    let centre = 0.5 * (lo + hi);

    // Grip the vertex that lies farthest out of a few: an edge or a handle, not the hinge.
    let vertices = &object.parts[part].vertices;
    let grip = (0..12)
        .filter(|_| !vertices.is_empty())
        .map(|_| poses[part].apply(vertices[rng.usize(0..vertices.len())].as_dvec3()))
        .max_by(|a, b| a.distance(centre).total_cmp(&b.distance(centre)))
        .unwrap_or(centre);
    // The arm comes from outside and above, somewhat at random.
    let random = DVec3::new(rng.f64() - 0.5, rng.f64() - 0.5, rng.f64());
    let outward = ((grip - centre).normalize_or(DVec3::X) + 0.7 * random + 0.2 * DVec3::Z).normalize();

    arm(grip, outward, unit, skin)
}

/// A hand that grips at `grip` and its forearm, which comes along `outward`. `unit`: scene units of
/// a metre.
pub(super) fn arm(grip: DVec3, outward: DVec3, unit: f64, skin: u32) -> PartGeometry {
    let mut out = PartGeometry::default();
    let mut capsule = |from: DVec3, to: DVec3, radius: f64| {
        let along = (to - from).normalize_or(DVec3::Z);
        let pose = Pose::new(DQuat::from_rotation_arc(DVec3::Z, along), 0.5 * (from + to));
        out.append(&shapes::capsule(radius, 0.5 * from.distance(to), skin), &pose, DVec3::ONE);
    };
    let side = outward.any_orthonormal_vector();
    let knuckles = grip + outward * (0.8 * FINGER[1] * unit);
    let wrist = knuckles + outward * (2.0 * (PALM[0] + PALM[1]) * unit);
    capsule(wrist, wrist + outward * (FOREARM[1] * unit), FOREARM[0] * unit);
    for k in [-1.0, 0.0, 1.0] {
        // The palm is three capsules side by side: flatter than one.
        let shift = side * (k * 0.6 * PALM[0] * unit);
        capsule(knuckles + shift, wrist + shift * 0.6, 0.55 * PALM[0] * unit);
    }
    for k in [-1.5, -0.5, 0.5, 1.5] {
        let root = knuckles + side * (k * 2.1 * FINGER[0] * unit);
        capsule(root, root - outward * (FINGER[1] * unit), FINGER[0] * unit);
    }
    let thumb = knuckles + side * (1.1 * PALM[0] * unit) + outward * (0.03 * unit);
    capsule(thumb, thumb + (side * 0.5 - outward) * (0.8 * FINGER[1] * unit), 1.2 * FINGER[0] * unit);
    out
}

/// The part of the joint that moves the largest share of its play between the neighbouring states.
fn held_part(object: &ArticulatedObject, states: &[Vec<f64>], state: usize) -> usize {
    let (before, after) = (&states[state.saturating_sub(1)], &states[(state + 1).min(states.len() - 1)]);
    let share = |j: usize| {
        let all = states.iter().map(|q| q[j]);
        let (lo, hi) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), q| (lo.min(q), hi.max(q)));
        (after[j] - before[j]).abs() / (hi - lo).max(1e-12)
    };
    let joint = (0..object.tree.joints.len()).max_by(|&a, &b| share(a).total_cmp(&share(b)));
    joint.map_or(0, |j| object.tree.joints[j].child)
}
