//! `hingecast build`

use super::{Outcome, Session};
use crate::cli::{Build, BuildSettings};
use hingecast::build::{Options, Stage};
use hingecast::config::{Config, Method, difference};
use hingecast::failure::{Failure, Result};
use hingecast::report;
use hingecast::stage::RunFolder;
use std::path::{Path, PathBuf};
use std::time::Instant;

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
    Ok(Options { from, to, fresh: args.fresh, force: args.force, ..session.options() })
}

/// The settings of the run that is there, as its file has them.
fn settings_of(run: &Path) -> Option<String> {
    RunFolder::open(run).ok()?;
    std::fs::read_to_string(run.join("config.toml")).ok()
}

/// Seconds of this build, and those of all stages where some were kept from earlier ones.
fn took(secs: f64, all: f64) -> String {
    // Two digits or whole seconds.
    let round = |s: f64| if s < 9.95 { format!("{s:.1} s") } else { format!("{s:.0} s") };
    if all > secs { format!("{} ({} with the stages of earlier builds)", round(secs), round(all)) } else { round(secs) }
}

pub fn run(session: &Session, args: &Build) -> Result<Outcome> {
    let out = run_folder(args.out.as_deref(), &args.recording);
    RunFolder::may_become_run(&out)?;
    let config = config(&args.settings)?;
    let options = options(session, args, config.method)?;
    let before = settings_of(&out);
    if let Some(line) = before.and_then(|before| difference::sentence(&before, &config)) {
        session.ui.say(&line);
    }
    let start = Instant::now();
    let run = hingecast::build::build(&args.recording, &out, &config, &options, &session.ui)?;
    if let Some(to) = args.to.as_deref().filter(|to| *to != "twin") {
        session.ui.say(&format!("stopped after {to}, as asked; run again without --to for the twin"));
        session.answer(&serde_json::json!({ "run": run.root, "to": to, "secs": run.record.total_secs() }))?;
        return Ok(Outcome::Done);
    }
    let secs = start.elapsed().as_secs_f64();
    let page = report::write(&run)?;
    let memory = run.record.peak_memory() as f64 / 1e9;
    session.ui.say(&format!("built in {}, peak memory {memory:.2} GB", took(secs, run.record.total_secs())));
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

#[cfg(test)]
mod tests {
    use super::*;

    /// The sum of all stages was called the time of the build, also of those that were kept.
    #[test]
    fn kept_stages_are_told_apart() {
        assert_eq!(took(9.93, 17.2), "9.9 s (17 s with the stages of earlier builds)");
        assert_eq!(took(17.6, 17.2), "18 s");
    }
}
