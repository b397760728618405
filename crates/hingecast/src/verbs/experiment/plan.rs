//! What an experiment will do, resolved before its first step.

use crate::cli;
use crate::verbs::{build, synth};
use hingecast::config::{Config, Method};
use hingecast::experiment::World;
use hingecast::failure::Result;
use hingecast::training;
use hingecast_capture::synth::SynthConfig;
use hingecast_policy::train::TrainConfig;
use std::collections::BTreeMap;

/// The worlds besides the true object.
const WORLDS: [&str; 11] =
    ["twin", "track", "axis=3", "axis=10", "axis=30", "pivot=3", "pivot=10", "pivot=30", "limits=0.5", "edge", "back"];

/// Everything resolved before the first step: a typing error must not wait an hour.
pub struct Plan<'a> {
    pub args: &'a cli::Experiment,
    pub worlds: Vec<(String, World)>,
    pub synth: SynthConfig,
    pub twin: Config,
    pub track: Config,
    pub training: Vec<TrainConfig>,
}

impl<'a> Plan<'a> {
    pub fn new(args: &'a cli::Experiment) -> Result<Self> {
        let names: Vec<String> =
            if args.worlds.is_empty() { WORLDS.map(String::from).to_vec() } else { args.worlds.clone() };
        let worlds = names.into_iter().map(|n| Ok((n.clone(), World::read(&n)?))).collect::<Result<_>>()?;
        let twin = build::config(&args.build)?;
        let preset =
            serde_json::from_value(args.policy.clone().into()).expect("the flag takes the presets' names only");
        let training = (0..args.train_seeds).map(|k| {
            let set: Vec<String> = args.policy_set.iter().cloned().chain([format!("seed={k}")]).collect();
            training::resolve(preset, None, &set)
        });
        Ok(Self {
            args,
            worlds,
            synth: synth::config(&args.synth, args.recording_seed, true)?,
            track: Config { method: Method::Track, ..twin.clone() },
            twin,
            training: training.collect::<Result<_>>()?,
        })
    }

    pub fn has(&self, world: &World) -> bool {
        self.worlds.iter().any(|(_, w)| w == world)
    }

    pub fn needs_recording(&self) -> bool {
        [World::Twin, World::Track, World::Back].iter().any(|w| self.has(w))
    }

    pub fn needs_twin(&self) -> bool {
        self.has(&World::Twin) || self.has(&World::Back)
    }

    pub fn episodes_in(&self, world: &World) -> usize {
        let n = self.args.episodes;
        if matches!(world, World::Spoiled(_)) { self.args.spoiled_episodes.unwrap_or(n).min(n) } else { n }
    }

    /// Steps of each kind for one object: what the time left is reckoned with.
    pub fn steps(&self) -> BTreeMap<&'static str, usize> {
        let (seeds, back) = (self.args.train_seeds, usize::from(self.has(&World::Back)));
        BTreeMap::from([
            ("record", usize::from(self.needs_recording())),
            ("build", usize::from(self.needs_twin())),
            ("track", usize::from(self.has(&World::Track))),
            ("demos", 1 + back),
            ("train", seeds * (1 + back)),
            ("rollout", seeds * (1 + self.worlds.len())),
        ])
    }

    pub fn settings(&self) -> serde_json::Value {
        let a = self.args;
        let worlds: Vec<&String> = self.worlds.iter().map(|(name, _)| name).collect();
        serde_json::json!({
            "worlds": worlds, "demos": a.demos, "episodes": a.episodes, "spoiled_episodes": a.spoiled_episodes,
            "recording": self.synth, "recordings": a.recordings, "runs": a.runs, "build": self.twin, "training": self.training,
        })
    }
}
