//! Where a scan may stand: pairs of oriented samples vote for a turn about up and a shift.
//!
//! A sample whose normal is not vertical, matched with one of the other scan, says it all: the turn
//! from the two normals, the shift from the two places. The right place gets a vote of every true
//! match; false ones spread.

use glam::{DQuat, DVec3, Quat, Vec3};
use hingecast_geom::Pose;
use std::collections::HashMap;
use std::f32::consts::TAU;

/// Bins around.
const TURNS: i32 = 72;
/// Normals steeper than this say no turn.
const STEEP: f32 = 0.85;
/// Matched samples' normals differ less than this in height.
const TILT: f32 = 0.12;

/// Oriented samples, up along z.
pub(super) struct Upright {
    pub points: Vec<Vec3>,
    pub normals: Vec<Vec3>,
}

/// Poses (target from source, both upright, a turn about z and a shift) with most votes, most first.
/// `bin`: edge of the bins of the shift, scene units.
pub(super) fn places(source: &Upright, target: &Upright, bin: f32, count: usize) -> Vec<Pose> {
    let centre = source.points.iter().sum::<Vec3>() / source.points.len().max(1) as f32;
    let turn_of = |n: &Vec3| n.y.atan2(n.x);
    let level = |cloud: &Upright| -> Vec<(f32, f32, Vec3)> {
        let flat = cloud.normals.iter().zip(&cloud.points).filter(|(n, _)| n.z.abs() < STEEP);
        let mut level: Vec<_> = flat.map(|(n, x)| (n.z, turn_of(n), *x)).collect();
        level.sort_by(|a, b| a.0.total_cmp(&b.0));
        level
    };
    let (from, to) = (level(source), level(target));
    let mut votes: HashMap<[i32; 4], u32> = HashMap::new();
    for (height, turn, x) in &from {
        let (first, last) = (to.partition_point(|t| t.0 < height - TILT), to.partition_point(|t| t.0 <= height + TILT));
        for (_, other, y) in &to[first..last] {
            let by = (other - turn).rem_euclid(TAU);
            let k = (by / TAU * TURNS as f32) as i32 % TURNS;
            // Where the source's middle goes.
            let c = *y - Quat::from_rotation_z(by) * (*x - centre);
            let at = (c / bin).floor().as_ivec3();
            *votes.entry([k, at.x, at.y, at.z]).or_default() += 1;
        }
    }
    let mut most: Vec<([i32; 4], u32)> = votes.iter().map(|(k, v)| (*k, *v)).collect();
    most.sort_by(|a, b| b.1.cmp(&a.1).then(a.0.cmp(&b.0)));
    most.truncate(40 * count);
    // What falls on both sides of a bin's wall is one heap.
    let around = |k: &[i32; 4]| -> u32 {
        let mut sum = 0;
        for d in 0..81 {
            let step = [d % 3 - 1, d / 3 % 3 - 1, d / 9 % 3 - 1, d / 27 - 1];
            let at = [(k[0] + step[0]).rem_euclid(TURNS), k[1] + step[1], k[2] + step[2], k[3] + step[3]];
            sum += votes.get(&at).copied().unwrap_or(0);
        }
        sum
    };
    let mut heaps: Vec<([i32; 4], u32)> = most.iter().map(|(k, _)| (*k, around(k))).collect();
    heaps.sort_by(|a, b| b.1.cmp(&a.1).then(a.0.cmp(&b.0)));
    let mut taken: Vec<[i32; 4]> = Vec::new();
    for (k, _) in &heaps {
        let near = |t: &[i32; 4]| {
            let turn = (t[0] - k[0]).rem_euclid(TURNS);
            turn.min(TURNS - turn) <= 1 && (1..4).all(|a| (t[a] - k[a]).abs() <= 1)
        };
        if !taken.iter().any(near) {
            taken.push(*k);
        }
        if taken.len() == count {
            break;
        }
    }
    let pose = |k: &[i32; 4]| {
        let rot = DQuat::from_rotation_z(f64::from((k[0] as f32 + 0.5) / TURNS as f32 * TAU));
        let to = (Vec3::new(k[1] as f32, k[2] as f32, k[3] as f32) + 0.5) * bin;
        Pose::new(rot, DVec3::from(to) - rot * DVec3::from(centre))
    };
    taken.iter().map(pose).collect()
}
