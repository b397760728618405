//! Reads robomimic's files, and says which field of a damaged one is wrong.

use super::links::{Found, Wrong, find};
use super::{Demos, Episode, check, index_of, masks};
use crate::{ACTION_SIZE, PolicyError};
use rust_hdf5::{DatatypeMessage, H5Dataset, H5File, H5Group, Hdf5Error};
use std::cell::Cell;
use std::collections::BTreeMap;
use std::path::Path;

/// Deflate, the densest packing that is read, makes at most 1032 bytes out of one. A file that
/// says it holds more lies about its shapes, and would otherwise decide how much memory we take.
const MOST_UNPACKED: u64 = 1032;

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
    let bytes = std::fs::metadata(path).map_err(|e| PolicyError::read(path, e))?.len();
    let h5 = H5File::open(path).map_err(|e| damaged(&file, e))?;
    let root = h5.root_group();
    let reader = Reader { file, h5, budget: Cell::new(bytes.saturating_mul(MOST_UNPACKED)) };
    let data = reader.group(&root, "data", "data")?;
    let env_args = reader.env_args(&data)?;

    // demo_10 comes after demo_9, not after demo_1.
    let names = data.link_names().map_err(|e| reader.damaged("data", e))?;
    let mut names: Vec<(usize, String)> = names.into_iter().filter_map(|n| Some((index_of(&n)?, n))).collect();
    names.sort();
    let mut episodes = Vec::with_capacity(names.len());
    let mut new_names: BTreeMap<String, String> = BTreeMap::new();
    for (_, name) in names {
        let place = format!("data/{name}");
        if let Found::Group(group) = reader.find(&data, &name, &place)? {
            new_names.insert(name, format!("demo_{}", episodes.len()));
            episodes.push(reader.episode(&group, &place)?);
        }
    }
    let mut masks = reader.masks(&root)?;
    masks::check(&masks, |name| new_names.contains_key(name), &reader.file)?;
    masks.values_mut().flatten().for_each(|name| *name = new_names[name.as_str()].clone());
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
    /// Bytes that may still be read.
    budget: Cell<u64>,
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

    /// What a name in `parent` leads to, through all links.
    fn find(&self, parent: &H5Group, name: &str, place: &str) -> Result<Found, PolicyError> {
        find(&self.h5, parent, name).map_err(|wrong| match wrong {
            Wrong::File(e) => self.damaged(place, e),
            Wrong::Link(what, link) => PolicyError::new(
                what,
                format!("{}, {place}: {link}", self.file),
                "copy what it leads to into the file (h5py: file.copy), or remove the link",
            ),
        })
    }

    fn group(&self, parent: &H5Group, name: &str, place: &str) -> Result<H5Group, PolicyError> {
        match self.find(parent, name, place)? {
            Found::Group(group) => Ok(group),
            _ => Err(self.missing(place)),
        }
    }

    /// Takes `bytes` off what may still be read.
    fn spend(&self, bytes: Option<u64>, place: &str, shape: &[usize]) -> Result<(), PolicyError> {
        let left = bytes.and_then(|bytes| self.budget.get().checked_sub(bytes));
        self.budget.set(left.unwrap_or(0));
        left.map(|_| ()).ok_or_else(|| {
            PolicyError::new(
                "a file that says it holds more than can be packed into it",
                format!("{}, {place}: shape {shape:?}", self.file),
                "record it again; a file cut short, or made to exhaust memory, looks like this",
            )
        })
    }

    fn env_args(&self, data: &H5Group) -> Result<serde_json::Value, PolicyError> {
        let place = "data, attribute env_args";
        let names = data.attr_names().map_err(|e| self.damaged(place, e))?;
        if !names.iter().any(|n| n == "env_args") {
            return Err(self.missing(place));
        }
        let text = data.attr_string("env_args").map_err(|e| self.damaged(place, e))?;
        serde_json::from_str(text.trim_end_matches('\0')).map_err(|e| {
            PolicyError::new(
                format!("not JSON: {e}"),
                format!("{}, {place}", self.file),
                "robomimic writes {\"env_name\": ..., \"type\": ..., \"env_kwargs\": {...}}",
            )
        })
    }

    fn episode(&self, group: &H5Group, place: &str) -> Result<Episode, PolicyError> {
        let attributes = group.attr_names().map_err(|e| self.damaged(place, e))?;
        let optional = |name: &str| -> Result<Option<Table>, PolicyError> {
            let place = format!("{place}/{name}");
            match self.find(group, name, &place)? {
                Found::Dataset(dataset) => self.table(&dataset, &place),
                _ => Ok(None),
            }
        };
        let model_file = match attributes.iter().any(|a| a == "model_file") {
            true => group.attr_string("model_file").map_err(|e| self.damaged(&format!("{place}, model_file"), e))?,
            false => String::new(),
        };
        self.spend(Some(model_file.len() as u64), &format!("{place}, model_file"), &[model_file.len()])?;

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
        let observations = |name: &str| -> Result<Option<Observations>, PolicyError> {
            let place = format!("{place}/{name}");
            let mut out = BTreeMap::new();
            let Found::Group(group) = self.find(group, name, &place)? else {
                return Ok(None);
            };
            for key in group.link_names().map_err(|e| self.damaged(&place, e))? {
                let place = format!("{place}/{key}");
                if let Found::Dataset(dataset) = self.find(&group, &key, &place)?
                    && let Some(table) = self.table(&dataset, &place)?
                {
                    out.insert(key, table.into_rows());
                }
            }
            Ok(Some(out))
        };
        Ok(Episode {
            model_file,
            actions: actions.values.chunks_exact(ACTION_SIZE).map(|a| a.try_into().expect("seven")).collect(),
            states: optional("states")?.map_or(Vec::new(), Table::into_rows),
            rewards: column("rewards")?,
            dones: column("dones")?.iter().map(|d| *d != 0.0).collect(),
            obs: observations("obs")?.ok_or_else(|| self.missing(&format!("{place}/obs")))?,
            next_obs: observations("next_obs")?.unwrap_or_default(),
        })
    }

    /// A dataset of one or two axes as f64; `None` for pictures. Everything is widened to f64.
    fn table(&self, dataset: &H5Dataset, place: &str) -> Result<Option<Table>, PolicyError> {
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
        let refuse = |what: &str| {
            let hint = "write it again with one row of numbers per step";
            PolicyError::new(what, format!("{}, {place}: shape {shape:?}", self.file), hint)
        };
        if rows > 0 && width == 0 {
            return Err(refuse("rows without numbers"));
        }
        let count = rows.checked_mul(width);
        let size = dataset.element_size().max(size_of::<f64>()) as u64;
        self.spend(count.and_then(|n| size.checked_mul(n as u64)), place, &shape)?;
        let values = self.numbers(dataset).map_err(|e| self.damaged(place, e))?;
        if Some(values.len()) != count {
            return Err(refuse(&format!("{} numbers, which do not fill the shape", values.len())));
        }
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

    /// Masks with the names of the file.
    fn masks(&self, root: &H5Group) -> Result<BTreeMap<String, Vec<String>>, PolicyError> {
        let mut out = BTreeMap::new();
        let Found::Group(group) = self.find(root, "mask", "mask")? else {
            return Ok(out);
        };
        for mask in group.link_names().map_err(|e| self.damaged("mask", e))? {
            let place = format!("mask/{mask}");
            if let Found::Dataset(dataset) = self.find(&group, &mask, &place)? {
                let count = dataset.shape().iter().try_fold(1u64, |n, axis| n.checked_mul(*axis as u64));
                let bytes = count.and_then(|n| n.checked_mul(dataset.element_size() as u64));
                self.spend(bytes, &place, &dataset.shape())?;
                let names = dataset.read_strings().map_err(|e| self.damaged(&place, e))?;
                // C programs count a string's last zero in.
                out.insert(mask, names.into_iter().map(|n| n.trim_end_matches('\0').to_string()).collect());
            }
        }
        Ok(out)
    }
}

/// Per key T rows.
type Observations = BTreeMap<String, Vec<Vec<f64>>>;

/// Row-major.
struct Table {
    rows: usize,
    width: usize,
    values: Vec<f64>,
}

impl Table {
    fn into_rows(self) -> Vec<Vec<f64>> {
        // Nothing is repeated by the file's count: without numbers there are no rows.
        self.values.chunks_exact(self.width.max(1)).map(<[f64]>::to_vec).collect()
    }
}
