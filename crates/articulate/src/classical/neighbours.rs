//! Nearest neighbours among gaussians.

use glam::Vec3;
use hingecast_geom::PointTree;
use rayon::prelude::*;

/// The `k` nearest other points of each point, nearest first.
pub fn neighbours(means: &[[f32; 3]], k: usize) -> Vec<Vec<u32>> {
    let points: Vec<Vec3> = means.iter().map(|x| Vec3::from(*x)).collect();
    let tree = PointTree::new(&points);
    points
        .par_iter()
        .enumerate()
        .map(|(i, x)| {
            let mut list = tree.k_nearest(*x, k + 1);
            list.retain(|&j| j as usize != i);
            // Points on top of each other may push the point itself off its own list.
            list.truncate(k);
            while list.len() < k {
                list.push(list.last().copied().unwrap_or(i as u32));
            }
            list
        })
        .collect()
}
