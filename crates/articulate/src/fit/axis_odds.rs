//! What it costs to turn the axis of a joint, everything else about the joint following.

use super::gauss_newton::{Settings, normal_equations};
use crate::model::owners::Member;
use crate::model::twist::square;
use crate::observe::evidence::Evidence;
use crate::score::compare::CORRELATED;
use glam::DVec3;
use hingecast_geom::KinematicTree;
use nalgebra::{DMatrix, Vector2};

/// Samples are not better than this, voxels: edges of cells and of pixels shift whole faces.
const FLOOR: f64 = 0.08;

/// Nats by which `own`, the samples of its part, speak against turning the axis of joint `j` to `axis` while
/// pivot and values follow: half of d' S d, S the normal matrix of Gauss and Newton without pivot and values
/// (its Schur complement), d the turn. Unlike a mean cost, what finds no surface under either axis has no say.
/// 0 where the matrix cannot be inverted, and of a joint that does not move: nothing is known.
pub fn nats_against(
    evidence: &Evidence,
    tree: &KinematicTree,
    own: &[Member],
    j: usize,
    axis: DVec3,
    settings: &Settings,
    seed: u64,
) -> f64 {
    let (a, rms, rows) = normal_equations(evidence, tree, own, j, settings, seed);
    let Some(others) = a.nrows().checked_sub(2) else { return 0.0 };
    let mut rest: DMatrix<f64> = a.view((2, 2), (others, others)).into_owned();
    let least = 1e-9 * a.diagonal().max().max(1e-12);
    (0..others).for_each(|i| rest[(i, i)] += least);
    let across = a.view((0, 2), (2, others)).into_owned();
    let Some(rest) = rest.cholesky() else { return 0.0 };
    let told = a.view((0, 0), (2, 2)) - &across * rest.solve(&across.transpose());
    let [b1, b2] = square(tree.joints[j].screw.axis);
    let turn = tree.joints[j].screw.axis.cross(axis);
    let d = Vector2::new(b1.dot(turn), b2.dot(turn));
    let variance = rms.powi(2) + (FLOOR * evidence.lattice.voxel as f64).powi(2);
    let share = own.len() as f64 / rows.max(1) as f64; // a sample meets several states
    0.5 * (d.transpose() * told * d)[0].max(0.0) * share / (variance * CORRELATED)
}
