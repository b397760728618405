//! Nearest neighbours in a fixed point set: a kd-tree from a library behind two questions.

use glam::Vec3;
use kiddo::{ImmutableKdTree, QueryResultItem, SquaredEuclidean};
use std::num::NonZeroUsize;

/// A kd-tree over points. Coordinates that are not finite must not go in.
pub struct PointTree {
    /// `None` for an empty set, which the library refuses.
    tree: Option<ImmutableKdTree<f32, 3>>,
}

impl PointTree {
    /// Builds the tree; answers are indices into `points`.
    pub fn new(points: &[Vec3]) -> Self {
        let rows: Vec<[f32; 3]> = points.iter().map(|p| p.to_array()).collect();
        Self { tree: ImmutableKdTree::new_from_slice(&rows).ok().filter(|_| !rows.is_empty()) }
    }

    /// Index and squared distance of the nearest point; `None` in an empty set.
    pub fn nearest(&self, x: Vec3) -> Option<(usize, f32)> {
        let found = self.tree.as_ref()?.query(&x.to_array()).nearest_one::<SquaredEuclidean<f32>>().execute();
        Some((found.item as usize, found.distance))
    }

    /// Indices of the `k` nearest points, nearest first; fewer in a smaller set.
    pub fn k_nearest(&self, x: Vec3, k: usize) -> Vec<u32> {
        let (Some(tree), Some(k)) = (&self.tree, NonZeroUsize::new(k)) else { return Vec::new() };
        let found = tree.query(&x.to_array()).nearest_n::<SquaredEuclidean<f32>>(k).execute();
        found.iter().map(|f: &QueryResultItem<_, _, _>| f.item).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_brute_force() {
        let mut rng = fastrand::Rng::with_seed(4);
        let mut point = || Vec3::new(rng.f32(), rng.f32(), rng.f32());
        let points: Vec<Vec3> = (0..500).map(|_| point()).collect();
        let tree = PointTree::new(&points);
        for _ in 0..50 {
            let x = point();
            let mut order: Vec<u32> = (0..500).collect();
            order.sort_by(|a, b| {
                points[*a as usize].distance_squared(x).total_cmp(&points[*b as usize].distance_squared(x))
            });
            assert_eq!(tree.nearest(x).unwrap().0, order[0] as usize);
            assert_eq!(tree.k_nearest(x, 7), order[..7]);
        }
        assert!(PointTree::new(&[]).nearest(Vec3::ZERO).is_none());
    }
}
