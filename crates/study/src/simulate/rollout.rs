//! A policy in seeded episodes on several worlds: the true object, its twin, spoiled ones. Episode
//! k has the same seed everywhere, so worlds are compared in pairs (McNemar's exact test,
//! `policy::statistics`).
//!
//! Two things are counted. *Success*: the joint moved as far as the task asks, half of the true
//! range. *As true*: the part ended where the joint of the first world (the true object) would have
//! it (`sim::path`): a compliant arm opens many a wrong hinge.

use super::record::{ENV_NAME, episode_seed, outcome_name};
use super::strip;
use glam::DVec3;
use hingecast::failure::{Failure, Result};
use hingecast_geom::Progress;
use hingecast_policy::statistics::{Comparison, Paired, wilson};
use hingecast_policy::{Actor, Policy};
use hingecast_sim::{Env, Outcome, Scene, SpotPath};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Seconds of a control step.
pub(crate) const STEP_SECS: f64 = 0.05;

/// Settings are chosen on other episodes than those that are reported (seed 0 and its neighbours).
const SCORE_SEED: u64 = 1 << 20;

/// One world to roll out in.
pub struct World {
    /// "true", "twin", "axis=30", ...
    pub name: String,
    /// Its model file, for the report; the scene is what counts.
    pub object: PathBuf,
    /// What is simulated; all worlds have the same task.
    pub scene: Scene,
}

/// How one episode went.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct EpisodeResult {
    /// Gives the object's place, the arm's posture and the policy's dice.
    pub seed: u64,
    /// How it ended.
    pub outcome: Outcome,
    /// Control steps of 50 ms, until success or the task's horizon.
    pub steps: usize,
    /// How far the joint moved at most, as a share of the task's (the true object's) range.
    pub moved: f64,
    /// Where the grasped spot of the part was at the end, world frame, m.
    pub end: [f64; 3],
    /// How far it was from the way on which the true joint leads it, mm; `None` when the simulation
    /// diverged.
    pub off_mm: Option<f64>,
    /// That is little: the part ended as the true one would.
    pub as_true: bool,
}

impl EpisodeResult {
    /// Whether it ended in success, the part as the true joint would have it or not.
    pub fn won(&self) -> bool {
        self.outcome == Outcome::Success
    }

    fn opened_otherwise(&self) -> bool {
        self.won() && !self.as_true
    }
}

/// All episodes of one world.
#[derive(Clone, Debug, Serialize)]
pub struct WorldResult {
    /// That of the [`World`].
    pub name: String,
    /// Model file of its object.
    pub object: PathBuf,
    /// How many episodes there are.
    pub episodes: usize,
    /// How many of them ended in success.
    pub successes: usize,
    /// Wilson's 95 % interval of the success rate, 0 to 1.
    pub interval: [f64; 2],
    /// How many ended with the part where the first world's joint would have it.
    pub as_true: usize,
    /// Wilson's 95 % interval of their rate, 0 to 1.
    pub as_true_interval: [f64; 2],
    /// How many episodes ended how; what never came up is left out.
    pub outcomes: BTreeMap<Outcome, usize>,
    /// Simulated seconds, over the successes; `None` without any.
    pub median_secs_to_success: Option<f64>,
    /// Mean over all episodes, share of the true range: wrong limits cannot hide behind it.
    pub mean_moved: f64,
    /// Median distance of the grasped spot from where it ended in the first world, same seed, both
    /// successes, mm. A compliant arm opens many a wrong hinge; where the part then is tells it.
    /// `None` for the first world, and where no seed succeeded in both.
    pub end_gap_mm: Option<f64>,
    /// Against the first world: its success rate minus this one's. `None` for the first itself.
    pub against_first: Option<Comparison>,
    /// The same for episodes that ended as true.
    pub as_true_against_first: Option<Comparison>,
    /// Every episode, in the order of the seeds.
    pub results: Vec<EpisodeResult>,
    /// Picture strips, when [`pictures`] were asked for: outcome -> file.
    pub strips: BTreeMap<Outcome, PathBuf>,
}

/// `n` episodes with seeds `seed * 2^20 + 0 ..` in every world; the first world says what is true.
///
/// # Errors
/// When the policy wants other observations than this world has or answers an action that is not
/// finite, or the person stops it.
///
/// # Panics
/// No episodes: `n` is 0.
pub fn rollout(
    policy: &Policy,
    worlds: &[World],
    n: usize,
    seed: u64,
    progress: &Progress,
) -> Result<Vec<WorldResult>> {
    let Some(truth) = worlds.first().map(|w| SpotPath::of(&w.scene)) else { return Ok(Vec::new()) };
    let mut out: Vec<WorldResult> = Vec::new();
    for (w, world) in worlds.iter().enumerate() {
        let report = |k: usize| Ok(progress.report(w * n + k, n * worlds.len(), &world.name)?);
        let results = episodes(policy, &world.scene, &truth, n, seed, &report)?;
        let summary = summarise(world, results, out.first().map(|f| f.results.as_slice()));
        out.push(summary);
    }
    Ok(out)
}

/// `n` episodes in one world; `truth` is the true joint's way, and `report` hears after each how
/// many are finished.
///
/// # Errors
/// When the policy wants other observations than this world has, or `report` says to stop.
pub(crate) fn episodes(
    policy: &Policy,
    scene: &Scene,
    truth: &SpotPath,
    n: usize,
    seed: u64,
    report: &(dyn Fn(usize) -> Result<()> + Sync),
) -> Result<Vec<EpisodeResult>> {
    let done = AtomicUsize::new(0);
    (0..n)
        .into_par_iter()
        .map_init(
            || Env::new(scene),
            |env, k| {
                // Asked before as well: a stop must not wait for an episode that has not begun.
                report(done.load(Ordering::Relaxed))?;
                let result = episode(policy, env, truth, episode_seed(seed, k), |_| ())?;
                report(done.fetch_add(1, Ordering::Relaxed) + 1)?;
                Ok(result)
            },
        )
        .collect()
}

/// The success rate, 0 to 1, of the policy in `folder` in the world that its demonstrations were
/// recorded in, over `n` episodes: a sweep's score. They are none of those that [`rollout`] runs
/// with a `seed` below 2^20.
///
/// # Errors
/// A folder without a policy; those of [`rollout`].
///
/// # Panics
/// No episodes: `n` is 0.
pub fn success_rate(folder: &Path, scene: &Scene, n: usize) -> Result<f64> {
    let policy = Policy::load(folder)?;
    let world = World { name: "demonstrated".into(), object: PathBuf::new(), scene: scene.clone() };
    let results = rollout(&policy, std::slice::from_ref(&world), n, SCORE_SEED, &Progress::default())?;
    Ok(results[0].successes as f64 / n as f64)
}

/// One episode; `each` sees the environment before every step and at the end.
fn episode(
    policy: &Policy,
    env: &mut Env,
    truth: &SpotPath,
    seed: u64,
    mut each: impl FnMut(&Env),
) -> Result<EpisodeResult> {
    env.reset(seed);
    // The policy's dice must not be those of the reset.
    let mut actor = Actor::new(policy, seed ^ 0x726f_6c6c_6f75_7421);
    let mut steps = 0;
    while steps < env.scene.task.horizon && !env.success() {
        each(env);
        let action = actor.act(&env.observe())?;
        env.step(&action)?;
        steps += 1;
    }
    each(env);
    let (outcome, moved, end) = (env.outcome(), env.moved_at_most(), env.grasp().trans.to_array());
    let off = env.off(truth);
    let off_mm = off.is_finite().then_some(1e3 * off);
    Ok(EpisodeResult { seed, outcome, steps, moved, end, off_mm, as_true: off <= truth.tolerance() })
}

fn summarise(world: &World, results: Vec<EpisodeResult>, first: Option<&[EpisodeResult]>) -> WorldResult {
    let mut outcomes = BTreeMap::new();
    results.iter().for_each(|r| *outcomes.entry(r.outcome).or_default() += 1);
    let successes = results.iter().filter(|r| r.won()).count();
    let as_true = results.iter().filter(|r| r.as_true).count();
    let end_gap_mm = first.and_then(|f| {
        let both = |(a, b): &(&EpisodeResult, &EpisodeResult)| a.won() && b.won();
        let gap = |(a, b): (&EpisodeResult, &EpisodeResult)| 1e3 * DVec3::from(a.end).distance(DVec3::from(b.end));
        median(f.iter().zip(&results).filter(both).map(gap).collect())
    });
    let secs = results.iter().filter(|r| r.won()).map(|r| r.steps as f64 * STEP_SECS);
    WorldResult {
        name: world.name.clone(),
        object: world.object.clone(),
        episodes: results.len(),
        successes,
        interval: wilson(successes, results.len()),
        as_true,
        as_true_interval: wilson(as_true, results.len()),
        outcomes,
        median_secs_to_success: median(secs.collect()),
        mean_moved: results.iter().map(|r| r.moved).sum::<f64>() / results.len() as f64,
        end_gap_mm,
        against_first: first.map(|f| compare(f, &results, EpisodeResult::won)),
        as_true_against_first: first.map(|f| compare(f, &results, |r| r.as_true)),
        results,
        strips: BTreeMap::new(),
    }
}

/// The same seeds in two worlds; where one has fewer episodes, the first ones of the other.
pub(crate) fn compare(
    first: &[EpisodeResult],
    this: &[EpisodeResult],
    won: impl Fn(&EpisodeResult) -> bool,
) -> Comparison {
    let (first, this): (Vec<bool>, Vec<bool>) = first.iter().zip(this).map(|(a, b)| (won(a), won(b))).unzip();
    Paired::count(&first, &this).compare()
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// A strip of six pictures of the first episode of every kind of end, per world, as PNG in
/// `folder`. `results`, as [`rollout`] answers them for these worlds, then say where. For that
/// these episodes run again.
///
/// # Errors
/// When the folder cannot be written; those of [`rollout`].
pub fn pictures(
    policy: &Policy,
    worlds: &[World],
    results: &mut [WorldResult],
    folder: &Path,
    progress: &Progress,
) -> Result<()> {
    for (w, (world, result)) in worlds.iter().zip(results).enumerate() {
        let name = format!("{w}_{}", world.name.replace(['=', ','], "_"));
        result.strips = strips(policy, &world.scene, &result.results, &folder.join(name), progress)?;
    }
    Ok(())
}

/// One strip per kind of end, in files whose names begin with `prefix`.
///
/// # Errors
/// When they cannot be written.
pub(crate) fn strips(
    policy: &Policy,
    scene: &Scene,
    results: &[EpisodeResult],
    prefix: &Path,
    progress: &Progress,
) -> Result<BTreeMap<Outcome, PathBuf>> {
    let firsts: BTreeMap<Outcome, u64> = results.iter().rev().map(|r| (r.outcome, r.seed)).collect();
    let mut out = BTreeMap::new();
    for (outcome, seed) in firsts {
        progress.check()?;
        let mut env = Env::new(scene);
        let mut states = Vec::new();
        let mut start = None;
        episode(policy, &mut env, &SpotPath::of(scene), seed, |env| {
            start.get_or_insert_with(|| env.start());
            states.push(env.state());
        })?;
        let Some(start) = start else { continue };
        let mut path = prefix.as_os_str().to_owned();
        path.push(format!("_{}.png", outcome_name(outcome).replace(' ', "_")));
        let path = PathBuf::from(path);
        strip::write(scene, &start, &states, &path)?;
        out.insert(outcome, path);
    }
    Ok(out)
}

/// The table for people: two lines a world, one for each way to count.
pub fn table(results: &[WorldResult]) -> String {
    let mut out = format!(
        "{:<22} {:<8} {:>9} {:>7} {:>14} {:>24} {:>8} {:>5} {:>6} {:>7}\n",
        "world", "counted", "episodes", "rate %", "95 %", "first - this [points]", "McNemar", "s", "moved", "gap mm"
    );
    let percent = |x: f64| 100.0 * x;
    for r in results {
        let figures = |k: usize, interval: [f64; 2], against: Option<Comparison>| {
            let against = against.map_or(["-".to_string(), "-".to_string()], |c| {
                let [lo, hi] = c.interval.map(percent);
                [format!("{:+.1} [{lo:+.1}, {hi:+.1}]", percent(c.difference)), format!("{:.2e}", c.p_value)]
            });
            let [lo, hi] = interval.map(percent);
            format!(
                "{:>9} {:>7.1} {:>14} {:>24} {:>8}",
                format!("{k}/{}", r.episodes),
                percent(k as f64 / r.episodes as f64),
                format!("{lo:.1} .. {hi:.1}"),
                against[0],
                against[1]
            )
        };
        out += &format!(
            "{:<22} {:<8} {} {:>5} {:>6.2} {:>7}\n",
            r.name,
            "success",
            figures(r.successes, r.interval, r.against_first),
            r.median_secs_to_success.map_or("-".into(), |s| format!("{s:.1}")),
            r.mean_moved,
            r.end_gap_mm.map_or("-".into(), |g| format!("{g:.1}")),
        );
        let as_true = figures(r.as_true, r.as_true_interval, r.as_true_against_first);
        out += &format!("{:<22} {:<8} {as_true}\n", "", "as true");
        let failed: Vec<String> = r
            .outcomes
            .iter()
            .filter(|(o, _)| **o != Outcome::Success)
            .map(|(o, k)| format!("{k} {}", outcome_name(*o)))
            .chain(r.results.iter().any(EpisodeResult::opened_otherwise).then(|| {
                let k = r.results.iter().filter(|e| e.opened_otherwise()).count();
                format!("{k} opened otherwise than the first world's joint would")
            }))
            .collect();
        if !failed.is_empty() {
            out += &format!("    {}\n", failed.join(", "));
        }
    }
    out += "(as true: ended where the first world's joint leads, to half a pad; s: median time to success; moved: mean share of the \
            true range; gap: median distance between the ends; docs/simulation.md)\n";
    out
}

/// The world of a policy: what `train` noted beside it. `None` without a note that can be read, or
/// when its demonstrations came from another simulator.
///
/// # Errors
/// When the note is damaged.
pub fn world_of_policy(folder: &Path) -> Result<Option<super::record::WorldArgs>> {
    let path = folder.join("env_args.json");
    let Ok(bytes) = std::fs::read(&path) else { return Ok(None) };
    let damaged = |e: serde_json::Error| {
        Failure::new(format!("not what `train` writes: {e}"), path.display().to_string(), "delete it, or train again")
    };
    let value: serde_json::Value = serde_json::from_slice(&bytes).map_err(damaged)?;
    // Demonstrations of another simulator have other arguments: then the task comes from the
    // object.
    if !value["env_name"].as_str().is_some_and(|name| name.starts_with(ENV_NAME)) {
        return Ok(None);
    }
    serde_json::from_value(value["env_kwargs"].clone()).map(Some).map_err(damaged)
}
