//! `hingecast build`

use super::{Outcome, Session};
use crate::cli::{Build, BuildSettings};
use hingecast::build::{Options, Stage};
use hingecast::config::{Config, Method};
use hingecast::failure::{Failure, Result};
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

/// What to run. Stage names that are not there, and `--from` after `--to` (it would do nothing and
/// say that it is done), are refused before anything is thrown away.
fn options(session: &Session, args: &Build, method: Method) -> Result<Options> {
    let named = |name: &Option<String>| name.as_deref().map(|n| Stage::named(n, method)).transpose();
    let (from, to) = (named(&args.from)?, named(&args.to)?);
    let place = |stage: Stage| Stage::all(method).iter().position(|s| *s == stage);
    if let (Some(first), Some(last)) = (from, to)
        && place(first) > place(last)
    {
        let names: Vec<&str> = Stage::all(method).iter().map(|s| s.name()).collect();
        return Err(Failure::new(
            format!("'{}' comes after '{}': nothing is left to do", first.name(), last.name()),
            "--from / --to",
            format!("the stages are, in order: {}", names.join(", ")),
        ));
    }
    Ok(Options { from, to, fresh: args.fresh, ..session.options() })
}

pub fn run(session: &Session, args: &Build) -> Result<Outcome> {
    let out = run_folder(args.out.as_deref(), &args.recording);
    RunFolder::may_become_run(&out)?;
    let config = config(&args.settings)?;
    let options = options(session, args, config.method)?;
    let run = hingecast::build::build(&args.recording, &out, &config, &options, &session.ui)?;
    if let Some(to) = args.to.as_deref().filter(|to| *to != "twin") {
        session.ui.say(&format!("stopped after {to}, as asked; run again without --to for the twin"));
        session.answer(&serde_json::json!({ "run": run.root, "to": to, "secs": run.record.total_secs() }))?;
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
    }))?;
    Ok(if args.strict && !run.record.doubts.is_empty() { Outcome::UnderBar } else { Outcome::Done })
}
