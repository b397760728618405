//! Fits gaussians to views: many [`Engine::step`]s in a good order.
//!
//! Half-size pictures for the first third; learning rates that fall exponentially; dead gaussians
//! moved to where the error is. The order of views and everything random follow from the seed and
//! the iteration, so that a resumed fit takes the same steps as one that was never stopped.

use crate::adam::Rates;
use crate::checkpoint::{self, Checkpoint};
use crate::engine::Engine;
use crate::error::SplatError;
use crate::loss::{LossConfig, LossTerms};
use crate::params::plane;
use crate::relocate::relocate;
use crate::views::{Halved, Views};
use hingecast_geom::Progress;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// How long and how fast to fit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct FitConfig {
    /// Steps, one view each.
    pub iterations: usize,
    /// Of the order of the views and of everything random.
    pub seed: u64,
    /// Share of the iterations done at half size.
    pub half_size_share: f64,
    /// `depth_scale` here is a share of the object's radius.
    pub loss: LossConfig,
    /// Rates at the start; `means` is a share of the object's radius.
    pub rates: Rates,
    /// What the rate of the means has fallen to at the end, as a share of the start.
    pub final_means: f32,
    /// The same for all other rates.
    pub final_others: f32,
    /// Iterations between two relocations of dead gaussians; 0 never. None happen in the last
    /// quarter.
    pub relocate_every: usize,
    /// Where to save, if at all, and how often. An existing file is resumed from.
    pub checkpoint: Option<PathBuf>,
    /// Iterations between two saves.
    pub checkpoint_every: usize,
}

impl Default for FitConfig {
    fn default() -> Self {
        Self {
            iterations: 4000,
            seed: 0,
            half_size_share: 1.0 / 3.0,
            loss: LossConfig::default(),
            rates: Rates { means: 1e-3, scales: 2e-2, quats: 5e-3, opacity: 5e-2, sh0: 2e-2, sh1: 2e-3 },
            final_means: 0.02,
            final_others: 0.25,
            relocate_every: 250,
            checkpoint: None,
            checkpoint_every: 1000,
        }
    }
}

/// What came of a fit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FitReport {
    /// Iterations of the fit, resumed ones included.
    pub iterations: usize,
    /// Means over the last pass through the views.
    pub last: LossTerms,
    /// PSNR over the training views of the last pass, dB.
    pub psnr: f64,
    /// Gaussians moved because they did nothing.
    pub relocated: usize,
}

/// Fits the engine's gaussians to `views`.
///
/// # Errors
/// No views, views of impossible size, a checkpoint of another fit, or [`SplatError::Cancelled`];
/// then the work so far is in the checkpoint, if one was asked for.
pub fn fit(
    engine: &mut Engine,
    views: &Views,
    config: &FitConfig,
    progress: &Progress,
) -> Result<FitReport, SplatError> {
    if views.count == 0 {
        return Err(SplatError::Empty { what: "the set of views", item: "view" });
    }
    let mut state = Checkpoint { iteration: 0, extent: extent(engine) };
    if let Some(path) = config.checkpoint.as_ref().filter(|p| p.exists()) {
        state = checkpoint::load(engine, path)?;
    }
    let loss = LossConfig { depth_scale: config.loss.depth_scale * state.extent, ..config.loss };
    let half_until = (config.iterations as f64 * config.half_size_share) as usize;
    let mut halved = Halved::default();
    let mut report = FitReport { iterations: config.iterations, ..Default::default() };
    let mut recent: Vec<LossTerms> = Vec::new();

    while state.iteration < config.iterations {
        let i = state.iteration;
        let view = view_of(config.seed, i, views.count);
        // Only pictures that can be halved are.
        let target = (views.get)(view);
        let small = i < half_until && target.camera().width.min(target.camera().height) >= 64;
        let target = if small { halved.get(views, view)? } else { target };
        if i == half_until {
            halved = Halved::default();
        }
        if let Some(poses) = views.poses {
            engine.set_poses(&poses(view))?;
        }
        recent.push(engine.step(&target, &loss, &rates_at(config, &state))?);
        state.iteration += 1;

        if relocation_due(config, state.iteration) {
            let mut rng = fastrand::Rng::with_seed(config.seed ^ (state.iteration as u64) << 20);
            report.relocated += relocate(engine, views, state.extent, engine.len() / 20, &mut rng)?;
        }
        if recent.len() > views.count {
            recent.remove(0);
        }
        if state.iteration.is_multiple_of(50) || state.iteration == config.iterations {
            let mean = mean(&recent);
            let note = format!("loss {:.5}, psnr {:.2} dB", mean.total, mean.psnr());
            if let Err(cancelled) = progress.report(state.iteration, config.iterations, &note) {
                save(engine, &state, config)?;
                return Err(cancelled.into());
            }
        }
        if config.checkpoint_every > 0 && state.iteration.is_multiple_of(config.checkpoint_every) {
            save(engine, &state, config)?;
        }
    }
    save(engine, &state, config)?;
    report.last = mean(&recent);
    report.psnr = report.last.psnr();
    Ok(report)
}

fn save(engine: &Engine, state: &Checkpoint, config: &FitConfig) -> Result<(), SplatError> {
    config.checkpoint.as_ref().map_or(Ok(()), |path| checkpoint::save(engine, state, path))
}

/// Every view once per pass, each pass in an order of its own.
fn view_of(seed: u64, iteration: usize, count: usize) -> usize {
    let pass = (iteration / count) as u64;
    let mut order: Vec<usize> = (0..count).collect();
    fastrand::Rng::with_seed(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(pass)).shuffle(&mut order);
    order[iteration % count]
}

fn relocation_due(config: &FitConfig, iteration: usize) -> bool {
    config.relocate_every > 0
        && iteration.is_multiple_of(config.relocate_every)
        && iteration <= config.iterations - config.iterations / 4
}

/// Exponential decay from 1 to the final share.
fn rates_at(config: &FitConfig, state: &Checkpoint) -> Rates {
    let t = state.iteration as f32 / config.iterations as f32;
    let rates = config.rates.scaled(config.final_others.powf(t));
    Rates { means: config.rates.means * state.extent * config.final_means.powf(t), ..rates }
}

/// Radius of the box that holds 98 % of the means in each direction.
fn extent(engine: &Engine) -> f32 {
    let spread = |k: usize| {
        let mut v = engine.params().plane(plane::MEANS + k).to_vec();
        v.sort_unstable_by(f32::total_cmp);
        v[v.len() - 1 - v.len() / 100] - v[v.len() / 100]
    };
    let radius = 0.5 * (0..3).map(|k| spread(k).powi(2)).sum::<f32>().sqrt();
    // A single gaussian has no extent; its own size will do.
    if radius > 0.0 { radius } else { engine.params().plane(plane::SCALES)[0].exp() }
}

fn mean(terms: &[LossTerms]) -> LossTerms {
    let n = terms.len().max(1) as f64;
    let mean = |f: fn(&LossTerms) -> f64| terms.iter().map(f).sum::<f64>() / n;
    LossTerms {
        total: mean(|t| t.total),
        l1: mean(|t| t.l1),
        ssim: mean(|t| t.ssim),
        depth: mean(|t| t.depth),
        alpha: mean(|t| t.alpha),
        mse: mean(|t| t.mse),
    }
}
