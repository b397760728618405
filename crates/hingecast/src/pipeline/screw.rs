//! The stages of `--method screw`: `parts` (what moves, and how, from the depth of all states), `splat` (gaussians of all
//! states at once), `joints` (a person's corrections, doubts).

use super::joints::JointsFile;
use super::splat::{self, Extent};
use super::{Context, overrides};
use crate::failure::{Failure, Result};
use crate::stage::{read_json, write_json};
use glam::Vec3;
use hingecast_articulate::screw::{self, Labelled, cloud, refine::Report};
use hingecast_capture::{Split, View};
use hingecast_geom::ply::{read_vertices, write_float_vertices};
use hingecast_geom::{Certainty, KinematicTree, PointTree, Pose};
use hingecast_splat::{Engine, SurfaceSample, Target, Views, from_surface, surface_samples};
use hingecast_twin::{BACKGROUND, UNKNOWN};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

/// `parts/parts.json`
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PartsFile {
    pub tree: KinematicTree,
    /// camera_from_world as corrected, by frame of the recording.
    pub cameras: BTreeMap<usize, Pose>,
    pub report: Report,
    /// Of each joint, in the tree's order.
    pub certainty: Vec<Certainty>,
    pub doubts: Vec<String>,
    /// Box of the object over all states.
    pub lo: [f32; 3],
    pub hi: [f32; 3],
    /// Spacing of the labelled samples, scene units.
    pub voxel: f32,
}

pub fn load(run: &Path) -> Result<PartsFile> {
    read_json(&run.join("parts").join("parts.json"))
}

const COLUMNS: [&str; 5] = ["x", "y", "z", "state", "part"];

fn load_samples(run: &Path) -> Result<Vec<Labelled>> {
    let path = run.join("parts").join("samples.ply");
    let table = read_vertices(&path)?;
    if table.names != COLUMNS {
        let place = path.display().to_string();
        return Err(Failure::new("not a file of labelled samples", place, "build again with --from parts"));
    }
    let row = |r: &[f32]| Labelled { point: Vec3::new(r[0], r[1], r[2]), state: r[3] as usize, part: r[4] as u8 };
    Ok(table.data.chunks_exact(COLUMNS.len()).map(row).collect())
}

/// At most `most` points of every part's surface, where the first state has it.
pub fn canonical_points(run: &Path, tree: &KinematicTree, most: usize) -> Result<Vec<Vec<Vec3>>> {
    let mut out = vec![Vec::new(); tree.parts.len()];
    let n_states = tree.joints.first().map_or(1, |j| j.values.len());
    let back: Vec<Vec<Pose>> = (0..n_states).map(|s| tree.poses_at(s).iter().map(Pose::inverse).collect()).collect();
    for s in load_samples(run)? {
        let pose = &back[s.state.min(n_states - 1)][s.part as usize];
        out[s.part as usize].push(pose.apply(s.point.as_dvec3()).as_vec3());
    }
    for points in &mut out {
        let stride = points.len().div_ceil(most).max(1);
        *points = points.iter().step_by(stride).copied().collect();
    }
    Ok(out)
}

/// Pixels of a view as the search for parts wants them.
fn depth_view(view: &View) -> cloud::DepthView {
    let class = |i: usize| match (view.usable[i], view.mask[i], view.depth[i] > 0.0) {
        (1, 1, true) => cloud::OBJECT,
        (1, 0, false) => cloud::BACKGROUND,
        // A hand, a hole, or depth outside a ragged mask.
        _ => cloud::UNKNOWN,
    };
    cloud::DepthView {
        camera: view.camera,
        class: (0..view.mask.len()).map(class).collect(),
        depth: view.depth.clone(),
    }
}

pub fn run_parts(context: &Context, at: &Path) -> Result<()> {
    let recording = context.recording;
    let progress = context.ui.stage("parts");
    let all: Vec<usize> = (0..recording.n_states).collect();
    let (lo, hi) = splat::extent(context, &all)?;
    let frames: Vec<Vec<usize>> = all.iter().map(|&s| recording.frames_of(s, Split::Train)).collect();
    let mut views = |state: usize| -> Result<Vec<cloud::DepthView>> {
        frames[state].par_iter().map(|&f| Ok(depth_view(&*context.cache.get(f)?))).collect()
    };
    let (config, seed) = (&context.config.screw, context.config.seed);
    let extent = (lo.as_vec3(), hi.as_vec3());
    let found = screw::run::<Failure>(recording.n_states, extent, &mut views, config, seed, &progress)?;
    let rows: Vec<f32> =
        found.samples.iter().flat_map(|s| [s.point.x, s.point.y, s.point.z, s.state as f32, s.part as f32]).collect();
    write_float_vertices(&at.join("samples.ply"), &COLUMNS.map(String::from), &rows)?;
    let cameras = frames.iter().zip(&found.cameras).flat_map(|(f, c)| f.iter().copied().zip(c.iter().copied()));
    let file = PartsFile {
        cameras: cameras.collect(),
        tree: found.tree,
        voxel: found.voxel,
        report: found.report,
        certainty: found.certainty,
        doubts: found.doubts,
        lo: extent.0.into(),
        hi: extent.1.into(),
    };
    write_json(&at.join("parts.json"), &file)
}

/// `splat/groups.json`: the part of every gaussian.
#[derive(Serialize, Deserialize)]
struct Groups {
    labels: Vec<u8>,
}

/// Gaussians of the whole object in its first state, fitted to views of all states with every part in its place.
pub fn run_splat(context: &Context, run: &Path, at: &Path) -> Result<()> {
    let found = load(run)?;
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
    let gaussians = splat::fit(context, engine, &views, at, &progress)?;
    gaussians.write_ply(&at.join("gaussians.ply"))?;
    write_json(&at.join("groups.json"), &Groups { labels: groups.iter().map(|g| *g as u8).collect() })?;
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
    let by_state = surfaces(run, poses.len())?;
    // Farther from every sample is stray depth.
    let reach = (0.04 * diagonal as f32).powi(2);
    let each = targets.par_iter().enumerate().map(|(v, target)| {
        let state = state_of(v);
        let (tree, parts) = &by_state[state];
        let back: Vec<Pose> = poses[state].iter().map(Pose::inverse).collect();
        let mut own = surface_samples(target, targets.len(), context.config.seed ^ v as u64);
        own.retain_mut(|s| {
            let Some((i, _)) = tree.nearest(s.position).filter(|n| n.1 < reach) else { return false };
            s.group = parts[i] as u16;
            let pose = &back[parts[i] as usize];
            s.position = pose.apply(s.position.as_dvec3()).as_vec3();
            s.normal = pose.rotate(s.normal.as_dvec3()).as_vec3();
            true
        });
        own
    });
    Ok(each.collect::<Vec<_>>().concat())
}

/// Per state: a tree over its labelled samples, and their parts.
fn surfaces(run: &Path, n_states: usize) -> Result<Vec<(PointTree, Vec<u8>)>> {
    let labelled = load_samples(run)?;
    let of_state = |state: usize| {
        let own: Vec<&Labelled> = labelled.iter().filter(|s| s.state == state).collect();
        let points: Vec<Vec3> = own.iter().map(|s| s.point).collect();
        (PointTree::new(&points), own.iter().map(|s| s.part).collect())
    };
    Ok((0..n_states).into_par_iter().map(of_state).collect())
}

/// Part of every pixel of `frames`: that of the nearest labelled sample of its state.
pub fn pixel_labels(context: &Context, run: &Path, frames: &[usize]) -> Result<Vec<Vec<u8>>> {
    let by_state = surfaces(run, context.recording.n_states)?;
    let reach = (2.0 * load(run)?.voxel).powi(2);
    let of_frame = |&f: &usize| -> Result<Vec<u8>> {
        let view = context.view(f)?;
        let (tree, parts) = &by_state[context.recording.frames[f].state];
        let silent = |i: usize| {
            if view.usable[i] == 1 && view.mask[i] == 0 && !(view.depth[i] > 0.0) { BACKGROUND } else { UNKNOWN }
        };
        let mut out: Vec<u8> = (0..view.mask.len()).map(silent).collect();
        super::surface::unproject(&view, 1, &mut |x, i| {
            if let Some((k, _)) = tree.nearest(x.as_vec3()).filter(|n| n.1 < reach) {
                out[i] = parts[k];
            }
        });
        Ok(out)
    };
    frames.par_iter().map(of_frame).collect()
}

pub fn run_joints(context: &Context, run: &Path, at: &Path) -> Result<()> {
    let found = load(run)?;
    let groups: Groups = read_json(&run.join("splat").join("groups.json"))?;
    let certainty = found.certainty.into_iter().map(Some).collect();
    let mut file = JointsFile { tree: found.tree, labels: groups.labels, doubts: found.doubts, certainty };
    overrides::apply(&mut file, &context.config.joint)?;
    write_json(&at.join("joints.json"), &file)
}
