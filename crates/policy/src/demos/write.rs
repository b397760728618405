//! Writes what robomimic's `SequenceDataset` reads.

use super::strings::{ROOM, settle};
use super::{Demos, check};
use crate::{ACTION_SIZE, PolicyError};
use hingecast_geom::staging::write_through;
use rust_hdf5::{DatatypeMessage, H5File, H5Group, Hdf5Error};
use std::path::Path;

/// Writes `demos` out of sight and renames the file into place: it is whole or absent.
///
/// # Errors
/// Demonstrations that [`super::read()`] would refuse, or a folder that cannot be written.
pub fn write(path: &Path, demos: &Demos) -> Result<(), PolicyError> {
    check(demos, &path.display().to_string())?;
    write_through(path, |new| {
        let strings = write_file(new, demos).map_err(std::io::Error::other)?;
        settle(new, strings)
    })
    .map_err(|e: std::io::Error| PolicyError::write(path, e))
}

/// Number of string attributes, which still have [`ROOM`] behind their names.
fn write_file(path: &Path, demos: &Demos) -> Result<usize, Hdf5Error> {
    let file = H5File::create(path)?;
    let data = file.create_group("data")?;
    let mut strings = 1;
    data.set_attr_string(&format!("env_args{ROOM}"), &demos.env_args.to_string())?;
    data.set_attr_numeric("total", &(demos.steps() as i64))?;
    for (i, episode) in demos.episodes.iter().enumerate() {
        let group = data.create_group(&format!("demo_{i}"))?;
        group.set_attr_numeric("num_samples", &(episode.actions.len() as i64))?;
        if !episode.model_file.is_empty() {
            group.set_attr_string(&format!("model_file{ROOM}"), &episode.model_file)?;
            strings += 1;
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
            mask_names(&masks, mask, names)?;
        }
    }
    file.close()?;
    Ok(strings)
}

/// Strings of one length filled up with zeros, ASCII: what robomimic writes (numpy's `S`), and what
/// every h5py returns as bytes, which robomimic decodes.
fn mask_names(group: &H5Group, mask: &str, names: &[String]) -> Result<(), Hdf5Error> {
    let width = names.iter().map(String::len).max().unwrap_or(0).max(1);
    let mut bytes = Vec::with_capacity(names.len() * width);
    for (i, name) in names.iter().enumerate() {
        bytes.extend_from_slice(name.as_bytes());
        bytes.resize((i + 1) * width, 0);
    }
    let kind = DatatypeMessage::FixedString { size: width as u32, padding: 1, charset: 0 };
    let dataset = group.new_dataset::<u8>().datatype(kind).shape([names.len()]).create(mask)?;
    if bytes.is_empty() { Ok(()) } else { dataset.write_raw_bytes(&bytes) }
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
