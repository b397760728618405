//! `hingecast demo`: record, build, evaluate, report, in one go and a few minutes.

use super::{Outcome, Session, table};
use crate::cli::Demo;
use hingecast::config::{Config, Preset};
use hingecast::eval::evaluate;
use hingecast::failure::{Failure, Result};
use hingecast::report;
use hingecast::stage::RunFolder;
use hingecast_capture::Truth;
use hingecast_capture::synth::SynthConfig;
use hingecast_study::suite::{name_of, record};
use std::path::Path;

pub fn run(session: &Session, args: &Demo) -> Result<Outcome> {
    let out = args.out.clone().unwrap_or_else(|| Path::new("runs/demo").join(name_of(&args.object)));
    let (recording, run) = (out.join("recording"), out.join("run"));
    let entries = || std::fs::read_dir(&out).into_iter().flatten().flatten();
    if entries().any(|e| !["recording", "recording.truth", "run"].iter().any(|name| e.file_name() == *name)) {
        let hint = "give a new folder: hingecast demo OBJECT -o FOLDER";
        return Err(Failure::new("the demo's folder holds something else", out.display().to_string(), hint));
    }
    RunFolder::may_become_run(&run)?;
    if !recording.join("transforms.json").exists() {
        let config = SynthConfig { views: 30, size: 192, ..Default::default() };
        record(&session.host(), &args.object, &config, &recording)?;
    }
    let config = Config::preset(Preset::Fast);
    let folder = hingecast::build::build(&recording, &run, &config, &session.options(), &session.ui)?;
    let page = report::write(&folder)?;
    let evaluation = evaluate(&run, &Truth::folder_of(&recording), &session.ui.stage("eval"))?;
    session.ui.say(&format!("\n{}", table::detail(&evaluation)));
    let twin = folder.folder("twin");
    session.ui.say(&format!("\nreport: {}\ntwin:   {}", page.display(), twin.display()));
    session.ui.say(&format!("look:   python3 -m mujoco.viewer --mjcf={}", twin.join("robot.xml").display()));
    session.answer(&evaluation)?;
    Ok(Outcome::Done)
}
