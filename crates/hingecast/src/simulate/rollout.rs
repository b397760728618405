//! A policy in seeded episodes on several worlds: the true object, its twin, spoiled ones. Episode k has the same seed everywhere,
//! so worlds are compared in pairs (McNemar's exact test, `policy::statistics`).

use super::record::{ENV_NAME, outcome_name};
use super::strip;
use crate::failure::{Failure, Result};
use glam::DVec3;
use hingecast_geom::Progress;
use hingecast_policy::statistics::{Comparison, Paired, wilson};
use hingecast_policy::{Actor, Policy};
use hingecast_sim::{Env, Outcome, Scene};
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Seconds of a control step.
pub const STEP_SECS: f64 = 0.05;

/// Settings are chosen on other episodes than those that are reported (seed 0 and its neighbours).
const SCORE_SEED: u64 = 1 << 20;

/// One world to roll out in.
pub struct World {
    /// "true", "twin", "axis=30", ...
    pub name: String,
    pub object: PathBuf,
    pub scene: Scene,
}

#[derive(Clone, Debug, Serialize)]
pub struct EpisodeResult {
    pub seed: u64,
    pub outcome: Outcome,
    pub steps: usize,
    /// How far the joint moved at most, as a share of the task's (the true object's) range.
    pub moved: f64,
    /// Where the grasped spot of the part was at the end, world frame, m.
    pub end: [f64; 3],
}

#[derive(Clone, Debug, Serialize)]
pub struct WorldResult {
    pub name: String,
    pub object: PathBuf,
    pub episodes: usize,
    pub successes: usize,
    /// Wilson's 95 % interval of the success rate.
    pub interval: [f64; 2],
    pub outcomes: BTreeMap<Outcome, usize>,
    /// Over the successes; `None` without any.
    pub median_secs_to_success: Option<f64>,
    /// Mean over all episodes, share of the true range: wrong limits cannot hide behind it.
    pub mean_moved: f64,
    /// Median distance of the grasped spot from where it ended in the first world, same seed, both successes, mm. A compliant arm
    /// opens many a wrong hinge; where the part then is tells it.
    pub end_gap_mm: Option<f64>,
    /// Against the first world: its rate minus this one's.
    pub against_first: Option<Comparison>,
    pub results: Vec<EpisodeResult>,
    /// Picture strips, when they were asked for: outcome -> file.
    pub strips: BTreeMap<Outcome, PathBuf>,
}

/// `n` episodes with seeds `seed * 2^20 + 0 ..` in every world.
///
/// # Errors
/// When the policy wants other observations than this world has, or the person stops it.
pub fn rollout(
    policy: &Policy,
    worlds: &[World],
    n: usize,
    seed: u64,
    progress: &Progress,
) -> Result<Vec<WorldResult>> {
    let done = AtomicUsize::new(0);
    let total = n * worlds.len();
    let mut out: Vec<WorldResult> = Vec::new();
    for world in worlds {
        let results: Vec<EpisodeResult> = (0..n)
            .into_par_iter()
            .map_init(
                || Env::new(&world.scene),
                |env, k| {
                    let k_seed = (seed << 20) + k as u64;
                    let result = episode(policy, env, k_seed, progress, |_| ())?;
                    let finished = done.fetch_add(1, Ordering::Relaxed) + 1;
                    progress.report(finished, total, &world.name)?;
                    Ok(result)
                },
            )
            .collect::<Result<_>>()?;
        let summary = summarise(world, results, out.first());
        out.push(summary);
    }
    Ok(out)
}

/// The success rate of the policy in `folder` in the world that its demonstrations were recorded in: a sweep's score.
///
/// # Errors
/// Those of [`rollout`].
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
    seed: u64,
    progress: &Progress,
    mut each: impl FnMut(&Env),
) -> Result<EpisodeResult> {
    progress.check()?;
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
    let (outcome, moved, end) = (env.outcome(), env.moved_of_true_range(), env.grasp().trans.to_array());
    Ok(EpisodeResult { seed, outcome, steps, moved, end })
}

fn summarise(world: &World, results: Vec<EpisodeResult>, first: Option<&WorldResult>) -> WorldResult {
    let won: Vec<bool> = results.iter().map(|r| r.outcome == Outcome::Success).collect();
    let successes = won.iter().filter(|w| **w).count();
    let mut outcomes = BTreeMap::new();
    results.iter().for_each(|r| *outcomes.entry(r.outcome).or_default() += 1);
    let against_first = first.map(|f| {
        let theirs: Vec<bool> = f.results.iter().map(|r| r.outcome == Outcome::Success).collect();
        Paired::count(&theirs, &won).compare()
    });
    let end_gap_mm = first.and_then(|f| {
        let both = |(a, b): &(&EpisodeResult, &EpisodeResult)| [a, b].iter().all(|r| r.outcome == Outcome::Success);
        let gap = |(a, b): (&EpisodeResult, &EpisodeResult)| 1e3 * DVec3::from(a.end).distance(DVec3::from(b.end));
        median(f.results.iter().zip(&results).filter(both).map(gap).collect())
    });
    let secs = results.iter().filter(|r| r.outcome == Outcome::Success).map(|r| r.steps as f64 * STEP_SECS);
    WorldResult {
        name: world.name.clone(),
        object: world.object.clone(),
        episodes: results.len(),
        successes,
        interval: wilson(successes, results.len()),
        outcomes,
        median_secs_to_success: median(secs.collect()),
        mean_moved: results.iter().map(|r| r.moved).sum::<f64>() / results.len() as f64,
        end_gap_mm,
        against_first,
        results,
        strips: BTreeMap::new(),
    }
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// A strip of pictures of the first episode of every kind of end, per world.
///
/// # Errors
/// When the folder cannot be written.
pub fn pictures(
    policy: &Policy,
    worlds: &[World],
    results: &mut [WorldResult],
    folder: &Path,
    progress: &Progress,
) -> Result<()> {
    for (w, (world, result)) in worlds.iter().zip(results).enumerate() {
        let firsts: BTreeMap<Outcome, u64> = result.results.iter().rev().map(|r| (r.outcome, r.seed)).collect();
        for (outcome, seed) in firsts {
            let mut env = Env::new(&world.scene);
            let mut states = Vec::new();
            let mut start = None;
            episode(policy, &mut env, seed, progress, |env| {
                start.get_or_insert_with(|| env.start());
                states.push(env.state());
            })?;
            let Some(start) = start else { continue };
            let name =
                format!("{w}_{}_{}.png", world.name.replace(['=', ','], "_"), outcome_name(outcome).replace(' ', "_"));
            let path = folder.join(name);
            strip::write(&world.scene, &start, &states, &path)?;
            result.strips.insert(outcome, path);
        }
    }
    Ok(())
}

/// The table for people.
pub fn table(results: &[WorldResult]) -> String {
    let mut out = format!(
        "{:<22} {:>9} {:>7} {:>14} {:>5} {:>6} {:>7} {:>24} {:>8}\n",
        "world", "success", "rate %", "95 %", "s", "moved", "gap mm", "first - this [points]", "McNemar"
    );
    for r in results {
        let percent = |x: f64| 100.0 * x;
        let against = r.against_first.map_or(["-".to_string(), "-".to_string()], |c| {
            let [lo, hi] = c.interval.map(percent);
            [format!("{:+.1} [{lo:+.1}, {hi:+.1}]", percent(c.difference)), format!("{:.2e}", c.p_value)]
        });
        let [lo, hi] = r.interval.map(percent);
        out += &format!(
            "{:<22} {:>9} {:>7.1} {:>14} {:>5} {:>6.2} {:>7} {:>24} {:>8}\n",
            r.name,
            format!("{}/{}", r.successes, r.episodes),
            percent(r.successes as f64 / r.episodes as f64),
            format!("{lo:.1} .. {hi:.1}"),
            r.median_secs_to_success.map_or("-".into(), |s| format!("{s:.1}")),
            r.mean_moved,
            r.end_gap_mm.map_or("-".into(), |g| format!("{g:.1}")),
            against[0],
            against[1]
        );
        let failed: Vec<String> = r
            .outcomes
            .iter()
            .filter(|(o, _)| **o != Outcome::Success)
            .map(|(o, k)| format!("{k} {}", outcome_name(*o)))
            .collect();
        if !failed.is_empty() {
            out += &format!("    {}\n", failed.join(", "));
        }
    }
    out
}

/// The world of a policy: what `train` noted beside it.
///
/// # Errors
/// When the note is damaged; `None` when there is none.
pub fn world_of_policy(folder: &Path) -> Result<Option<super::record::WorldArgs>> {
    let path = folder.join("env_args.json");
    let Ok(bytes) = std::fs::read(&path) else { return Ok(None) };
    let damaged = |e: serde_json::Error| {
        Failure::new(format!("not what `train` writes: {e}"), path.display().to_string(), "delete it, or train again")
    };
    let value: serde_json::Value = serde_json::from_slice(&bytes).map_err(damaged)?;
    // Demonstrations of another simulator have other arguments: then the task comes from the object.
    if !value["env_name"].as_str().is_some_and(|name| name.starts_with(ENV_NAME)) {
        return Ok(None);
    }
    serde_json::from_value(value["env_kwargs"].clone()).map(Some).map_err(damaged)
}
