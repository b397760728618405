//! Chamfer distances and F-scores of part meshes, whole and visible, with the sampling floor beside
//! them.

use crate::failure::Result;
use glam::Vec3;
use hingecast_capture::{Recording, Split, ViewCache};
use hingecast_geom::{Camera, KinematicTree, PointTree, Pose, TriMesh};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Samples per mesh, as in the published tables.
const SAMPLES: usize = 10_000;

/// How far off the surface of one true part is.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SurfaceErrors {
    /// Name of the true part.
    pub part: String,
    /// CD of the whole mesh; the miss value when nothing was matched.
    pub chamfer: f64,
    /// CD between two samplings of the true mesh: what a perfect twin would score.
    pub floor: f64,
    /// CD restricted to surface that some camera of some state sees.
    pub visible_chamfer: f64,
    /// The same of two samplings of the truth.
    pub visible_floor: f64,
    /// F-score, precision and recall at 1 % of the diagonal, visible surface.
    pub f_score: f64,
    /// Share of found points near true surface.
    pub precision: f64,
    /// Share of true points near found surface.
    pub recall: f64,
}

fn nearest_squared(from: &[Vec3], to: &[Vec3]) -> Vec<f64> {
    let tree = PointTree::new(to);
    from.par_iter().map(|p| tree.nearest(*p).map_or(f64::INFINITY, |n| n.1 as f64)).collect()
}

/// 1000 x (mean_p min_q |p-q|^2 + mean_q min_p |q-p|^2); `None` when a set is empty.
pub fn chamfer(a: &[Vec3], b: &[Vec3]) -> Option<f64> {
    if a.is_empty() || b.is_empty() {
        return None;
    }
    let mean = |d: Vec<f64>| d.iter().sum::<f64>() / d.len() as f64;
    Some(1000.0 * (mean(nearest_squared(a, b)) + mean(nearest_squared(b, a))))
}

/// Depth images against which a point is visible, world frame, with their state.
pub struct Seen {
    views: Vec<(usize, Camera, Vec<f32>)>,
}

impl Seen {
    /// Every state; every third training view keeps this quick and leaves no side unseen.
    pub fn new(recording: &Recording, cache: &ViewCache) -> Result<Self> {
        let frames: Vec<usize> =
            (0..recording.n_states).flat_map(|s| recording.frames_of(s, Split::Train).into_iter().step_by(3)).collect();
        let views = frames
            .par_iter()
            .map(|&f| {
                let view = cache.get(f)?;
                // Background is infinitely far.
                let depth = view.depth.iter().zip(&view.mask).map(|(d, m)| if *m == 0 { f32::INFINITY } else { *d });
                Ok((recording.frames[f].state, view.camera, depth.collect()))
            })
            .collect::<Result<Vec<_>>>()?;
        Ok(Self { views })
    }

    /// The points (reference state) of a part with `motion[s]` that are not behind a measured
    /// surface in some view.
    fn visible(&self, points: &[Vec3], motion: &[Pose], tolerance: f32) -> Vec<Vec3> {
        let seen = |x: &Vec3| {
            self.views.iter().any(|(state, camera, depth)| {
                let (uv, z) = camera.project(motion[*state].apply(x.as_dvec3()));
                let inside = z > 0.0 && uv.x >= 0.0 && uv.y >= 0.0;
                let (u, v) = (uv.x as usize, uv.y as usize);
                inside && u < camera.width && v < camera.height && (z as f32) < depth[v * camera.width + u] + tolerance
            })
        };
        let keep: Vec<bool> = points.par_iter().map(seen).collect();
        points.iter().zip(keep).filter(|(_, k)| *k).map(|(p, _)| *p).collect()
    }
}

/// World motion of a part between the first state and every state.
fn motions(tree: &KinematicTree, part: usize) -> Vec<Pose> {
    let n = tree.joints.iter().map(|j| j.values.len()).max().unwrap_or(0).max(1);
    if tree.joints.is_empty() {
        return vec![Pose::IDENTITY; 1024];
    }
    let back = tree.poses_at(0)[part].inverse();
    (0..n).map(|s| tree.poses_at(s)[part] * back).collect()
}

/// Meshes in the reference state; one entry per true part.
pub fn errors(
    found: &[TriMesh],
    truth: &[TriMesh],
    matching: &[Option<usize>],
    found_tree: &KinematicTree,
    true_tree: &KinematicTree,
    diagonal: f64,
    seen: &Seen,
) -> Vec<SurfaceErrors> {
    let tolerance = 0.005 * diagonal as f32;
    let sample = |m: &TriMesh, seed: u64| m.sample_surface(SAMPLES, seed).into_iter().map(|s| s.0).collect::<Vec<_>>();
    let worst = 1000.0 * diagonal * diagonal;
    (0..truth.len())
        .map(|t| {
            let (a, again) = (sample(&truth[t], 1), sample(&truth[t], 2));
            let b = matching[t].map(|f| sample(&found[f], 3)).unwrap_or_default();
            let move_true = motions(true_tree, t);
            let a_seen = seen.visible(&a, &move_true, tolerance);
            let again_seen = seen.visible(&again, &move_true, tolerance);
            let b_seen = matching[t].map(|f| seen.visible(&b, &motions(found_tree, f), tolerance)).unwrap_or_default();
            let share_within = |from: &[Vec3], to: &[Vec3]| {
                if from.is_empty() || to.is_empty() {
                    return 0.0;
                }
                let limit = (0.01 * diagonal).powi(2);
                nearest_squared(from, to).iter().filter(|d| **d <= limit).count() as f64 / from.len() as f64
            };
            let (precision, recall) = (share_within(&b_seen, &a), share_within(&a_seen, &b));
            SurfaceErrors {
                part: true_tree.parts[t].clone(),
                chamfer: chamfer(&a, &b).unwrap_or(worst),
                floor: chamfer(&a, &again).unwrap_or(0.0),
                visible_chamfer: chamfer(&a_seen, &b_seen).unwrap_or(worst),
                visible_floor: chamfer(&a_seen, &again_seen).unwrap_or(0.0),
                f_score: 2.0 * precision * recall / (precision + recall).max(1e-12),
                precision,
                recall,
            }
        })
        .collect()
}
