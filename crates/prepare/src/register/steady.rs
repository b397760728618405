//! An object that was pushed between states: each state brought onto the largest piece that it has
//! in common with the states before.
//!
//! A small motion is looked for, and it must be earned: a state stays as it was recorded unless
//! another place explains clearly more of all states before it. A door that moved is no push: the
//! states before contradict each other about it, or it is smaller than what stood still. And what is
//! pushed stays upright: the lid of a laptop that opens from shut is most of what is seen of it, and
//! no push.

use super::pair::{Judges, farthest, refined, score, upright, voters};
use super::place::{Place, put_down, side, stays_down};
use super::votes::places;
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
/// What is pushed stays upright and on its floor within so many times what is allowed, before its place is
/// settled finely.
const LOOSELY: f64 = 4.0;
/// Places that are settled finely.
const FINALISTS: usize = 6;
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
        let mut brought: Vec<Pose> = Vec::new();
        for pose in out[..s].iter().filter(|p| **p != Pose::IDENTITY) {
            if !brought.contains(pose) {
                brought.push(*pose);
            }
        }
        let candidates = candidates(scan, &before, &brought, up, seed);
        // What is pushed stays there: home is where it was recorded or where a state before was brought, whichever
        // is better, and another place must be clearly better than that. (Drawers pulled out after a push look like
        // another push, against the recorded place alone.)
        let place = Place::new(scan, &before, up, seed);
        out[s] = place.better(place.home(&brought), &candidates);
    }
    Ok(out)
}

/// The first state, and the last few before `s`.
fn compared(s: usize) -> impl Iterator<Item = usize> {
    let last = s.saturating_sub(COMPARED - 1).max(1);
    std::iter::once(0).chain(last..s)
}

/// Places that may be right: where states before were `brought`, and where samples vote for; those that agree
/// with most come first.
fn candidates(scan: &Scan, before: &[(&Scan, Pose)], brought: &[Pose], up: DVec3, seed: u64) -> Vec<Pose> {
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
    let mut out = brought.to_vec();
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
