//! Which part a measured sample belongs to: the one under which all states contradict it least and
//! confirm it most.
//!
//! A motion can bring a sample onto surface by chance: the underside of an open drawer, turned
//! about the upright axis of a door, stays in its plane. So support is worth what the states
//! *believe* about the surface that they show there: cost = 2 contradictions - sum over states of
//! the belief that the surface met belongs to this part. Beliefs are soft-mins of the costs,
//! smoothed over neighbours of the same state that face alike, and both are computed in turns.

use super::beliefs::Beliefs;
use super::by_likelihood_ratio::{coupled_pairs, divide, restrict_neighbours};
use super::by_verdicts::{cheapest, cost};
use super::flat_patches::whole_patches;
use super::smooth::{NEAR, Near, neighbours, smooth};
use crate::model::motions::motions_of;
use crate::model::owners::Owners;
use crate::observe::evidence::Evidence;
use crate::observe::sample::{Motion, Sample};
use crate::score::verdict::Verdict;
use glam::Vec3;
use hingecast_geom::KinematicTree;
use rayon::prelude::*;

/// Turns of costs and beliefs.
const TURNS: usize = 4;
/// Most that a neighbour speaks against a part where depth is sharp (a contradiction costs 2, a
/// confirmation -1).
const HEARD: f32 = 4.0;

/// The part of every point of every state's cloud. `[state][point]`
pub fn label_clouds(evidence: &Evidence, tree: &KinematicTree, owners: &Owners) -> Vec<Vec<u8>> {
    let twins = coupled_pairs(evidence, tree, owners);
    let (n_states, n_parts) = (evidence.n_states(), tree.parts.len());
    let between = motions_of(tree, evidence.n_states());
    // Poses that are off by a fraction of a voxel look like such steps.
    let sharp = !evidence.is_noisy();
    let heard = if sharp { HEARD } else { f32::INFINITY };
    let verdicts: Vec<Vec<Verdict>> = (0..n_states)
        .map(|state| {
            let cloud = &evidence.clouds[state];
            let ask = |i: usize| {
                let sample = Sample::of(cloud, state, i);
                let mut own: Vec<Verdict> =
                    (0..n_parts).map(|p| evidence.verdict(&sample, &between[p][state])).collect();
                // Where more than one part could own it, the grid alone does not tell.
                if sharp && own.iter().filter(|v| cost(v) < 0.0).count() > 1 {
                    for (v, between) in own.iter_mut().zip(&between).filter(|(v, _)| cost(v) < 0.0) {
                        *v = evidence.sharpened(*v, &sample, &between[state]);
                    }
                }
                own
            };
            (0..cloud.points.len()).into_par_iter().flat_map_iter(ask).collect()
        })
        .collect();
    let near: Vec<Vec<Near>> = evidence.clouds.iter().map(neighbours).collect();
    // Before anybody believes anything, all support counts.
    let mut costs: Vec<Vec<f32>> = verdicts.iter().map(|state| state.iter().map(cost).collect()).collect();
    for _ in 0..TURNS {
        let smoothed = costs.iter().zip(&near).map(|(c, near)| smooth(c, near, n_parts, heard));
        let beliefs: Vec<Beliefs> = smoothed
            .zip(&evidence.clouds)
            .map(|(c, cloud)| Beliefs::new(&evidence.lattice, cloud, &c, n_parts))
            .collect();
        for (state, (costs, verdicts)) in costs.iter_mut().zip(&verdicts).enumerate() {
            let cloud = &evidence.clouds[state];
            costs.par_iter_mut().zip(verdicts).enumerate().for_each(|(k, (cost, v))| {
                let (x, part) = (cloud.points[k / n_parts], k % n_parts);
                *cost =
                    2.0 * v.against.count_ones() as f32 - believed(&beliefs, x, part, v.support, &between[part][state]);
            });
        }
    }
    let plain = |state: usize| -> Vec<u8> {
        let smoothed = smooth(&costs[state], &near[state], n_parts, heard);
        smoothed.chunks_exact(n_parts).map(|c| cheapest(n_parts, |p| c[p])).collect()
    };
    let plain: Vec<Vec<u8>> = (0..n_states).into_par_iter().map(plain).collect();
    let patched = |state: usize| {
        let mut labels = plain[state].clone();
        let cloud = &evidence.clouds[state];
        whole_patches(&mut labels, cloud, &near[state], &verdicts[state], &twins, evidence.lattice.voxel);
        labels
    };
    let patched: Vec<Vec<u8>> = (0..n_states).into_par_iter().map(patched).collect();
    // A patch may reach beyond its owner, over the rim of the case that ends flush with the
    // drawer's back. Where a sample's place in the other states is what it was before, and not the
    // owner's, it stays what it was.
    let agreeing = |state: usize, i: usize, part: u8| {
        let v = &verdicts[state][i * n_parts + part as usize];
        let confirms = |t: &usize| {
            let x = between[part as usize][state][*t].apply(evidence.clouds[state].points[i]);
            v.support >> t & 1 == 1 && evidence.clouds[*t].nearest(x).is_some_and(|(j, _)| patched[*t][j] == part)
        };
        (0..n_states).filter(confirms).count() as i64 - 2 * v.against.count_ones() as i64
    };
    let settled = |state: usize| -> Vec<u8> {
        let both = plain[state].iter().zip(&patched[state]).enumerate();
        let keeps = |i: usize, was: u8, is: u8| was == is || agreeing(state, i, is) >= agreeing(state, i, was);
        both.map(|(i, (&was, &is))| if keeps(i, was, is) { is } else { was }).collect()
    };
    let mut labels: Vec<Vec<u8>> = (0..n_states).into_par_iter().map(settled).collect();
    for pair in twins {
        for (state, (labels, near)) in labels.iter_mut().zip(&near).enumerate() {
            let which: Vec<usize> = (0..labels.len()).filter(|&i| pair.contains(&(labels[i] as usize))).collect();
            let points: Vec<Sample> = which.iter().map(|&i| Sample::of(&evidence.clouds[state], state, i)).collect();
            let near: Vec<[u32; NEAR]> = near.iter().map(|n| n.map(|(j, _)| j)).collect();
            let divided = divide(evidence, tree, pair, &points, &restrict_neighbours(&which, &near));
            which.iter().zip(divided).for_each(|(&i, part)| labels[i] = part);
        }
    }
    labels
}

/// Sum over the states in `support` of their belief in `part` where `x` comes to lie.
fn believed(beliefs: &[Beliefs], x: Vec3, part: usize, mut support: u64, from: &[Motion]) -> f32 {
    let mut sum = 0.0;
    while support != 0 {
        let t = support.trailing_zeros() as usize;
        support &= support - 1;
        sum += beliefs[t].at(from[t].apply(x), part);
    }
    sum
}
