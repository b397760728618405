//! Iterative closest point of a part's points against the measured surface of a state: point to
//! plane (Chen and Medioni 1991) with a shrinking gate, so that what is hidden in that state pulls
//! nowhere.

use crate::pose::quat_from_rotation_vector;
use crate::{PointTree, Pose};
use glam::{DVec3, Vec3};
use nalgebra::{Matrix6, Vector6};
use rayon::prelude::*;

/// A measured surface: points with normals, world frame, and a tree over them.
pub struct Surface {
    /// Measured points, world frame, scene units. (n, 3)
    pub points: Vec<Vec3>,
    /// Their unit normals, towards the side that was seen. (n, 3)
    pub normals: Vec<Vec3>,
    tree: PointTree,
}

impl Surface {
    /// Builds the tree over `points`; `normals` has the same length.
    pub fn new(points: Vec<Vec3>, normals: Vec<Vec3>) -> Self {
        let tree = PointTree::new(&points);
        Self { points, normals, tree }
    }

    /// Index and squared distance of the nearest point.
    pub fn nearest(&self, x: Vec3) -> Option<(usize, f32)> {
        self.tree.nearest(x)
    }

    /// Indices of the `k` nearest points, nearest first.
    pub fn k_nearest(&self, x: Vec3, k: usize) -> Vec<u32> {
        self.tree.k_nearest(x, k)
    }
}

/// How well the aligned points lie on the surface.
#[derive(Clone, Copy, Debug)]
pub struct IcpReport {
    /// Share of points within the last gate.
    pub inliers: f64,
    /// Root mean square distance to the plane of these, scene units.
    pub rms: f64,
}

/// Improves `start` (world at the target state from world at the source state) for `points` with
/// `normals`. `gates`: largest accepted distance per round, scene units.
///
/// # Panics
/// When `normals` is shorter than `points`, or the target has fewer normals than points.
pub fn align(points: &[Vec3], normals: &[Vec3], target: &Surface, start: Pose, gates: &[f64]) -> (Pose, IcpReport) {
    align_tethered(points, normals, target, start, gates, 0.0)
}

/// As [`align`], with every point tied to where it was given by `tether` times the pull towards a
/// plane: directions that the surface leaves open (a plane sliding in itself) stay as they were
/// recorded.
///
/// # Panics
/// As [`align`].
pub fn align_tethered(
    points: &[Vec3],
    normals: &[Vec3],
    target: &Surface,
    start: Pose,
    gates: &[f64],
    tether: f64,
) -> (Pose, IcpReport) {
    let mut pose = start;
    let mut report = IcpReport { inliers: 0.0, rms: f64::INFINITY };
    for &gate in gates {
        let (rot, trans) = (pose.mat3().as_mat3(), pose.trans.as_vec3());
        // One row per accepted point: J = [x x n | n], residual n . (x - y). Chunked sums keep the
        // order fixed.
        let sums: Vec<(Matrix6<f64>, Vector6<f64>, f64, usize)> = (0..points.len())
            .collect::<Vec<_>>()
            .par_chunks(2048)
            .map(|chunk| {
                let (mut a, mut b, mut sum, mut n) = (Matrix6::zeros(), Vector6::zeros(), 0.0, 0);
                for &i in chunk {
                    let x = rot * points[i] + trans;
                    let Some((j, squared)) = target.tree.nearest(x) else { continue };
                    let normal = target.normals[j];
                    // A front does not match a back: thin doors have both.
                    if squared as f64 > gate * gate || (rot * normals[i]).dot(normal) < 0.3 {
                        continue;
                    }
                    let r = normal.dot(x - target.points[j]) as f64;
                    let (x, normal) = (x.as_dvec3(), normal.as_dvec3());
                    let along = |n: DVec3| {
                        let c = x.cross(n);
                        Vector6::new(c.x, c.y, c.z, n.x, n.y, n.z)
                    };
                    let row = along(normal);
                    a += row * row.transpose();
                    b -= row * r;
                    if tether > 0.0 {
                        let off = x - points[i].as_dvec3();
                        for n in [DVec3::X, DVec3::Y, DVec3::Z] {
                            let row = along(n);
                            a += tether * row * row.transpose();
                            b -= tether * row * off.dot(n);
                        }
                    }
                    sum += r * r;
                    n += 1;
                }
                (a, b, sum, n)
            })
            .collect();
        let (mut a, mut b, mut sum, mut n) = (Matrix6::zeros(), Vector6::zeros(), 0.0, 0);
        for s in sums {
            a += s.0;
            b += s.1;
            sum += s.2;
            n += s.3;
        }
        if n < 12 {
            break;
        }
        report = IcpReport { inliers: n as f64 / points.len() as f64, rms: (sum / n as f64).sqrt() };
        // A little damping keeps directions that the surface does not constrain (a plane sliding in
        // itself) still.
        let damping = 1e-4 * a.trace() / 6.0;
        let Some(step) = (a + Matrix6::identity() * damping).cholesky().map(|c| c.solve(&b)) else { break };
        let delta = Pose::new(
            quat_from_rotation_vector(DVec3::new(step[0], step[1], step[2])),
            DVec3::new(step[3], step[4], step[5]),
        );
        pose = delta * pose;
    }
    (pose, report)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_corner_finds_its_place() {
        // Three faces of a unit cube constrain all six degrees of freedom.
        let (mut points, mut normals) = (Vec::new(), Vec::new());
        for i in 0..40 {
            for j in 0..40 {
                let (u, v) = (i as f32 / 39.0, j as f32 / 39.0);
                for (p, n) in
                    [(Vec3::new(u, v, 0.0), Vec3::Z), (Vec3::new(u, 0.0, v), Vec3::Y), (Vec3::new(0.0, u, v), Vec3::X)]
                {
                    points.push(p);
                    normals.push(n);
                }
            }
        }
        let truth = Pose::new(quat_from_rotation_vector(DVec3::new(0.02, -0.03, 0.025)), DVec3::new(0.01, 0.02, -0.01));
        let move_all = |p: &[Vec3]| p.iter().map(|x| truth.apply(x.as_dvec3()).as_vec3()).collect::<Vec<_>>();
        let turned = normals.iter().map(|n| truth.rotate(n.as_dvec3()).as_vec3()).collect();
        let target = Surface::new(move_all(&points), turned);
        let (pose, report) = align(&points, &normals, &target, Pose::IDENTITY, &[0.1; 12]);
        assert!((pose.inverse() * truth).angle() < 2e-4, "{:?}", pose);
        assert!((pose.trans - truth.trans).length() < 5e-4 && report.rms < 1e-3);
    }
}
