//! Scans aligned to scans: point to plane, weights that let go of what moved, and all states
//! together at the end.

use super::balanced;
use crate::scan::Scan;
use glam::{DVec3, Vec3};
use hingecast_articulate::observe::cloud::Cloud;
use hingecast_geom::Pose;
use hingecast_geom::icp::Surface;
use hingecast_geom::pose::quat_from_rotation_vector;
use nalgebra::{Matrix6, Vector6};
use rayon::prelude::*;

/// Rounds of all states together.
const ROUNDS: usize = 3;
/// Samples of a scan that are aligned.
const SAMPLES: usize = 12_000;

/// One round of Gauss and Newton. `gate`: farthest neighbour, scene units; `scale`: residual at
/// which a sample's weight has fallen to a quarter (Geman and McClure). Returns the pose, and
/// the lower quartile and the median of the absolute residuals within the gate.
pub(crate) fn step(
    points: &[Vec3],
    normals: &[Vec3],
    target: &Surface,
    pose: Pose,
    gate: f32,
    scale: f64,
) -> (Pose, [f64; 2]) {
    let (rot, trans) = (pose.mat3().as_mat3(), pose.trans.as_vec3());
    let centre = pose.apply(points.iter().sum::<Vec3>().as_dvec3() / points.len().max(1) as f64);
    let order: Vec<usize> = (0..points.len()).collect();
    let chunks: Vec<(Matrix6<f64>, Vector6<f64>, Vec<f64>)> = order
        .par_chunks(1024)
        .map(|chunk| {
            let (mut a, mut b, mut residuals) = (Matrix6::zeros(), Vector6::zeros(), Vec::new());
            for &i in chunk {
                let (x, m) = (rot * points[i] + trans, rot * normals[i]);
                let Some((j, squared)) = target.nearest(x) else { continue };
                let n = target.normals[j];
                if squared > gate * gate || m.dot(n) < 0.7 {
                    continue;
                }
                let r = f64::from(n.dot(x - target.points[j]));
                residuals.push(r.abs());
                let w = (1.0 + (r / scale).powi(2)).powi(-2);
                let (arm, n) = (x.as_dvec3() - centre, n.as_dvec3());
                let c = arm.cross(n);
                let row = Vector6::new(c.x, c.y, c.z, n.x, n.y, n.z);
                a += w * row * row.transpose();
                b -= w * row * r;
            }
            (a, b, residuals)
        })
        .collect();
    let (mut a, mut b, mut residuals) = (Matrix6::zeros(), Vector6::zeros(), Vec::new());
    for (ca, cb, cr) in chunks {
        a += ca;
        b += cb;
        residuals.extend(cr);
    }
    if residuals.len() < 30 {
        return (pose, [f64::INFINITY; 2]);
    }
    let last = residuals.len() - 1;
    let off = [last / 4, last / 2].map(|k| *residuals.select_nth_unstable_by(k, f64::total_cmp).1);
    let damping = 1e-6 * a.trace() / 6.0;
    let Some(x) = (a + Matrix6::identity() * damping).cholesky().map(|c| c.solve(&b)) else { return (pose, off) };
    let turn = quat_from_rotation_vector(DVec3::new(x[0], x[1], x[2]));
    let shift = DVec3::new(x[3], x[4], x[5]);
    let about_centre = Pose::new(turn, centre + shift - turn * centre);
    (about_centre * pose, off)
}

/// The poses of all states (frame of state 0 from each), refined together from `start`. `order`: the
/// states as the pairs reach them, state 0 first.
pub(super) fn together(scans: &[Scan], start: Vec<Pose>, order: &[usize], seed: u64) -> Vec<Pose> {
    let n = scans.len();
    let own: Vec<Cloud> = scans.iter().map(|scan| balanced::pick(&scan.fine, SAMPLES, seed)).collect();
    let voxel = scans.iter().map(|s| s.fine_voxel).fold(0.0, f32::max);
    let aligned = |s: usize, others: &[usize], poses: &[Pose], rounds: usize| {
        let (mut points, mut normals) = (Vec::new(), Vec::new());
        for &r in others {
            let (p, m) = carried(&scans[r].fine, &poses[r]);
            points.extend(p);
            normals.extend(m);
        }
        let surface = Surface::new(points, normals);
        let (mut pose, mut scale) = (poses[s], f64::from(voxel));
        for _ in 0..rounds {
            let (better, [_, median]) = step(&own[s].points, &own[s].normals, &surface, pose, 2.0 * voxel, scale);
            pose = better;
            scale = (3.0 * median).clamp(0.05 * f64::from(voxel), f64::from(voxel));
        }
        pose
    };
    let mut poses = start;
    // Each onto those before it: two states that lie well on each other would hold each other where
    // both are off.
    for k in 1..order.len() {
        let before = &order[k.saturating_sub(ALL)..k];
        poses[order[k]] = aligned(order[k], before, &poses, 12);
    }
    for _ in 0..ROUNDS {
        let next: Vec<Pose> = (0..n)
            .into_par_iter()
            .map(|s| {
                // With many states a few of the others hold a scan as well as all do.
                let others: Vec<usize> = (0..n).filter(|&r| r != s).take(ALL).collect();
                if n == 2 && s == 0 { poses[0] } else { aligned(s, &others, &poses, 4) }
            })
            .collect();
        // State 0 keeps its frame.
        let back = next[0].inverse();
        poses = next.into_iter().map(|p| back * p).collect();
        poses[0] = Pose::IDENTITY;
    }
    poses
}

/// Other states that a scan is aligned to.
const ALL: usize = 8;

/// A cloud in another frame.
pub(super) fn carried(cloud: &Cloud, pose: &Pose) -> (Vec<Vec3>, Vec<Vec3>) {
    let (rot, trans) = (pose.mat3().as_mat3(), pose.trans.as_vec3());
    let points = cloud.points.iter().map(|x| rot * *x + trans).collect();
    (points, cloud.normals.iter().map(|n| rot * *n).collect())
}
