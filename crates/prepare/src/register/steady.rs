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
use glam::{DVec3, Vec3};
use hingecast_articulate::Depths;
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
const ROUNDS: usize = 12;
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
        out[s] = placed(scan, &before, &candidates, up, seed);
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
    let side = f64::from(voxel) * f64::from(scan.space.lattice.size.max_element());
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
        out.extend(better.filter(small).map(|p| *theirs * p));
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

/// The place at which most samples lie exactly on those of the states before; the recorded one unless
/// another is clearly better.
fn placed(scan: &Scan, before: &[(&Scan, Pose)], candidates: &[Pose], up: DVec3, seed: u64) -> Pose {
    let surface = fine::surface(before.iter().copied());
    let voxel = scan.fine_voxel;
    let (even, facing) = (balanced::evenly(&scan.fine, SAMPLES), balanced::pick(&scan.fine, SAMPLES, seed));
    let back: Vec<(&Scan, Pose)> = before.iter().map(|(other, pose)| (*other, pose.inverse())).collect();
    let on = |pose: &Pose, within: f32| -> Vec<bool> {
        let (moved, turned) = fine::carried(&even, pose);
        // A drawer lies on itself in a state that had it as far out; others looked through there.
        let empty = |x: DVec3, m: DVec3| {
            let ask = |(other, back): &(&Scan, Pose)| other.ask(back.apply(x).as_vec3(), back.rotate(m).as_vec3());
            back.iter().any(|other| ask(other) == Answer::Free)
        };
        let lies = |(x, m): (&Vec3, &Vec3)| {
            fine::lies_on(&surface, *x, *m, voxel, within) && !empty(x.as_dvec3(), m.as_dvec3())
        };
        moved.iter().zip(&turned).map(lies).collect()
    };
    let settled = |start: &Pose| {
        let (mut pose, mut scale, mut noise) = (*start, 2.0 * f64::from(voxel), 0.0);
        for round in 0..ROUNDS {
            let gate = if round < ROUNDS / 3 { 4.0 } else { 2.0 };
            let (better, [quartile, _]) =
                fine::step(&facing.points, &facing.normals, &surface, pose, gate * voxel, scale);
            (pose, noise) = (better, 2.0 * quartile);
            // Half of the samples near others may be of parts that moved.
            scale = (6.0 * quartile).clamp(0.05 * f64::from(voxel), 2.0 * f64::from(voxel));
        }
        (pose, noise)
    };
    let tried: Vec<(Pose, f64)> = std::iter::once(&Pose::IDENTITY).chain(candidates).map(settled).collect();
    let noise = tried.iter().map(|t| t.1).fold(f64::INFINITY, f64::min);
    let within = fine::on(voxel, noise);
    let side = scan.voxel() * scan.space.lattice.size.max_element() as f32;
    let middle = even.points.iter().sum::<Vec3>() / even.points.len().max(1) as f32;
    let stays_down = |pose: &Pose| {
        let tilt = pose.rotate(up).angle_between(up);
        let rise = (pose.apply(middle.as_dvec3()) - middle.as_dvec3()).dot(up);
        tilt < TILT && rise.abs() < RISE * f64::from(side)
    };
    let count = |on: &[bool]| on.iter().filter(|o| **o).count();
    let upright = tried.iter().map(|(pose, _)| pose).filter(|pose| stays_down(pose));
    let best = upright.map(|pose| (on(pose, within), *pose)).max_by_key(|(on, _)| count(on));
    let Some((best_on, best)) = best.filter(|(on, _)| count(on) >= FEW) else { return Pose::IDENTITY };
    // What stands still has drifted a little at most: a push must beat the place that is found from
    // the recorded one, too.
    let near = tried[0].0;
    let found_near = farthest(&best, &near, &even.points) < CLEARLY * f64::from(within);
    let enough = match found_near {
        true => EARNED_FINELY,
        false if best.angle() < STRAIGHT => EARNED_STRAIGHT,
        false => EARNED,
    };
    let (mut stood, mut stood_on) = (Pose::IDENTITY, on(&Pose::IDENTITY, within));
    if !found_near {
        let near_on = on(&near, within);
        if count(&near_on) > count(&stood_on) {
            (stood, stood_on) = (near, near_on);
        }
    }
    let earned = count(&best_on) as f64 / count(&stood_on).max(1) as f64;
    // What a push would have carried off, and how much of it stands where it stood.
    let carried_off = (0..best_on.len()).filter(|&i| {
        let (x, n) = (even.points[i].as_dvec3(), even.normals[i].as_dvec3());
        (best.apply(x) - stood.apply(x)).dot(n).abs() > CLEARLY * f64::from(within)
    });
    let (all, stands) = carried_off
        .fold((0usize, 0usize), |(all, stands), i| (all + 1, stands + usize::from(stood_on[i] && !best_on[i])));
    let believed = earned > enough && all >= FEW / 2 && (stands as f64) < STANDS * all as f64;
    if believed { best } else { Pose::IDENTITY }
}
