//! `hingecast train`

use super::{Outcome, Session};
use crate::cli::Train;
use hingecast::failure::{Failure, Result};
use hingecast_policy::Demos;
use hingecast_policy::train::Preset;
use hingecast_study::training::{self, sweep};
#[cfg(feature = "mujoco")]
use std::path::Path;

pub fn run(session: &Session, args: &Train) -> Result<Outcome> {
    let preset: Preset =
        serde_json::from_value(args.preset.clone().into()).expect("the flag takes the presets' names only");
    let mut set = args.set.clone();
    set.extend(args.steps.map(|n| format!("steps={n}")));
    set.extend(args.seed.map(|n| format!("seed={n}")));
    // Everything that can be refused quickly, before the demonstrations are read.
    training::may_become_policy(&args.out)?;
    let config = training::resolve(preset, args.config.as_deref(), &set)?;
    let sweep = args.sweep.as_deref().map(sweep::Sweep::read).transpose()?;
    let demos = hingecast_policy::demos::read(&args.demos)?;
    if let Some(sweep) = sweep {
        return run_sweep(session, args, preset, &set, &sweep, &demos);
    }

    let start = std::time::Instant::now();
    let report = training::train(&demos, &config, &args.out, &session.ui.stage("train"))?;
    let secs = start.elapsed().as_secs_f64();
    let last = report.last();
    if report.resumed_from > 0 {
        session.ui.say(&format!("went on from step {}", report.resumed_from));
    }
    let valid = last.valid.map_or("none, no demonstrations are kept for it".to_string(), |v| format!("{v:.4}"));
    session.ui.say(&format!(
        "{} steps on {} windows of {} demonstrations in {secs:.0} s; {} parameters\nloss {:.4}, validation {valid} ({} demonstrations)",
        report.steps, report.train_windows, report.train_demos, report.parameters, last.train, report.valid_demos
    ));
    session.ui.say(&format!("policy: {}", args.out.display()));
    session.answer(&serde_json::json!({
        "policy": args.out, "steps": report.steps, "resumed_from": report.resumed_from, "parameters": report.parameters,
        "train_demos": report.train_demos, "valid_demos": report.valid_demos, "train_loss": last.train,
        "valid_loss": last.valid, "secs": secs,
    }))?;
    Ok(Outcome::Done)
}

fn run_sweep(
    session: &Session,
    args: &Train,
    preset: Preset,
    set: &[String],
    sweep: &sweep::Sweep,
    demos: &Demos,
) -> Result<Outcome> {
    let progress = session.ui.stage("sweep");
    let (file, threads) = (args.config.as_deref(), session.threads);
    let score = score(args, demos)?;
    let rows = sweep::run(sweep, preset, file, set, demos, &args.out, threads, &progress, score.as_deref())?;
    drop(progress);
    session.ui.say(&sweep::table(&rows));
    session.ui.say(&format!("table and plots: {}", args.out.display()));
    session.answer(&rows)?;
    if rows.iter().all(|row| row.failed.is_some()) {
        let why = rows.first().and_then(|row| row.failed.clone()).unwrap_or_default();
        let hint = "see the table; train one of them alone: hingecast train DEMOS -o POLICY --set KEY=VALUE";
        return Err(Failure::new("no training of the sweep succeeded", why, hint));
    }
    Ok(Outcome::Done)
}

/// Success rates beside the losses, where the demonstrations are of our own simulator.
#[cfg(feature = "mujoco")]
fn score(args: &Train, demos: &Demos) -> Result<Option<Box<sweep::Score>>> {
    use hingecast_sim::{Scene, SceneConfig};
    use hingecast_study::simulate::{record::world_of, rollout::success_rate};
    let Ok(world) = world_of(demos, &args.demos) else { return Ok(None) };
    if args.rollouts == 0 {
        return Ok(None);
    }
    let config = SceneConfig { object: world.object, spoil: Vec::new(), visuals: false };
    let scene = Scene::new(&config, &world.task)?;
    let n = args.rollouts;
    Ok(Some(Box::new(move |folder: &Path| success_rate(folder, &scene, n))))
}

#[cfg(not(feature = "mujoco"))]
fn score(_: &Train, _: &Demos) -> Result<Option<Box<sweep::Score>>> {
    Ok(None)
}
