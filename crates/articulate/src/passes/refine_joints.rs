//! All joints and their values together, by Gauss and Newton.

use super::pass::Round;
use crate::fit::gauss_newton::{Settings, gauss_newton};
use crate::model::estimate::Estimate;

/// Refines all joints with all samples of moving parts; wide in the first round.
pub fn refine_joints(round: &Round, estimate: &mut Estimate) {
    let gate = if round.number == 0 { 1.0 } else { 0.6 };
    refine_all(round, estimate, gate);
}

/// The same, its gate narrowing from `gate` voxels to half of it.
pub fn refine_all(round: &Round, estimate: &mut Estimate, gate: f64) {
    let members = estimate.owners.moving(round.evidence);
    let settings = Settings::narrowing(gate, 0.5 * gate, round.evidence.lattice.voxel);
    let free = vec![true; estimate.tree.joints.len()];
    let seed = round.seed ^ round.number as u64;
    estimate.report = gauss_newton(round.evidence, &mut estimate.tree, &members, &free, &settings, seed);
}
