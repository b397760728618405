//! Stages of `--method track`.

pub mod joints;
pub mod motion;
pub mod parts;
pub mod splat;
pub mod surface;

/// Gaussians below this opacity say little about where the surface is.
const OPAQUE: f32 = 0.3;
