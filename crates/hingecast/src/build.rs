//! From a recording to a twin: the driver of the stages, each kept while its stamp fits.

use crate::artifacts::{Made, samples};
use crate::config::{Config, Method};
use crate::failure::{Failure, Result};
use crate::run_files::RunLock;
use crate::stage::{RunFolder, erased, stamp};
use crate::stages::inputs::Inputs;
use crate::stages::{self, classical, targets};
use crate::watcher::Watcher;
use hingecast_articulate::MOST_STATES;
use hingecast_capture::{Recording, Split, ViewCache};
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

/// A step of a build; its folder in the run bears its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// What moves, and how.
    Parts,
    /// Gaussians.
    Splat,
    /// Gaussians followed through the states; `--method track` alone.
    Motion,
    /// The tree with a person's corrections.
    Joints,
    /// Meshes, collision shapes, URDF, MJCF.
    Twin,
}

impl Stage {
    /// The stages of a method, in order.
    pub fn all(method: Method) -> &'static [Self] {
        match method {
            Method::Screw => &[Self::Parts, Self::Splat, Self::Joints, Self::Twin],
            Method::Track => &[Self::Splat, Self::Motion, Self::Parts, Self::Joints, Self::Twin],
        }
    }

    /// As on the command line and in the run folder.
    pub fn name(self) -> &'static str {
        match self {
            Self::Parts => "parts",
            Self::Splat => "splat",
            Self::Motion => "motion",
            Self::Joints => "joints",
            Self::Twin => "twin",
        }
    }

    /// The stage of a method by its name.
    ///
    /// # Errors
    /// The method has no such stage.
    pub fn named(name: &str, method: Method) -> Result<Self> {
        let all = Self::all(method);
        all.iter().find(|s| s.name() == name).copied().ok_or_else(|| {
            let names: Vec<&str> = all.iter().map(|s| s.name()).collect();
            let hint = format!("the stages are, in order: {}", names.join(", "));
            Failure::new(format!("no stage '{name}'"), "--from / --to", hint)
        })
    }
}

/// Also on small machines: scripts that were written on large ones shall run.
const MOST_THREADS: usize = 256;

/// Which stages to run, and on how much of the machine.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// First stage to redo even if it is done; the first that is missing if `None`.
    pub from: Option<Stage>,
    /// Last stage to run; all if `None`.
    pub to: Option<Stage>,
    /// Throw what an existing run has made away first.
    pub fresh: bool,
    /// Build also from a recording of which [`check`](crate::prepare::check()) says that it is in vain.
    pub force: bool,
    /// Worker threads of this build, in a pool of its own; 0 = as many as the machine has cores.
    /// The results do not depend on it.
    pub threads: usize,
}

/// Runs what is missing. Answers the finished run folder.
///
/// # Errors
/// A recording that cannot be built from, a folder that holds something else, disk trouble, the
/// watcher's wish to stop.
pub fn build(
    recording: &Path,
    run: &Path,
    config: &Config,
    options: &Options,
    watcher: &dyn Watcher,
) -> Result<RunFolder> {
    let threads = threads(options.threads)?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(|e| {
        let hint = "fewer threads: the machine's cores are enough";
        Failure::new(format!("threads cannot be started: {e}"), format!("threads = {threads}"), hint)
    })?;
    pool.install(|| build_with(recording, run, config, options, threads, watcher))
}

/// How many worker threads `asked` means: 0 = as many as there are cores.
///
/// # Errors
/// More than a machine is likely to start; where it cannot, the process would end without a word.
pub fn threads(asked: usize) -> Result<usize> {
    let cores = std::thread::available_parallelism().map_or(2, |n| n.get());
    let most = (4 * cores).max(MOST_THREADS);
    if asked > most {
        let hint = format!("at most {most}; this machine has {cores} cores, and more threads than cores gain nothing");
        return Err(Failure::new("more threads than this machine can use", format!("--threads {asked}"), hint));
    }
    Ok(if asked == 0 { cores } else { asked })
}

fn build_with(
    recording: &Path,
    run: &Path,
    config: &Config,
    options: &Options,
    threads: usize,
    watcher: &dyn Watcher,
) -> Result<RunFolder> {
    let mut recording = Recording::open(recording)?;
    refuse_hopeless(&recording, config.method)?;
    RunFolder::may_become_run(run)?;
    std::fs::create_dir_all(run).map_err(Failure::io(run))?;
    let _alone = RunLock::take(run)?;
    let mut folder = RunFolder::create(run)?;
    if options.fresh {
        folder.empty()?;
    }
    folder.record.version = env!("CARGO_PKG_VERSION").to_string();
    let whole = std::fs::canonicalize(&recording.root).unwrap_or_else(|_| recording.root.clone());
    // JSON holds it: a link may lead to a name that is not UTF-8.
    folder.record.recording = whole.to_string_lossy().into_owned().into();
    folder.record.fingerprint = recording.fingerprint()?;
    folder.record.threads = threads;
    let text = toml::to_string_pretty(config).expect("a config is a table");
    let path = run.join("config.toml");
    hingecast_geom::staging::write_whole(&path, text.as_bytes()).map_err(Failure::io(&path))?;

    let (prepared, doubts) =
        crate::prepare::for_build(&mut recording, &mut folder, (config.seed, options.force), watcher)?;
    let doubts = recording.doubts.iter().cloned().chain(doubts).collect();
    let cache = ViewCache::new(&recording, config.memory_mb << 20);
    let background = targets::background(&recording, &cache)?;
    let mut inputs =
        Inputs { recording: &recording, cache: &cache, config, threads, background, cameras: BTreeMap::new(), doubts };
    let mut made = Made::new(run.to_path_buf());
    let all = Stage::all(config.method);
    let stamps = stamps(config, &format!("{}{prepared}", folder.record.fingerprint));
    let place = |stage: Stage| all.iter().position(|s| *s == stage).unwrap_or(all.len());
    let from = options.from.map_or(all.len(), place);
    let to = options.to.map_or(all.len() - 1, place);
    if !folder.is_done(all[0].name(), &stamps[0]) {
        // Another method's stages would stand in the way.
        folder.record.stages.retain(|s| s.name == crate::prepare::STAGE);
    }
    for (i, stage) in all.iter().enumerate().take(to + 1) {
        let name = stage.name();
        if i < from && folder.is_done(name, &stamps[i]) {
            watcher.say(&format!("{name:<7} kept"));
        } else {
            let start = Instant::now();
            // Asked to redo: then its checkpoint is forgotten, too.
            let at = folder.begin(name, &stamps[i], i >= from)?;
            let progress = watcher.stage(name);
            run_stage(*stage, &inputs, &mut made, &mut folder, &at, &progress)?;
            drop(progress);
            let secs = start.elapsed().as_secs_f64();
            folder.finish(name, &stamps[i], secs)?;
            watcher.say(&format!("{name:<7} {secs:.1} s"));
        }
        match (config.method, stage) {
            (Method::Screw, Stage::Parts) => inputs.cameras.clone_from(&made.parts()?.cameras),
            (Method::Screw, Stage::Splat) => {
                if let Some(placed) = &made.splats()?.placed {
                    placed.correct(&recording, &mut inputs.cameras);
                }
            }
            _ => {}
        }
    }
    Ok(folder)
}

/// Runs one stage, writes its artifact into `at`, and remembers it.
fn run_stage(
    stage: Stage,
    inputs: &Inputs,
    made: &mut Made,
    folder: &mut RunFolder,
    at: &Path,
    progress: &hingecast_geom::Progress,
) -> Result<()> {
    match (inputs.config.method, stage) {
        (Method::Screw, Stage::Parts) => {
            let (parts, labelled, trace) = stages::parts::run(inputs, progress)?;
            samples::write(at, &labelled)?;
            made.keep_parts(parts.write(at, &trace)?, labelled);
        }
        (Method::Screw, Stage::Splat) => {
            let splats = stages::splat::run(inputs, made.parts()?, made.samples()?, at, progress)?;
            made.keep_splats(splats.write(at)?);
        }
        (Method::Screw, Stage::Joints) => {
            let joints = stages::joints::run(made.parts()?, made.splats()?, &inputs.config.joint)?;
            made.keep_joints(joints.write(at)?);
        }
        (Method::Track, Stage::Splat) => {
            let splats = classical::splat::run(inputs, at, progress)?;
            made.keep_splats(splats.write(at)?);
        }
        (_, Stage::Motion) => classical::motion::run(inputs, made.splats()?, at, progress)?,
        (Method::Track, Stage::Parts) => {
            let groups = classical::parts::run(inputs, made.splats()?, &folder.folder("motion"), progress)?;
            made.keep_groups(groups.write(at)?);
        }
        (Method::Track, Stage::Joints) => {
            let mut joints = classical::joints::run(inputs, made.splats()?, made.groups()?, progress)?;
            crate::overrides::apply(&mut joints, &inputs.config.joint, &made.splats()?.extent)?;
            made.keep_joints(joints.write(at)?);
        }
        (method, Stage::Twin) => {
            let surface = match method {
                Method::Screw => Some((&made.samples()?[..], made.parts()?.voxel)),
                Method::Track => None,
            };
            let (splats, joints) = (made.splats()?, made.joints()?);
            folder.record.doubts = stages::twin::run(inputs, splats, surface, joints, at, progress)?;
        }
    }
    Ok(())
}

/// The stages' stamps. Each holds the one before: a change upstream redoes everything after it.
fn stamps(c: &Config, fingerprint: &str) -> Vec<String> {
    let chain = |first: String, rest: &[&dyn erased::Json]| {
        let mut out = vec![first];
        for own in rest {
            let before = out.last().cloned().unwrap_or_default();
            out.push(stamp(&[&before, &own.json()]));
        }
        out
    };
    match c.method {
        Method::Screw => {
            let first = stamp(&[&fingerprint, &c.seed, &c.method, &c.screw, &c.passes]);
            chain(first, &[&c.fit, &c.joint, &c.twin])
        }
        Method::Track => {
            let first = stamp(&[&fingerprint, &c.seed, &c.method, &c.fit]);
            chain(first, &[&c.track, &c.parts, &(&c.joints, &c.joint), &c.twin])
        }
    }
}

/// Recordings that no method can build from are refused before any work.
fn refuse_hopeless(recording: &Recording, method: Method) -> Result<()> {
    let place = recording.root.join("transforms.json").display().to_string();
    if recording.n_states < 2 {
        let what = format!("the recording has {} state: nothing moves", recording.n_states);
        return Err(Failure::new(
            what,
            place,
            "give every frame its \"state\": 0 before the joint moved, 1 after, ...",
        ));
    }
    for state in 0..recording.n_states {
        let n = recording.frames_of(state, Split::Train).len();
        // The other states of a film are a picture or a few.
        let least = if recording.is_filmed(state) { 1 } else { 3 };
        if n < least {
            let what = format!("state {state} has {n} usable training views");
            return Err(Failure::new(what, place, "record at least 3 (better 20) views of every state"));
        }
    }
    if let Some(i) = recording.frames.iter().position(|f| f.depth.is_none() && f.split == Split::Train) {
        let what = format!("frames[{i}] has no depth, and parts are found by depth");
        return Err(Failure::new(what, place, "add depth_file_path to every frame"));
    }
    if method == Method::Screw && recording.n_states > MOST_STATES {
        let what = format!(
            "the recording has {} states, and the method screw takes at most {MOST_STATES}",
            recording.n_states
        );
        let hint = "leave out states between the others, or build with --method track";
        return Err(Failure::new(what, place, hint));
    }
    Ok(())
}
