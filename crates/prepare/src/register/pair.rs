//! Two scans: where one stands in the frame of the other, and how sure that is.

use super::votes::{Upright, places};
use super::{AGREES, Freedom, OVERLAPS, SECOND, balanced, fine};
use crate::error::PrepareError;
use crate::scan::Scan;
use glam::{DQuat, DVec3, Vec3};
use hingecast_articulate::observe::cloud::Cloud;
use hingecast_articulate::observe::occupancy::Answer;
use hingecast_geom::Pose;
use hingecast_geom::icp::Surface;
use rayon::prelude::*;

/// Samples that vote, and those that judge.
const VOTERS: usize = 1500;
const JUDGES: usize = 1500;
/// Places that are refined, and those that are refined again.
const PLACES: usize = 64;
const FINALISTS: usize = 8;
/// Directions that may be up where gravity is not known.
const UPS: usize = 3;

/// Where one scan stands in the frame of another.
pub(super) struct Placed {
    /// target_from_source.
    pub pose: Pose,
    /// What agrees less what contradicts, over all judges.
    pub score: f64,
    /// What agrees over what can be judged.
    pub share: f64,
    /// The second best place's score over this one's.
    pub second: f64,
    /// How far away the second best is: radians, farthest point in scene units.
    pub rival: (f64, f64),
    /// The score of the place that was recorded, give or take a voxel or two.
    pub recorded: f64,
    /// The middle of the source, in the target's frame.
    pub centre: DVec3,
}

impl Placed {
    /// Whether enough is seen by both scans, and agrees.
    pub fn agrees(&self) -> bool {
        self.share >= AGREES && self.score >= OVERLAPS
    }

    /// Whether it does so here alone.
    pub fn is_sure(&self) -> bool {
        self.agrees() && self.second <= SECOND
    }
}

/// Finds where `source` stands in the frame of `target`.
pub(super) fn align(source: &Scan, target: &Scan, freedom: Freedom, seed: u64) -> Result<Placed, PrepareError> {
    let turns: Vec<(DQuat, DQuat)> = match freedom {
        Freedom::AboutUp(up) => vec![(upright(up), upright(up))],
        Freedom::Any => {
            let (a, b) = (main_facings(&source.coarse), main_facings(&target.coarse));
            a.iter().flat_map(|u| b.iter().map(move |v| (upright(*u), upright(*v)))).collect()
        }
    };
    let voxel = source.voxel().max(target.voxel());
    let mut starts = Vec::new();
    for (source_up, target_up) in turns {
        let (from, to) = (voters(source, source_up, seed), voters(target, target_up, seed ^ 1));
        let (back, turn) = (Pose::new(target_up.inverse(), DVec3::ZERO), Pose::new(source_up, DVec3::ZERO));
        starts.extend(places(&from, &to, 4.0 * voxel, PLACES).into_iter().map(|p| back * p * turn));
    }
    let judges = (Judges::new(source, seed ^ 2), Judges::new(target, seed ^ 3));
    let surface = Surface::new(target.coarse.points.clone(), target.coarse.normals.clone());
    let all_refined = |starts: Vec<Pose>, gates: &[f32], every: usize| {
        let mut out: Vec<(Pose, f64)> = starts
            .into_par_iter()
            .map(|start| {
                let pose = refined(&judges.0, every, &surface, start, gates, voxel);
                (pose, score(&judges.0, &judges.1, source, target, &pose).0)
            })
            .collect();
        out.sort_by(|a, b| b.1.total_cmp(&a.1));
        distinct(out, &judges.0.points, 4.0 * voxel)
    };
    let here = |gates: &[f32]| {
        let pose = refined(&judges.0, 1, &surface, Pose::IDENTITY, gates, voxel);
        score(&judges.0, &judges.1, source, target, &pose).0
    };
    let recorded = (here(&[]), here(&[2.0, 1.5, 1.5]));
    let mut found = all_refined(starts, &[4.0, 4.0, 3.0, 3.0, 2.0, 2.0], 3);
    found.truncate(FINALISTS);
    let found = all_refined(found.into_iter().map(|f| f.0).collect(), &[3.0, 2.0, 1.5, 1.5, 1.5, 1.5], 1);
    let Some(&(pose, best)) = found.first() else {
        return Ok(Placed {
            pose: Pose::IDENTITY,
            score: 0.0,
            share: 0.0,
            second: 1.0,
            rival: (0.0, 0.0),
            recorded: recorded.0.max(recorded.1),
            centre: DVec3::ZERO,
        });
    };
    let (_, share) = score(&judges.0, &judges.1, source, target, &pose);
    let rival = found.get(1);
    let away = |other: &Pose| ((pose.inverse() * *other).angle(), farthest(&pose, other, &judges.0.points));
    Ok(Placed {
        pose,
        score: best,
        share,
        second: rival.map_or(0.0, |r| (r.1 / best.max(1e-9)).clamp(0.0, 1.0)),
        rival: rival.map_or((0.0, 0.0), |r| away(&r.0)),
        recorded: recorded.0.max(recorded.1),
        centre: pose.apply(judges.0.points.iter().sum::<Vec3>().as_dvec3() / judges.0.points.len().max(1) as f64),
    })
}

/// Samples that judge a place, facings balanced.
pub(super) struct Judges {
    pub points: Vec<Vec3>,
    pub normals: Vec<Vec3>,
}

impl Judges {
    pub fn new(scan: &Scan, seed: u64) -> Self {
        let Cloud { points, normals } = balanced::pick(&scan.coarse, JUDGES, seed);
        Self { points, normals }
    }

    /// The same by surface: an object has no floor that drowns the rest, but thin edges that
    /// would.
    pub fn by_surface(scan: &Scan) -> Self {
        let Cloud { points, normals } = balanced::evenly(&scan.coarse, JUDGES);
        Self { points, normals }
    }

    /// How many judges find a surface like theirs in `other`, and how many an empty place.
    fn judge(&self, other: &Scan, pose: &Pose) -> (usize, usize) {
        let (rot, trans) = (pose.mat3().as_mat3(), pose.trans.as_vec3());
        self.points.iter().zip(&self.normals).fold((0, 0), |(yes, no), (x, n)| {
            match other.ask(rot * *x + trans, rot * *n) {
                Answer::Surface => (yes + 1, no),
                Answer::Free => (yes, no + 1),
                Answer::Silent => (yes, no),
            }
        })
    }
}

/// What agrees less what contradicts over all judges of both scans, and what agrees over what can be
/// judged.
pub(super) fn score(own: &Judges, theirs: &Judges, source: &Scan, target: &Scan, pose: &Pose) -> (f64, f64) {
    let (a, b) = (own.judge(target, pose), theirs.judge(source, &pose.inverse()));
    let (yes, no) = ((a.0 + b.0) as f64, (a.1 + b.1) as f64);
    let all = (own.points.len() + theirs.points.len()) as f64;
    ((yes - no) / all.max(1.0), yes / (yes + no).max(1.0))
}

/// A place refined on every so many judges; gates in voxels.
pub(super) fn refined(
    judges: &Judges,
    every: usize,
    surface: &Surface,
    start: Pose,
    gates: &[f32],
    voxel: f32,
) -> Pose {
    let pick = |v: &Vec<Vec3>| v.iter().step_by(every).copied().collect::<Vec<_>>();
    let (points, normals) = (pick(&judges.points), pick(&judges.normals));
    gates.iter().fold(start, |pose, gate| {
        fine::step(&points, &normals, surface, pose, gate * voxel, f64::from(0.5 * gate * voxel)).0
    })
}

/// Without those that are within `near` of a better one.
fn distinct(sorted: Vec<(Pose, f64)>, points: &[Vec3], near: f32) -> Vec<(Pose, f64)> {
    let mut out: Vec<(Pose, f64)> = Vec::new();
    for (pose, score) in sorted {
        if !out.iter().any(|(other, _)| farthest(other, &pose, points) < f64::from(near)) {
            out.push((pose, score));
        }
    }
    out
}

/// Farthest that one of the points lies from itself in two poses.
pub(super) fn farthest(a: &Pose, b: &Pose, points: &[Vec3]) -> f64 {
    let every = (points.len() / 64).max(1);
    let far = |x: &Vec3| (a.apply(x.as_dvec3()) - b.apply(x.as_dvec3())).length();
    points.iter().step_by(every).map(far).fold(0.0, f64::max)
}

/// The turn that brings `up` to z.
pub(super) fn upright(up: DVec3) -> DQuat {
    DQuat::from_rotation_arc(up.normalize_or(DVec3::Z), DVec3::Z)
}

pub(super) fn voters(scan: &Scan, up: DQuat, seed: u64) -> Upright {
    let turn = up.as_quat();
    let some = balanced::draw(&scan.coarse, turn.inverse() * Vec3::Z, VOTERS, seed);
    Upright {
        points: some.iter().map(|&i| turn * scan.coarse.points[i]).collect(),
        normals: some.iter().map(|&i| turn * scan.coarse.normals[i]).collect(),
    }
}

/// The facings of most surface: floor, walls, the object's front.
fn main_facings(cloud: &Cloud) -> Vec<DVec3> {
    const SAME: f32 = 0.97;
    let every = (cloud.normals.len() / 1500).max(1);
    let some: Vec<Vec3> = cloud.normals.iter().step_by(every).copied().collect();
    let mut left = some.clone();
    let mut out = Vec::new();
    while out.len() < UPS && left.len() > some.len() / 50 {
        let count = |n: &Vec3| left.iter().filter(|m| m.dot(*n) > SAME).count();
        let counts: Vec<usize> = left.par_iter().map(count).collect();
        let Some(best) = (0..left.len()).max_by_key(|&i| (counts[i], std::cmp::Reverse(i))) else { break };
        let mean: Vec3 = left.iter().filter(|m| m.dot(left[best]) > SAME).sum();
        let mean = mean.normalize();
        out.push(mean.as_dvec3());
        left.retain(|m| m.dot(mean) < 0.8);
    }
    out
}
