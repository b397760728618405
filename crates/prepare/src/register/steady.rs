//! An object that was pushed between states: each state brought onto the largest piece that it has
//! in common with the states before.
//!
//! A small motion is looked for, and it must be earned: a state stays as it was recorded unless
//! another place explains clearly more of all states before it. A door that moved is no push: the
//! states before contradict each other about it, or it is smaller than what stood still. And what is
//! pushed stays upright: the lid of a laptop that opens from shut is most of what is seen of it, and
//! no push.

use super::pair::{Judges, farthest, refined, score, upright, voters};
use super::votes::places;
use super::{balanced, fine};
use crate::error::PrepareError;
use crate::scan::Scan;
use glam::{DQuat, DVec3, Vec3};
use hingecast_articulate::Depths;
use hingecast_articulate::observe::cloud::Cloud;
use hingecast_articulate::observe::occupancy::Answer;
use hingecast_geom::icp::Surface;
use hingecast_geom::{Pose, Progress};

/// Space around the object that is looked at, shares of its longest side: as far as it may be
/// pushed.
const AROUND: f32 = 0.25;
/// States before that a state is compared with.
const COMPARED: usize = 4;
/// Largest push: turn, radians, and shift, shares of the scan's longest side.
const TURN: f64 = 0.25;
const SHIFT: f64 = 0.2;
/// What is pushed stays on its floor: largest tilt, radians, and rise, shares of the longest side.
const TILT: f64 = 0.03;
const RISE: f64 = 0.02;
/// The same, times so many, before a place is settled finely.
const LOOSELY: f64 = 2.0;
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
/// Places that are settled finely, and the rounds of that.
const FINALISTS: usize = 6;
const ROUNDS: usize = 24;
/// Samples of the fine step.
const SAMPLES: usize = 4000;
/// Samples that must lie on others for the fine step to say anything.
const FEW: usize = 150;
/// Places per compared state that are tried.
const PLACES: usize = 20;

/// Of every state: the frame of the object as state 0 has it, from the recorded one; the identity
/// where nothing was pushed. Views' pixels of class `OBJECT` count, `up` is up in all states.
///
/// # Errors
/// A view that cannot be read, the wish to stop. States with hardly any surface stay as they are.
pub fn steady(depths: &mut dyn Depths, up: DVec3, seed: u64, progress: &Progress) -> Result<Vec<Pose>, PrepareError> {
    let n = depths.n_states();
    let mut scans = Vec::new();
    for state in 0..n {
        progress.report(state, n, "was it pushed?")?;
        scans.push(Scan::new(&depths.views(state)?, AROUND));
    }
    let mut out: Vec<Pose> = vec![Pose::IDENTITY; n];
    for s in 1..n {
        progress.check()?;
        let Some(scan) = &scans[s] else { continue };
        let before: Vec<(&Scan, Pose)> = compared(s).filter_map(|r| Some((scans[r].as_ref()?, out[r]))).collect();
        if before.is_empty() {
            continue;
        }
        let known: Vec<Pose> = out[..s].to_vec();
        let candidates = candidates(scan, &before, &known, up, seed);
        out[s] = placed(scan, &before, &known, &candidates, up, seed);
    }
    Ok(out)
}

/// The first state, and the last few before `s`.
fn compared(s: usize) -> impl Iterator<Item = usize> {
    let last = s.saturating_sub(COMPARED - 1).max(1);
    std::iter::once(0).chain(last..s)
}

/// Places that may be right: where states before stand, and where samples vote for; those that agree
/// with most come first.
fn candidates(scan: &Scan, before: &[(&Scan, Pose)], known: &[Pose], up: DVec3, seed: u64) -> Vec<Pose> {
    let own = Judges::by_surface(scan);
    let voxel = scan.voxel();
    let side = side(scan);
    let turn = upright(up);
    let (back, there) = (Pose::new(turn.inverse(), DVec3::ZERO), Pose::new(turn, DVec3::ZERO));
    let others: Vec<Judges> = before.iter().map(|(other, _)| Judges::by_surface(other)).collect();
    let total = |pose: &Pose| -> f64 {
        let one = |((other, theirs), judges): (&(&Scan, Pose), &Judges)| {
            score(&own, judges, scan, other, &(theirs.inverse() * *pose)).0
        };
        before.iter().zip(&others).map(one).sum()
    };
    let mut out: Vec<Pose> = Vec::new();
    for pose in known.iter().filter(|p| **p != Pose::IDENTITY) {
        if !out.contains(pose) {
            out.push(*pose);
        }
    }
    for (other, theirs) in before {
        let (from, to) = (voters(scan, turn, seed), voters(other, turn, seed ^ 1));
        let voted = places(&from, &to, 4.0 * voxel, 8 * PLACES).into_iter().map(|p| back * p * there);
        let small = |p: &Pose| p.angle() < TURN && farthest(p, &Pose::IDENTITY, &own.points) < SHIFT * side;
        let near: Vec<Pose> = voted.filter(small).take(PLACES).collect();
        let surface = Surface::new(other.coarse.points.clone(), other.coarse.normals.clone());
        let better = near.into_iter().map(|p| refined(&own, 2, &surface, p, &[5.0, 5.0, 4.0, 3.0, 2.0, 1.5], voxel));
        // A lid that opened draws them after itself; its own place is no push, and there are only so many finalists.
        let down = |p: &Pose| stays_down(p, &own.points, side, up, LOOSELY);
        let own_place = |p: Pose| *theirs * p;
        out.extend(better.filter(small).map(own_place).filter(down).map(|p| put_down(&p, &own.points, up)));
    }
    let mut ranked: Vec<(f64, Pose)> = out.into_iter().map(|p| (total(&p), p)).collect();
    ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut few: Vec<Pose> = Vec::new();
    for (_, pose) in ranked {
        if few.len() < FINALISTS && few.iter().all(|p| farthest(p, &pose, &own.points) > f64::from(0.5 * voxel)) {
            few.push(pose);
        }
    }
    few
}

/// The place at which most samples lie exactly on those of the states before. What is pushed stays there: home
/// is where it was recorded or where a state before was brought, whichever is better, and another place must
/// be clearly better than that. (Drawers pulled out after a push look like another push, against the recorded
/// place alone.)
fn placed(scan: &Scan, before: &[(&Scan, Pose)], known: &[Pose], candidates: &[Pose], up: DVec3, seed: u64) -> Pose {
    let case = Case {
        surface: fine::surface(before.iter().copied()),
        even: balanced::evenly(&scan.fine, SAMPLES),
        facing: balanced::pick(&scan.fine, SAMPLES, seed),
        back: before.iter().map(|(other, pose)| (*other, pose.inverse())).collect(),
        scan,
        up,
    };
    let mut brought: Vec<Pose> = Vec::new();
    for pose in known.iter().rev().filter(|p| **p != Pose::IDENTITY) {
        if !brought.contains(pose) {
            brought.push(*pose);
        }
    }
    let home = case.home(&brought);
    case.better(home, candidates)
}

/// Longest side of what a scan looks at, scene units.
fn side(scan: &Scan) -> f64 {
    f64::from(scan.voxel()) * f64::from(scan.space.lattice.size.max_element())
}

/// Whether what is pushed like that stays upright and on its floor, within so many times what is allowed.
fn stays_down(pose: &Pose, points: &[Vec3], side: f64, up: DVec3, times: f64) -> bool {
    let middle = (points.iter().sum::<Vec3>() / points.len().max(1) as f32).as_dvec3();
    let rise = (pose.apply(middle) - middle).dot(up);
    pose.rotate(up).angle_between(up) < times * TILT && rise.abs() < times * RISE * side
}

/// The nearest place that keeps it upright and on its floor.
fn put_down(pose: &Pose, points: &[Vec3], up: DVec3) -> Pose {
    let middle = (points.iter().sum::<Vec3>() / points.len().max(1) as f32).as_dvec3();
    let there = pose.apply(middle);
    let rot = DQuat::from_rotation_arc(pose.rotate(up), up) * pose.rot;
    let there = there - (there - middle).dot(up) * up;
    Pose::new(rot, there - rot * middle)
}

/// A state, and those before.
struct Case<'a> {
    scan: &'a Scan,
    surface: Surface,
    /// Samples that are counted, and those that are fitted.
    even: Cloud,
    facing: Cloud,
    /// The states before, and where this one's frame is in theirs.
    back: Vec<(&'a Scan, Pose)>,
    up: DVec3,
}

impl Case<'_> {
    /// Which samples lie on the states before, none of which looked through there.
    fn on(&self, samples: &Cloud, pose: &Pose, within: f32) -> Vec<bool> {
        let (moved, turned) = fine::carried(samples, pose);
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

    /// Where the object was last: the recorded place, or the best of those where states before were `brought`.
    fn home(&self, brought: &[Pose]) -> Pose {
        if brought.is_empty() {
            return Pose::IDENTITY;
        }
        let tried: Vec<(Pose, f64)> =
            std::iter::once(&Pose::IDENTITY).chain(brought).map(|p| self.settled(p)).collect();
        let noise = tried.iter().map(|t| t.1).fold(f64::INFINITY, f64::min);
        let within = fine::on(self.scan.fine_voxel, noise);
        let count = |pose: &Pose| self.on(&self.even, pose, within).into_iter().filter(|on| *on).count();
        let placed = tried[1..].iter().map(|t| t.0).filter(|pose| self.stays_down(pose));
        let best = placed.map(|pose| (count(&pose), pose)).max_by_key(|(on, _)| *on);
        best.filter(|(on, _)| *on > count(&Pose::IDENTITY)).map_or(Pose::IDENTITY, |(_, pose)| pose)
    }

    /// `home`, unless one of the candidates is clearly better.
    fn better(&self, home: Pose, candidates: &[Pose]) -> Pose {
        let tried: Vec<(Pose, f64)> = std::iter::once(&home).chain(candidates).map(|p| self.settled(p)).collect();
        let noise = tried.iter().map(|t| t.1).fold(f64::INFINITY, f64::min);
        let within = fine::on(self.scan.fine_voxel, noise);
        let far = CLEARLY * f64::from(within);
        let count = |on: &[bool]| on.iter().filter(|o| **o).count();
        let upright = tried.iter().map(|(pose, _)| pose).filter(|pose| self.stays_down(pose));
        let best = upright.map(|pose| (self.on(&self.even, pose, within), *pose)).max_by_key(|(on, _)| count(on));
        let Some((best_on, best)) = best.filter(|(on, _)| count(on) >= FEW) else { return home };
        // What stands still has drifted a little at most: a push must beat the place that is found from
        // home, too.
        let near = tried[0].0;
        let found_near = farthest(&best, &near, &self.even.points) < far;
        let enough = match found_near {
            true => EARNED_FINELY,
            false if (best * home.inverse()).angle() < STRAIGHT => EARNED_STRAIGHT,
            false => EARNED,
        };
        let (mut stood, mut stood_on) = (home, self.on(&self.even, &home, within));
        if !found_near {
            let near_on = self.on(&self.even, &near, within);
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
        let believed = earned > enough && all >= FEW / 2 && (stands as f64) < STANDS * all as f64;
        if believed { best } else { home }
    }
}
