//! A revolute axis from the points that a motion leaves in place, by RANSAC (Fischler and Bolles
//! 1981).
//!
//! Candidates are the part's own points and a lattice around it: a hinge is seldom on the part that
//! it carries.

use glam::DVec3;
use hingecast_geom::Pose;
use serde::{Deserialize, Serialize};

/// Which candidates count as left in place.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Rule {
    /// The `k` that moved least.
    TopK(usize),
    /// Those that moved less than this share of the largest move (0.02 = 2 %).
    Share(f64),
}

/// Points of a lattice with `spacing` that fills the box `lo..hi`.
pub fn lattice(lo: DVec3, hi: DVec3, spacing: f64) -> Vec<DVec3> {
    let n = ((hi - lo) / spacing).floor().as_uvec3() + glam::UVec3::ONE;
    let mut out = Vec::with_capacity((n.x * n.y * n.z) as usize);
    for z in 0..n.z {
        for y in 0..n.y {
            for x in 0..n.x {
                out.push(lo + DVec3::new(x as f64, y as f64, z as f64) * spacing);
            }
        }
    }
    out
}

/// The candidates that stay under all `motions`: by root mean square displacement over the motions.
pub fn fixed(candidates: &[DVec3], motions: &[Pose], rule: Rule) -> Vec<DVec3> {
    let moved: Vec<f64> = candidates
        .iter()
        .map(|x| motions.iter().map(|m| (m.apply(*x) - *x).length_squared()).sum::<f64>().sqrt())
        .collect();
    let mut order: Vec<usize> = (0..candidates.len()).collect();
    order.sort_by(|a, b| moved[*a].total_cmp(&moved[*b]).then(a.cmp(b)));
    let keep = match rule {
        Rule::TopK(k) => k.min(order.len()),
        Rule::Share(share) => {
            let largest = moved.iter().copied().fold(0.0, f64::max);
            order.iter().filter(|&&i| moved[i] <= share * largest).count()
        }
    };
    order[..keep].iter().map(|&i| candidates[i]).collect()
}

/// Line (point, unit direction) through `points` with most within `tolerance`, then least squares
/// on these.
pub fn ransac_line(points: &[DVec3], tolerance: f64, seed: u64) -> Option<(DVec3, DVec3)> {
    if points.len() < 2 {
        return None;
    }
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut best: Vec<usize> = Vec::new();
    for _ in 0..200 {
        let (a, b) = (points[rng.usize(0..points.len())], points[rng.usize(0..points.len())]);
        let Some(d) = (b - a).try_normalize() else { continue };
        let close: Vec<usize> = (0..points.len()).filter(|&i| (points[i] - a).cross(d).length() <= tolerance).collect();
        if close.len() > best.len() {
            best = close;
        }
    }
    let inliers: Vec<DVec3> = best.iter().map(|&i| points[i]).collect();
    if inliers.len() < 2 {
        return None;
    }
    let centre = inliers.iter().sum::<DVec3>() / inliers.len() as f64;
    let mut m = nalgebra::Matrix3::<f64>::zeros();
    for x in &inliers {
        let d = nalgebra::Vector3::from((*x - centre).to_array());
        m += d * d.transpose();
    }
    let eigen = m.symmetric_eigen();
    let widest = eigen.eigenvalues.imax();
    let d = eigen.eigenvectors.column(widest);
    Some((centre, DVec3::new(d[0], d[1], d[2]).try_normalize()?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use hingecast_geom::{JointKind, Screw};

    #[test]
    fn the_hinge_beside_the_door_is_found() {
        let screw = Screw {
            kind: JointKind::Revolute,
            axis: DVec3::new(0.05, 0.02, 1.0).normalize(),
            pivot: DVec3::new(-0.53, 0.04, 0.0),
        };
        let motions: Vec<Pose> = [0.2, 0.5, 1.1].map(|q| screw.motion(q)).to_vec();
        let candidates = lattice(DVec3::new(-0.7, -0.2, -0.5), DVec3::new(0.6, 0.2, 0.5), 0.02);
        for rule in [Rule::TopK(150), Rule::Share(0.02)] {
            let points = fixed(&candidates, &motions, rule);
            let (x, d) = ransac_line(&points, 0.04, 1).unwrap();
            assert!(d.dot(screw.axis).abs() > 0.9999, "{rule:?} {d}");
            assert!(screw.distance(x) < 0.006, "{rule:?} {}", screw.distance(x));
        }
    }
}
