//! A set of parts under construction.

use crate::score::verdict::Verdict;
use hingecast_geom::KinematicTree;

/// A set of parts under construction.
pub struct Partial {
    /// Parts and joints so far.
    pub tree: KinematicTree,
    /// Per part, per sample.
    pub verdicts: Vec<Vec<Verdict>>,
    /// Samples that every part contradicts.
    pub open: Vec<usize>,
    /// Contradictions removed so far, by tight count, times the prior.
    pub merit: f64,
}
