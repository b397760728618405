//! One file per verb; each answers an [`Outcome`].

mod bench;
mod build;
mod check;
mod demo;
#[cfg(feature = "mujoco")]
mod demos;
mod doctor;
mod eval;
#[cfg(feature = "mujoco")]
mod experiment;
mod import;
mod import_object;
mod mask;
#[cfg(feature = "mujoco")]
mod rollout;
mod synth;
mod table;
mod train;

use crate::cli::{Cli, Verb};
use crate::ui::{Ui, answer};
use hingecast::failure::{Failure, Result};
use hingecast::{report, stage::RunFolder};
use std::path::Path;

/// A source to read: a typo in its name is no unknown layout.
fn there(source: &Path) -> Result<()> {
    let hint = "check the path: a folder as the app exports it, a .zip or a .r3d";
    let missing = || Failure::new("there is no such file or folder", source.display().to_string(), hint);
    if source.exists() { Ok(()) } else { Err(missing()) }
}

pub enum Outcome {
    Done,
    /// A bar that was asked for was missed.
    UnderBar,
}

/// What every verb gets besides its own flags.
pub struct Session {
    pub ui: Ui,
    pub json: bool,
    pub threads: usize,
}

impl Session {
    /// What studies run on.
    pub fn host(&self) -> hingecast_study::host::Host<'_> {
        hingecast_study::host::Host { watcher: &self.ui, threads: self.threads }
    }

    /// How builds run.
    pub fn options(&self) -> hingecast::build::Options {
        hingecast::build::Options { threads: self.threads, ..Default::default() }
    }

    /// The machine's answer, when it was asked for.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn answer(&self, value: &impl serde::Serialize) -> Result<()> {
        if self.json { answer(&serde_json::to_string(value).expect("plain data")) } else { Ok(()) }
    }
}

pub fn run(cli: &Cli) -> Result<Outcome> {
    let threads = hingecast::build::threads(cli.threads.unwrap_or(0))?;
    // Fails only when a pool is there already: then that one serves.
    let _ = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
    let session = Session { ui: Ui::new(cli.quiet), json: cli.json, threads };
    match &cli.verb {
        Verb::Demo(args) => demo::run(&session, args),
        Verb::Synth(args) => synth::run(&session, args),
        Verb::Import(args) => args.sources.iter().try_for_each(|s| there(s)).and_then(|()| import::run(&session, args)),
        Verb::ImportObject(args) => import_object::run(&session, args),
        Verb::Mask(args) => mask::run(&session, args),
        Verb::Check(args) => check::run(&session, args),
        Verb::Build(args) => build::run(&session, args),
        Verb::Eval(args) => eval::run(&session, args),
        Verb::Bench(args) => bench::run(&session, args),
        Verb::Report(args) => {
            let path = report::write(&RunFolder::open(&args.run)?)?;
            session.ui.say(&format!("report: {}", path.display()));
            session.answer(&serde_json::json!({ "report": path }))?;
            Ok(Outcome::Done)
        }
        Verb::View(args) => {
            let (twin, place) = hingecast::view::place(&args.path)?;
            let page = args.out.clone().unwrap_or(place);
            hingecast::view::write(&twin, &page)?;
            session.ui.say(&format!("page: {}", page.display()));
            session.answer(&serde_json::json!({ "page": page }))?;
            Ok(Outcome::Done)
        }
        #[cfg(feature = "mujoco")]
        Verb::Demos(args) => demos::run(&session, args),
        #[cfg(not(feature = "mujoco"))]
        Verb::Demos(_) => Err(without_mujoco("demos")),
        #[cfg(feature = "mujoco")]
        Verb::Rollout(args) => rollout::run(&session, args),
        #[cfg(not(feature = "mujoco"))]
        Verb::Rollout(_) => Err(without_mujoco("rollout")),
        #[cfg(feature = "mujoco")]
        Verb::Experiment(args) => experiment::run(&session, args),
        #[cfg(not(feature = "mujoco"))]
        Verb::Experiment(_) => Err(without_mujoco("experiment")),
        Verb::Train(args) => train::run(&session, args),
        Verb::Doctor => doctor::run(&session),
    }
}

#[cfg(not(feature = "mujoco"))]
fn without_mujoco(verb: &str) -> Failure {
    let hint = "scripts/fetch_mujoco.sh, then build with default features";
    Failure::new("this hingecast was built without the simulator", format!("hingecast {verb}"), hint)
}
