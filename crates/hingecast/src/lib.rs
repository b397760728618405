//! The facade: stages, configuration, evaluation, reports and benches behind the `hingecast` binary.

pub mod artifacts;
pub mod build;
pub mod chart;
pub mod config;
pub mod eval;
pub mod failure;
pub mod import_object;
pub mod memory;
pub mod overrides;
pub mod report;
pub mod stage;
pub mod stages;
pub mod watcher;
