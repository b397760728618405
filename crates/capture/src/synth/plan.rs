//! Which joint values and which cameras a recording has.

use super::coupled::{self, useful_ranges};
use super::framing::{Optics, Subject};
use super::ranges::UsefulRange;
use super::world::{Placement, Site, Trajectory};
use super::{SynthConfig, film, play, trajectory};
use crate::object::ArticulatedObject;
use crate::{CaptureError, Split};
use glam::{DVec3, Vec3};
use hingecast_geom::Camera;

/// One view to render.
pub(super) struct Shot {
    pub state: usize,
    pub view: usize,
    pub split: Split,
    pub camera: Camera,
}

/// Where each joint is played: from `lower` to `upper`.
pub(super) fn ranges(object: &ArticulatedObject, config: &SynthConfig) -> Result<Vec<UsefulRange>, CaptureError> {
    let names: Vec<&str> = object.tree.joints.iter().map(|j| j.name.as_str()).collect();
    if let Some((name, range)) =
        config.ranges.iter().find(|(n, r)| !names.contains(&n.as_str()) || !r.iter().all(|x| x.is_finite()))
    {
        let hint = format!("the joints are: {}", names.join(", "));
        return Err(CaptureError::new(
            "no such joint, or its range is not finite",
            format!("--range {name}={range:?}"),
            hint,
        ));
    }
    for c in &object.tree.couplings {
        let (follower, leader) = (names[c.follower], names[c.leader]);
        if config.ranges.contains_key(follower) {
            let what = format!("joint '{follower}' follows '{leader}'");
            return Err(CaptureError::new(what, format!("--range {follower}"), format!("--range {leader}=FROM:TO")));
        }
    }
    let mut useful = useful_ranges(object);
    for (name, range) in names.iter().zip(&mut useful) {
        if let Some(&[lower, upper]) = config.ranges.get(*name) {
            *range = UsefulRange { lower, upper, ..*range };
        }
    }
    coupled::follow(object, &mut useful);
    Ok(useful)
}

/// When each state is recorded, in numbers of recorded states; held-out ones stand half-way between
/// two recorded ones, spread over the play.
pub(super) fn times(config: &SynthConfig) -> Vec<f64> {
    let last = (config.states.max(2) - 1) as f64;
    let held_out = if config.states < 3 { 0 } else { config.test_states };
    let between = (0..held_out).map(|k| (last * (k + 1) as f64 / (held_out + 1) as f64).floor() + 0.5);
    (0..config.states).map(|s| s as f64).chain(between).collect()
}

/// Joint values of the recorded states, then of the held-out ones between them.
pub(super) fn joint_values(object: &ArticulatedObject, config: &SynthConfig, ranges: &[UsefulRange]) -> Vec<Vec<f64>> {
    if let Some(pictures) = config.film {
        return film::joint_values(object, ranges, pictures, config.seed);
    }
    let mut rng = fastrand::Rng::with_seed(config.seed ^ 0x706c_6179);
    let behind: Vec<bool> = ranges.iter().map(|r| r.behind).collect();
    let play = play::Play::new(&behind, config.states == 2, &mut rng);
    let last = (config.states.max(2) - 1) as f64;
    let value = |(f, r): (f64, &UsefulRange)| r.lower + f * (r.upper - r.lower);
    let at = |t: f64| {
        let mut q: Vec<f64> = play.fractions(t).into_iter().zip(ranges).map(value).collect();
        object.tree.follow(&mut q);
        q
    };
    times(config).into_iter().map(|s| at(s / last)).collect()
}

/// All views: per state the training cameras, then the held-out ones. `front`: towards which the
/// object opens.
pub(super) fn shots(
    object: &ArticulatedObject,
    config: &SynthConfig,
    states: &[Vec<f64>],
    placement: &Placement,
    front: DVec3,
    site: Option<&Site>,
) -> Vec<Shot> {
    let optics = match config.world.lens {
        Some(lens) => Optics::of(lens),
        None => Optics::square(config.size, config.fov_deg.to_radians()),
    };
    let subject = Subject::new(object, states, placement);
    let way = config.world.trajectory;
    let stands = |salt: u64, n: usize| {
        let mut rng = fastrand::Rng::with_seed(config.seed.wrapping_mul(0x9e37_79b9) ^ salt);
        trajectory::stands(way, n, front, site, &mut rng)
    };
    let rig = config.same_cameras && way != Trajectory::Walk;
    let mut looking_on = config.film.map(|pictures| film::stands(pictures, front, site, config.seed).into_iter());
    let per_state = |state: usize| {
        if let Some(play) = looking_on.as_mut().filter(|_| state > 0) {
            return (play.next().into_iter().collect(), Vec::new());
        }
        let salt = if rig { 0 } else { state as u64 };
        let train = if state < config.states { stands(salt, config.views) } else { Vec::new() };
        (train, stands(1_000_003 + state as u64, config.test_views))
    };
    let all: Vec<(Vec<trajectory::Stand>, Vec<trajectory::Stand>)> = (0..states.len()).map(per_state).collect();
    let distance = subject.distance(all.iter().flat_map(|(train, test)| train.iter().chain(test)), &optics);
    let mut shots = Vec::new();
    for (state, (train, test)) in all.iter().enumerate() {
        let splits = train.iter().map(|s| (Split::Train, s)).chain(test.iter().map(|s| (Split::Test, s)));
        for (view, (split, stand)) in splits.enumerate() {
            shots.push(Shot { state, view, split, camera: subject.camera(stand, distance, &optics) });
        }
    }
    shots
}

/// Scene units per depth step: a ten-thousandth unless the object, or the `surroundings` (points of
/// the world), are too far for 16 bits.
pub(super) fn depth_scale(object: &ArticulatedObject, shots: &[Shot], surroundings: &[Vec3]) -> f64 {
    let (lo, hi) = object.bounds(&vec![0.0; object.tree.joints.len()]);
    let centre = 0.5 * (lo + hi);
    let farthest =
        shots.iter().map(|s| s.camera.centre().distance(centre)).fold(0.0, f64::max) + 2.0 * (hi - lo).length();
    let mut scale = 1e-4;
    while farthest / scale > 65_535.0 {
        scale *= 10.0;
    }
    // Small objects (a pair of glasses in metres) deserve finer steps.
    while farthest / (scale / 10.0) < 65_535.0 {
        scale /= 10.0;
    }
    let z = |s: &Shot, x: &Vec3| s.camera.camera_from_world.apply(x.as_dvec3()).z;
    let around = shots.iter().flat_map(|s| surroundings.iter().map(move |x| z(s, x))).fold(0.0, f64::max);
    while around / scale > 65_535.0 {
        scale *= 2.0;
    }
    scale
}
