//! Parts and joints from all states' depth at once (`--method screw`).
pub mod adopt;
pub mod cameras;
pub mod cloud;
pub mod discover;
pub mod evidence;
pub mod hypotheses;
pub mod jury;
pub mod plausible;
pub mod propose;
pub mod refine;
pub mod scan;
pub mod settle;
pub mod space;
