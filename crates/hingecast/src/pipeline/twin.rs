//! Stage `twin`: labelled depth of all states fused, exported, tried in MuJoCo.

use super::joints::JointsFile;
use super::labels::Labeller;
use super::{Context, joints, labelled, splat};
use crate::config::Method;
use crate::failure::{Failure, Result};
use crate::stage::{read_json, write_json};
use hingecast_capture::Split;
use hingecast_geom::Gaussians;
use hingecast_twin::{Observation, build as twin, relabel};
use std::path::Path;

/// Builds, writes, tries. Answers all doubts about the run, gravest first.
pub fn run(context: &Context, run: &Path) -> Result<Vec<String>> {
    let (gaussians, extent) = splat::load(run)?;
    let found = joints::load(run)?;
    let recording = context.recording;
    let frames: Vec<usize> = (0..recording.n_states).flat_map(|s| recording.frames_of(s, Split::Train)).collect();

    // Labels of all frames first: the engine uses all threads for one picture.
    let mut labels = match context.config.method {
        Method::Screw => labelled::pixel_labels(context, run, &frames)?,
        Method::Track => rendered_labels(context, &frames, &gaussians, &found, extent.diagonal)?,
    };

    let progress = context.ui.stage("twin");
    let observe = |i: usize, labels: Vec<u8>| -> Result<Observation> {
        let view = context.view(frames[i])?;
        // Depth of a hand is not depth of the object.
        let depth = view.depth.iter().zip(&view.usable).map(|(d, u)| if *u == 1 { *d } else { 0.0 });
        Ok(Observation {
            state: recording.frames[frames[i]].state,
            camera: view.camera,
            depth: depth.collect(),
            labels,
            rgb: view.rgb,
        })
    };
    let poses: Vec<_> = (0..recording.n_states).map(|s| found.tree.poses_at(s)).collect();
    let unlabelled = |i: usize| observe(i, Vec::new());
    if context.config.method == Method::Track {
        relabel::resolve::<Failure>(&mut labels, &unlabelled, &poses, 0.01 * extent.diagonal)?;
    }
    let load = |i: usize| observe(i, labels[i].clone());
    let input = twin::Input {
        name: &recording.name,
        tree: &found.tree,
        n_states: recording.n_states,
        n_observations: frames.len(),
        diagonal: extent.diagonal,
        metric: recording.metric,
        up: recording.up,
    };
    let mut twin = twin::build::<Failure>(&input, &load, &context.config.twin, &progress)?;
    let mut doubts = found.doubts;
    doubts.append(&mut twin.doubts);
    twin.doubts = doubts;
    twin.certainty = found.certainty;
    let folder = run.join("twin");
    hingecast_twin::write(&twin, Some((&gaussians, &found.labels)), &folder)?;
    doubts = twin.doubts;

    let tried = try_in_simulator(&folder, extent.diagonal)?;
    if !tried.is_empty() {
        doubts.extend(tried);
        let path = folder.join("twin.json");
        let mut json: serde_json::Value = read_json(&path)?;
        json["doubts"] = serde_json::json!(doubts);
        write_json(&path, &json)?;
    }
    Ok(doubts)
}

/// Labels by rendering the gaussians in every state.
fn rendered_labels(
    context: &Context,
    frames: &[usize],
    gaussians: &Gaussians,
    found: &JointsFile,
    diagonal: f64,
) -> Result<Vec<Vec<u8>>> {
    let progress = context.ui.stage("label");
    let mut labeller = Labeller::new(gaussians, &found.labels, context.threads)?;
    let tolerance = (0.02 * diagonal) as f32;
    let mut labels = Vec::with_capacity(frames.len());
    let mut state = usize::MAX;
    for (k, &f) in frames.iter().enumerate() {
        if context.recording.frames[f].state != state {
            state = context.recording.frames[f].state;
            labeller.pose(&found.tree, &found.tree.values_at(state))?;
            progress.report(k, frames.len(), "")?;
        }
        labels.push(labeller.label(&context.view(f)?, tolerance)?);
    }
    Ok(labels)
}

#[cfg(feature = "mujoco")]
fn try_in_simulator(folder: &Path, diagonal: f64) -> Result<Vec<String>> {
    match hingecast_sim::check_twin(folder, &hingecast_sim::CheckConfig::default()) {
        Ok(checks) => {
            write_json(&folder.join("simulator.json"), &checks)?;
            Ok(checks.iter().flat_map(|c| c.doubts(diagonal)).collect())
        }
        // A twin that MuJoCo refuses is a grave doubt, but the meshes and joints are there all the same.
        Err(e) => Ok(vec![e.to_string().lines().next().unwrap_or_default().to_string()]),
    }
}

#[cfg(not(feature = "mujoco"))]
fn try_in_simulator(_: &Path, _: f64) -> Result<Vec<String>> {
    Ok(vec!["not tried in a simulator: this hingecast was built without MuJoCo".to_string()])
}
