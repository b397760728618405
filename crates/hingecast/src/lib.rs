//! The facade: stages, configuration, evaluation, reports and benches behind the `hingecast` binary.

// `ui` writes to the terminal, and nobody else.
#![deny(clippy::print_stdout, clippy::print_stderr)]

pub mod artifacts;
pub mod build;
pub mod chart;
pub mod config;
pub mod eval;
#[cfg(feature = "mujoco")]
pub mod experiment;
pub mod failure;
pub mod import_object;
pub mod overrides;
pub mod report;
pub mod run_files;
#[cfg(feature = "mujoco")]
pub mod simulate;
pub mod stage;
pub mod stages;
pub mod training;
pub mod ui;
pub mod watcher;
