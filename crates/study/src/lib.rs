//! What a twin is worth: demonstrations on it, policies cloned from them, rollouts on the true
//! object and on its twins, whole experiments, and grids of recordings through the search for
//! parts. Algorithms behind the verbs `demos`, `train`, `rollout`, `experiment` and `bench`.

#![warn(missing_docs)]

#[cfg(feature = "mujoco")]
pub mod experiment;
pub mod grid;
pub mod host;
#[cfg(feature = "mujoco")]
pub mod report;
#[cfg(feature = "mujoco")]
pub mod simulate;
pub mod suite;
pub mod training;
