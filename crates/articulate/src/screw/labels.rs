//! Which part a measured sample belongs to: the one under which all states contradict it least and confirm it most.
//!
//! A motion can bring a sample onto surface by chance: the underside of an open drawer, turned about the upright axis of a
//! door, stays in its plane. So support is worth what the states *believe* about the surface that they show there:
//! cost = 2 contradictions - sum over states of the belief that the surface met belongs to this part. Beliefs are soft-mins of the
//! costs, smoothed over neighbours of the same state that face alike, and both are computed in turns.

use super::connected::{among, divide, pairs};
use super::discover::motions_of;
use super::evidence::{Evidence, Motion, Sample, Verdict};
use super::settle::Owners;
use super::space::Lattice;
use crate::icp::Surface;
use glam::Vec3;
use hingecast_geom::KinematicTree;
use rayon::prelude::*;

/// Rounds of smoothing over neighbours.
const SMOOTHING: usize = 3;
/// Turns of costs and beliefs.
const TURNS: usize = 4;
/// Neighbours that smooth a cost.
const NEAR: usize = 8;
/// Weight of a neighbour that faces elsewhere: parts often meet at a crease.
const CREASE: f32 = 0.15;
/// Share of its own cost that a sample keeps in a round of smoothing.
const OWN: f32 = 0.3;
/// Most that a neighbour speaks against a part where depth is sharp (a contradiction costs 2, a confirmation -1).
const HEARD: f32 = 4.0;

/// Square of the distance of two points, `gap` apart, that counts three times off the plane of one: two blades lie closer together than their
/// samples.
pub fn far_off_plane(gap: Vec3, normal: Vec3) -> f32 {
    gap.length_squared() + 8.0 * normal.dot(gap).powi(2)
}

/// What it costs to give a sample to a part with this verdict.
fn cost(v: &Verdict) -> f32 {
    2.0 * v.against.count_ones() as f32 - v.support.count_ones() as f32
}

/// The cheapest part; ties go to the lowest, the base.
fn cheapest(n_parts: usize, cost: impl Fn(usize) -> f32) -> u8 {
    (0..n_parts).fold(0, |best, p| if cost(p) < cost(best) - 1e-3 { p } else { best }) as u8
}

/// The part of every sample of the evidence by its verdicts alone: quick, good enough to refine joints with.
pub fn label(evidence: &Evidence, verdicts: &[Vec<Verdict>]) -> Vec<u8> {
    let n = verdicts[0].len();
    let mut costs: Vec<Vec<f32>> = verdicts.iter().map(|part| part.iter().map(cost).collect()).collect();
    costs.iter_mut().for_each(|c| even_out(c, &evidence.neighbours));
    (0..n).map(|i| cheapest(costs.len(), |p| costs[p][i])).collect()
}

/// Every value becomes 0.4 of itself and 0.6 of its neighbours' mean, some times over.
pub fn even_out(values: &mut Vec<f32>, neighbours: &[Vec<u32>]) {
    for _ in 0..SMOOTHING {
        let mean = |i: usize| {
            let near = &neighbours[i];
            let sum: f32 = near.iter().map(|&j| values[j as usize]).sum();
            0.4 * values[i] + 0.6 * sum / near.len().max(1) as f32
        };
        *values = (0..values.len()).into_par_iter().map(mean).collect();
    }
}

/// The part of every point of every state's cloud. [state][point]
pub fn label_clouds(evidence: &Evidence, tree: &KinematicTree, owners: &Owners) -> Vec<Vec<u8>> {
    let twins = pairs(evidence, tree, owners);
    let (n_states, n_parts) = (evidence.n_states(), tree.parts.len());
    let between = motions_of(evidence, tree);
    // Poses that are off by a fraction of a voxel look like such steps.
    let sharp = !evidence.is_noisy();
    let heard = if sharp { HEARD } else { f32::INFINITY };
    let verdicts: Vec<Vec<Verdict>> = (0..n_states)
        .map(|state| {
            let cloud = &evidence.clouds[state];
            let ask = |i: usize| {
                let sample = Sample::of(cloud, state, i);
                let mut own: Vec<Verdict> =
                    (0..n_parts).map(|p| evidence.ask_all(&sample, &between[p][state])).collect();
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
    // A patch may reach beyond its owner, over the rim of the case that ends flush with the drawer's back. Where a sample's place in
    // the other states is what it was before, and not the owner's, it stays what it was.
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
            let divided = divide(evidence, tree, pair, &points, &among(&which, &near));
            which.iter().zip(divided).for_each(|(&i, part)| labels[i] = part);
        }
    }
    labels
}

/// A flat patch has at least this many samples.
const PATCH: usize = 30;
/// Contradicted share of a patch up to which a part can own all of it, and from which on it cannot.
const CLEAN: f32 = 0.03;
const SOILED: f32 = 0.10;
/// Share of a patch that must be its owner's already: thin lips are contradicted by noise alone.
const BEGUN: f32 = 0.3;

/// A connected flat patch that one part alone can own without contradictions is that part's. The wall of a drawer slides in its own
/// plane: deep inside it could stand still as well, but where it sticks out it cannot, and it is one wall. `twins`: pairs of parts that
/// moved nearly alike and count as one here.
fn whole_patches(
    labels: &mut [u8],
    cloud: &Surface,
    near: &[Near],
    verdicts: &[Verdict],
    twins: &[[usize; 2]],
    voxel: f32,
) {
    let (points, normals) = (&cloud.points, &cloud.normals);
    let n_parts = verdicts.len() / labels.len().max(1);
    let one = |p: usize, q: usize| p == q || twins.contains(&[p.min(q), p.max(q)]);
    let flat = |i: usize, j: usize| {
        let gap = points[j] - points[i];
        normals[i].dot(normals[j]) > 0.97 && gap.length() < 2.0 * voxel && normals[i].dot(gap).abs() < 0.3 * voxel
    };
    let mut seen = vec![false; labels.len()];
    for first in 0..labels.len() {
        if std::mem::replace(&mut seen[first], true) {
            continue;
        }
        let mut patch = vec![first];
        let mut next = 0;
        while next < patch.len() {
            let i = patch[next];
            next += 1;
            for &(j, _) in &near[i] {
                let j = j as usize;
                if !seen[j] && flat(i, j) {
                    seen[j] = true;
                    patch.push(j);
                }
            }
        }
        if patch.len() < PATCH {
            continue;
        }
        let soiled = |p: usize| {
            let against = patch.iter().filter(|&&i| verdicts[i * n_parts + p].against != 0).count();
            against as f32 / patch.len() as f32
        };
        let shares: Vec<f32> = (0..n_parts).map(soiled).collect();
        let clean: Vec<usize> = (0..n_parts).filter(|&p| shares[p] < SOILED).collect();
        let begun = |p: usize| patch.iter().filter(|&&i| one(labels[i] as usize, p)).count() as f32;
        if let Some(&owner) = clean.first()
            && clean.iter().all(|p| one(owner, *p))
            && shares[owner] < CLEAN
            && begun(owner) > BEGUN * patch.len() as f32
        {
            patch.retain(|&i| !one(labels[i] as usize, owner));
            patch.iter().for_each(|&i| labels[i] = owner as u8);
        }
    }
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

/// A sample's neighbours and their weights, which sum to one.
type Near = [(u32, f32); NEAR];

fn neighbours(cloud: &Surface) -> Vec<Near> {
    let of = |i: usize| {
        let mut near = [(i as u32, 0.0); NEAR];
        for (slot, j) in near.iter_mut().zip(cloud.k_nearest(cloud.points[i], NEAR)) {
            let alike = cloud.normals[i].dot(cloud.normals[j as usize]);
            *slot = (j, alike.max(CREASE));
        }
        let sum: f32 = near.iter().map(|n| n.1).sum();
        near.map(|(j, w)| (j, w / sum))
    };
    (0..cloud.points.len()).into_par_iter().map(of).collect()
}

/// Costs [point][part], smoothed. What a neighbour says against a part counts up to `most`: a rim two samples wide is not its neighbours'.
fn smooth(costs: &[f32], near: &[Near], n_parts: usize, most: f32) -> Vec<f32> {
    let mut costs = costs.to_vec();
    for _ in 0..SMOOTHING {
        let heard: Vec<f32> = costs
            .chunks_exact(n_parts)
            .flat_map(|c| {
                let least = c.iter().copied().fold(f32::INFINITY, f32::min);
                c.iter().map(move |c| c.min(least + most))
            })
            .collect();
        let mean = |k: usize| {
            let (i, p) = (k / n_parts, k % n_parts);
            let sum: f32 = near[i].iter().map(|(j, w)| w * heard[*j as usize * n_parts + p]).sum();
            OWN * costs[k] + (1.0 - OWN) * sum
        };
        costs = (0..costs.len()).into_par_iter().map(mean).collect();
    }
    costs
}

/// One state's opinion which part the surface in a cell belongs to.
struct Beliefs {
    lattice: Lattice,
    n_parts: usize,
    /// Cell of the lattice -> row of `rows`; u32::MAX: no surface near.
    row_of: Vec<u32>,
    /// Sum over the samples near a cell. [row][part]
    rows: Vec<f32>,
    /// Their number. [row]
    counts: Vec<f32>,
}

impl Beliefs {
    /// `costs`: [point][part].
    fn new(lattice: &Lattice, cloud: &Surface, costs: &[f32], n_parts: usize) -> Self {
        let (mut row_of, mut rows, mut counts) = (vec![u32::MAX; lattice.len()], Vec::new(), Vec::new());
        let mut own = vec![0.0; n_parts];
        for (x, costs) in cloud.points.iter().zip(costs.chunks_exact(n_parts)) {
            let least = costs.iter().copied().fold(f32::INFINITY, f32::min);
            own.iter_mut().zip(costs).for_each(|(b, c)| *b = (least - c).exp());
            let sum: f32 = own.iter().sum();
            lattice.around(*x, &mut |cell| {
                if row_of[cell] == u32::MAX {
                    row_of[cell] = counts.len() as u32;
                    counts.push(0.0);
                    rows.resize(rows.len() + n_parts, 0.0);
                }
                let row = row_of[cell] as usize;
                counts[row] += 1.0;
                for (slot, b) in rows[row * n_parts..].iter_mut().zip(&own) {
                    *slot += b / sum;
                }
            });
        }
        Self { lattice: *lattice, n_parts, row_of, rows, counts }
    }

    fn at(&self, x: Vec3, part: usize) -> f32 {
        let row = self.lattice.index(x).map_or(u32::MAX, |cell| self.row_of[cell]);
        if row == u32::MAX { 0.0 } else { self.rows[row as usize * self.n_parts + part] / self.counts[row as usize] }
    }
}
