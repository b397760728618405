//! What an experiment will do, resolved before its first step.

use super::World;
use hingecast::config::{Config, Method};
use hingecast::failure::Result;
use hingecast_capture::synth::SynthConfig;
use hingecast_policy::train::TrainConfig;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// The worlds besides the true object.
const WORLDS: [&str; 11] =
    ["twin", "track", "axis=3", "axis=10", "axis=30", "pivot=3", "pivot=10", "pivot=30", "limits=0.5", "edge", "back"];

/// What an experiment is asked for, resolved before the first step: a typing error must not wait an
/// hour.
pub struct Plan {
    /// Name and meaning of every world besides the true object.
    pub worlds: Vec<(String, World)>,
    /// How objects are recorded that have no recording yet.
    pub synth: SynthConfig,
    /// How the twin is built.
    pub twin: Config,
    /// How the twin of the classical method is built: [`Plan::classical`].
    pub track: Config,
    /// One of each training seed.
    pub training: Vec<TrainConfig>,
    /// Demonstrations of each object.
    pub demos: usize,
    /// Episodes of each policy in each world.
    pub episodes: usize,
    /// The same on spoiled objects, at most `episodes`; `None`: as many.
    pub spoiled_episodes: Option<usize>,
    /// Folder of recordings that are there already, one folder an object. An object without one is
    /// recorded; `None`: all are.
    pub recordings: Option<PathBuf>,
    /// Folders of runs that are there already, one folder an object. An object without a finished
    /// run of the method is built.
    pub runs: Vec<PathBuf>,
}

impl Plan {
    /// The worlds by their names, such as `twin`, `axis=30` or `pivot=10,edge`; the usual eleven if
    /// there are none.
    ///
    /// # Errors
    /// A name that means nothing.
    pub fn worlds(names: &[String]) -> Result<Vec<(String, World)>> {
        let usual = WORLDS.map(String::from);
        let names = if names.is_empty() { &usual[..] } else { names };
        names.iter().map(|n| Ok((n.clone(), World::read(n)?))).collect()
    }

    /// The same build by the classical way.
    pub fn classical(twin: &Config) -> Config {
        Config { method: Method::Track, ..twin.clone() }
    }

    pub(crate) fn has(&self, world: &World) -> bool {
        self.worlds.iter().any(|(_, w)| w == world)
    }

    pub(crate) fn needs_recording(&self) -> bool {
        [World::Twin, World::Track, World::Back].iter().any(|w| self.has(w))
    }

    pub(crate) fn needs_twin(&self) -> bool {
        self.has(&World::Twin) || self.has(&World::Back)
    }

    pub(crate) fn episodes_in(&self, world: &World) -> usize {
        let n = self.episodes;
        if matches!(world, World::Spoiled(_)) { self.spoiled_episodes.unwrap_or(n).min(n) } else { n }
    }

    /// Steps of each kind for one object: what the time left is reckoned with.
    pub fn steps(&self) -> BTreeMap<&'static str, usize> {
        let (seeds, back) = (self.training.len(), usize::from(self.has(&World::Back)));
        BTreeMap::from([
            ("record", usize::from(self.needs_recording())),
            ("build", usize::from(self.needs_twin())),
            ("track", usize::from(self.has(&World::Track))),
            ("demos", 1 + back),
            ("train", seeds * (1 + back)),
            ("rollout", seeds * (1 + self.worlds.len())),
        ])
    }

    /// The whole plan as JSON, for `experiment.json`.
    pub fn settings(&self) -> serde_json::Value {
        let worlds: Vec<&String> = self.worlds.iter().map(|(name, _)| name).collect();
        serde_json::json!({
            "worlds": worlds, "demos": self.demos, "episodes": self.episodes, "spoiled_episodes": self.spoiled_episodes,
            "recording": self.synth, "recordings": self.recordings, "runs": self.runs, "build": self.twin, "training": self.training,
        })
    }
}
