//! `hingecast build`: the stages from a recording to a twin, each kept while its stamp fits.

pub mod joints;
pub mod labelled;
pub mod labels;
pub mod motion;
pub mod overrides;
pub mod placed;
pub mod screw;
pub mod splat;
pub mod surface;
pub mod twin;

use crate::config::{Config, Method};
use crate::failure::{Failure, Result};
use crate::stage::{RunFolder, erased, stamp};
use crate::ui::Ui;
use hingecast_articulate::MOST_STATES;
use hingecast_capture::{Recording, Split, View, ViewCache};
use hingecast_geom::Pose;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// Stages in order; the folder of each bears its name.
pub fn stages(method: Method) -> &'static [&'static str] {
    match method {
        Method::Screw => &["parts", "splat", "joints", "twin"],
        Method::Track => &["splat", "motion", "parts", "joints", "twin"],
    }
}

/// What every stage may look at.
pub struct Context<'a> {
    pub recording: &'a Recording,
    pub cache: &'a ViewCache,
    pub config: &'a Config,
    pub threads: usize,
    pub ui: &'a Ui,
    /// Colour behind the object, and whether the pictures really show it.
    pub background: ([f32; 3], bool),
    /// camera_from_world where the depth corrected it, by frame.
    pub cameras: BTreeMap<usize, Pose>,
}

impl Context<'_> {
    /// A frame's pixels with its corrected camera.
    pub fn view(&self, frame: usize) -> Result<View> {
        let mut view = Arc::unwrap_or_clone(self.cache.get(frame)?);
        if let Some(pose) = self.cameras.get(&frame) {
            view.camera.camera_from_world = *pose;
        }
        Ok(view)
    }
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
    if config.method == Method::Screw && recording.n_states > MOST_STATES {
        return Err(Failure::new(
            format!(
                "the recording has {} states, and the method screw takes at most {MOST_STATES}",
                recording.n_states
            ),
            recording.root.join("transforms.json").display().to_string(),
            "leave out states between the others, or build with --method track",
        ));
    }
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
    let mut context =
        Context { recording: &recording, cache: &cache, config, threads, ui, background, cameras: BTreeMap::new() };
    let stages = stages(config.method);
    let stamps = stamps(config, &folder.record.fingerprint);
    let index = |name: &Option<String>, default: usize| {
        name.as_ref().map_or(Ok(default), |n| {
            stages.iter().position(|s| s == n).ok_or_else(|| {
                Failure::new(format!("no stage '{n}'"), "--from / --to", format!("one of {}", stages.join(", ")))
            })
        })
    };
    let (from, to) = (index(&span.from, stages.len())?, index(&span.to, stages.len() - 1)?);
    if !folder.is_done(stages[0], &stamps[0]) {
        // Another method's stages would stand in the way.
        folder.record.stages.clear();
    }
    for (i, stage) in stages.iter().enumerate().take(to + 1) {
        if i < from && folder.is_done(stage, &stamps[i]) {
            ui.say(&format!("{stage:<7} kept"));
        } else {
            if i >= from {
                // Asked to redo: forget this stage's checkpoint.
                let path = folder.folder(stage).join("stamp");
                let _ = std::fs::remove_file(path);
            }
            let start = Instant::now();
            let at = folder.begin(stage, &stamps[i])?;
            match (config.method, *stage) {
                (Method::Screw, "parts") => screw::run_parts(&context, &at)?,
                (Method::Screw, "splat") => placed::run(&context, run, &at)?,
                (Method::Screw, "joints") => screw::run_joints(&context, run, &at)?,
                (Method::Track, "splat") => splat::run(&context, &at)?,
                (Method::Track, "motion") => motion::run(&context, run, &at)?,
                (Method::Track, "parts") => joints::run_parts(&context, run, &at)?,
                (Method::Track, "joints") => joints::run_joints(&context, run, &at)?,
                _ => folder.record.doubts = twin::run(&context, run)?,
            }
            let secs = start.elapsed().as_secs_f64();
            folder.finish(stage, &stamps[i], secs)?;
            ui.say(&format!("{stage:<7} {secs:.1} s"));
        }
        if config.method == Method::Screw {
            match *stage {
                "parts" => context.cameras = screw::load(run)?.cameras,
                "splat" => placed::load(run)?.correct(&recording, &mut context.cameras),
                _ => {}
            }
        }
    }
    Ok(folder)
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
        let what = format!("frames[{i}] has no depth, and parts are found by depth");
        return Err(Failure::new(what, place, "add depth_file_path to every frame"));
    }
    Ok(())
}
