//! Parts one after another: what no known part explains must belong to a new one.
//!
//! Per round: the samples that every known part's motion would put into empty space are *open*. For
//! pairs of states and every possible parent, open samples of one state are sought in the other
//! ([`one_point_screws`]), the best finds are aligned (ICP), turned into a hinge and a slide, and
//! asked in all states ([`sweep_values`](crate::fit::sweep_values)). The finalists are refined by
//! Gauss-Newton, and the one that removes the most contradictions, measured within the noise,
//! becomes a part.

pub mod align_hypotheses;
pub mod candidates;
mod climb;
pub mod discover;
pub mod distinct;
pub mod finalists;
pub mod fit_candidate;
pub mod one_point_screws;
pub mod pairs;
pub mod partial;
pub mod rank_candidates;
pub mod state_pair;
