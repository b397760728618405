//! Demonstrations -> policy: behaviour cloning by Adam on random windows.
//!
//! ```text
//! folder/checkpoint.safetensors   where the training stands; the same call goes on from it
//! folder/losses.csv               step, train_loss, valid_loss
//! folder/snapshots/step_<n>/      policies on the way, if asked for
//! folder/policy.{safetensors,json}   the last iterate, when all steps are done
//! ```
//! Every pass through the windows has an order of its own, drawn from the seed and the pass; what
//! is left of a pass when no whole batch fits is dropped, as PyTorch's DataLoader does with
//! drop_last. So the k-th batch follows from seed and k alone, and a resumed training takes the
//! same steps as one that was never stopped: same bytes.

mod checkpoint;
mod config;
mod data;

pub use checkpoint::LossRecord;
pub use config::{Preset, TrainConfig};
pub use data::{Dataset, Window};

use crate::net::{Batch, Network, Workspace};
use crate::policy::{Policy, PolicyConfig};
use crate::{Demos, PolicyError};
use checkpoint::State;
use hingecast_geom::Progress;
use hingecast_geom::folder::may_be_emptied;
use hingecast_geom::staging::write_whole;
use std::path::Path;

/// Steps whose losses make one record.
const RECORD_EVERY: usize = 50;

/// What came of a training.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainReport {
    /// Step from which the training went on; 0 = from the beginning.
    pub resumed_from: usize,
    /// Steps taken, those before a resumption included.
    pub steps: usize,
    /// How many numbers were learnt.
    pub parameters: usize,
    /// Demonstrations to learn from.
    pub train_demos: usize,
    /// Demonstrations to validate with.
    pub valid_demos: usize,
    /// Windows to learn from.
    pub train_windows: usize,
    /// In the order of the steps; the last one is of the last iterate.
    pub history: Vec<LossRecord>,
}

impl TrainReport {
    /// Of the last iterate.
    pub fn last(&self) -> LossRecord {
        *self.history.last().expect("a record is made at the last step")
    }
}

/// Trains into `folder`, or goes on there. Runs on the calling thread's rayon pool; its size does
/// not change a bit.
///
/// # Errors
/// Settings or demonstrations that cannot be learnt from, a loss that is no longer finite, a folder
/// that cannot be written, or the wish to stop: then the work so far is in the checkpoint.
pub fn train(
    demos: &Demos,
    config: &TrainConfig,
    folder: &Path,
    progress: &Progress,
) -> Result<TrainReport, PolicyError> {
    config.check()?;
    let data = Dataset::new(demos, config)?;
    let net = Network::new(&config.net, data.obs.iter().map(|k| k.width).sum());
    let stamp = stamp(config, &data);
    let path = folder.join("checkpoint.safetensors");
    std::fs::create_dir_all(folder).map_err(|e| PolicyError::write(folder, e))?;
    let mut state = match State::load(&net, &stamp, &path)?.filter(|s| s.step() <= config.steps) {
        Some(state) => state,
        None => {
            forget(folder)?;
            State::new(&net, config.seed)
        }
    };
    let resumed_from = state.step();
    let policy = |state: &State| {
        let (obs, normalization) = (data.obs.clone(), data.normalization.clone());
        let steps = state.adam.steps;
        let config = PolicyConfig::new(obs, config.seq_length, config.net.clone(), normalization, steps);
        Policy::new(config, state.parameters.clone())
    };

    let mut workspace = Workspace::default();
    let mut order = Order::new(config.seed, data.train.len(), config.batch);
    let (mut observations, mut actions) = (Vec::new(), Vec::new());
    let mut note = String::new();
    while state.step() < config.steps {
        let step = state.step();
        let windows = order.batch(step).iter().map(|i| data.train[*i]);
        data.gather(windows, config.seq_length, &mut observations, &mut actions);
        let sequences = actions.len() / (config.seq_length * crate::ACTION_SIZE);
        let batch = Batch { sequences, steps: config.seq_length, observations: &observations, actions: &actions };
        let loss = net.loss_and_gradient(&state.parameters, &batch, &mut workspace);
        if !loss.is_finite() {
            return Err(diverged(step, config));
        }
        state.adam.step(&mut state.parameters, &workspace.gradients(), config.rate(step));
        state.loss_sum += loss;
        state.loss_count += 1;

        let (step, last) = (step + 1, step + 1 == config.steps);
        let validated = last || (config.validate_every > 0 && step.is_multiple_of(config.validate_every));
        if validated || step.is_multiple_of(RECORD_EVERY) {
            let train = state.loss_sum / state.loss_count as f64;
            let valid = validated.then(|| validation(&net, &state.parameters, &data, config, &mut workspace)).flatten();
            state.history.push(LossRecord { step, train, valid });
            (state.loss_sum, state.loss_count) = (0.0, 0);
            let valid = state.history.iter().rev().find_map(|r| r.valid);
            note = format!("loss {train:.3}") + &valid.map_or(String::new(), |v| format!(", validation {v:.3}"));
        }
        if config.snapshot_every > 0 && step.is_multiple_of(config.snapshot_every) {
            policy(&state)?.save(&folder.join(format!("snapshots/step_{step:07}")))?;
        }
        let stopped = progress.report(step, config.steps, &note);
        if stopped.is_err() || last || step.is_multiple_of(config.checkpoint_every) {
            state.save(&net, &stamp, &path)?;
        }
        stopped.map_err(|c| PolicyError {
            hint: "run the same command again: it goes on from the last checkpoint".into(),
            ..c.into()
        })?;
    }
    if state.parameters.iter().any(|p| !p.is_finite()) {
        return Err(diverged(config.steps, config));
    }
    write_losses(&folder.join("losses.csv"), &state.history)?;
    policy(&state)?.save(folder)?;
    Ok(TrainReport {
        resumed_from,
        steps: config.steps,
        parameters: net.parameters(),
        train_demos: data.train_demos,
        valid_demos: data.valid_demos,
        train_windows: data.train.len(),
        history: state.history,
    })
}

/// What a checkpoint belongs to. With a constant rate more steps are the same training gone
/// further.
fn stamp(config: &TrainConfig, data: &Dataset) -> String {
    let mut config = config.clone();
    if config.final_learning_rate == config.learning_rate {
        config.steps = 0;
    }
    let text = serde_json::to_string(&config).expect("plain data") + &data.fingerprint();
    format!("{:032x}", xxhash_rust::xxh3::xxh3_128(text.as_bytes()))
}

/// Removes what an earlier training of other settings left, so that nothing old passes for new.
fn forget(folder: &Path) -> Result<(), PolicyError> {
    let snapshot = |path: &Path| {
        let names: Vec<&str> = path.iter().filter_map(|name| name.to_str()).collect();
        matches!(names[..], [step, "policy.json" | "policy.safetensors"] if step.starts_with("step_"))
    };
    may_be_emptied("policy's folder", &folder.join("snapshots"), &snapshot, "move it elsewhere, or give a new folder")?;
    let files = ["checkpoint.safetensors", "losses.csv", "policy.json", "policy.safetensors"];
    let files = files.map(|name| (folder.join(name), false));
    for (path, is_folder) in files.into_iter().chain([(folder.join("snapshots"), true)]) {
        let removed = if is_folder { std::fs::remove_dir_all(&path) } else { std::fs::remove_file(&path) };
        match removed {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => return Err(PolicyError::write(&path, e)),
            _ => {}
        }
    }
    Ok(())
}

fn diverged(step: usize, config: &TrainConfig) -> PolicyError {
    PolicyError::new(
        "the loss is no longer finite",
        format!("step {step}, learning_rate = {}", config.learning_rate),
        "a smaller learning_rate, a larger net.min_std, or normalize_obs = true",
    )
}

/// Mean loss over all validation windows; `None` where there are none.
fn validation(
    net: &Network,
    parameters: &[f32],
    data: &Dataset,
    config: &TrainConfig,
    workspace: &mut Workspace,
) -> Option<f64> {
    let (mut observations, mut actions, mut sum) = (Vec::new(), Vec::new(), 0.0);
    for windows in data.valid.chunks(config.batch) {
        data.gather(windows.iter().copied(), config.seq_length, &mut observations, &mut actions);
        let (sequences, steps) = (windows.len(), config.seq_length);
        let batch = Batch { sequences, steps, observations: &observations, actions: &actions };
        sum += net.loss(parameters, &batch, workspace) * sequences as f64;
    }
    (!data.valid.is_empty()).then(|| sum / data.valid.len() as f64)
}

/// Which windows the k-th batch holds.
struct Order {
    seed: u64,
    batch: usize,
    pass: Option<usize>,
    windows: Vec<usize>,
}

impl Order {
    fn new(seed: u64, windows: usize, batch: usize) -> Self {
        Self { seed, batch: batch.min(windows), pass: None, windows: (0..windows).collect() }
    }

    fn batch(&mut self, step: usize) -> &[usize] {
        let batches = self.windows.len() / self.batch;
        let (pass, place) = (step / batches, step % batches);
        if self.pass != Some(pass) {
            self.windows.sort_unstable();
            let seed = self.seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(pass as u64);
            fastrand::Rng::with_seed(seed).shuffle(&mut self.windows);
            self.pass = Some(pass);
        }
        &self.windows[place * self.batch..(place + 1) * self.batch]
    }
}

fn write_losses(path: &Path, history: &[LossRecord]) -> Result<(), PolicyError> {
    let mut text = "step,train_loss,valid_loss\n".to_string();
    for LossRecord { step, train, valid } in history {
        text += &format!("{step},{train},{}\n", valid.map_or(String::new(), |v| v.to_string()));
    }
    write_whole(path, text.as_bytes()).map_err(|e| PolicyError::write(path, e))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pass_has_every_window_once_in_an_order_of_its_own() {
        let mut order = Order::new(3, 10, 3);
        let mut pass =
            |first: usize| -> Vec<usize> { (first..first + 3).flat_map(|step| order.batch(step).to_vec()).collect() };
        let (one, two) = (pass(0), pass(3));
        assert_ne!(one, two);
        for mut seen in [one.clone(), two] {
            seen.sort_unstable();
            seen.dedup();
            assert_eq!(seen.len(), 9);
        }
        // A resumed training asks for a late batch first.
        assert_eq!(Order::new(3, 10, 3).batch(2), &one[6..]);
    }
}
