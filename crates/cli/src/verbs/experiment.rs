//! `hingecast experiment`: the whole chain of verbs for each object, and one table.

use super::{Outcome, Session, build, synth};
use crate::cli;
use hingecast::failure::{Failure, Result};
use hingecast::stage::write_json;
use hingecast_geom::staging::write_whole;
use hingecast_study::experiment::cast::Cast;
use hingecast_study::experiment::plan::Plan;
use hingecast_study::experiment::steps::{Clock, Ledger, Steps};
use hingecast_study::experiment::{Experiment, plot, table};
use hingecast_study::suite::{Named, objects};
use hingecast_study::training;
use std::path::Path;

pub fn run(session: &Session, args: &cli::Experiment) -> Result<Outcome> {
    let plan = plan(args)?;
    let objects = objects(&args.objects)?;
    Experiment::may_become(&args.out)?;
    std::fs::create_dir_all(&args.out).map_err(Failure::io(&args.out))?;
    let mut experiment = Experiment { settings: plan.settings(), demonstrated: Vec::new(), rows: Vec::new() };
    // Marks the folder as ours before anything is in it: who is killed with the first object may go
    // on.
    if !args.out.join("experiment.json").exists() {
        save(&experiment, &args.out)?;
    }
    let mut clock = Clock::new(plan.steps(), objects.len());
    for Named { argument, name } in &objects {
        clock.next_object();
        let root = args.out.join(name);
        std::fs::create_dir_all(&root).map_err(Failure::io(&root))?;
        let steps = Steps { watcher: &session.ui, object: name, ledger: Ledger::open(&root), clock: &mut clock };
        let mut cast =
            Cast { host: session.host(), plan: &plan, argument, name, root, steps, demonstrated: Vec::new() };
        let rows = cast.rows()?;
        experiment.demonstrated.extend(cast.demonstrated);
        experiment.rows.extend(rows);
        // After every object: what is killed on the way leaves what it has.
        save(&experiment, &args.out)?;
    }
    session.ui.say(&format!("\n{}", table::markdown(&experiment)));
    session.ui.say(&format!("table and plot: {}", args.out.join("experiment.{md,csv,json,svg}").display()));
    session.answer(&experiment)?;
    let measured = experiment.rows.iter().any(|r| r.failed.is_none());
    Ok(if measured { Outcome::Done } else { Outcome::UnderBar })
}

/// Everything resolved from the flags.
fn plan(args: &cli::Experiment) -> Result<Plan> {
    let preset = serde_json::from_value(args.policy.clone().into()).expect("the flag takes the presets' names only");
    let training = (0..args.train_seeds).map(|k| {
        let set: Vec<String> = args.policy_set.iter().cloned().chain([format!("seed={k}")]).collect();
        training::resolve(preset, None, &set)
    });
    let twin = build::config(&args.build)?;
    Ok(Plan {
        worlds: Plan::worlds(&args.worlds)?,
        synth: synth::config(&args.synth, args.recording_seed, true)?,
        track: Plan::classical(&twin),
        twin,
        training: training.collect::<Result<_>>()?,
        demos: args.demos,
        episodes: args.episodes,
        spoiled_episodes: args.spoiled_episodes,
        recordings: args.recordings.clone(),
        runs: args.runs.clone().into_iter().collect(),
    })
}

fn save(experiment: &Experiment, out: &Path) -> Result<()> {
    write_json(&out.join("experiment.json"), experiment)?;
    let texts = [
        ("experiment.md", table::markdown(experiment)),
        ("experiment.csv", table::csv(experiment)),
        ("experiment.svg", plot::success_against_error(&experiment.rows)),
    ];
    texts.into_iter().try_for_each(|(name, text)| {
        let path = out.join(name);
        write_whole(&path, text.as_bytes()).map_err(Failure::io(&path))
    })
}
