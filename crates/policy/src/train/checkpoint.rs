//! Where a training stands, in one safetensors file: weights, Adam's two means, the losses so far.
//!
//! Written to a temporary name and renamed. Sums are kept as bits, so that a resumed training is
//! the same training.

use crate::PolicyError;
use crate::net::{Adam, Network};
use crate::policy::{not_safetensors, parameters_from, tensors_to_bytes};
use hingecast_geom::staging::write_whole;
use safetensors::tensor::SafeTensors;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Grows when the meaning of the file changes.
const FORMAT: &str = "hingecast-training-1";

/// Losses at one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LossRecord {
    /// Steps taken until then.
    pub step: usize,
    /// Mean over the batches since the record before.
    pub train: f64,
    /// Over all windows of the validation demonstrations; `None` where it was not asked.
    pub valid: Option<f64>,
}

/// The numbers beside the tensors, as JSON.
#[derive(Serialize, Deserialize)]
struct Note {
    format: String,
    stamp: String,
    step: u64,
    loss_sum_bits: u64,
    loss_count: usize,
}

/// A training between two steps.
pub struct State {
    /// The weights, in the network's order.
    pub parameters: Vec<f32>,
    /// The state of the optimiser.
    pub adam: Adam,
    /// Sum of the losses of the batches since the last record, and how many they are.
    pub loss_sum: f64,
    /// How many losses are in `loss_sum`.
    pub loss_count: usize,
    /// The records so far, in the order of the steps.
    pub history: Vec<LossRecord>,
}

impl State {
    /// Before the first step.
    pub fn new(net: &Network, seed: u64) -> Self {
        let parameters = net.initial_parameters(seed);
        Self { adam: Adam::new(parameters.len()), parameters, loss_sum: 0.0, loss_count: 0, history: Vec::new() }
    }

    /// Steps taken.
    pub fn step(&self) -> usize {
        self.adam.steps as usize
    }

    /// Writes the checkpoint; `stamp` says what it belongs to.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn save(&self, net: &Network, stamp: &str, path: &Path) -> Result<(), PolicyError> {
        let history: Vec<f64> =
            self.history.iter().flat_map(|r| [r.step as f64, r.train, r.valid.unwrap_or(f64::NAN)]).collect();
        let note = Note {
            format: FORMAT.to_string(),
            stamp: stamp.to_string(),
            step: self.adam.steps,
            loss_sum_bits: self.loss_sum.to_bits(),
            loss_count: self.loss_count,
        };
        let note = serde_json::to_string(&note).expect("plain data");
        let groups = [("", &self.parameters[..]), ("first.", &self.adam.first), ("second.", &self.adam.second)];
        let bytes = tensors_to_bytes(net, &groups, Some(("history", &history, note)));
        write_whole(path, &bytes).map_err(|e| PolicyError::write(path, e))
    }

    /// `None`: there is no checkpoint, or it is one of other settings or demonstrations.
    ///
    /// # Errors
    /// A file that cannot be read or is damaged.
    pub fn load(net: &Network, stamp: &str, path: &Path) -> Result<Option<Self>, PolicyError> {
        let bytes = match std::fs::read(path) {
            Ok(bytes) => bytes,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(e) => return Err(PolicyError::read(path, e)),
        };
        let damaged = |what: String| {
            let hint = "delete the file to begin this training anew";
            PolicyError::new(what, path.display().to_string(), hint)
        };
        let (_, metadata) = SafeTensors::read_metadata(&bytes).map_err(|e| not_safetensors(path, e))?;
        let note = metadata.metadata().as_ref().and_then(|notes| notes.get("note")).map_or("", String::as_str);
        let note: Note = serde_json::from_str(note).map_err(|e| damaged(format!("a damaged checkpoint: {e}")))?;
        if note.stamp != stamp || note.format != FORMAT {
            return Ok(None);
        }
        let file = SafeTensors::deserialize(&bytes).map_err(|e| not_safetensors(path, e))?;
        let history = file.tensor("history").map_err(|e| damaged(format!("a damaged checkpoint: {e}")))?;
        let numbers: Vec<f64> =
            history.data().chunks_exact(8).map(|b| f64::from_le_bytes(b.try_into().expect("eight bytes"))).collect();
        let record =
            |r: &[f64]| LossRecord { step: r[0] as usize, train: r[1], valid: Some(r[2]).filter(|v| !v.is_nan()) };
        Ok(Some(Self {
            parameters: parameters_from(net, &file, "", path)?,
            adam: Adam {
                first: parameters_from(net, &file, "first.", path)?,
                second: parameters_from(net, &file, "second.", path)?,
                steps: note.step,
            },
            loss_sum: f64::from_bits(note.loss_sum_bits),
            loss_count: note.loss_count,
            history: numbers.chunks_exact(3).map(record).collect(),
        }))
    }
}
