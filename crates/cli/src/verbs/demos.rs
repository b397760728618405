//! `hingecast demos`

use super::{Outcome, Session};
use crate::cli::Demos;
use hingecast::failure::{Failure, Result};
use hingecast_geom::staging::write_whole;
use hingecast_policy::demos::{read, write};
use hingecast_sim::trial::make_task;
use hingecast_sim::{Scene, SceneConfig, TaskKind, TaskSpec};
use hingecast_study::simulate::record::{self, WorldArgs};
use hingecast_study::simulate::teleop::session::Session as TeleopSession;
use hingecast_study::simulate::teleop::terminal::{self, Console};
use hingecast_study::simulate::teleop::{self, Wanted};
use hingecast_study::simulate::{imported_beside, may_replace, may_write, object_file, replay, twin_file};
use std::path::{Path, PathBuf};

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
        (name, None) => {
            let default = if kind == TaskKind::HingedBox { "hinged_blocks" } else { "covered_box" };
            object_file(&session.host(), name.as_deref().unwrap_or(default), Some(&imported_beside(out)))?
        }
    };
    may_write(out)?;
    if args.expert == "teleop" {
        return teleoperate(session, args, out, object, kind);
    }
    may_replace(out)?;
    let start = std::time::Instant::now();
    let task = new_task(session, args, &object, kind)?;
    let (demos, recorded) = record::record_on(&object, &task, args.n, args.seed, &session.ui.stage("demos"))?;
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
    }))?;
    Ok(Outcome::Done)
}

/// A person at the keyboard. What was kept is in the file at every moment.
fn teleoperate(session: &Session, args: &Demos, out: &Path, object: PathBuf, kind: TaskKind) -> Result<Outcome> {
    let wanted = Wanted { kind, object: &object, joint: args.joint.as_deref(), scale: args.scale };
    let there = teleop::go_on(out, &wanted)?;
    terminal::needed()?;
    let (kept, world) = match there {
        Some((demos, world)) => (Some(demos), WorldArgs { seed: args.seed, ..world }),
        None => {
            let task = new_task(session, args, &object, kind)?;
            (None, WorldArgs { object, task, control_freq: 20, seed: args.seed })
        }
    };
    let before = kept.as_ref().map_or(0, |d| d.episodes.len());
    let scene = scene_of(&world.object, &world.task)?;
    let console = Console::open()?;
    let mut person = TeleopSession::new(&scene, world, kept, console.releases);
    let save = |demos: &hingecast_policy::Demos| match demos.episodes.is_empty() {
        // The only one was taken back; it was this session's.
        true => std::fs::remove_file(out).map_err(Failure::io(out)),
        false => Ok(write(out, demos)?),
    };
    let driven = terminal::drive(&mut person, &scene, args.n, save, &session.ui.stage("teleop"));
    drop(console);
    let all = person.demos.episodes.len();
    session.ui.say(&format!("{all} demonstrations in {}, {} of them new", out.display(), all.saturating_sub(before)));
    let pace = driven?;
    session.ui.say(&format!(
        "{} control steps in {:.1} s, {} late by more than 10 ms (worst {:.0} ms); {:.0} pictures a second",
        pace.steps,
        pace.secs,
        pace.late,
        pace.worst_late_ms,
        f64::from(pace.pictures) / pace.secs.max(1e-3)
    ));
    session
        .answer(&serde_json::json!({ "demos": out, "kept": all, "new": all.saturating_sub(before), "pace": pace }))?;
    Ok(Outcome::Done)
}

/// Makes the task and says what it is.
fn new_task(session: &Session, args: &Demos, object: &Path, kind: TaskKind) -> Result<TaskSpec> {
    let made = make_task(object, kind, args.joint.as_deref(), args.scale)?;
    let task = made.task;
    session.ui.say(&format!(
        "task: {} '{}' of {}, size x {}, held where it is {:.0} mm thick",
        kind.name(),
        task.joint,
        object.display(),
        hingecast_study::simulate::short(task.scale),
        1e3 * task.width
    ));
    if made.worked < made.of {
        session.ui.say(&format!("doubt: only {} of {} first tries opened it", made.worked, made.of));
    }
    Ok(task)
}

fn scene_of(object: &Path, task: &TaskSpec) -> Result<Scene> {
    Ok(Scene::new(&SceneConfig { object: object.to_path_buf(), spoil: Vec::new(), visuals: false }, task)?)
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
    let there = std::fs::read_to_string(&svg);
    if there.as_ref().map_or(!svg.exists(), |text| text.is_empty() || text.contains(replay::HEIGHT)) {
        write_whole(&svg, replay::plot(&demos).as_bytes()).map_err(Failure::io(&svg))?;
        session.ui.say(&format!("plot: {}", svg.display()));
    } else {
        // Nobody named this file; a drawing of a person's stays.
        session.ui.say(&format!("no plot: {} is another picture", svg.display()));
    }
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
    }))?;
    Ok(if replayed.equal == replayed.episodes { Outcome::Done } else { Outcome::UnderBar })
}
