//! Before parts are sought: states that have a world each are registered, and where there are no
//! masks the object is found.
//!
//! `import` and `hingecast mask` write what was found into the recording; `build` keeps it in the
//! run's folder `prepare/` and leaves the recording alone.

mod examine;
mod film;
mod masks;
mod page;
mod places;
mod raw_depths;
mod sheet;
mod words;

use crate::failure::{Failure, Result};
use crate::stage::{RunFolder, stamp, write_json};
use crate::watcher::Watcher;
use hingecast_capture::{Recording, Split};
use hingecast_geom::{Pose, Progress};
use hingecast_prepare::{MaskReport, Registration};
use masks::{Pixels, restore_pixels};
use places::{apply, level, put_cameras, take_pushes_out};
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::time::Instant;

pub use examine::check;
pub use film::{FILM_STATES, Film, HandReport, film, film_sentences};
pub use hingecast_prepare::Wanted;
pub use masks::{find_masks, place_at};
pub use page::write_page;
pub use places::{register, settle};
pub use sheet::{SHEET_CAPTION, write_contact_sheet};
pub use words::{registration_doubts, sentence};

/// The name of the step, and of its folder in a run.
pub const STAGE: &str = "prepare";
/// With at least this share of the pixels known, pictures show a room.
const FILLED: f64 = 0.6;

/// `prepare/prepare.json`.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Prepared {
    /// Of every training frame, in order: camera_from_world where tracking had drifted, as all that a
    /// scan shows corrects it. Empty: the views of each scan agreed.
    #[serde(default)]
    pub cameras: Vec<Pose>,
    /// Of every state: the frame of state 0 from the recorded one, where the states share a frame but for
    /// what tracking drifted from scan to scan, as the room shows it. Empty: they agree.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub level: Vec<Pose>,
    /// Whether the room around the object holds all cameras: the search for parts lets them be.
    #[serde(default)]
    pub settled: bool,
    /// How the states' worlds lie to each other, where each had its own.
    pub registration: Option<Registration>,
    /// How the object was found, where there were no masks. Its masks lie beside.
    pub masks: Option<MaskReport>,
    /// The hands in a film. Their pixels lie beside.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hands: Option<HandReport>,
    /// Of every state: the frame of the object as state 0 has it, from the recording's; where it
    /// was pushed as a whole. Empty: never.
    #[serde(default)]
    pub pushes: Vec<Pose>,
    /// What a person should look at before believing the twin.
    #[serde(default)]
    pub doubts: Vec<String>,
}

impl Prepared {
    /// Whether the recording was as it should be.
    fn is_nothing(&self) -> bool {
        let placed = self.cameras.is_empty() && self.level.is_empty() && self.registration.is_none();
        placed && self.pushes.is_empty() && self.masks.is_none() && self.hands.is_none()
    }
}

/// What a recording lacks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Needs {
    /// Its states have a world each.
    pub registration: bool,
    /// It has no masks, and shows a room.
    pub masks: bool,
    /// Its depth shows the room around the object.
    pub room: bool,
}

impl Needs {
    /// What `recording` lacks.
    ///
    /// # Errors
    /// When its first picture cannot be read.
    pub fn of(recording: &Recording) -> Result<Self> {
        let masked = recording.frames.iter().any(|f| f.mask.is_some());
        let first = recording.frames_of(0, Split::Train);
        let (mut room, mut all) = (false, false);
        if let Some(&first) = first.first() {
            let view = recording.load(first)?;
            let known = view.depth.iter().filter(|z| **z > 0.0).count() as f64;
            room = known >= FILLED * view.depth.len() as f64;
            all = view.mask.iter().all(|m| *m == 1);
        }
        Ok(Self { registration: !recording.registered, masks: !masked && all && room, room })
    }
}

/// What `build` does before its stages: the stamp of what was done, empty if nothing had to be, and the
/// doubts about it.
pub(crate) fn for_build(
    recording: &mut Recording,
    folder: &mut RunFolder,
    (seed, force): (u64, bool),
    watcher: &dyn Watcher,
) -> Result<(String, Vec<String>)> {
    let own = stamp(&[&folder.record.fingerprint, &seed, &STAGE, &force]);
    let answer = |prepared: Prepared, own: String| match prepared.is_nothing() {
        true => (String::new(), Vec::new()),
        false => (own, prepared.doubts),
    };
    if folder.is_done(STAGE, &own) {
        let prepared = restore(recording, &folder.folder(STAGE))?;
        if !prepared.is_nothing() {
            watcher.say(&format!("{STAGE:<7} kept"));
        }
        return Ok(answer(prepared, own));
    }
    let start = Instant::now();
    let progress = watcher.stage(STAGE);
    // Asked before what an earlier build left is touched.
    let apart = !force && examine::before_build(recording, seed, &progress)?;
    let at = folder.begin(STAGE, &own, true)?;
    let mut changed = recording.clone();
    changed.registered &= !apart;
    let prepared = prepared(&mut changed, &at, seed, &progress, watcher)?;
    drop(progress);
    write_json(&at.join("prepare.json"), &prepared)?;
    folder.finish(STAGE, &own, start.elapsed().as_secs_f64())?;
    if !prepared.is_nothing() {
        watcher.say(&format!("{STAGE:<7} {:.1} s", start.elapsed().as_secs_f64()));
    }
    // As its file says it, whose digits are not quite those in memory: a build that goes on from here
    // another day gives the same bytes.
    Ok(answer(restore(recording, &at)?, own))
}

/// Everything that the recording lacks, found and put into it; masks go into `at`.
fn prepared(
    recording: &mut Recording,
    at: &Path,
    seed: u64,
    progress: &Progress,
    watcher: &dyn Watcher,
) -> Result<Prepared> {
    let needs = Needs::of(recording)?;
    let mut prepared = Prepared::default();
    // The pictures of a film were placed on its scan when they were imported.
    if (needs.registration || needs.room) && !recording.film {
        let masked = recording.frames.iter().any(|f| f.mask.is_some());
        (prepared.cameras, prepared.settled) = settle(recording, masked, progress)?;
        if !needs.registration && recording.n_states > 1 {
            let held;
            (prepared.level, held) = level(recording, seed, progress)?;
            prepared.settled &= held;
            if !prepared.level.is_empty() {
                let turn = prepared.level.iter().map(|p| p.angle().to_degrees()).fold(0.0, f64::max);
                watcher.say(&format!(
                    "the room says that the states' frames are off by up to {turn:.2} deg: brought together on it"
                ));
            }
        }
    }
    if needs.registration {
        let found = register(recording, seed, progress)?;
        watcher.say(&sentence(&found));
        prepared.doubts.extend(registration_doubts(&found));
        prepared.registration = Some(found);
    }
    if needs.masks {
        watcher.say("the recording has no masks: the object is taken for what moves and what that hangs on");
        let report = find_masks(recording, &Wanted::Moving, at, seed, progress)?;
        write_contact_sheet(recording, &at.join("masks.png"))?;
        prepared.doubts.extend(report.doubts.iter().cloned());
        prepared.masks = Some(report);
    }
    if recording.film {
        let hands = film::find_hands(recording, at, seed, progress)?;
        watcher.say(&film::hands_sentence(&hands));
        prepared.doubts.extend(film::hands_doubt(&hands));
        prepared.hands = Some(hands);
    } else {
        // A hand that comes and goes looks like a push.
        let (pushes, doubts) = take_pushes_out(recording, seed, progress)?;
        prepared.pushes = pushes;
        prepared.doubts.extend(doubts);
    }
    prepared.doubts.iter().for_each(|d| watcher.say(&format!("doubt: {d}")));
    Ok(prepared)
}

/// Puts what a run's folder `prepare/` holds into the recording.
fn restore(recording: &mut Recording, at: &Path) -> Result<Prepared> {
    let path = at.join("prepare.json");
    let text = std::fs::read(&path).map_err(Failure::io(&path))?;
    let prepared: Prepared = serde_json::from_slice(&text).map_err(|e| {
        Failure::new(format!("not what this program writes: {e}"), path.display().to_string(), "build again")
    })?;
    put_cameras(recording, &prepared.cameras);
    apply(recording, &prepared.level);
    recording.settled = prepared.settled;
    if let Some(found) = &prepared.registration {
        apply(recording, &found.common_from_state);
        recording.registered = true;
    }
    if prepared.masks.is_some() {
        restore_pixels(recording, Pixels::Object, at);
    }
    if prepared.hands.is_some() {
        restore_pixels(recording, Pixels::Hand, at);
    }
    apply(recording, &prepared.pushes);
    Ok(prepared)
}

/// The recording of a run, as its stages saw it.
///
/// # Errors
/// When it is gone, cannot be read, or has changed since; or when what was prepared has.
pub fn recording_of(run: &RunFolder) -> Result<Recording> {
    let mut recording = Recording::open(&run.record.recording)?;
    let hint = format!("build again: hingecast build {} -o {}", run.record.recording.display(), run.root.display());
    if recording.fingerprint()? != run.record.fingerprint {
        let what = "the recording has changed since this run was built from it";
        return Err(Failure::new(what, recording.root.display().to_string(), hint));
    }
    if run.has(STAGE) {
        if !run.is_whole(STAGE) {
            let what = "what the build prepared has changed since";
            return Err(Failure::new(what, run.folder(STAGE).display().to_string(), hint));
        }
        restore(&mut recording, &run.folder(STAGE))?;
    }
    Ok(recording)
}
