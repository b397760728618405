//! `hingecast build`

use super::{Outcome, Session};
use crate::cli::{Build, BuildSettings};
use hingecast::config::{Config, Method};
use hingecast::failure::{Failure, Result};
use hingecast::pipeline::{self, Span, stages};
use hingecast::report;
use hingecast::stage::RunFolder;
use std::path::{Path, PathBuf};

pub fn config(settings: &BuildSettings) -> Result<Config> {
    let mut config = Config::resolve(settings.preset, settings.config.as_deref(), &settings.set)?;
    if let Some(method) = settings.method {
        config.method = method;
    }
    if let Some(seed) = settings.seed {
        config.seed = seed;
    }
    Ok(config)
}

pub fn run_folder(out: Option<&Path>, recording: &Path) -> PathBuf {
    let name = recording.file_name().unwrap_or_else(|| "run".as_ref());
    out.map_or_else(|| Path::new("runs").join(name), Path::to_path_buf)
}

/// Stage names that are not there, and `--from` after `--to`: it would do nothing and say that it is done. Asked
/// before anything is thrown away.
fn refuse_odd_span(args: &Build, method: Method) -> Result<()> {
    let stages = stages(method);
    let refuse = |what: String| {
        Err(Failure::new(what, "--from / --to", format!("the stages are, in order: {}", stages.join(", "))))
    };
    let place = |name: &str| stages.iter().position(|s| *s == name);
    for name in [&args.from, &args.to].into_iter().flatten() {
        if place(name).is_none() {
            return refuse(format!("no stage '{name}'"));
        }
    }
    match (&args.from, &args.to) {
        (Some(from), Some(to)) if place(from) > place(to) => {
            refuse(format!("'{from}' comes after '{to}': nothing is left to do"))
        }
        _ => Ok(()),
    }
}

pub fn run(session: &Session, args: &Build) -> Result<Outcome> {
    let out = run_folder(args.out.as_deref(), &args.recording);
    RunFolder::may_become_run(&out)?;
    let config = config(&args.settings)?;
    refuse_odd_span(args, config.method)?;
    let span = Span { from: args.from.clone(), to: args.to.clone(), fresh: args.fresh };
    let run = pipeline::build(&args.recording, &out, &config, session.threads, &span, &session.ui)?;
    if let Some(to) = args.to.as_deref().filter(|to| *to != "twin") {
        session.ui.say(&format!("stopped after {to}, as asked; run again without --to for the twin"));
        session.answer(&serde_json::json!({ "run": run.root, "to": to, "secs": run.record.total_secs() }));
        return Ok(Outcome::Done);
    }
    let page = report::write(&run)?;
    session.ui.say(&format!(
        "built in {:.0} s, peak memory {:.2} GB",
        run.record.total_secs(),
        run.record.peak_memory() as f64 / 1e9
    ));
    for doubt in &run.record.doubts {
        session.ui.say(&format!("doubt: {doubt}"));
    }
    session.ui.say(&format!("twin:   {}\nreport: {}", run.folder("twin").display(), page.display()));
    session.answer(&serde_json::json!({
        "run": run.root, "twin": run.folder("twin"), "report": page, "secs": run.record.total_secs(),
        "peak_memory": run.record.peak_memory(), "doubts": run.record.doubts,
    }));
    Ok(if args.strict && !run.record.doubts.is_empty() { Outcome::UnderBar } else { Outcome::Done })
}
