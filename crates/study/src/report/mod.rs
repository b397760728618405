//! Pages about policies.

pub mod rollout;
mod rollout_plot;
