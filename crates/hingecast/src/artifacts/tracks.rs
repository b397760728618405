//! What the classical way (`--method track`) leaves: `motion/state_<n>.ply` and its own
//! `parts/parts.json`.

use super::check::{self, checked, read_checked};
use super::write_and_settle;
use crate::failure::{Failure, Result};
use hingecast_articulate::classical::trajectories::Trajectories;
use hingecast_geom::Pose;
use hingecast_geom::ply::{read_vertices, write_float_vertices};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// `parts/parts.json` of `--method track`.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Groups {
    /// Part of each gaussian.
    pub labels: Vec<u8>,
    /// World at state s from world at state 0. `[part][state]`
    pub motions: Vec<Vec<Pose>>,
    /// Part count tried, mean silhouette.
    pub silhouettes: Vec<(usize, f64)>,
}

impl Groups {
    /// Writes the file; answers the groups as a reader would have them.
    pub fn write(&self, folder: &Path) -> Result<Self> {
        write_and_settle(&folder.join("parts.json"), self)
    }

    /// Of a finished stage.
    ///
    /// # Errors
    /// When the file is missing or not ours.
    pub fn read(run: &Path) -> Result<Self> {
        read_checked(&run.join("parts").join("parts.json"), |groups: &Self| {
            let states = groups.motions.first().map_or(0, Vec::len);
            check::labels(&groups.labels, groups.motions.len())?;
            let rows = &groups.motions;
            rows.iter().try_for_each(|row| check::as_many("motions of a part", row.len(), "states", states))
        })
    }
}

fn file(at: &Path, state: usize) -> PathBuf {
    at.join(format!("state_{state:03}.ply"))
}

const COLUMNS: [&str; 7] = ["x", "y", "z", "rot_0", "rot_1", "rot_2", "rot_3"];

/// Writes one state's gaussians into the stage's folder.
///
/// # Errors
/// When the file cannot be written.
pub fn save_state(at: &Path, state: usize, means: &[[f32; 3]], quats: &[[f32; 4]]) -> Result<()> {
    let data: Vec<f32> = means.iter().zip(quats).flat_map(|(m, q)| m.iter().chain(q).copied()).collect();
    Ok(write_float_vertices(&file(at, state), &COLUMNS.map(String::from), &data)?)
}

/// Reads the states that are there, up to the first gap.
///
/// # Errors
/// When a file is damaged or not ours.
pub fn read_states(at: &Path) -> Result<Trajectories> {
    let mut out = Trajectories::default();
    while file(at, out.means.len()).exists() {
        let path = file(at, out.means.len());
        let table = read_vertices(&path)?;
        if table.names != COLUMNS {
            let place = path.display().to_string();
            return Err(Failure::new("not a file of tracked gaussians", place, "build again with --from motion"));
        }
        let rows = table.data.chunks_exact(COLUMNS.len());
        let first = out.means.first().map_or(rows.len(), Vec::len);
        checked(&path, check::as_many("gaussians", rows.len(), "gaussians of the first state", first))?;
        out.means.push(rows.clone().map(|r| [r[0], r[1], r[2]]).collect());
        out.quats.push(rows.map(|r| [r[3], r[4], r[5], r[6]]).collect());
    }
    Ok(out)
}
