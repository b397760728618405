//! Demonstrations in robomimic's HDF5 layout, both ways.
//!
//! ```text
//! data/                 attributes env_args (JSON: env_name, type, env_kwargs), total (steps of all episodes)
//!   demo_<i>/           attributes num_samples, model_file (the simulator's XML)
//!     actions (T,7)  states (T,D)  rewards (T)  dones (T)
//!     obs/<key> (T,K)   next_obs/<key> (T,K)
//! mask/<name>           strings demo_<i>: train, valid, or any other subset
//! ```
//! Source: robomimic 0.3, `robomimic/utils/dataset.py` (what it reads) and
//! `scripts/dataset_states_to_obs.py` (what it writes). All numbers are f64 here and in the files
//! that we write; f32 and integers are read as well.

mod links;
mod masks;
mod read;
mod strings;
mod write;

pub use read::read;
pub use write::write;

use crate::{ACTION_SIZE, PolicyError};
use std::collections::BTreeMap;

/// One demonstration of T steps. `rewards`, `dones`, `states` and `next_obs` may be empty where a
/// file lacks them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Episode {
    /// The simulator's model, MJCF text; empty where the file has none.
    pub model_file: String,
    /// T actions, each number in [-1, 1].
    pub actions: Vec<[f64; ACTION_SIZE]>,
    /// T states of the simulator, before each action.
    pub states: Vec<Vec<f64>>,
    /// T rewards, each earned by the action of the same index.
    pub rewards: Vec<f64>,
    /// T flags: whether the episode was over after the action.
    pub dones: Vec<bool>,
    /// Per key T rows: what was seen before each action.
    pub obs: BTreeMap<String, Vec<Vec<f64>>>,
    /// Per key T rows: what was seen after each action.
    pub next_obs: BTreeMap<String, Vec<Vec<f64>>>,
}

/// A file of demonstrations. Episode i is called `demo_<i>` in it and in the masks.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Demos {
    /// env_name, type, env_kwargs: what robomimic needs to make the environment again.
    pub env_args: serde_json::Value,
    /// The demonstrations; index = the number in the name.
    pub episodes: Vec<Episode>,
    /// Named subsets: `train`, `valid`, ... -> episode names.
    pub masks: BTreeMap<String, Vec<String>>,
}

impl Demos {
    /// Indices of a mask's episodes, in the mask's order; `None` when there is no such mask.
    pub fn subset(&self, mask: &str) -> Option<Vec<usize>> {
        Some(self.masks.get(mask)?.iter().filter_map(|name| index_of(name)).collect())
    }

    /// Steps of all episodes.
    pub fn steps(&self) -> usize {
        self.episodes.iter().map(|e| e.actions.len()).sum()
    }
}

/// `demo_12` -> 12.
fn index_of(name: &str) -> Option<usize> {
    name.strip_prefix("demo_")?.parse().ok()
}

/// Lengths that agree, finite numbers, masks that name what is there: asked of what is read and of
/// what is written. `file` goes into the error.
fn check(demos: &Demos, file: &str) -> Result<(), PolicyError> {
    if demos.episodes.is_empty() {
        let hint = "record some: hingecast demos; robomimic's files have groups data/demo_0, data/demo_1, ...";
        return Err(PolicyError::new("no demonstrations", format!("{file}, data: 0 groups demo_<i>"), hint));
    }
    for (i, episode) in demos.episodes.iter().enumerate() {
        check_episode(episode, &format!("{file}, data/demo_{i}"))?;
    }
    check_keys(&demos.episodes, file)?;
    let is_there = |name: &str| index_of(name).is_some_and(|i| i < demos.episodes.len());
    masks::check(&demos.masks, is_there, file)
}

fn check_episode(e: &Episode, place: &str) -> Result<(), PolicyError> {
    let steps = e.actions.len();
    if steps == 0 {
        let hint = "remove this demonstration from the file";
        return Err(PolicyError::new("a demonstration without steps", format!("{place}/actions: 0 rows"), hint));
    }
    finite(e.actions.iter().map(|a| &a[..]), &format!("{place}/actions"))?;
    if e.obs.is_empty() {
        let hint = "extract observations first: robomimic's dataset_states_to_obs.py writes obs/<key>";
        return Err(PolicyError::new("a demonstration without observations", format!("{place}/obs: no keys"), hint));
    }
    let rows = [("states", e.states.len()), ("rewards", e.rewards.len()), ("dones", e.dones.len())];
    for (field, got) in rows {
        if got != 0 {
            same_length(got, steps, &format!("{place}/{field}"))?;
        }
    }
    table(&e.states, &format!("{place}/states"))?;
    finite([&e.rewards[..]].into_iter(), &format!("{place}/rewards"))?;
    for (group, values) in [("obs", &e.obs), ("next_obs", &e.next_obs)] {
        for (key, rows) in values {
            let place = format!("{place}/{group}/{key}");
            same_length(rows.len(), steps, &place)?;
            table(rows, &place)?;
        }
    }
    Ok(())
}

/// Every demonstration has the same observation keys of the same widths as the first.
fn check_keys(episodes: &[Episode], file: &str) -> Result<(), PolicyError> {
    let widths = |e: &Episode| -> BTreeMap<String, usize> {
        e.obs.iter().map(|(key, rows)| (key.clone(), rows[0].len())).collect()
    };
    let first = widths(&episodes[0]);
    for (i, episode) in episodes.iter().enumerate().skip(1) {
        let here = widths(episode);
        let keys = first.keys().chain(here.keys());
        if let Some(key) = keys.into_iter().find(|key| first.get(*key) != here.get(*key)) {
            let say = |w: Option<&usize>| w.map_or("missing".to_string(), |w| format!("{w} numbers"));
            return Err(PolicyError::new(
                "demonstrations with different observations",
                format!("{file}, data/demo_{i}/obs/{key}: {}, demo_0: {}", say(here.get(key)), say(first.get(key))),
                "record or extract all demonstrations with the same observation keys",
            ));
        }
    }
    Ok(())
}

fn same_length(got: usize, steps: usize, place: &str) -> Result<(), PolicyError> {
    if got == steps {
        return Ok(());
    }
    let hint = "one row per action is expected; record the demonstration again or remove it";
    Err(PolicyError::new("rows that do not fit the actions", format!("{place}: {got} rows, {steps} actions"), hint))
}

/// All rows of one width, all numbers finite.
fn table(rows: &[Vec<f64>], place: &str) -> Result<(), PolicyError> {
    if let Some(step) = rows.iter().position(|row| row.len() != rows[0].len() || row.is_empty()) {
        return Err(PolicyError::new(
            "rows of different widths",
            format!("{place}[{step}]: {} numbers, {} in the first row", rows[step].len(), rows[0].len()),
            "every step needs the same numbers",
        ));
    }
    finite(rows.iter().map(|row| &row[..]), place)
}

fn finite<'a>(rows: impl Iterator<Item = &'a [f64]>, place: &str) -> Result<(), PolicyError> {
    for (step, row) in rows.enumerate() {
        if let Some(k) = row.iter().position(|v| !v.is_finite()) {
            return Err(PolicyError::new(
                "a number that is not finite",
                format!("{place}[{step}][{k}] = {}", row[k]),
                "remove this demonstration, or record it again",
            ));
        }
    }
    Ok(())
}
