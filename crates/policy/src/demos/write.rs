//! Writes what robomimic's `SequenceDataset` reads.

use super::{Demos, check};
use crate::{ACTION_SIZE, PolicyError};
use hingecast_geom::staging::write_through;
use rust_hdf5::{H5File, H5Group, Hdf5Error};
use std::path::Path;

/// Writes `demos` out of sight and renames the file into place: it is whole or absent.
///
/// # Errors
/// Demonstrations that [`super::read()`] would refuse, or a folder that cannot be written.
pub fn write(path: &Path, demos: &Demos) -> Result<(), PolicyError> {
    check(demos, &path.display().to_string())?;
    write_through(path, |new| write_file(new, demos).map_err(std::io::Error::other))
        .map_err(|e: std::io::Error| PolicyError::write(path, e))
}

fn write_file(path: &Path, demos: &Demos) -> Result<(), Hdf5Error> {
    let file = H5File::create(path)?;
    let data = file.create_group("data")?;
    data.set_attr_string("env_args", &demos.env_args.to_string())?;
    data.set_attr_numeric("total", &(demos.steps() as i64))?;
    for (i, episode) in demos.episodes.iter().enumerate() {
        let group = data.create_group(&format!("demo_{i}"))?;
        group.set_attr_numeric("num_samples", &(episode.actions.len() as i64))?;
        if !episode.model_file.is_empty() {
            group.set_attr_string("model_file", &episode.model_file)?;
        }
        let actions: Vec<f64> = episode.actions.iter().flatten().copied().collect();
        dataset(&group, "actions", &[episode.actions.len(), ACTION_SIZE], &actions)?;
        table(&group, "states", &episode.states)?;
        if !episode.rewards.is_empty() {
            dataset(&group, "rewards", &[episode.rewards.len()], &episode.rewards)?;
        }
        if !episode.dones.is_empty() {
            // robomimic's own files have 0 and 1 as 64-bit integers.
            let dones: Vec<i64> = episode.dones.iter().map(|d| i64::from(*d)).collect();
            group.new_dataset::<i64>().shape([dones.len()]).create("dones")?.write_raw(&dones)?;
        }
        for (name, observations) in [("obs", &episode.obs), ("next_obs", &episode.next_obs)] {
            if !observations.is_empty() {
                let group = group.create_group(name)?;
                for (key, rows) in observations {
                    table(&group, key, rows)?;
                }
            }
        }
    }
    if !demos.masks.is_empty() {
        let masks = file.create_group("mask")?;
        for (mask, names) in &demos.masks {
            let names: Vec<&str> = names.iter().map(String::as_str).collect();
            masks.write_vlen_strings(mask, &names)?;
        }
    }
    file.close()
}

/// Rows of one width; nothing for no rows.
fn table(group: &H5Group, name: &str, rows: &[Vec<f64>]) -> Result<(), Hdf5Error> {
    match rows.first() {
        None => Ok(()),
        Some(first) => dataset(group, name, &[rows.len(), first.len()], &rows.concat()),
    }
}

fn dataset(group: &H5Group, name: &str, shape: &[usize], values: &[f64]) -> Result<(), Hdf5Error> {
    group.new_dataset::<f64>().shape(shape).create(name)?.write_raw(values)
}
