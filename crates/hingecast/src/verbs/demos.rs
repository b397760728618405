//! `hingecast demos`

use super::{Outcome, Session};
use crate::cli::Demos;
use hingecast::failure::{Failure, Result};
use hingecast::simulate::record;
use hingecast::simulate::{object_file, replay, twin_file};
use hingecast_geom::ply::write_whole;
use hingecast_policy::demos::{read, write};
use hingecast_sim::TaskKind;
use hingecast_sim::trial::make_task;
use std::path::Path;

pub fn run(session: &Session, args: &Demos) -> Result<Outcome> {
    if let Some(file) = &args.inspect {
        return inspect(session, file);
    }
    let out = args
        .out
        .as_deref()
        .ok_or_else(|| Failure::new("where to write the demonstrations?", "--out", "for instance -o demos.hdf5"))?;
    let kind = TaskKind::from_name(&args.task).unwrap_or(TaskKind::Open);
    let object = match (&args.object, &args.twin) {
        (_, Some(run)) => twin_file(run)?,
        (Some(name), None) => object_file(name)?,
        (None, None) => object_file(if kind == TaskKind::HingedBox { "hinged_blocks" } else { "covered_box" })?,
    };
    let start = std::time::Instant::now();
    let made = make_task(&object, kind, args.joint.as_deref(), args.scale)?;
    let task = &made.task;
    session.ui.say(&format!(
        "task: {} '{}' of {}, size x {}, held where it is {:.0} mm thick",
        kind.name(),
        task.joint,
        object.display(),
        task.scale,
        1e3 * task.width
    ));
    if made.worked < made.of {
        session.ui.say(&format!("doubt: only {} of {} first tries opened it", made.worked, made.of));
    }
    let (demos, recorded) = record::record_on(&object, task, args.n, args.seed, &session.ui.stage("demos"))?;
    write(out, &demos)?;
    let secs = start.elapsed().as_secs_f64();
    let thrown: usize = recorded.thrown_away.values().sum();
    let ends: Vec<String> =
        recorded.thrown_away.iter().map(|(o, k)| format!("{k} {}", record::outcome_name(*o))).collect();
    session.ui.say(&format!(
        "{} demonstrations of {:.0} steps in {secs:.1} s -> {}; thrown away: {thrown}{}",
        recorded.kept,
        recorded.steps as f64 / recorded.kept as f64,
        out.display(),
        if ends.is_empty() { String::new() } else { format!(" ({})", ends.join(", ")) }
    ));
    session.answer(&serde_json::json!({
        "demos": out, "kept": recorded.kept, "thrown_away": recorded.thrown_away, "steps": recorded.steps,
        "secs": secs, "task": task,
    }));
    Ok(Outcome::Done)
}

/// Lists, plots, replays. Exit 1 when a replay differs.
fn inspect(session: &Session, file: &Path) -> Result<Outcome> {
    let demos = read(file)?;
    session.ui.say(&format!("{}: {} episodes, {} steps", file.display(), demos.episodes.len(), demos.steps()));
    for (mask, names) in &demos.masks {
        session.ui.say(&format!("  mask {mask}: {} episodes", names.len()));
    }
    if let Some(first) = demos.episodes.first() {
        let keys: Vec<String> =
            first.obs.iter().map(|(k, rows)| format!("{k} ({})", rows.first().map_or(0, Vec::len))).collect();
        session.ui.say(&format!("  observations: {}", keys.join(", ")));
    }
    for (i, e) in demos.episodes.iter().enumerate() {
        let still = e.actions.iter().filter(|a| a[..3].iter().all(|x| x.abs() < 0.15)).count();
        session.ui.say(&format!(
            "  demo_{i}: {} steps ({:.1} s), {still} nearly still, reward {:.0}",
            e.actions.len(),
            e.actions.len() as f64 / 20.0,
            e.rewards.iter().sum::<f64>()
        ));
    }
    let svg = file.with_extension("svg");
    write_whole(&svg, replay::plot(&demos).as_bytes()).map_err(Failure::io(&svg))?;
    session.ui.say(&format!("plot: {}", svg.display()));
    let world = record::world_of(&demos, file)?;
    let replayed = replay::replay(&demos, &world, &session.ui.stage("replay"))?;
    session.ui.say(&format!(
        "replay: {} of {} episodes reproduce every state to the bit, {} end in success",
        replayed.equal, replayed.episodes, replayed.successes
    ));
    if let Some((episode, step)) = replayed.first_difference {
        session.ui.say(&format!("  the first difference is in demo_{episode} at step {step}"));
    }
    let lengths: Vec<usize> = demos.episodes.iter().map(|e| e.actions.len()).collect();
    session.answer(&serde_json::json!({
        "demos": file, "episodes": demos.episodes.len(), "steps": demos.steps(), "lengths": lengths, "plot": svg,
        "replay": replayed, "env_args": demos.env_args,
    }));
    Ok(if replayed.equal == replayed.episodes { Outcome::Done } else { Outcome::UnderBar })
}
