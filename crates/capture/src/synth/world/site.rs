//! Where in the room the object stands: the space that it needs, the floor below it, the wall
//! behind it. All in the world frame, scene units.

use super::Placement;
use crate::object::ArticulatedObject;
use glam::DVec3;

/// Between the wall and what comes nearest to it in any state, m.
const GAP: [f64; 2] = [0.01, 0.03];
/// The floor lies this much below the lowest point, m: two surfaces in one place would flicker.
const BELOW: f64 = 0.0005;
/// Joint configurations between two states at which the needed space is asked.
const BETWEEN: usize = 4;
/// Cameras stay in front of the plane through the object's centre that is parallel to the wall: by
/// this share of their distance.
const AHEAD: f64 = 0.12;

pub(crate) struct Site {
    /// Horizontal unit vector along x or y, from the wall to the object.
    pub front: DVec3,
    /// Horizontal unit vector along the wall.
    pub side: DVec3,
    /// Corners of the box, along the axes, that holds the object in all states and between them.
    pub lo: DVec3,
    pub hi: DVec3,
    /// Height of the floor.
    pub floor: f64,
    /// The wall is where x . front equals this.
    pub wall: f64,
    /// Scene units of a metre.
    pub metre: f64,
}

impl Site {
    /// `states`: the joint values, of the recorded ones and then of the held-out ones.
    pub fn new(
        object: &ArticulatedObject,
        states: &[Vec<f64>],
        placement: &Placement,
        front: DVec3,
        metre: f64,
        seed: u64,
    ) -> Self {
        let (mut lo, mut hi) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let mut grow = |q: &[f64], state: usize| {
            for x in object.posed_vertices(&placement.part_poses(object, q, state)) {
                (lo, hi) = (lo.min(x), hi.max(x));
            }
        };
        for state in 0..states.len() {
            let (here, next) = (&states[state], &states[(state + 1).min(states.len() - 1)]);
            for k in 0..BETWEEN {
                let t = k as f64 / BETWEEN as f64;
                let q: Vec<f64> = here.iter().zip(next).map(|(a, b)| a + t * (b - a)).collect();
                grow(&q, state);
            }
        }
        let gap = GAP[0] + (GAP[1] - GAP[0]) * fastrand::Rng::with_seed(seed ^ 0x7761_6c6c).f64();
        let back = lo.dot(front).min(hi.dot(front));
        let (floor, wall) = (lo.z - BELOW * metre, back - gap * metre);
        Self { front, side: front.cross(DVec3::Z), lo, hi, floor, wall, metre }
    }

    /// A direction from the object to a camera, moved to the front half space: what lies behind is
    /// mirrored, what lies beside is turned forward a little.
    pub fn in_front(&self, direction: DVec3) -> DVec3 {
        let ahead = direction.dot(self.front);
        let wanted = ahead.abs().max(AHEAD);
        (direction + self.front * (wanted - ahead)).normalize()
    }

    /// Corners of the needed space along `side` and `front`: lower and upper ends.
    pub fn footprint(&self) -> [[f64; 2]; 2] {
        [self.side, self.front].map(|axis| {
            let (a, b) = (self.lo.dot(axis), self.hi.dot(axis));
            [a.min(b), a.max(b)]
        })
    }
}
