//! Views -> gaussians: render, gradients, fit, metrics, on the CPU.
//!
//! - [`Engine`] owns the gaussians: [`Engine::render`], [`Engine::step`], [`Engine::loss_and_gradients`].
//! - [`Target`] is one training view, prepared once.
//! - [`Engine::set_groups`] moves groups of gaussians rigidly and hands back the gradient by each group's pose.
//!
//! Conventions are those of `hingecast-geom`: OpenCV cameras, pixel centres at +0.5, depth is z, `a_from_b`.
//! Alpha below 1/255 does not count, alpha is capped at 0.99, a pixel is finished below a transmittance of 1e-4, and 0.3 px
//! are added to both screen variances. Results do not depend on the number of threads, bit for bit; between instruction
//! sets they agree to about 1e-5.

#![warn(missing_docs)]

mod adam;
mod bins;
pub mod checkpoint;
mod engine;
mod error;
mod fit;
mod frame;
mod init;
mod kernels;
mod loss;
mod median;
pub mod metrics;
mod params;
mod pool;
mod prefetch;
mod project;
mod project_backward;
mod raster;
pub mod reference;
mod relocate;
mod simd;
mod ssim;
mod target;
mod view;
mod views;

pub use adam::Rates;
pub use engine::{Engine, Gradients, PixelGradients, Render, RenderOptions};
pub use error::SplatError;
pub use fit::{FitConfig, FitReport, fit};
pub use init::{SurfaceSample, from_surface, initialise, surface_samples};
pub use kernels::Simd;
pub use loss::{DepthLoss, LossConfig, LossTerms};
pub use median::Hit;
pub use params::{Planes, plane};
pub use raster::MAX_EXTRA;
pub use target::{Pixels, Target, TargetImages};
pub use views::Views;
