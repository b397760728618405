//! Demonstrations by the scripted expert: episodes in parallel, successes kept, the same file for
//! any number of threads.
//!
//! Attempt k has the seed `seed * 2^20 + k`. Attempts are made in blocks of a fixed size and looked
//! at in order; the first `n` successes are kept. So which thread made an attempt cannot matter.

use hingecast::failure::{Failure, Result};
use hingecast_geom::Progress;
use hingecast_policy::{Demos, Episode};
use hingecast_sim::env::ACTION;
use hingecast_sim::trial::demonstrate;
use hingecast_sim::{Env, Outcome, Scene, SceneConfig, TaskSpec};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Attempts between two looks at how many succeeded.
const BLOCK: usize = 32;
/// One demonstration of ten is for validation.
const VALID_EVERY: usize = 10;

/// What the names of our worlds begin with in `env_args`.
pub(crate) const ENV_NAME: &str = "hingecast-";

/// `env_kwargs` of the file: what replays and rollouts need to make the world again.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct WorldArgs {
    /// Model file of the object or twin that was opened.
    pub object: PathBuf,
    /// What was done with which of its joints.
    pub task: TaskSpec,
    /// Control steps a second: 20.
    pub control_freq: usize,
    /// Of the recording: attempt k has the seed `seed * 2^20 + k`.
    pub seed: u64,
}

/// How a recording by the scripted expert went.
#[derive(Clone, Debug, Serialize)]
pub struct Recorded {
    /// Successful episodes: as many as were asked for.
    pub kept: usize,
    /// How the attempts that were thrown away ended, and how many did so.
    pub thrown_away: BTreeMap<Outcome, usize>,
    /// Control steps of 50 ms in the kept episodes together.
    pub steps: usize,
}

/// Records `n` successful episodes of `task` on this object or twin (its model file), in parallel
/// on the calling thread's rayon pool. Every tenth is in the mask `valid`, the rest in `train`.
///
/// # Errors
/// When the object cannot be loaded or lacks the task's joint, the demonstrator succeeds in less
/// than one of four attempts, or the person stops it.
pub fn record_on(
    object: &Path,
    task: &TaskSpec,
    n: usize,
    seed: u64,
    progress: &Progress,
) -> Result<(Demos, Recorded)> {
    let scene = Scene::new(&SceneConfig { object: object.to_path_buf(), spoil: Vec::new(), visuals: false }, task)?;
    let world = WorldArgs { object: object.to_path_buf(), task: task.clone(), control_freq: 20, seed };
    record(&scene, &world, n, progress)
}

/// Records `n` successful episodes of `scene`.
///
/// # Errors
/// When the demonstrator succeeds in less than one of four attempts, or the person stops it.
fn record(scene: &Scene, args: &WorldArgs, n: usize, progress: &Progress) -> Result<(Demos, Recorded)> {
    let mut episodes: Vec<Episode> = Vec::new();
    let mut thrown_away: BTreeMap<Outcome, usize> = BTreeMap::new();
    let mut attempts = 0;
    while episodes.len() < n {
        // Enough attempts to know; waiting for the last of `n` would take as long again.
        if attempts >= 4 * BLOCK && 4 * episodes.len() < attempts {
            let ends: Vec<String> = thrown_away.iter().map(|(o, k)| format!("{k} {}", outcome_name(*o))).collect();
            return Err(Failure::new(
                format!("the demonstrator succeeded in only {} of {attempts} attempts", episodes.len()),
                format!("{}: {}", args.object.display(), ends.join(", ")),
                "--joint for another joint, or --scale for another size",
            ));
        }
        let block: Vec<Result<(Outcome, Episode)>> = (attempts..attempts + BLOCK)
            .into_par_iter()
            .map_init(|| Env::new(scene), |env, k| attempt(env, episode_seed(args.seed, k), progress))
            .collect();
        for made in block {
            let (outcome, episode) = made?;
            attempts += 1;
            if outcome != Outcome::Success {
                *thrown_away.entry(outcome).or_default() += 1;
            } else {
                episodes.push(episode);
            }
            if episodes.len() == n {
                break;
            }
        }
        let note = format!("{} thrown away", thrown_away.values().sum::<usize>());
        progress.report(episodes.len(), n, &note)?;
    }
    let steps = episodes.iter().map(|e| e.actions.len()).sum();
    let demos = Demos { env_args: env_args(args), masks: masks(episodes.len()), episodes };
    Ok((demos, Recorded { kept: n, thrown_away, steps }))
}

/// The file's `env_args`: robomimic's keys with our world in them.
pub(crate) fn env_args(world: &WorldArgs) -> serde_json::Value {
    serde_json::json!({
        "env_name": format!("{ENV_NAME}{}", world.task.kind.name()),
        // robomimic's number for environments of the gym kind.
        "type": 2,
        "env_kwargs": world,
    })
}

/// Which of `n` episodes train and which validate.
pub(crate) fn masks(n: usize) -> BTreeMap<String, Vec<String>> {
    let names = |valid: bool| -> Vec<String> {
        (0..n).filter(|i| (i % VALID_EVERY == VALID_EVERY - 1) == valid).map(|i| format!("demo_{i}")).collect()
    };
    let mut masks = BTreeMap::from([("train".to_string(), names(false))]);
    if n >= VALID_EVERY {
        masks.insert("valid".to_string(), names(true));
    }
    masks
}

/// Seed of the `k`-th episode of a recording with `seed`.
pub(crate) fn episode_seed(seed: u64, k: usize) -> u64 {
    (seed << 20) + k as u64
}

fn attempt(env: &mut Env, seed: u64, progress: &Progress) -> Result<(Outcome, Episode)> {
    progress.check()?;
    let mut tape = None;
    let outcome = demonstrate(env, seed, |env, action| tape.get_or_insert_with(|| Tape::begin(env)).note(env, action))?;
    // The horizon of a task is at least one step long.
    let tape = tape.unwrap_or_else(|| Tape::begin(env));
    Ok((outcome, tape.finish(env)))
}

/// An episode while it is being recorded.
pub(crate) struct Tape {
    episode: Episode,
    /// What was seen before each action.
    seen: Vec<BTreeMap<String, Vec<f64>>>,
}

impl Tape {
    /// Right after a reset: the episode's `model_file` says where the object stands.
    pub fn begin(env: &Env) -> Self {
        let model_file = env.scene.xml_at(&env.start().place);
        Self { episode: Episode { model_file, ..Episode::default() }, seen: Vec::new() }
    }

    /// Before the step that `action` makes.
    pub fn note(&mut self, env: &Env, action: &[f64; ACTION]) {
        self.seen.push(env.observe());
        self.episode.states.push(env.state());
        self.episode.actions.push(*action);
    }

    /// The actions so far.
    pub fn actions(&self) -> &[[f64; ACTION]] {
        &self.episode.actions
    }

    /// Forgets all but the first `steps` steps.
    pub fn cut(&mut self, steps: usize) {
        self.seen.truncate(steps);
        self.episode.states.truncate(steps);
        self.episode.actions.truncate(steps);
    }

    /// After the last step. The last reward is 1 when the task is done.
    pub fn finish(self, env: &Env) -> Episode {
        let Self { mut episode, mut seen } = self;
        seen.push(env.observe());
        let steps = episode.actions.len();
        for (t, observation) in seen.into_iter().enumerate() {
            for (key, row) in observation {
                if t < steps {
                    episode.obs.entry(key.clone()).or_default().push(row.clone());
                }
                if t > 0 {
                    episode.next_obs.entry(key).or_default().push(row);
                }
            }
        }
        let last = |t: usize| t + 1 == steps && env.outcome() == Outcome::Success;
        episode.rewards = (0..steps).map(|t| f64::from(u8::from(last(t)))).collect();
        episode.dones = (0..steps).map(last).collect();
        episode
    }
}

/// For people, such as `lost grasp`: as the JSON says it, with a space for the hyphen.
pub fn outcome_name(outcome: Outcome) -> &'static str {
    match outcome {
        Outcome::Success => "success",
        Outcome::NeverReached => "never reached",
        Outcome::LostGrasp => "lost grasp",
        Outcome::MovedTooLittle => "moved too little",
        Outcome::KnockedAway => "knocked away",
    }
}

/// The world that demonstrations were recorded in. `file`, where they were read from, is only named
/// in the error.
///
/// # Errors
/// When they are of another simulator, or of no task of ours.
pub fn world_of(demos: &Demos, file: &Path) -> Result<WorldArgs> {
    serde_json::from_value(demos.env_args["env_kwargs"].clone()).map_err(|e| {
        Failure::new(
            format!("these demonstrations were recorded in another simulator's world: {e}"),
            format!("{}, data, attribute env_args", file.display()),
            "list and train on them all the same; only replay needs the world",
        )
    })
}
