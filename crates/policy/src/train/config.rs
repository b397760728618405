//! The settings of a training and their presets.

use crate::PolicyError;
use crate::net::{Head, NetConfig};
use serde::{Deserialize, Serialize};

/// A named set of settings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Preset {
    /// robomimic's behaviour cloning: an MLP that sees one step.
    Bc,
    /// robomimic's BC-RNN-GMM with its settings for Lift, low-dimensional observations.
    BcRnn,
    /// A smaller BC-RNN-GMM that learns in minutes on two cores.
    BcRnnFast,
}

/// Everything that decides the bytes of a policy but the demonstrations.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TrainConfig {
    /// What the settings began as.
    pub preset: Preset,
    /// Seed of initial weights, order of windows, and the split where the file has no masks.
    pub seed: u64,
    /// Training steps, one batch each.
    pub steps: usize,
    /// Windows in a batch.
    pub batch: usize,
    /// Adam's rate at the start.
    pub learning_rate: f64,
    /// Adam's rate at the end; between the two half a cosine. Equal to learning_rate: constant.
    pub final_learning_rate: f64,
    /// Steps of a window, and of a rollout before the hidden state is forgotten.
    pub seq_length: usize,
    /// Shift and scale every observed number to mean 0 and deviation 1 over the training
    /// demonstrations.
    pub normalize_obs: bool,
    /// Observations that the policy sees.
    pub obs: Vec<String>,
    /// Mask of the demonstrations to learn from.
    pub train_mask: String,
    /// Mask of the demonstrations to validate with.
    pub valid_mask: String,
    /// Share of the demonstrations kept for validation where the file lacks these masks.
    pub valid_share: f64,
    /// Steps between two validations; 0 = only at the end.
    pub validate_every: usize,
    /// Steps between two checkpoints.
    pub checkpoint_every: usize,
    /// Steps between two policies kept in snapshots/; 0 = none. Likelihood is no guide to success:
    /// roll them out.
    pub snapshot_every: usize,
    /// Shape of the network.
    pub net: NetConfig,
}

impl Default for TrainConfig {
    fn default() -> Self {
        Self::preset(Preset::BcRnnFast)
    }
}

impl TrainConfig {
    /// All settings of a preset, seed 0.
    pub fn preset(preset: Preset) -> Self {
        // robomimic: 2000 epochs of 100 steps, checks and checkpoints every 50 epochs.
        let bc_rnn = Self {
            preset,
            seed: 0,
            steps: 200_000,
            batch: 100,
            learning_rate: 1e-4,
            final_learning_rate: 1e-4,
            seq_length: 10,
            normalize_obs: false,
            obs: ["object", "robot0_eef_pos", "robot0_eef_quat", "robot0_gripper_qpos"].map(String::from).to_vec(),
            train_mask: "train".into(),
            valid_mask: "valid".into(),
            valid_share: 0.1,
            validate_every: 1000,
            checkpoint_every: 500,
            snapshot_every: 5000,
            net: NetConfig::default(),
        };
        match preset {
            Preset::BcRnn => bc_rnn,
            Preset::Bc => Self {
                seq_length: 1,
                net: NetConfig {
                    rnn_layers: 0,
                    actor_layer_dims: vec![1024, 1024],
                    head: Head::Action,
                    ..NetConfig::default()
                },
                ..bc_rnn
            },
            Preset::BcRnnFast => Self {
                steps: 6000,
                learning_rate: 1e-3,
                // A rate that falls lets the last iterate be as good as any before: no choosing by
                // success.
                final_learning_rate: 2e-5,
                normalize_obs: true,
                validate_every: 500,
                snapshot_every: 0,
                net: NetConfig { rnn_hidden: 100, min_std: 1e-2, ..NetConfig::default() },
                ..bc_rnn
            },
        }
    }

    /// Adam's rate for step `step` (from 0).
    pub fn rate(&self, step: usize) -> f64 {
        let turn = std::f64::consts::PI * step as f64 / self.steps as f64;
        self.final_learning_rate + (self.learning_rate - self.final_learning_rate) * 0.5 * (1.0 + turn.cos())
    }

    /// Refuses values that no training can work with.
    ///
    /// # Errors
    /// The first of them, by name.
    pub fn check(&self) -> Result<(), PolicyError> {
        let refuse = |what: String, hint: &str| Err(PolicyError::new("a setting is out of range", what, hint));
        let whole = [
            ("steps", self.steps),
            ("batch", self.batch),
            ("seq_length", self.seq_length),
            ("checkpoint_every", self.checkpoint_every),
        ];
        if let Some((name, _)) = whole.into_iter().find(|(_, value)| *value == 0) {
            return refuse(format!("{name} = 0"), &format!("{name} = 1 or more"));
        }
        let rates = [("learning_rate", self.learning_rate), ("final_learning_rate", self.final_learning_rate)];
        if let Some((name, value)) = rates.into_iter().find(|(_, value)| !(*value > 0.0 && *value <= 1.0)) {
            return refuse(format!("{name} = {value}"), &format!("{name} = above 0, at most 1; 1e-3 is usual"));
        }
        if !(self.valid_share >= 0.0 && self.valid_share <= 0.9) {
            return refuse(format!("valid_share = {}", self.valid_share), "valid_share = 0 to 0.9");
        }
        if self.obs.is_empty() {
            return refuse("obs = []".into(), "name at least one observation, for instance obs = [\"object\"]");
        }
        if self.net.rnn_layers == 0 && self.seq_length != 1 {
            let what = format!("seq_length = {} with net.rnn_layers = 0", self.seq_length);
            return refuse(what, "a network without memory sees one step: seq_length = 1");
        }
        self.net.check().or_else(|what| refuse(format!("net.{what}"), "see train.toml of any policy for all settings"))
    }
}
