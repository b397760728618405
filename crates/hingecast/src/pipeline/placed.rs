//! Stage `splat` of `--method screw`: one set of gaussians for all states, fitted with every part in its place; and what the pictures
//! then say about these places.

use super::splat::{self, Extent};
use super::{Context, labelled, screw};
use crate::failure::Result;
use crate::stage::{read_json, write_json};
use hingecast_articulate::pictures::levenberg::refine_by_pictures;
use hingecast_articulate::pictures::problem::Shot;
use hingecast_capture::{Recording, Split};
use hingecast_geom::{KinematicTree, Pose};
use hingecast_splat::{Engine, SurfaceSample, Target, Views, from_surface, surface_samples};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

/// `splat/placed.json`
#[derive(Serialize, Deserialize)]
pub struct Placed {
    /// Of every gaussian.
    pub parts: Vec<u8>,
    /// By depth and pictures.
    pub tree: KinematicTree,
    /// Per state: what its cameras, as the stage before left them, take for the world, from the world. Empty where depth had the
    /// last word.
    pub state_from_world: Vec<Pose>,
    /// What the tree cost before the pictures were asked, and after.
    pub nats: [f64; 2],
}

impl Placed {
    /// Corrects cameras (camera_from_world by frame) by what their states' worlds were off.
    pub fn correct(&self, recording: &Recording, cameras: &mut BTreeMap<usize, Pose>) {
        for (frame, camera) in cameras {
            if let Some(state) = self.state_from_world.get(recording.frames[*frame].state) {
                *camera = *camera * *state;
            }
        }
    }
}

pub fn load(run: &Path) -> Result<Placed> {
    read_json(&run.join("splat").join("placed.json"))
}

/// Gaussians of the whole object in its first state, fitted to views of all states with every part in its place.
pub fn run(context: &Context, run: &Path, at: &Path) -> Result<()> {
    let found = screw::load(run)?;
    let recording = context.recording;
    let progress = context.ui.stage("splat");
    let frames = spread(context);
    let (lo, hi) = splat::extent(context, &[0])?;
    let extent = Extent { lo: lo.to_array(), hi: hi.to_array(), diagonal: (hi - lo).length() };
    let targets: Vec<Arc<Target>> = frames
        .par_iter()
        .map(|&f| Ok(Arc::new(splat::target(&context.view(f)?, context.background)?)))
        .collect::<Result<_>>()?;
    let poses: Vec<Vec<Pose>> = (0..recording.n_states).map(|s| found.tree.poses_at(s)).collect();
    let state_of = |view: usize| recording.frames[frames[view]].state;

    let samples = canonical_samples(context, run, &targets, &state_of, &poses, extent.diagonal)?;
    let (first, groups) = from_surface(&samples, context.config.fit.gaussians);
    drop(samples);
    let mut engine = Engine::from_gaussians(&first, context.threads)?;
    engine.set_groups(&groups, &poses[0])?;
    let get = |i: usize| targets[i].clone();
    let pose = |i: usize| poses[state_of(i)].clone();
    let views = Views { count: targets.len(), get: &get, poses: Some(&pose) };
    let mut gaussians = splat::fit(context, engine, &views, at, &progress)?;
    let mut placed = Placed {
        parts: groups.iter().map(|g| *g as u8).collect(),
        tree: found.tree,
        state_from_world: Vec::new(),
        nats: [0.0; 2],
    };
    if !found.information.is_empty() {
        let shot = |(v, target): (usize, &Arc<Target>)| Shot { target: target.clone(), state: state_of(v) };
        let shots: Vec<Shot> = targets.iter().enumerate().map(shot).collect();
        let mut engine = Engine::from_gaussians(&gaussians, context.threads)?;
        engine.set_groups(&groups, &poses[0])?;
        let refined = refine_by_pictures(&mut engine, &shots, &placed.tree, &found.information, &progress)?;
        groups.iter().enumerate().for_each(|(i, g)| gaussians.transform_one(i, &refined.first[usize::from(*g)]));
        placed =
            Placed { tree: refined.tree, state_from_world: refined.state_from_world, nats: refined.cost, ..placed };
    }
    gaussians.write_ply(&at.join("gaussians.ply"))?;
    write_json(&at.join("placed.json"), &placed)?;
    write_json(&at.join("extent.json"), &extent)
}

/// Most views that are fitted: more of them say little that is new, and each costs memory.
const MOST_VIEWS: usize = 240;

/// Training frames spread over states and cameras.
fn spread(context: &Context) -> Vec<usize> {
    let recording = context.recording;
    let n = recording.n_states;
    let per_state: Vec<Vec<usize>> = (0..n).map(|s| recording.frames_of(s, Split::Train)).collect();
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
    context: &Context,
    run: &Path,
    targets: &[Arc<Target>],
    state_of: &(dyn Fn(usize) -> usize + Sync),
    poses: &[Vec<Pose>],
    diagonal: f64,
) -> Result<Vec<SurfaceSample>> {
    let by_state = labelled::surfaces(run, poses.len(), &[])?;
    // Farther from every sample is stray depth.
    let reach = (0.04 * diagonal as f32).powi(2);
    let each = targets.par_iter().enumerate().map(|(v, target)| {
        let state = state_of(v);
        let surface = &by_state[state];
        let back: Vec<Pose> = poses[state].iter().map(Pose::inverse).collect();
        let mut own = surface_samples(target, targets.len(), context.config.seed ^ v as u64);
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
