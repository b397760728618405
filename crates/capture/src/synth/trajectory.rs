//! The ways of the camera: all around from above, a person's arc, or a look from the front.

use super::cameras;
use super::world::{Site, Trajectory};
use glam::DVec3;
use std::f64::consts::TAU;

/// A walk reaches this far to either side of the front, degrees; beside a wall the second.
const WALK: [f64; 2] = [100.0, 80.0];
/// Elevations of a walk, degrees: from the lowest to the highest.
const WALK_HEIGHTS: [f64; 2] = [8.0, 52.0];
/// How much farther than it must a walker stands, from the nearest place to the farthest.
const WALK_DISTANCE: [f64; 2] = [1.08, 1.25];
/// How far a hand lets the camera turn up and down, to the sides and about its axis, degrees.
const WOBBLE: [f64; 3] = [1.2, 1.2, 3.0];
/// `front` reaches this far to either side, degrees, and to this sine of the elevation.
const FRONT: f64 = 70.0;
const FRONT_HIGHEST: f64 = 0.8;

/// Who looks on while somebody plays walks this far to either side of the front, degrees, at these
/// elevations; how many swings of an unsteady hand a picture takes.
const LOOK_ON: f64 = 35.0;
const LOOK_ON_HEIGHTS: [f64; 2] = [18.0, 42.0];
const SWINGS: f64 = 0.02;

/// Where a camera stands and how it is held.
pub(super) struct Stand {
    /// Unit vector from the centre of the object.
    pub direction: DVec3,
    /// Distance from there, times the one at which all is in the picture.
    pub farther: f64,
    /// Rotation vector in the camera's axes, radians; zero: upright, the object in the middle.
    pub held: DVec3,
}

/// `n` places on a way, in the order in which they are taken. `front`: towards which the object
/// opens; with a `site`, all are in front of its wall.
pub(super) fn stands(
    kind: Trajectory,
    n: usize,
    front: DVec3,
    site: Option<&Site>,
    rng: &mut fastrand::Rng,
) -> Vec<Stand> {
    let plain = |direction: DVec3| Stand { direction, farther: 1.0, held: DVec3::ZERO };
    let all: Vec<Stand> = match kind {
        Trajectory::Hemisphere => cameras::directions(n, rng).into_iter().map(plain).collect(),
        Trajectory::Front => from_front(n, front, rng).into_iter().map(plain).collect(),
        Trajectory::Walk => walk(n, front, WALK[usize::from(site.is_some())], rng),
    };
    before_wall(all, site)
}

/// The unit vector at an azimuth about the vertical, counted from `front`, and the sine of an
/// elevation.
fn towards(front: DVec3, azimuth: f64, z: f64) -> DVec3 {
    let r = (1.0 - z * z).sqrt();
    front * (r * azimuth.cos()) + front.cross(DVec3::Z) * (r * azimuth.sin()) + DVec3::Z * z
}

/// Evenly over the patch: rows by height, columns by the golden ratio.
fn from_front(n: usize, front: DVec3, rng: &mut fastrand::Rng) -> Vec<DVec3> {
    let (start, golden) = (rng.f64(), 0.5 * (5f64.sqrt() - 1.0));
    let place = |i: usize| {
        let (u, v) = ((start + golden * i as f64).fract(), (i as f64 + rng.f64()) / n as f64);
        let z = cameras::LOWEST + (FRONT_HIGHEST - cameras::LOWEST) * v;
        towards(front, FRONT.to_radians() * (2.0 * u - 1.0), z)
    };
    (0..n).map(place).collect()
}

/// How a person goes around the front.
struct Way<'a> {
    /// To either side of the front, degrees.
    reach: f64,
    /// Elevations, degrees.
    heights: [f64; 2],
    /// Swings up and down, and nearer and farther, on the way.
    swings: [f64; 2],
    /// Of the hand, about each axis, at a picture and its share of the way.
    unsteady: &'a dyn Fn(usize, f64) -> [f64; 3],
}

/// From one side to the other, up and down, nearer and farther, with a hand that is not steady.
fn arc(n: usize, front: DVec3, way: &Way, rng: &mut fastrand::Rng) -> Vec<Stand> {
    let leftwards = if rng.bool() { 1.0 } else { -1.0 };
    let [height, distance, pitch, yaw, roll] = [(); 5].map(|()| Sway::new(rng));
    let between = |[lo, hi]: [f64; 2], x: f64| lo + (hi - lo) * 0.5 * (1.0 + x);
    let stand = |i: usize| {
        let t = (i as f64 + 0.5) / n as f64;
        let elevation = between(way.heights, height.at(way.swings[0] * t)).to_radians();
        let [a, b, c] = (way.unsteady)(i, t);
        let held = DVec3::new(WOBBLE[0] * pitch.at(a), WOBBLE[1] * yaw.at(b), WOBBLE[2] * roll.at(c));
        Stand {
            direction: towards(front, leftwards * way.reach.to_radians() * (2.0 * t - 1.0), elevation.sin()),
            farther: between(WALK_DISTANCE, distance.at(way.swings[1] * t)),
            held: held * 1f64.to_radians(),
        }
    };
    (0..n).map(stand).collect()
}

fn walk(n: usize, front: DVec3, reach: f64, rng: &mut fastrand::Rng) -> Vec<Stand> {
    let unsteady = |_: usize, t: f64| [6.0 * t, 6.0 * t, 3.0 * t];
    arc(n, front, &Way { reach, heights: WALK_HEIGHTS, swings: [1.5, 2.0], unsteady: &unsteady }, rng)
}

/// From one side of the front slowly to the other, as somebody goes who films a play of `n` pictures.
pub(super) fn look_on(n: usize, front: DVec3, site: Option<&Site>, rng: &mut fastrand::Rng) -> Vec<Stand> {
    let unsteady = |i: usize, _: f64| [SWINGS * i as f64; 3];
    let way = Way { reach: LOOK_ON, heights: LOOK_ON_HEIGHTS, swings: [1.0, 1.0], unsteady: &unsteady };
    before_wall(arc(n, front, &way, rng), site)
}

/// All in front of a site's wall.
fn before_wall(mut all: Vec<Stand>, site: Option<&Site>) -> Vec<Stand> {
    if let Some(site) = site {
        all.iter_mut().for_each(|s| s.direction = site.in_front(s.direction));
    }
    all
}

/// A smooth way to and fro between -1 and 1; about one swing as time goes by 1.
struct Sway([(f64, f64); 3]);

impl Sway {
    fn new(rng: &mut fastrand::Rng) -> Self {
        Self([0.6, 1.0, 1.7].map(|pace| (pace * (0.85 + 0.3 * rng.f64()), TAU * rng.f64())))
    }

    fn at(&self, t: f64) -> f64 {
        self.0.iter().map(|(pace, phase)| (TAU * pace * t + phase).sin()).sum::<f64>() / 3.0
    }
}
