//! Stage `splat` of `--method screw`: one set of gaussians for all states, fitted with every part
//! in its place; and what the pictures then say about these places.

use super::fit_gaussians::fit_gaussians;
use super::inputs::Inputs;
use super::part_of_pixel::surfaces;
use super::targets::target;
use crate::artifacts::{Extent, Parts, Placed, Splats};
use crate::failure::Result;
use hingecast_articulate::Labelled;
use hingecast_articulate::pictures::levenberg::refine_by_pictures;
use hingecast_articulate::pictures::problem::Shot;
use hingecast_geom::{Pose, Progress};
use hingecast_splat::{Engine, SurfaceSample, Target, Views, from_surface, surface_samples};
use rayon::prelude::*;
use std::path::Path;
use std::sync::Arc;

/// Gaussians of the whole object in its first state, fitted to views of all states with every part
/// in its place.
pub fn run(inputs: &Inputs, found: &Parts, labelled: &[Labelled], at: &Path, progress: &Progress) -> Result<Splats> {
    let recording = inputs.recording;
    let frames = spread(inputs);
    let (lo, hi) = inputs.extent(&[0])?;
    let extent = Extent { lo: lo.to_array(), hi: hi.to_array(), diagonal: (hi - lo).length() };
    let targets: Vec<Arc<Target>> = frames
        .par_iter()
        .map(|&f| Ok(Arc::new(target(&inputs.view(f)?, inputs.background)?)))
        .collect::<Result<_>>()?;
    let poses: Vec<Vec<Pose>> = (0..recording.n_states).map(|s| found.tree.poses_at(s)).collect();
    let state_of = |view: usize| recording.frames[frames[view]].state;

    let samples = canonical_samples(inputs, labelled, &targets, &state_of, &poses, extent.diagonal)?;
    let (first, groups) = from_surface(&samples, inputs.config.fit.gaussians);
    drop(samples);
    let mut engine = Engine::from_gaussians(&first, inputs.threads)?;
    engine.set_groups(&groups, &poses[0])?;
    let get = |i: usize| targets[i].clone();
    let pose = |i: usize| poses[state_of(i)].clone();
    let views = Views { count: targets.len(), get: &get, poses: Some(&pose) };
    let mut gaussians = fit_gaussians(inputs, engine, &views, at, progress)?;
    let mut placed = Placed {
        parts: groups.iter().map(|g| *g as u8).collect(),
        tree: found.tree.clone(),
        state_from_world: Vec::new(),
        nats: [0.0; 2],
    };
    if !found.information.is_empty() {
        let shot = |(v, target): (usize, &Arc<Target>)| Shot { target: target.clone(), state: state_of(v) };
        let shots: Vec<Shot> = targets.iter().enumerate().map(shot).collect();
        let mut engine = Engine::from_gaussians(&gaussians, inputs.threads)?;
        engine.set_groups(&groups, &poses[0])?;
        let refined = refine_by_pictures(&mut engine, &shots, &placed.tree, &found.information, progress)?;
        groups.iter().enumerate().for_each(|(i, g)| gaussians.transform_one(i, &refined.first[usize::from(*g)]));
        placed =
            Placed { tree: refined.tree, state_from_world: refined.state_from_world, nats: refined.cost, ..placed };
    }
    Ok(Splats { gaussians, extent, placed: Some(placed) })
}

/// Most views that are fitted: more of them say little that is new, and each costs memory.
const MOST_VIEWS: usize = 240;

/// Training frames spread over states and cameras.
fn spread(inputs: &Inputs) -> Vec<usize> {
    let recording = inputs.recording;
    let n = recording.n_states;
    let per_state = inputs.training_frames();
    // The first state is the one the gaussians stand in; it gets a third.
    let rest = (MOST_VIEWS * 2 / 3).div_ceil(n - 1).max(2);
    let mut out = Vec::new();
    for (s, frames) in per_state.iter().enumerate() {
        let most = if s == 0 { MOST_VIEWS / 3 } else { rest };
        let stride = frames.len() as f64 / most.min(frames.len()) as f64;
        // Each state begins elsewhere, so that all cameras of a fixed rig get their turn.
        let first = (s as f64 * 0.618).fract() * stride;
        out.extend(
            (0..most.min(frames.len())).map(|k| frames[((first + k as f64 * stride) as usize).min(frames.len() - 1)]),
        );
    }
    out
}

/// Surface of all views with parts, where the first state has it.
fn canonical_samples(
    inputs: &Inputs,
    labelled: &[Labelled],
    targets: &[Arc<Target>],
    state_of: &(dyn Fn(usize) -> usize + Sync),
    poses: &[Vec<Pose>],
    diagonal: f64,
) -> Result<Vec<SurfaceSample>> {
    let by_state = surfaces(labelled, poses.len(), &[]);
    // Farther from every sample is stray depth.
    let reach = (0.04 * diagonal as f32).powi(2);
    let each = targets.par_iter().enumerate().map(|(v, target)| {
        let state = state_of(v);
        let surface = &by_state[state];
        let back: Vec<Pose> = poses[state].iter().map(Pose::inverse).collect();
        let mut own = surface_samples(target, targets.len(), inputs.config.seed ^ v as u64);
        own.retain_mut(|s| {
            let Some(part) = surface.part_at(s.position, Some(s.normal), reach) else { return false };
            s.group = u16::from(part);
            let pose = &back[part as usize];
            s.position = pose.apply(s.position.as_dvec3()).as_vec3();
            s.normal = pose.rotate(s.normal.as_dvec3()).as_vec3();
            true
        });
        own
    });
    Ok(each.collect::<Vec<_>>().concat())
}
