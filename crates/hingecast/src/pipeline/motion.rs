//! Stage `motion`: the gaussians of the first state carried through all states. One file per state, so that a
//! killed run goes on at the state where it stopped.

use super::{Context, splat};
use crate::failure::{Failure, Result};
use hingecast_articulate::classical::track;
use hingecast_articulate::classical::trajectories::Trajectories;
use hingecast_geom::ply::{read_vertices, write_float_vertices};
use std::path::{Path, PathBuf};

fn file(at: &Path, state: usize) -> PathBuf {
    at.join(format!("state_{state:03}.ply"))
}

const COLUMNS: [&str; 7] = ["x", "y", "z", "rot_0", "rot_1", "rot_2", "rot_3"];

fn save(at: &Path, state: usize, means: &[[f32; 3]], quats: &[[f32; 4]]) -> Result<()> {
    let data: Vec<f32> = means.iter().zip(quats).flat_map(|(m, q)| m.iter().chain(q).copied()).collect();
    Ok(write_float_vertices(&file(at, state), &COLUMNS.map(String::from), &data)?)
}

/// Reads the states that are there, up to the first gap.
pub fn load(at: &Path) -> Result<Trajectories> {
    let mut out = Trajectories::default();
    while file(at, out.means.len()).exists() {
        let path = file(at, out.means.len());
        let table = read_vertices(&path)?;
        if table.names != COLUMNS {
            let place = path.display().to_string();
            return Err(Failure::new("not a file of tracked gaussians", place, "build again with --from motion"));
        }
        let rows = table.data.chunks_exact(COLUMNS.len());
        out.means.push(rows.clone().map(|r| [r[0], r[1], r[2]]).collect());
        out.quats.push(rows.map(|r| [r[3], r[4], r[5], r[6]]).collect());
    }
    Ok(out)
}

pub fn run(context: &Context, run: &Path, at: &Path) -> Result<()> {
    let (gaussians, extent) = splat::load(run)?;
    let progress = context.ui.stage("motion");
    let targets = |state: usize| splat::targets(context, state);
    let mut keep = |state: usize, means: &[[f32; 3]], quats: &[[f32; 4]]| save(at, state, means, quats);
    track::run::<Failure>(
        &gaussians,
        context.recording.n_states,
        extent.diagonal,
        &targets,
        load(at)?,
        &mut keep,
        &context.config.track,
        context.config.seed,
        context.threads,
        &progress,
    )?;
    Ok(())
}
