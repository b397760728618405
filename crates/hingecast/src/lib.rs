//! The facade: stages, configuration, evaluation, reports and benches behind the `hingecast` binary.

pub mod chart;
pub mod config;
pub mod eval;
#[cfg(feature = "mujoco")]
pub mod experiment;
pub mod failure;
pub mod import_object;
pub mod pipeline;
pub mod report;
pub mod run;
#[cfg(feature = "mujoco")]
pub mod simulate;
pub mod stage;
pub mod training;
pub mod ui;
