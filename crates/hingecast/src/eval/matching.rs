//! Which found part is which true part: the Hungarian method on symmetric Chamfer distances in the
//! reference state. Roots match roots. Never on joint errors: that would hide bad parts.

use super::surfaces::chamfer;
use glam::Vec3;
use hingecast_geom::{KinematicTree, TriMesh};
use rayon::prelude::*;

/// For each true part the found part, if any.
pub fn match_parts(
    found: &[TriMesh],
    truth: &[TriMesh],
    found_tree: &KinematicTree,
    true_tree: &KinematicTree,
) -> Vec<Option<usize>> {
    match_points(&surface_points(found), &surface_points(truth), found_tree, true_tree)
}

/// Points per part that it is matched by.
pub const POINTS: usize = 3000;

/// [`POINTS`] points on each surface.
pub fn surface_points(meshes: &[TriMesh]) -> Vec<Vec<Vec3>> {
    meshes.iter().map(|m| m.sample_surface(POINTS, 1).into_iter().map(|s| s.0).collect()).collect()
}

/// The same from points on the parts' surfaces.
pub fn match_points(
    found: &[Vec<Vec3>],
    truth: &[Vec<Vec3>],
    found_tree: &KinematicTree,
    true_tree: &KinematicTree,
) -> Vec<Option<usize>> {
    let movable = |tree: &KinematicTree, n: usize| (0..n).filter(|&p| tree.joint_of(p).is_some()).collect::<Vec<_>>();
    let (rows, columns) = (movable(true_tree, truth.len()), movable(found_tree, found.len()));
    let cost: Vec<Vec<f64>> = rows
        .par_iter()
        .map(|&t| columns.iter().map(|&f| chamfer(&truth[t], &found[f]).unwrap_or(1e9)).collect())
        .collect();
    let mut out = vec![None; truth.len()];
    for (row, column) in assignment(&cost).into_iter().enumerate() {
        out[rows[row]] = column.map(|c| columns[c]);
    }
    let root = |tree: &KinematicTree, n: usize| (0..n).find(|&p| tree.joint_of(p).is_none());
    if let (Some(t), Some(f)) = (root(true_tree, truth.len()), root(found_tree, found.len())) {
        out[t] = Some(f);
    }
    out
}

/// Column of each row in the cheapest assignment (Kuhn 1955, in the O(n^3) potentials form).
/// With more rows than columns some rows get none.
pub fn assignment(cost: &[Vec<f64>]) -> Vec<Option<usize>> {
    let rows = cost.len();
    let columns = cost.first().map_or(0, Vec::len);
    let n = rows.max(columns);
    let at = |i: usize, j: usize| if i < rows && j < columns { cost[i][j] } else { 0.0 };
    // 1-based potentials u, v; way back p.
    let (mut u, mut v, mut p, mut way) = (vec![0.0; n + 1], vec![0.0; n + 1], vec![0; n + 1], vec![0; n + 1]);
    for i in 1..=n {
        p[0] = i;
        let mut j0 = 0;
        let mut least = vec![f64::INFINITY; n + 1];
        let mut used = vec![false; n + 1];
        loop {
            used[j0] = true;
            let (i0, mut delta, mut j1) = (p[j0], f64::INFINITY, 0);
            for j in 1..=n {
                if used[j] {
                    continue;
                }
                let reduced = at(i0 - 1, j - 1) - u[i0] - v[j];
                if reduced < least[j] {
                    (least[j], way[j]) = (reduced, j0);
                }
                if least[j] < delta {
                    (delta, j1) = (least[j], j);
                }
            }
            for j in 0..=n {
                if used[j] {
                    u[p[j]] += delta;
                    v[j] -= delta;
                } else {
                    least[j] -= delta;
                }
            }
            j0 = j1;
            if p[j0] == 0 {
                break;
            }
        }
        while j0 != 0 {
            p[j0] = p[way[j0]];
            j0 = way[j0];
        }
    }
    let mut out = vec![None; rows];
    for j in 1..=n {
        if p[j] >= 1 && p[j] <= rows && j <= columns {
            out[p[j] - 1] = Some(j - 1);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::assignment;

    #[test]
    fn the_cheapest_assignment_is_found() {
        let cost = vec![vec![4.0, 1.0, 3.0], vec![2.0, 0.0, 5.0], vec![3.0, 2.0, 2.0]];
        assert_eq!(assignment(&cost), vec![Some(1), Some(0), Some(2)]);
        // Three true parts, one found: only the best pair is matched.
        assert_eq!(assignment(&[vec![3.0], vec![1.0], vec![2.0]]), vec![None, Some(0), None]);
        assert_eq!(assignment(&[vec![], vec![]]), vec![None, None]);
    }
}
