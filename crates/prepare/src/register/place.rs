//! Where an object that may have been pushed stands in a state, seen from the states before.

use super::pair::farthest;
use super::{balanced, fine};
use crate::scan::Scan;
use glam::{DQuat, DVec3, Vec3};
use hingecast_articulate::observe::cloud::Cloud;
use hingecast_articulate::observe::occupancy::Answer;
use hingecast_geom::Pose;
use hingecast_geom::icp::Surface;

/// What is pushed stays on its floor: largest tilt, radians, and rise, shares of the longest side.
const TILT: f64 = 0.015;
const RISE: f64 = 0.01;
/// A push is believed when it explains so many times what the place nearest to the recorded one
/// does.
const EARNED: f64 = 1.25;
/// The same for a push that hardly turns, by this many radians: drawers pulled out together look
/// like it. What people push turns with it.
const EARNED_STRAIGHT: f64 = 1.5;
const STRAIGHT: f64 = 0.026;
/// The nearest place itself must explain so many times what the recorded one does.
const EARNED_FINELY: f64 = 1.15;
/// Of the surface that a push would have moved by so many tolerances along its normals, at most this
/// share may stand where it stood, and nowhere else: the frame of drawers that were pulled out has
/// stayed.
const CLEARLY: f64 = 2.5;
const STANDS: f64 = 0.05;
/// With less than this share, a push needs no more than the nearest place: a box that slid along its
/// own long sides is found again on most of itself.
const HARDLY_STANDS: f64 = 0.01;
/// A place that turns further than another, by this many radians, must explain so many times what that
/// does: doors open far, and people push things by a few degrees.
const FURTHER: f64 = 0.09;
const EARNED_FURTHER: f64 = 1.5;
/// Rounds in which a place is settled finely, and samples of that.
const ROUNDS: usize = 24;
const SAMPLES: usize = 4000;
/// Samples that must lie on others for the fine step to say anything.
const FEW: usize = 150;

/// Longest side of what a scan looks at, scene units.
pub(super) fn side(scan: &Scan) -> f64 {
    f64::from(scan.voxel()) * f64::from(scan.space.lattice.size.max_element())
}

/// The middle of some points.
fn middle(points: &[Vec3]) -> DVec3 {
    (points.iter().sum::<Vec3>() / points.len().max(1) as f32).as_dvec3()
}

/// Whether what is pushed like that stays upright and on its floor, within so many times what is allowed.
pub(super) fn stays_down(pose: &Pose, points: &[Vec3], side: f64, up: DVec3, times: f64) -> bool {
    let middle = middle(points);
    let rise = (pose.apply(middle) - middle).dot(up);
    pose.rotate(up).angle_between(up) < times * TILT && rise.abs() < times * RISE * side
}

/// The nearest place that keeps it upright and on its floor.
pub(super) fn put_down(pose: &Pose, points: &[Vec3], up: DVec3) -> Pose {
    let middle = middle(points);
    let there = pose.apply(middle);
    let rot = DQuat::from_rotation_arc(pose.rotate(up), up) * pose.rot;
    let there = there - (there - middle).dot(up) * up;
    Pose::new(rot, there - rot * middle)
}

/// A state, and those before.
pub(super) struct Place<'a> {
    scan: &'a Scan,
    surface: Surface,
    /// Samples that are counted, and those that are fitted.
    even: Cloud,
    facing: Cloud,
    /// The states before, and where this one's frame is in theirs.
    back: Vec<(&'a Scan, Pose)>,
    up: DVec3,
}

impl<'a> Place<'a> {
    /// `before`: states before, and where each stands.
    pub fn new(scan: &'a Scan, before: &[(&'a Scan, Pose)], up: DVec3, seed: u64) -> Self {
        Self {
            surface: fine::surface(before.iter().copied()),
            even: balanced::evenly(&scan.fine, SAMPLES),
            facing: balanced::pick(&scan.fine, SAMPLES, seed),
            back: before.iter().map(|(other, pose)| (*other, pose.inverse())).collect(),
            scan,
            up,
        }
    }

    /// Which samples lie on the states before, none of which looked through there.
    fn on(&self, pose: &Pose, within: f32) -> Vec<bool> {
        let (moved, turned) = fine::carried(&self.even, pose);
        // A drawer lies on itself in a state that had it as far out; others looked through there.
        let empty = |x: DVec3, m: DVec3| {
            let ask = |(other, back): &(&Scan, Pose)| other.ask(back.apply(x).as_vec3(), back.rotate(m).as_vec3());
            self.back.iter().any(|other| ask(other) == Answer::Free)
        };
        let lies = |(x, m): (&Vec3, &Vec3)| {
            fine::lies_on(&self.surface, *x, *m, self.scan.fine_voxel, within) && !empty(x.as_dvec3(), m.as_dvec3())
        };
        moved.iter().zip(&turned).map(lies).collect()
    }

    /// The place that a start leads to, and how far its samples are off.
    fn settled(&self, start: &Pose) -> (Pose, f64) {
        let voxel = f64::from(self.scan.fine_voxel);
        let (mut pose, mut scale, mut noise) = (*start, 2.0 * voxel, 0.0);
        for round in 0..ROUNDS {
            let gate = if round < ROUNDS / 3 { 4.0 } else { 2.0 };
            let (points, normals) = (&self.facing.points, &self.facing.normals);
            let (better, [quartile, _]) =
                fine::step(points, normals, &self.surface, pose, gate * self.scan.fine_voxel, scale);
            (pose, noise) = (better, 2.0 * quartile);
            // Half of the samples near others may be of parts that moved.
            scale = (6.0 * quartile).clamp(0.05 * voxel, 2.0 * voxel);
        }
        (pose, noise)
    }

    fn stays_down(&self, pose: &Pose) -> bool {
        stays_down(pose, &self.even.points, side(self.scan), self.up, 1.0)
    }

    /// The places that some starts lead to, and how close to the states before a sample lies on them there.
    fn tried<'b>(&self, starts: impl Iterator<Item = &'b Pose>) -> (Vec<Pose>, f32) {
        let (places, noise): (Vec<Pose>, Vec<f64>) = starts.map(|p| self.settled(p)).unzip();
        (places, fine::on(self.scan.fine_voxel, noise.into_iter().fold(f64::INFINITY, f64::min)))
    }

    /// Where the object was last: the recorded place, or the best of those where states before were `brought`.
    pub fn home(&self, brought: &[Pose]) -> Pose {
        if brought.is_empty() {
            return Pose::IDENTITY;
        }
        let (tried, within) = self.tried(std::iter::once(&Pose::IDENTITY).chain(brought.iter().rev()));
        let count = |pose: &Pose| self.on(pose, within).into_iter().filter(|on| *on).count();
        let placed = tried[1..].iter().filter(|pose| self.stays_down(pose));
        let best = placed.map(|pose| (count(pose), *pose)).max_by_key(|(on, _)| *on);
        best.filter(|(on, _)| *on > count(&Pose::IDENTITY)).map_or(Pose::IDENTITY, |(_, pose)| pose)
    }

    /// `home`, unless one of the candidates is clearly better.
    pub fn better(&self, home: Pose, candidates: &[Pose]) -> Pose {
        let (tried, within) = self.tried(std::iter::once(&home).chain(candidates));
        let far = CLEARLY * f64::from(within);
        let count = |on: &[bool]| on.iter().filter(|o| **o).count();
        let upright = tried.iter().filter(|pose| self.stays_down(pose));
        let places: Vec<(Vec<bool>, Pose)> = upright.map(|pose| (self.on(pose, within), *pose)).collect();
        let most = places.iter().map(|(on, _)| count(on)).max().unwrap_or(0) as f64;
        // A door that opened by little takes more surface with it than is seen of a fridge: of what is nearly
        // as good, that which turns least is believed.
        let turn = |pose: &Pose| (*pose * home.inverse()).angle();
        let nearly = || places.iter().filter(|(on, _)| EARNED_FURTHER * count(on) as f64 >= most);
        let least = nearly().map(|(_, pose)| turn(pose)).fold(f64::INFINITY, f64::min);
        let best = nearly().filter(|(_, pose)| turn(pose) < least + FURTHER).max_by_key(|(on, _)| count(on)).cloned();
        let Some((best_on, best)) = best.filter(|(on, _)| count(on) >= FEW) else { return home };
        // What stands still has drifted a little at most: a push must beat the place that is found from
        // home, too.
        let near = tried[0];
        let found_near = farthest(&best, &near, &self.even.points) < far;
        let (mut stood, mut stood_on) = (home, self.on(&home, within));
        if !found_near {
            let near_on = self.on(&near, within);
            if count(&near_on) > count(&stood_on) {
                (stood, stood_on) = (near, near_on);
            }
        }
        let earned = count(&best_on) as f64 / count(&stood_on).max(1) as f64;
        // What a push would have carried off, and how much of it stands where it stood.
        let carried_off = (0..best_on.len()).filter(|&i| {
            let (x, n) = (self.even.points[i].as_dvec3(), self.even.normals[i].as_dvec3());
            // Along the normals as they are in the frame of the states before.
            (best.apply(x) - stood.apply(x)).dot(stood.rotate(n)).abs() > far
        });
        let (all, stands) = carried_off
            .fold((0usize, 0usize), |(all, stands), i| (all + 1, stands + usize::from(stood_on[i] && !best_on[i])));
        let stands = stands as f64 / all.max(1) as f64;
        let enough = match found_near {
            true => EARNED_FINELY,
            false if (best * home.inverse()).angle() < STRAIGHT => EARNED_STRAIGHT,
            false if stands < HARDLY_STANDS => EARNED_FINELY,
            false => EARNED,
        };
        let believed = earned > enough && all >= FEW / 2 && stands < STANDS;
        if believed { best } else { home }
    }
}
