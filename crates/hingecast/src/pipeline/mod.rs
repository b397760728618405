//! `hingecast build`: the stages from a recording to a twin, each kept while its stamp fits.

pub mod joints;
pub mod labels;
pub mod motion;
pub mod splat;
pub mod surface;
pub mod twin;

use crate::config::Config;
use crate::failure::{Failure, Result};
use crate::stage::{RunFolder, stamp};
use crate::ui::Ui;
use hingecast_capture::{Recording, Split, ViewCache};
use std::path::Path;
use std::time::Instant;

/// Stages in order; the folder of each bears its name.
pub const STAGES: [&str; 5] = ["splat", "motion", "parts", "joints", "twin"];

/// What every stage may look at.
pub struct Context<'a> {
    pub recording: &'a Recording,
    pub cache: &'a ViewCache,
    pub config: &'a Config,
    pub threads: usize,
    pub ui: &'a Ui,
    /// Colour behind the object, and whether the pictures really show it.
    pub background: ([f32; 3], bool),
}

/// Which stages to run.
#[derive(Clone, Debug, Default)]
pub struct Span {
    pub from: Option<String>,
    pub to: Option<String>,
    pub fresh: bool,
}

/// Runs what is missing. Answers the finished run folder.
///
/// # Errors
/// A recording that cannot be built from, disk trouble, Ctrl-C.
pub fn build(recording: &Path, run: &Path, config: &Config, threads: usize, span: &Span, ui: &Ui) -> Result<RunFolder> {
    let recording = Recording::open(recording)?;
    refuse_hopeless(&recording)?;
    if span.fresh && run.exists() {
        std::fs::remove_dir_all(run).map_err(Failure::io(run))?;
    }
    let mut folder = RunFolder::create(run)?;
    folder.record.version = env!("CARGO_PKG_VERSION").to_string();
    folder.record.recording = std::fs::canonicalize(&recording.root).unwrap_or_else(|_| recording.root.clone());
    folder.record.fingerprint = recording.fingerprint()?;
    folder.record.threads = threads;
    let text = toml::to_string_pretty(config).expect("a config is a table");
    let path = run.join("config.toml");
    hingecast_geom::ply::write_whole(&path, text.as_bytes()).map_err(Failure::io(&path))?;

    let cache = ViewCache::new(&recording, config.memory_mb << 20);
    let background = splat::background(&recording, &cache)?;
    let context = Context { recording: &recording, cache: &cache, config, threads, ui, background };
    let fingerprint = folder.record.fingerprint.clone();
    let seed = config.seed;
    let c = config;
    // Each stamp holds the one before: a change upstream redoes everything after it.
    let s0 = stamp(&[&fingerprint, &seed, &c.fit]);
    let s1 = stamp(&[&s0, &c.method, &c.track]);
    let s2 = stamp(&[&s1, &c.parts]);
    let s3 = stamp(&[&s2, &c.joints]);
    let s4 = stamp(&[&s3, &c.twin]);
    let stamps = [s0, s1, s2, s3, s4];

    let index = |name: &Option<String>, default: usize| {
        name.as_ref().map_or(Ok(default), |n| {
            STAGES.iter().position(|s| s == n).ok_or_else(|| {
                Failure::new(format!("no stage '{n}'"), "--from / --to", format!("one of {}", STAGES.join(", ")))
            })
        })
    };
    let (from, to) = (index(&span.from, STAGES.len())?, index(&span.to, STAGES.len() - 1)?);
    for (i, stage) in STAGES.iter().enumerate().take(to + 1) {
        if i < from && folder.is_done(stage, &stamps[i]) {
            ui.say(&format!("{stage:<7} kept"));
            continue;
        }
        if i >= from {
            // Asked to redo: forget this stage's checkpoint.
            let path = folder.folder(stage).join("stamp");
            let _ = std::fs::remove_file(path);
        }
        let start = Instant::now();
        let at = folder.begin(stage, &stamps[i])?;
        match *stage {
            "splat" => splat::run(&context, &at)?,
            "motion" => motion::run(&context, run, &at)?,
            "parts" => joints::run_parts(&context, run, &at)?,
            "joints" => joints::run_joints(&context, run, &at)?,
            _ => folder.record.doubts = twin::run(&context, run)?,
        }
        let secs = start.elapsed().as_secs_f64();
        folder.finish(stage, &stamps[i], secs)?;
        ui.say(&format!("{stage:<7} {secs:.1} s"));
    }
    Ok(folder)
}

/// Recordings that no method can build from are refused before any work.
fn refuse_hopeless(recording: &Recording) -> Result<()> {
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
        if n < 3 {
            let what = format!("state {state} has {n} usable training views");
            return Err(Failure::new(what, place, "record at least 3 (better 20) views of every state"));
        }
    }
    if let Some(i) = recording.frames.iter().position(|f| f.depth.is_none() && f.split == Split::Train) {
        let what = format!("frames[{i}] has no depth, and the method '{}' needs it", "track");
        return Err(Failure::new(what, place, "add depth_file_path to every frame"));
    }
    Ok(())
}
