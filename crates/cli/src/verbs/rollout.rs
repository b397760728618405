//! `hingecast rollout`

use super::{Outcome, Session};
use crate::cli::Rollout;
use hingecast::failure::{Failure, Result};
use hingecast::stage::{RunFolder, write_json};
use hingecast_geom::folder::may_become;
use hingecast_policy::Policy;
use hingecast_policy::demos::read;
use hingecast_sim::trial::make_task;
use hingecast_sim::{Scene, SceneConfig, Spoil, TaskKind, TaskSpec};
use hingecast_study::report::rollout::{self as report, RolloutReport};
use hingecast_study::simulate::record::{WorldArgs, world_of};
use hingecast_study::simulate::rollout::{World, WorldResult, pictures, rollout, table, world_of_policy};
use hingecast_study::simulate::{object_file, twin_file};
use std::path::Path;

pub fn run(session: &Session, args: &Rollout) -> Result<Outcome> {
    let policy = Policy::load(&args.policy)?;
    let truth = args.object.as_deref().map(|o| object_file(&session.host(), o, None)).transpose()?;
    let twin = args.twin.as_deref().map(twin_file).transpose()?;
    // A typo is noticed now and not after the episodes.
    let spoils = args.spoil.iter().map(|text| Ok((text, Spoil::read(text)?))).collect::<Result<Vec<_>>>()?;

    let known: Option<WorldArgs> = match &args.demos {
        Some(file) => Some(world_of(&read(file)?, file)?),
        None => world_of_policy(&args.policy)?,
    };
    let first = truth.clone().or(twin.clone()).or(known.as_ref().map(|w| w.object.clone())).ok_or_else(|| {
        let hint = "--object OBJECT, --twin RUN, or both";
        Failure::new("in which world shall the policy act?", "--object / --twin", hint)
    })?;
    let task = match known {
        Some(world) => world.task,
        None => make_task(&first, TaskKind::Open, None, None)?.task,
    };
    let mut worlds = Vec::new();
    match (&truth, &twin) {
        (None, None) => worlds.push(world("demonstrated", &first, Vec::new(), &task)?),
        _ => {
            for (name, path) in [("true", &truth), ("twin", &twin)] {
                if let Some(path) = path {
                    worlds.push(world(name, path, Vec::new(), &task)?);
                }
            }
        }
    }
    for (text, spoil) in spoils {
        worlds.push(world(text, &first, spoil, &task)?);
    }

    if let Some(folder) = &args.out {
        let hint = "give a new folder: hingecast rollout POLICY -o FOLDER";
        may_become("rollouts' folder", folder, &["rollout.json"], hint)?;
        std::fs::create_dir_all(folder).map_err(Failure::io(folder))?;
        // Marks the folder as ours before pictures are in it: who is killed may go on.
        if !folder.join("rollout.json").exists() {
            write_json(&folder.join("rollout.json"), &Vec::<WorldResult>::new())?;
        }
    }
    let start = std::time::Instant::now();
    let mut results = rollout(&policy, &worlds, args.n, args.seed, &session.ui.stage("rollout"))?;
    let secs = start.elapsed().as_secs_f64();
    let mut page = None;
    if let Some(folder) = &args.out {
        pictures(&policy, &worlds, &mut results, folder, &session.ui.stage("picture"))?;
        write_json(&folder.join("rollout.json"), &results)?;
        let told = RolloutReport { policy: &args.policy, task: &task, seed: args.seed, secs, results: &results };
        page = Some(report::write(&told, folder)?);
    }
    session.ui.say(table(&results).trim_end());
    let episodes = args.n * worlds.len();
    session.ui.say(&format!("{episodes} episodes in {secs:.1} s"));
    if let Some(page) = &page {
        session.ui.say(&format!("report: {}", page.display()));
    }
    session.answer(&serde_json::json!({ "worlds": results, "secs": secs, "task": task, "report": page }))?;
    Ok(Outcome::Done)
}

fn world(name: &str, object: &Path, spoil: Vec<Spoil>, task: &TaskSpec) -> Result<World> {
    // Also where a policy remembers the twin of a run.
    RunFolder::refuse_unfinished(object)?;
    let config = SceneConfig { object: object.to_path_buf(), spoil, visuals: false };
    Ok(World { name: name.to_string(), object: object.to_path_buf(), scene: Scene::new(&config, task)? })
}
