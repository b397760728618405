//! Which of two parts that moved nearly alike a point belongs to.
//!
//! The walls of a drawer slide in their own plane and fit the motion of the drawer beside it as
//! well. Its front and its back know, and the rest belongs to what it hangs on.

use super::smooth::even_out;
use crate::model::motions::{motions_of, poses_of, state_to_state};
use crate::model::owners::Owners;
use crate::observe::evidence::Evidence;
use crate::observe::sample::{Motion, Sample};
use crate::score::agreement::agreement;
use hingecast_geom::KinematicTree;
use rayon::prelude::*;

/// Parts that never are farther apart than this, voxels, moved nearly alike: twice as far as values
/// are sought beside one between them.
const ALIKE_VOXELS: f32 = 6.0;
/// Samples of a part that tell.
const TELLING_SAMPLES: usize = 50;
/// A point knows where it belongs if one part explains it better by this.
const SURE_GAIN: f32 = 0.3;

/// How much better the second of two motions explains a sample, by states where they differ along
/// its normal. `from[k][t]`: world at t from world at the sample's state.
pub fn agreement_gain(evidence: &Evidence, s: &Sample, from: [&[Motion]; 2]) -> f32 {
    let differ = |(a, b): (&Motion, &Motion)| (a.rot * s.normal).dot(b.apply(s.point) - a.apply(s.point)).abs();
    let tells = |t: &usize| *t != s.state && differ((&from[0][*t], &from[1][*t])) > evidence.tolerance;
    let states = (0..from[0].len()).filter(tells);
    states.map(|t| agreement(evidence, t, s, &from[1][t]) - agreement(evidence, t, s, &from[0][t])).sum()
}

/// Of `parts`, the one that each of `points` belongs to, where both moved nearly alike.
/// `neighbours[i]`: points near the i-th.
pub fn divide(
    evidence: &Evidence,
    tree: &KinematicTree,
    parts: [usize; 2],
    points: &[Sample],
    neighbours: &[Vec<u32>],
) -> Vec<u8> {
    let between = parts.map(|p| state_to_state(&poses_of(tree, p, evidence.n_states())));
    let gain = |s: &Sample| agreement_gain(evidence, s, [0, 1].map(|k: usize| &between[k][s.state][..]));
    let mut gains: Vec<f32> = points.par_iter().map(gain).collect();
    even_out(&mut gains, neighbours);
    let mut reached: Vec<usize> = (0..gains.len()).filter(|&i| gains[i].abs() > SURE_GAIN).collect();
    let mut known: Vec<bool> = gains.iter().map(|gain| gain.abs() > SURE_GAIN).collect();
    let mut next = 0;
    while next < reached.len() {
        let i = reached[next];
        next += 1;
        for &k in &neighbours[i] {
            let k = k as usize;
            if !std::mem::replace(&mut known[k], true) {
                gains[k] = gains[i];
                reached.push(k);
            }
        }
    }
    gains.iter().map(|gain| parts[usize::from(*gain > 0.0)] as u8).collect()
}

/// The neighbours of the points `which` that are among these, counted as they are there.
pub fn restrict_neighbours(which: &[usize], neighbours: &[impl AsRef<[u32]>]) -> Vec<Vec<u32>> {
    let mut place = vec![u32::MAX; neighbours.len()];
    which.iter().zip(0..).for_each(|(&i, k)| place[i] = k);
    let of = |&i: &usize| {
        let near = neighbours[i].as_ref().iter().map(|&j| place[j as usize]);
        near.filter(|k| *k != u32::MAX).collect()
    };
    which.iter().map(of).collect()
}

/// Pairs of moving parts, the lower first, that are never farther apart than six voxels.
pub fn coupled_pairs(evidence: &Evidence, tree: &KinematicTree, owners: &Owners) -> Vec<[usize; 2]> {
    let between = motions_of(tree, evidence.n_states());
    let far = |s: &Sample, [p, q]: [usize; 2]| {
        let (p, q) = (&between[p][s.state], &between[q][s.state]);
        let apart = |(p, q): (&Motion, &Motion)| p.apply(s.point).distance(q.apply(s.point));
        p.iter().zip(q).any(|motions| apart(motions) > ALIKE_VOXELS * evidence.lattice.voxel)
    };
    let own = |p: usize| owners.labels.iter().zip(&evidence.samples).filter(move |(l, _)| **l as usize == p);
    let alike = |pair: &[usize; 2]| {
        let stride = own(pair[0]).count().div_ceil(TELLING_SAMPLES).max(1);
        !own(pair[0]).step_by(stride).any(|(_, s)| far(s, *pair))
    };
    let all = (1..tree.parts.len()).flat_map(|p| (p + 1..tree.parts.len()).map(move |q| [p, q]));
    all.filter(alike).collect()
}
