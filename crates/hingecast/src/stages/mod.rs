//! One file a stage, named after it: plain data in, an artifact out. Stages of `--method track` are
//! in [`classical`].

pub mod classical;
pub mod fit_gaussians;
pub mod inputs;
pub mod joints;
pub mod labeller;
pub mod observations;
pub mod part_of_pixel;
pub mod parts;
pub mod pixels;
pub mod splat;
pub mod targets;
pub mod twin;
