//! Parts and joints from all states' depth at once (`--method screw`).
pub mod cloud;
pub mod discover;
pub mod evidence;
pub mod hypotheses;
pub mod refine;
pub mod scan;
pub mod space;
