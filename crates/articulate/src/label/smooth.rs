//! Smoothing over a sample's neighbours.

use hingecast_geom::icp::Surface;
use rayon::prelude::*;

/// Rounds of smoothing over neighbours.
const ROUNDS: usize = 3;
/// Shares of its own value and of its neighbours' mean in a round of [`even_out`].
const OWN_VALUE: f32 = 0.4;
const NEIGHBOURS_VALUE: f32 = 0.6;
/// Share of its own cost that a sample keeps in a round of [`smooth`].
const OWN_COST: f32 = 0.3;
/// Neighbours that smooth a cost.
pub const NEAR: usize = 8;
/// Weight of a neighbour that faces elsewhere: parts often meet at a crease.
const CREASE: f32 = 0.15;

/// Every value becomes a mean of itself and of its neighbours' mean, some times over.
pub fn even_out(values: &mut Vec<f32>, neighbours: &[Vec<u32>]) {
    for _ in 0..ROUNDS {
        let mean = |i: usize| {
            let near = &neighbours[i];
            let sum: f32 = near.iter().map(|&j| values[j as usize]).sum();
            OWN_VALUE * values[i] + NEIGHBOURS_VALUE * sum / near.len().max(1) as f32
        };
        *values = (0..values.len()).into_par_iter().map(mean).collect();
    }
}

/// A sample's neighbours and their weights, which sum to one.
pub type Near = [(u32, f32); NEAR];

/// The neighbours of every sample; those that face elsewhere weigh less.
pub fn neighbours(cloud: &Surface) -> Vec<Near> {
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

/// Costs `[point][part]`, smoothed. What a neighbour says against a part counts up to `most`: a rim
/// two samples wide is not its neighbours'.
pub fn smooth(costs: &[f32], near: &[Near], n_parts: usize, most: f32) -> Vec<f32> {
    let mut costs = costs.to_vec();
    for _ in 0..ROUNDS {
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
            OWN_COST * costs[k] + (1.0 - OWN_COST) * sum
        };
        costs = (0..costs.len()).into_par_iter().map(mean).collect();
    }
    costs
}
