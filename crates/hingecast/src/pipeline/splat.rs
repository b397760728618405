//! Stage `splat`: gaussians of the first state.

use super::Context;
use crate::failure::{Failure, Result};
use crate::stage::write_json;
use hingecast_capture::{Recording, Split, View, ViewCache};
use hingecast_geom::{Gaussians, Progress};
use hingecast_splat::{Engine, FitConfig, Pixels, Target, TargetImages, Views, initialise};
use rayon::prelude::*;
use std::path::Path;
use std::sync::Arc;

/// The training picture of a view, as the engine wants it.
pub fn target(view: &View, background: ([f32; 3], bool)) -> Result<Target> {
    let to_255 = |x: &[u8]| x.iter().map(|v| v * 255).collect::<Vec<u8>>();
    let (mask, usable) = (to_255(&view.mask), to_255(&view.usable));
    let hidden = view.usable.contains(&0);
    Ok(Target::new(
        &view.camera,
        &TargetImages {
            rgb: Pixels::U8(&view.rgb),
            depth: (!view.depth.is_empty()).then_some(&view.depth),
            mask: Some(Pixels::U8(&mask)),
            weight: hidden.then_some(Pixels::U8(&usable)),
            background: background.0,
            shows_background: background.1,
        },
    )?)
}

/// Training targets of one state.
pub fn targets(context: &Context, state: usize) -> Result<Vec<Target>> {
    let frames = context.recording.frames_of(state, Split::Train);
    frames.par_iter().map(|&f| target(&context.view(f)?, context.background)).collect()
}

/// One colour around the object in all pictures (a studio, a renderer), or black and "paint it over".
pub fn background(recording: &Recording, cache: &ViewCache) -> Result<([f32; 3], bool)> {
    /// Largest deviation, 8-bit, that still counts as one colour: JPEG and light fall-off exceed it.
    const FLAT: i32 = 3;
    let frames = recording.frames_of(0, Split::Train);
    let mut colour: Option<[u8; 3]> = None;
    for &f in frames.iter().step_by(frames.len().div_ceil(8).max(1)) {
        let view = cache.get(f)?;
        let (w, h) = (view.camera.width, view.camera.height);
        // The picture's border is the surest background.
        let border = (0..w).map(|x| (x, 0)).chain((0..w).map(|x| (x, h - 1)));
        for (x, y) in border {
            let i = y * w + x;
            if view.mask[i] == 1 || view.usable[i] == 0 {
                continue;
            }
            let c: [u8; 3] = [view.rgb[3 * i], view.rgb[3 * i + 1], view.rgb[3 * i + 2]];
            let reference = *colour.get_or_insert(c);
            if (0..3).any(|k| (c[k] as i32 - reference[k] as i32).abs() > FLAT) {
                return Ok(([0.0; 3], false));
            }
        }
    }
    Ok(colour.map_or(([0.0; 3], false), |c| (c.map(|x| x as f32 / 255.0), true)))
}

/// What a perfect twin would render for a held-out view, (h, w, 3), 0..1: the photo, and where `background` is not what it shows around
/// the object, painted over with it.
pub fn photo(view: &View, background: ([f32; 3], bool)) -> Vec<f32> {
    let paint = |(i, c): (usize, &u8)| {
        if background.1 || view.mask[i / 3] == 1 { *c as f32 / 255.0 } else { background.0[i % 3] }
    };
    view.rgb.iter().enumerate().map(paint).collect()
}

/// Box of the masked depth of some states, world frame. That of the first state scales every length in the settings.
pub fn extent(context: &Context, states: &[usize]) -> Result<(glam::DVec3, glam::DVec3)> {
    let frames: Vec<usize> = states.iter().flat_map(|s| context.recording.frames_of(*s, Split::Train)).collect();
    let stride = if states.len() > 1 { 8 } else { 4 };
    let points: Vec<Vec<glam::DVec3>> = frames
        .par_iter()
        .map(|&f| {
            let mut own = Vec::new();
            super::surface::unproject(&*context.cache.get(f)?, stride, &mut |x, _| own.push(x));
            Ok(own)
        })
        .collect::<Result<_>>()?;
    let mut axes: [Vec<f64>; 3] = std::array::from_fn(|a| points.iter().flatten().map(|x| x[a]).collect());
    if axes[0].len() < 100 {
        return Err(Failure::new(
            "the recording shows no object: fewer than 100 pixels have mask and depth",
            context.recording.root.display().to_string(),
            "hingecast check RECORDING; are the masks inverted, or the depth unit wrong?",
        ));
    }
    // A thousandth on each side is noise: flying pixels at depth edges.
    let mut quantile = |a: usize, q: f64| {
        let k = ((axes[a].len() - 1) as f64 * q) as usize;
        *axes[a].select_nth_unstable_by(k, f64::total_cmp).1
    };
    let lo = glam::DVec3::new(quantile(0, 0.001), quantile(1, 0.001), quantile(2, 0.001));
    let hi = glam::DVec3::new(quantile(0, 0.999), quantile(1, 0.999), quantile(2, 0.999));
    Ok((lo, hi))
}

pub fn run(context: &Context, at: &Path) -> Result<()> {
    let (lo, hi) = extent(context, &[0])?;
    let diagonal = (hi - lo).length();
    let targets: Vec<_> = targets(context, 0)?.into_iter().map(Arc::new).collect();
    let progress = context.ui.stage("splat");
    let get = |i: usize| targets[i].clone();
    let views = Views { count: targets.len(), get: &get, poses: None };
    let first = initialise(&views, context.config.fit.gaussians, context.config.seed)?;
    let gaussians = fit(context, Engine::from_gaussians(&first, context.threads)?, &views, at, &progress)?;
    gaussians.write_ply(&at.join("gaussians.ply"))?;
    write_json(&at.join("extent.json"), &Extent { lo: lo.to_array(), hi: hi.to_array(), diagonal })
}

/// `splat/extent.json`
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
pub struct Extent {
    pub lo: [f64; 3],
    pub hi: [f64; 3],
    /// Scene units.
    pub diagonal: f64,
}

pub fn load(run: &Path) -> Result<(Gaussians, Extent)> {
    let at = run.join("splat");
    Ok((Gaussians::read_ply(&at.join("gaussians.ply"))?, crate::stage::read_json(&at.join("extent.json"))?))
}

/// Fits the engine's gaussians to the views; a killed fit goes on from its checkpoint in `at`.
pub fn fit(context: &Context, mut engine: Engine, views: &Views, at: &Path, progress: &Progress) -> Result<Gaussians> {
    let checkpoint = at.join("checkpoint.bin");
    let config = FitConfig {
        iterations: context.config.fit.steps,
        seed: context.config.seed,
        checkpoint: Some(checkpoint.clone()),
        ..Default::default()
    };
    let report = hingecast_splat::fit(&mut engine, views, &config, progress)?;
    write_json(&at.join("fit.json"), &serde_json::json!({ "training_psnr": report.psnr, "steps": report.iterations }))?;
    let _ = std::fs::remove_file(checkpoint);
    Ok(engine.gaussians())
}
