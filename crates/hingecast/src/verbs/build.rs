//! `hingecast build`

use super::{Outcome, Session};
use crate::cli::{Build, BuildSettings};
use hingecast::config::Config;
use hingecast::failure::Result;
use hingecast::pipeline::{self, Span};
use hingecast::report;
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

pub fn run(session: &Session, args: &Build) -> Result<Outcome> {
    let out = run_folder(args.out.as_deref(), &args.recording);
    let span = Span { from: args.from.clone(), to: args.to.clone(), fresh: args.fresh };
    let run = pipeline::build(&args.recording, &out, &config(&args.settings)?, session.threads, &span, &session.ui)?;
    if args.to.as_deref().is_some_and(|to| to != "twin") {
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
