//! How well a motion, a part or a whole tree explains the evidence. Pure functions; what a score
//! counts is in each file's head.

pub mod agreement;
pub mod claims;
pub mod compare;
pub mod consensus;
pub mod likelihood;
pub mod part_cost;
pub mod prior;
pub mod verdict;
