//! `parts/samples.ply`: the surface of every state, sample by sample, with its part.

use super::check::checked;
use crate::failure::{Failure, Result};
use glam::Vec3;
use hingecast_articulate::Labelled;
use hingecast_geom::ply::{read_vertices, write_float_vertices};
use hingecast_geom::{KinematicTree, Pose};
use std::path::Path;

const COLUMNS: [&str; 5] = ["x", "y", "z", "state", "part"];

/// Writes the file into a stage's folder.
pub fn write(folder: &Path, samples: &[Labelled]) -> Result<()> {
    let row = |s: &Labelled| [s.point.x, s.point.y, s.point.z, s.state as f32, s.part as f32];
    let rows: Vec<f32> = samples.iter().flat_map(row).collect();
    Ok(write_float_vertices(&folder.join("samples.ply"), &COLUMNS.map(String::from), &rows)?)
}

/// Of a finished stage; `tree`: that of the same stage, whose parts and states the samples name.
///
/// # Errors
/// When the file is missing or not ours.
pub fn read(run: &Path, tree: &KinematicTree) -> Result<Vec<Labelled>> {
    let path = run.join("parts").join("samples.ply");
    let table = read_vertices(&path)?;
    if table.names != COLUMNS {
        let place = path.display().to_string();
        return Err(Failure::new("not a file of labelled samples", place, "build again with --from parts"));
    }
    let row = |r: &[f32]| Labelled { point: Vec3::new(r[0], r[1], r[2]), state: r[3] as usize, part: r[4] as u8 };
    let samples: Vec<Labelled> = table.data.chunks_exact(COLUMNS.len()).map(row).collect();
    let n_states = tree.joints.first().map_or(usize::MAX, |j| j.values.len());
    let nowhere = |s: &Labelled| usize::from(s.part) >= tree.parts.len() || s.state >= n_states || !s.point.is_finite();
    let verdict =
        samples.iter().position(nowhere).map_or(Ok(()), |i| Err(format!("sample {i} is of no part or state")));
    checked(&path, verdict)?;
    Ok(samples)
}

/// At most `most` points of every part's surface, where the first state has it.
pub fn canonical_points(samples: &[Labelled], tree: &KinematicTree, most: usize) -> Vec<Vec<Vec3>> {
    let mut out = vec![Vec::new(); tree.parts.len()];
    let n_states = tree.joints.first().map_or(1, |j| j.values.len());
    let back: Vec<Vec<Pose>> = (0..n_states).map(|s| tree.poses_at(s).iter().map(Pose::inverse).collect()).collect();
    for s in samples {
        let pose = &back[s.state.min(n_states - 1)][s.part as usize];
        out[s.part as usize].push(pose.apply(s.point.as_dvec3()).as_vec3());
    }
    for points in &mut out {
        let stride = points.len().div_ceil(most).max(1);
        *points = points.iter().step_by(stride).copied().collect();
    }
    out
}
