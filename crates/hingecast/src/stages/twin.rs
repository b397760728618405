//! Stage `twin`: labelled depth of all states fused, exported, tried in MuJoCo.

use super::inputs::Inputs;
use super::labeller::Labeller;
use super::observations::Observations;
use super::part_of_pixel::{LabelledSurface, parts_of_pixels, surfaces};
use crate::artifacts::{Joints, Splats};
use crate::config::Method;
use crate::failure::{Failure, Result};
use crate::stage::{read_json, write_json};
use hingecast_articulate::Labelled;
use hingecast_geom::Progress;
use hingecast_twin::{build as twin, relabel};
use std::path::Path;

/// What labels are made from: the surface that the search labelled, and the spacing of its samples;
/// by `--method track` the gaussians do it.
pub type Surface<'a> = Option<(&'a [Labelled], f32)>;

/// Builds, writes into `folder`, tries. Answers all doubts about the run, gravest first.
pub fn run(
    inputs: &Inputs,
    splats: &Splats,
    surface: Surface,
    joints: &Joints,
    folder: &Path,
    progress: &Progress,
) -> Result<Vec<String>> {
    let recording = inputs.recording;
    let diagonal = splats.extent.diagonal;
    let frames = inputs.training_frames().concat();
    let poses: Vec<_> = (0..recording.n_states).map(|s| joints.tree.poses_at(s)).collect();
    let mut seen = Observations::new(inputs, &frames, inputs.config.memory_mb << 20);
    match surface {
        Some((samples, voxel)) => {
            let moved = splats.placed.as_ref().map_or(&[][..], |p| &p.state_from_world);
            let by_state: Vec<LabelledSurface> = surfaces(samples, recording.n_states, moved);
            seen.label(&|view, state| parts_of_pixels(view, &by_state[state], voxel))?;
        }
        None => label_by_gaussians(inputs, splats, joints, &frames, &mut seen, progress)?,
    }
    if inputs.config.method == Method::Track {
        let mut labels = seen.take_labels();
        relabel::resolve::<Failure>(&mut labels, &|i| seen.get(i), &poses, 0.01 * diagonal)?;
        seen.set_labels(labels);
    }
    let input = twin::Input {
        name: &recording.name,
        tree: &joints.tree,
        n_states: recording.n_states,
        n_observations: frames.len(),
        diagonal,
        metric: recording.metric,
        up: recording.up,
    };
    let mut twin = twin::build::<Failure>(&input, &|i| seen.get(i), &inputs.config.twin, progress)?;
    let found = joints.doubts.iter().map(ToString::to_string);
    let mut doubts: Vec<String> = found.chain(inputs.doubts.iter().cloned()).collect();
    doubts.append(&mut twin.doubts);
    twin.doubts.clone_from(&doubts);
    twin.certainty.clone_from(&joints.certainty);
    hingecast_twin::write(&twin, Some((&splats.gaussians, &joints.labels)), folder)?;

    let tried = try_in_simulator(folder, diagonal)?;
    if !tried.is_empty() {
        doubts.extend(tried);
        let path = folder.join("twin.json");
        let mut json: serde_json::Value = read_json(&path)?;
        json["doubts"] = serde_json::json!(doubts);
        write_json(&path, &json)?;
    }
    Ok(doubts)
}

/// Labels by rendering the gaussians in every state. One picture after the other: the engine uses
/// all threads for each.
fn label_by_gaussians(
    inputs: &Inputs,
    splats: &Splats,
    joints: &Joints,
    frames: &[usize],
    seen: &mut Observations,
    progress: &Progress,
) -> Result<()> {
    let mut labeller = Labeller::new(&splats.gaussians, &joints.labels, inputs.threads)?;
    let tolerance = (0.02 * splats.extent.diagonal) as f32;
    let mut state = usize::MAX;
    for (k, &f) in frames.iter().enumerate() {
        if inputs.recording.frames[f].state != state {
            state = inputs.recording.frames[f].state;
            labeller.pose(&joints.tree, &joints.tree.values_at(state))?;
            progress.report(k, frames.len(), "labels")?;
        }
        let view = seen.load(f)?;
        let labels = labeller.label(&view, tolerance)?;
        seen.push(&view, labels);
    }
    Ok(())
}

#[cfg(feature = "mujoco")]
fn try_in_simulator(folder: &Path, diagonal: f64) -> Result<Vec<String>> {
    match hingecast_sim::check_twin(folder, &hingecast_sim::CheckConfig::default()) {
        Ok(checks) => {
            write_json(&folder.join("simulator.json"), &checks)?;
            Ok(checks.iter().flat_map(|c| c.doubts(diagonal)).collect())
        }
        // A twin that MuJoCo refuses is a grave doubt, but the meshes and joints are there all the
        // same.
        Err(e) => Ok(vec![e.to_string().lines().next().unwrap_or_default().to_string()]),
    }
}

#[cfg(not(feature = "mujoco"))]
fn try_in_simulator(_: &Path, _: f64) -> Result<Vec<String>> {
    Ok(vec!["not tried in a simulator: this hingecast was built without MuJoCo".to_string()])
}
