//! Reads robomimic's files, and says which field of a damaged one is wrong.

use super::{Demos, Episode, check, index_of};
use crate::{ACTION_SIZE, PolicyError};
use rust_hdf5::{DatatypeMessage, H5Dataset, H5File, H5Group, Hdf5Error};
use std::collections::BTreeMap;
use std::path::Path;

/// Reads all demonstrations of `path`. Where numbers are missing among `demo_<i>`, the episodes
/// move up and the masks follow. Observations that are pictures (more than two axes) are left out.
///
/// # Errors
/// No such file, no HDF5, damaged, without the groups and datasets that robomimic reads, of wrong
/// shape, NaN.
pub fn read(path: &Path) -> Result<Demos, PolicyError> {
    let file = path.display().to_string();
    let head = read_head(path)?;
    if head != *b"\x89HDF\r\n\x1a\n" {
        let hint = "give a file that `hingecast demos` or robomimic wrote";
        return Err(PolicyError::new("not an HDF5 file", format!("{file}: its first bytes are {head:02x?}"), hint));
    }
    let h5 = H5File::open(path).map_err(|e| damaged(&file, e))?;
    let root = h5.root_group();
    let reader = Reader { file, h5 };
    let data = reader.group(&root, "data", "data")?;
    let env_args = reader.env_args(&data)?;

    // demo_10 comes after demo_9, not after demo_1.
    let names = data.group_names().map_err(|e| reader.damaged("data", e))?;
    let mut names: Vec<(usize, String)> = names.into_iter().filter_map(|n| Some((index_of(&n)?, n))).collect();
    names.sort();
    let mut episodes = Vec::with_capacity(names.len());
    for (_, name) in &names {
        let place = format!("data/{name}");
        episodes.push(reader.episode(&reader.group(&data, name, &place)?, &place)?);
    }
    let new_names: BTreeMap<&str, String> =
        names.iter().enumerate().map(|(i, (_, name))| (name.as_str(), format!("demo_{i}"))).collect();
    let masks = reader.masks(&root, &new_names)?;
    let demos = Demos { env_args, episodes, masks };
    check(&demos, &reader.file)?;
    Ok(demos)
}

/// The first eight bytes; zeros where the file is shorter.
fn read_head(path: &Path) -> Result<[u8; 8], PolicyError> {
    use std::io::Read;
    let mut head = Vec::new();
    let file = std::fs::File::open(path).map_err(|e| PolicyError::read(path, e))?;
    file.take(8).read_to_end(&mut head).map_err(|e| PolicyError::read(path, e))?;
    head.resize(8, 0);
    Ok(head.try_into().expect("eight bytes"))
}

fn damaged(place: &str, e: Hdf5Error) -> PolicyError {
    PolicyError::new(
        format!("a damaged or unusual HDF5 file: {e}"),
        place,
        "copy or record the file again; h5dump says whether other programs can read it",
    )
}

struct Reader {
    file: String,
    h5: H5File,
}

impl Reader {
    fn damaged(&self, place: &str, e: Hdf5Error) -> PolicyError {
        damaged(&format!("{}, {place}", self.file), e)
    }

    fn missing(&self, place: &str) -> PolicyError {
        PolicyError::new(
            "robomimic's layout is expected, and something is missing in it",
            format!("{}, {place}: not there", self.file),
            "docs/policy.md lists the groups and datasets; `hingecast demos` writes them",
        )
    }

    fn group(&self, parent: &H5Group, name: &str, place: &str) -> Result<H5Group, PolicyError> {
        parent.group(name).map_err(|e| match e {
            Hdf5Error::NotFound(_) => self.missing(place),
            e => self.damaged(place, e),
        })
    }

    fn env_args(&self, data: &H5Group) -> Result<serde_json::Value, PolicyError> {
        let place = "data, attribute env_args";
        let names = data.attr_names().map_err(|e| self.damaged(place, e))?;
        if !names.iter().any(|n| n == "env_args") {
            return Err(self.missing(place));
        }
        let text = data.attr_string("env_args").map_err(|e| self.damaged(place, e))?;
        serde_json::from_str(&text).map_err(|e| {
            PolicyError::new(
                format!("not JSON: {e}"),
                format!("{}, {place}", self.file),
                "robomimic writes {\"env_name\": ..., \"type\": ..., \"env_kwargs\": {...}}",
            )
        })
    }

    fn episode(&self, group: &H5Group, place: &str) -> Result<Episode, PolicyError> {
        let datasets = group.dataset_names().map_err(|e| self.damaged(place, e))?;
        let groups = group.group_names().map_err(|e| self.damaged(place, e))?;
        let attributes = group.attr_names().map_err(|e| self.damaged(place, e))?;
        let optional = |name: &str| -> Result<Option<Table>, PolicyError> {
            if !datasets.iter().any(|d| d == name) {
                return Ok(None);
            }
            self.table(group, name, &format!("{place}/{name}"))
        };
        let model_file = match attributes.iter().any(|a| a == "model_file") {
            true => group.attr_string("model_file").map_err(|e| self.damaged(&format!("{place}, model_file"), e))?,
            false => String::new(),
        };

        let actions = optional("actions")?.ok_or_else(|| self.missing(&format!("{place}/actions")))?;
        if actions.width != ACTION_SIZE {
            return Err(PolicyError::new(
                format!("actions of {} numbers, {ACTION_SIZE} are expected", actions.width),
                format!("{}, {place}/actions: shape ({}, {})", self.file, actions.rows, actions.width),
                "one arm under OSC_POSE: 3 translation, 3 rotation, 1 gripper; two-armed tasks are not read",
            ));
        }
        let column =
            |name: &str| -> Result<Vec<f64>, PolicyError> { Ok(optional(name)?.map_or(Vec::new(), |t| t.values)) };
        let observations = |name: &str| -> Result<BTreeMap<String, Vec<Vec<f64>>>, PolicyError> {
            if !groups.iter().any(|g| g == name) {
                return Ok(BTreeMap::new());
            }
            let place = format!("{place}/{name}");
            let group = self.group(group, name, &place)?;
            let mut out = BTreeMap::new();
            for key in group.dataset_names().map_err(|e| self.damaged(&place, e))? {
                if let Some(table) = self.table(&group, &key, &format!("{place}/{key}"))? {
                    out.insert(key, table.into_rows());
                }
            }
            Ok(out)
        };
        if !groups.iter().any(|g| g == "obs") {
            return Err(self.missing(&format!("{place}/obs")));
        }
        Ok(Episode {
            model_file,
            actions: actions.values.chunks_exact(ACTION_SIZE).map(|a| a.try_into().expect("seven")).collect(),
            states: optional("states")?.map_or(Vec::new(), Table::into_rows),
            rewards: column("rewards")?,
            dones: column("dones")?.iter().map(|d| *d != 0.0).collect(),
            obs: observations("obs")?,
            next_obs: observations("next_obs")?,
        })
    }

    /// A dataset of one or two axes as f64; `None` for pictures. Everything is widened to f64.
    fn table(&self, group: &H5Group, name: &str, place: &str) -> Result<Option<Table>, PolicyError> {
        let path = format!("{}/{name}", group.name().trim_start_matches('/'));
        let dataset = self.h5.dataset(&path).map_err(|e| self.damaged(place, e))?;
        let shape = dataset.shape();
        let (rows, width) = match shape[..] {
            [rows] => (rows, 1),
            [rows, width] => (rows, width),
            [] => {
                let hint = "one row per step is expected";
                return Err(PolicyError::new("a single number, not a table", format!("{}, {place}", self.file), hint));
            }
            _ => return Ok(None),
        };
        let values = self.numbers(&dataset).map_err(|e| self.damaged(place, e))?;
        Ok(Some(Table { rows, width, values }))
    }

    /// Floating, whole, or (h5py's booleans) an enumeration in a byte.
    fn numbers(&self, dataset: &H5Dataset) -> Result<Vec<f64>, Hdf5Error> {
        if matches!(dataset.datatype()?, DatatypeMessage::Enum { .. }) {
            return Ok(dataset.read_raw::<i8>()?.into_iter().map(f64::from).collect());
        }
        match dataset.read_numeric_as::<f64>() {
            Err(Hdf5Error::TypeMismatch(_)) => {
                Ok(dataset.read_numeric_as::<i64>()?.into_iter().map(|v| v as f64).collect())
            }
            read => read,
        }
    }

    /// Masks with the episodes' new names.
    fn masks(
        &self,
        root: &H5Group,
        new_names: &BTreeMap<&str, String>,
    ) -> Result<BTreeMap<String, Vec<String>>, PolicyError> {
        let mut out = BTreeMap::new();
        if !root.group_names().map_err(|e| self.damaged("mask", e))?.iter().any(|n| n == "mask") {
            return Ok(out);
        }
        let group = self.group(root, "mask", "mask")?;
        for mask in group.dataset_names().map_err(|e| self.damaged("mask", e))? {
            let place = format!("mask/{mask}");
            let names = self.h5.dataset(&place).and_then(|d| d.read_strings());
            let names = names.map_err(|e| self.damaged(&place, e))?;
            // A name that is not there stays as it is: the check says so.
            out.insert(mask, names.into_iter().map(|n| new_names.get(n.as_str()).cloned().unwrap_or(n)).collect());
        }
        Ok(out)
    }
}

/// Row-major.
struct Table {
    rows: usize,
    width: usize,
    values: Vec<f64>,
}

impl Table {
    fn into_rows(self) -> Vec<Vec<f64>> {
        if self.width == 0 {
            return vec![Vec::new(); self.rows];
        }
        self.values.chunks_exact(self.width).map(<[f64]>::to_vec).collect()
    }
}
