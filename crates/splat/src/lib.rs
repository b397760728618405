//! Views -> gaussians: render, gradients, fit, metrics, on the CPU.
//!
//! - [`Engine`] owns the gaussians: [`Engine::render`], [`Engine::step`], [`Engine::loss_and_gradients`].
//! - [`Target`] is one training view, prepared once.
//! - [`Engine::set_groups`] moves groups of gaussians rigidly and hands back the gradient by each group's pose.
//!
//! Conventions are those of `hingecast-geom`: OpenCV cameras, pixel centres at +0.5, depth is z,
//! `a_from_b`. Alpha below 1/255 does not count, alpha is capped at 0.99, a pixel is finished below
//! a transmittance of 1e-4, and 0.3 px are added to both screen variances. Results do not depend on
//! the number of threads, bit for bit; between instruction sets they agree to about 1e-5.
//!
//! ```
//! use glam::{DVec2, DVec3};
//! use hingecast_geom::{Camera, Progress};
//! use hingecast_splat::{
//!     Engine, FitConfig, Pixels, RenderOptions, Target, TargetImages, Views, fit, initialise,
//! };
//! use std::sync::Arc;
//!
//! // A red ball of radius 0.5 before black, seen from eight sides.
//! let cameras: Vec<Camera> = (0..8)
//!     .map(|i| {
//!         let (sin, cos) = (0.785 * i as f64).sin_cos();
//!         let eye = DVec3::new(1.9 * cos, 1.9 * sin, 0.6);
//!         Camera::look_at(eye, DVec3::ZERO, DVec3::Z, 64, 64, 0.7)
//!     })
//!     .collect();
//! let mut targets = Vec::new();
//! for camera in &cameras {
//!     let (mut rgb, mut depth, mut mask) = (vec![], vec![], vec![]);
//!     for i in 0..64 * 64 {
//!         let ray = camera.ray(DVec2::new((i % 64) as f64 + 0.5, (i / 64) as f64 + 0.5));
//!         let eye = camera.centre();
//!         let (a, b, c) = (ray.dot(ray), eye.dot(ray), eye.dot(eye) - 0.25);
//!         let hit = b * b > a * c;
//!         rgb.extend(if hit { [0.8f32, 0.2, 0.1] } else { [0.0; 3] });
//!         depth.push(if hit { ((-b - (b * b - a * c).sqrt()) / a) as f32 } else { 0.0 });
//!         mask.push(if hit { 1.0f32 } else { 0.0 });
//!     }
//!     let images = TargetImages {
//!         rgb: Pixels::F32(&rgb),
//!         depth: Some(&depth),
//!         mask: Some(Pixels::F32(&mask)),
//!         weight: None,
//!         background: [0.0; 3],
//!         shows_background: true,
//!     };
//!     targets.push(Arc::new(Target::new(camera, &images)?));
//! }
//!
//! let get = |i: usize| Arc::clone(&targets[i]);
//! let views = Views { count: targets.len(), get: &get, poses: None };
//! let mut engine = Engine::from_gaussians(&initialise(&views, 500, 1)?, 2)?;
//! let config = FitConfig { iterations: 100, ..FitConfig::default() };
//! let report = fit(&mut engine, &views, &config, &Progress::default())?;
//! assert!(report.psnr > 15.0);
//!
//! let picture = engine.render(&cameras[0], &RenderOptions::default())?;
//! assert_eq!(picture.rgb.len(), 64 * 64 * 3);
//! assert!(picture.alpha[32 * 64 + 32] > 0.5);
//! # Ok::<(), hingecast_splat::SplatError>(())
//! ```

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
