//! What is believed: trees, who owns which sample, motions, and small edits of them.

pub mod estimate;
pub mod faces;
pub mod mean;
pub mod motions;
pub mod nearest_screw;
pub mod owners;
pub mod tree_edit;
pub mod twist;
