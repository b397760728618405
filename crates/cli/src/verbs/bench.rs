//! `hingecast bench`: a suite of objects through the whole path.

use super::{Outcome, Session, build, synth, table};
use crate::cli::Bench;
use hingecast::config::{Config, Method};
use hingecast::eval::parts::PartsEvaluation;
use hingecast::eval::{Evaluation, evaluate};
use hingecast::failure::{Failure, Result};
use hingecast::report;
use hingecast::stage::{RunFolder, read_json, write_json};
use hingecast_capture::Truth;
use hingecast_capture::synth::SynthConfig;
use hingecast_geom::folder::may_become;
use hingecast_geom::staging::write_whole;
use hingecast_study::grid::{self, Request};
use hingecast_study::suite::{Named, objects, record_once, tidy};
use std::path::Path;

pub fn run(session: &Session, args: &Bench) -> Result<Outcome> {
    let suite = objects(&args.suite)?;
    let settings = build::config(&args.build)?;
    if !args.joints && (!args.protocols.is_empty() || args.seeds != 1) {
        let hint = "add --joints, or leave --protocol and --seeds out";
        return Err(Failure::new("protocols and seeds are for the bench of joints", "--protocol / --seeds", hint));
    }
    if args.joints && settings.method == Method::Track {
        let what = "the bench of joints knows the method screw alone";
        return Err(Failure::new(what, "--method track", "leave --joints out, or --method"));
    }
    claim(&args.out, if args.joints { "joints.json" } else { "bench.json" })?;
    if args.joints {
        return joints(session, args, &suite, &settings);
    }
    let synth_config = synth::config(&args.synth, args.recording_seed, true)?;
    let build_config = settings;
    let before: Option<Vec<Evaluation>> = args.against.as_deref().map(earlier).transpose()?;
    let mut evaluations: Vec<Evaluation> = Vec::new();
    for Named { argument, name } in &suite {
        session.ui.say(&format!("== {name}"));
        let (recording, run) = (args.out.join("recordings").join(name), args.out.join("runs").join(name));
        match one(session, argument, &recording, &run, &synth_config, &build_config) {
            Ok(evaluation) => {
                session.ui.say(&table::detail(&evaluation));
                evaluations.push(evaluation);
            }
            Err(failure) if failure.cancelled => return Err(failure),
            // One broken object must not hide the others' figures.
            Err(failure) => session.ui.complain(&failure),
        }
        if args.tidy {
            tidy(&session.host(), &recording);
        }
    }
    let text = table::overview(&evaluations);
    session.ui.say(&format!("\n{text}"));
    write_json(&args.out.join("bench.json"), &evaluations)?;
    let path = args.out.join("bench.md");
    write_whole(&path, text.as_bytes()).map_err(Failure::io(&path))?;
    session.answer(&evaluations)?;
    let mut outcome = if evaluations.len() < suite.len() { Outcome::UnderBar } else { Outcome::Done };
    if let Some(before) = &before {
        let worse = compare(before, &evaluations);
        worse.iter().for_each(|w| session.ui.say(&format!("worse: {w}")));
        if !worse.is_empty() {
            outcome = Outcome::UnderBar;
        }
    }
    Ok(outcome)
}

/// The table of an earlier bench.
fn earlier(file: &Path) -> Result<Vec<Evaluation>> {
    let hint = "give the bench.json of an earlier bench";
    let text = std::fs::read(file)
        .map_err(|e| Failure::new(format!("cannot read the table: {e}"), file.display().to_string(), hint))?;
    serde_json::from_slice(&text)
        .map_err(|e| Failure::new(format!("not a table of a bench: {e}"), file.display().to_string(), hint))
}

/// Parts and joints alone, in a grid of protocols and seeds.
fn joints(session: &Session, args: &Bench, suite: &[Named], settings: &Config) -> Result<Outcome> {
    let request = Request {
        suite,
        protocols: &args.protocols,
        seeds: args.seeds,
        first_seed: args.recording_seed,
        synth: &synth::config(&args.synth, args.recording_seed, true)?,
        build: settings,
        out: &args.out,
        tidy: args.tidy,
    };
    let (rows, text) = grid::run(&session.host(), &request)?;
    session.ui.say(&format!("\n{text}"));
    write_json(&args.out.join("joints.json"), &rows)?;
    let path = args.out.join("joints.md");
    write_whole(&path, text.as_bytes()).map_err(Failure::io(&path))?;
    session.answer(&rows)?;
    Ok(Outcome::Done)
}

/// Makes sure that the folder is new, empty, or one of ours, and marks it as such before anything
/// is in it.
fn claim(out: &Path, file: &str) -> Result<()> {
    let hint = "give a new folder: hingecast bench SUITE -o FOLDER";
    let before = ["bench.json", "joints.json"].map(|name| out.join(name));
    let ours = |path: &&std::path::PathBuf| {
        let evaluations = || read_json::<Vec<Evaluation>>(path).is_ok();
        path.is_file() && (evaluations() || read_json::<Vec<PartsEvaluation>>(path).is_ok())
    };
    if !before.iter().any(|path| ours(&path)) {
        may_become("bench folder", out, &[], hint)?;
    }
    let mark = out.join(file);
    if !mark.exists() {
        std::fs::create_dir_all(out).map_err(Failure::io(out))?;
        write_json(&mark, &Vec::<Evaluation>::new())?;
    }
    Ok(())
}

fn one(
    session: &Session,
    argument: &str,
    recording: &Path,
    run: &Path,
    synth_config: &SynthConfig,
    build_config: &Config,
) -> Result<Evaluation> {
    record_once(&session.host(), argument, synth_config, recording)?;
    RunFolder::may_become_run(run)?;
    let folder = hingecast::build::build(recording, run, build_config, &session.options(), &session.ui)?;
    report::write(&folder)?;
    evaluate(run, &Truth::folder_of(recording), &session.ui.stage("eval"))
}

/// What got clearly worse: beyond the spread between seeds, not beyond the last digit.
fn compare(before: &[Evaluation], now: &[Evaluation]) -> Vec<String> {
    let mut out = Vec::new();
    for b in before {
        let Some(n) = now.iter().find(|n| n.object == b.object) else { continue };
        let mut check = |what: &str, old: f64, new: f64, slack: f64| {
            if !(new <= old * 1.25 + slack) {
                out.push(format!("{}: {what} {old:.4} -> {new:.4}", b.object));
            }
        };
        check("axis deg", b.axis_max(), n.axis_max(), 0.05);
        check("pivot", b.pivot_max().unwrap_or(0.0), n.pivot_max().unwrap_or(0.0), 0.001);
        check("depth MAE", b.first_state.depth_mae, n.first_state.depth_mae, 0.0);
        check("seconds", b.build_secs, n.build_secs, 5.0);
        check("memory GB", b.peak_memory_gb, n.peak_memory_gb, 0.1);
        if n.first_state.psnr < b.first_state.psnr - 0.5 {
            out.push(format!("{}: PSNR {:.2} -> {:.2}", b.object, b.first_state.psnr, n.first_state.psnr));
        }
        if b.parts_right() && !n.parts_right() {
            out.push(format!("{}: part count {} -> {}", b.object, b.found_parts, n.found_parts));
        }
    }
    out
}
