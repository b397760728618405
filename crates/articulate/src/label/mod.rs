//! Which part every piece of measured surface belongs to.

pub mod beliefs;
pub mod boundaries;
pub mod by_evidence;
pub mod by_likelihood_ratio;
pub mod by_verdicts;
pub mod flat_patches;
pub mod labelled;
pub mod smooth;
