//! An object that was pushed between states: each state brought onto the largest piece that it has
//! in common with the states before.
//!
//! A small motion is looked for, and it must be earned: a state stays as it was recorded unless
//! another place explains clearly more of all states before it. A door that moved is no push: the
//! states before contradict each other about it, or it is smaller than what stood still.

use super::pair::{Judges, farthest, refined, score, upright, voters};
use super::votes::places;
use super::{balanced, fine};
use crate::error::PrepareError;
use crate::scan::Scan;
use glam::DVec3;
use hingecast_articulate::Depths;
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
/// A push is believed when it explains so many times what the recorded place does.
const EARNED: f64 = 1.25;
/// The same for a place that is found from the recorded one.
const EARNED_FINELY: f64 = 1.15;
/// Within so many fine voxels of a plane, or three times the noise, a sample lies on it.
const ON: f32 = 0.25;
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
        out[s] = placed(scan, &before, &candidates, seed);
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
fn placed(scan: &Scan, before: &[(&Scan, Pose)], candidates: &[Pose], seed: u64) -> Pose {
    let (mut points, mut normals) = (Vec::new(), Vec::new());
    for (other, pose) in before {
        let (p, n) = fine::carried(&other.fine, pose);
        points.extend(p);
        normals.extend(n);
    }
    let surface = Surface::new(points, normals);
    let voxel = scan.fine_voxel;
    let (even, facing) = (balanced::evenly(&scan.fine, SAMPLES), balanced::pick(&scan.fine, SAMPLES, seed));
    let on = |pose: &Pose, within: f32| {
        let (moved, turned) = fine::carried(&even, pose);
        let lies = |(x, m): &(&glam::Vec3, &glam::Vec3)| {
            let Some((j, squared)) = surface.nearest(**x) else { return false };
            let n = surface.normals[j];
            squared < (2.0 * voxel).powi(2) && m.dot(n) > 0.9 && n.dot(**x - surface.points[j]).abs() < within
        };
        moved.iter().zip(&turned).filter(lies).count()
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
    let within = (ON * voxel).max(if noise.is_finite() { 3.0 * noise as f32 } else { 0.0 });
    let recorded = on(&Pose::IDENTITY, within);
    let counts = tried.iter().enumerate().map(|(k, (pose, _))| {
        let earned = if k == 0 { EARNED_FINELY } else { EARNED };
        (on(pose, within), earned, *pose)
    });
    let best = counts.max_by_key(|(count, _, _)| *count);
    best.filter(|(count, earned, _)| *count >= FEW && *count as f64 > earned * recorded as f64)
        .map_or(Pose::IDENTITY, |(_, _, pose)| pose)
}
