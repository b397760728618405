//! The hands of a play: each holds a moving part where a person would, moves along with it, and is
//! seen by every training camera.
//!
//! A hand holds where the part sticks out farthest from its hinge, in the middle of that edge; a
//! slide is held in the middle of its front. It is rigid in the part's frame, lets go while the
//! joint rests and takes hold at the same spot again. The forearm comes from where, over all the
//! states in which it holds, it stays clearest of the object and above what the object stands on.

use super::occluder::{self, FOREARM};
use super::ranges::sample;
use crate::object::{ArticulatedObject, PartGeometry};
use glam::DVec3;
use hingecast_geom::{Joint, JointKind, Pose};

/// A person goes through 25 states in five seconds.
pub(super) const SECS_PER_STATE: f64 = 0.2;
/// Off the middle of the edge a place is worth this much less a unit of length.
const OFF_MIDDLE: f64 = 0.5;
/// Directions for the forearm that are tried.
const DIRECTIONS: usize = 96;
/// Distances from the grip at which its clearance is asked, shares of hand and forearm together.
const ALONG: [f64; 5] = [0.2, 0.35, 0.5, 0.75, 1.0];
/// Hand without forearm, m.
const HAND: f64 = 0.19;

pub(super) struct Hand {
    pub part: usize,
    /// In the part's canonical frame.
    pub geometry: PartGeometry,
    /// In which it holds.
    pub states: Vec<usize>,
}

/// A hand for every joint that moves in `states`. `film`: a hand holds on through short rests.
pub(super) fn hold(object: &ArticulatedObject, states: &[Vec<f64>], film: bool, metres_per_unit: f64) -> Vec<Hand> {
    let joints = object.tree.joints.iter().enumerate();
    let one = |(j, joint): (usize, &Joint)| {
        let moving = moving_states(j, states);
        let held = if film { super::film::held(moving) } else { moving };
        // Between two joints of one body there is nothing to hold.
        let solid = !object.parts[joint.child].faces.is_empty();
        (!held.is_empty() && solid).then(|| {
            let grip = grip(object, joint, states[held[held.len() - 1]][j] - states[held[0]][j]);
            let unit = 1.0 / metres_per_unit;
            let outward = outward(object, joint.child, grip, states, &held, unit);
            let skin = object.materials.len() as u32;
            Hand { part: joint.child, geometry: occluder::arm(grip, outward, unit, skin), states: held }
        })
    };
    joints.filter_map(one).collect()
}

/// States before or after which the joint moves.
fn moving_states(joint: usize, states: &[Vec<f64>]) -> Vec<usize> {
    let q = |s: usize| states[s][joint];
    let moves = |s: &usize| q(s.saturating_sub(1)) != q(*s) || q((s + 1).min(states.len() - 1)) != q(*s);
    (0..states.len()).filter(moves).collect()
}

/// Where the part is held, canonical frame. `way`: how far the joint goes, with its sign.
fn grip(object: &ArticulatedObject, joint: &Joint, way: f64) -> DVec3 {
    let points = sample([&object.parts[joint.child]].into_iter());
    let centre = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
    let axis = joint.screw.axis;
    let worth = |x: &DVec3| match joint.screw.kind {
        JointKind::Prismatic => {
            let off = *x - centre;
            let ahead = off.dot(axis) * way.signum();
            ahead - OFF_MIDDLE * off.reject_from_normalized(axis).length()
        }
        _ => joint.screw.distance(*x) - OFF_MIDDLE * (*x - centre).dot(axis).abs(),
    };
    points.into_iter().max_by(|a, b| worth(a).total_cmp(&worth(b))).unwrap_or(joint.screw.pivot)
}

/// Where the forearm comes from, canonical frame, unit.
fn outward(
    object: &ArticulatedObject,
    part: usize,
    grip: DVec3,
    states: &[Vec<f64>],
    held: &[usize],
    unit: f64,
) -> DVec3 {
    let length = (HAND + FOREARM[1]) * unit;
    // First, last and what lies between: a forearm that is clear there is clear on the way.
    let asked = [0, 1, 2, 3, 4].map(|k| held[k * (held.len() - 1) / 4]);
    let surfaces: Vec<Vec<DVec3>> =
        object.parts.iter().map(|p| sample([p].into_iter()).into_iter().step_by(4).collect()).collect();
    let scenes: Vec<(Pose, Vec<DVec3>, f64)> = asked
        .iter()
        .map(|&s| {
            let poses = object.tree.poses(&states[s]);
            let points = surfaces.iter().zip(&poses).flat_map(|(points, pose)| points.iter().map(|x| pose.apply(*x)));
            (poses[part], points.collect(), object.bounds(&states[s]).0.z)
        })
        .collect();
    let clearance = |direction: &DVec3| {
        let mut least = f64::INFINITY;
        for (pose, points, ground) in &scenes {
            for share in ALONG {
                let x = pose.apply(grip + *direction * (share * length));
                let surface = points.iter().map(|p| p.distance_squared(x)).fold(f64::INFINITY, f64::min).sqrt();
                // As an angle seen from the grip: near it everything is near.
                least = least.min(surface.min(x.z - ground) / (share * length));
            }
        }
        least
    };
    sphere(DIRECTIONS).max_by(|a, b| clearance(a).total_cmp(&clearance(b))).unwrap_or(DVec3::Z)
}

/// Unit vectors all around: a Fibonacci spiral.
fn sphere(n: usize) -> impl Iterator<Item = DVec3> {
    let golden = std::f64::consts::TAU * (2.0 / (1.0 + 5f64.sqrt()));
    (0..n).map(move |i| {
        let z = 1.0 - 2.0 * (i as f64 + 0.5) / n as f64;
        let (s, c) = (golden * i as f64).sin_cos();
        let r = (1.0 - z * z).sqrt();
        DVec3::new(r * c, r * s, z)
    })
}
