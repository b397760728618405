//! Looks over a recording before hours are spent on it: names what is wrong, where, what to try,
//! and repairs what can be repaired safely.
//!
//! Three passes: the description (`transforms.json`), every image, and whether cameras, depth,
//! masks and states agree with each other in space.

mod apart;
mod carry;
mod description;
mod fix;
mod motion;
mod pixels;
mod space;
mod unit;

pub(crate) use fix::backup;
pub use fix::{Fix, fix};

use crate::recording::transforms;
use crate::{CaptureError, Recording, Split};
use hingecast_geom::Progress;
use serde::Serialize;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Whether `build` can go on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// `build` cannot use the recording, or not this frame of it.
    Error,
    /// `build` can go on; the result may suffer.
    Warning,
}

/// One thing that is wrong.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// Whether `build` can go on.
    pub severity: Severity,
    /// Stable name of the kind of finding, such as "depth-unit".
    pub code: &'static str,
    /// What is wrong, in one sentence.
    pub what: String,
    /// File, field and value.
    pub place: String,
    /// What to try.
    pub hint: String,
    /// What `fix` would do about it.
    pub fix: Option<Fix>,
    /// The state that it is about, if it is about one.
    pub state: Option<usize>,
}

impl std::fmt::Display for Finding {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let tag = if self.severity == Severity::Error { "error" } else { "warning" };
        let fixable = if self.fix.is_some() { " (--fix repairs it)" } else { "" };
        write!(f, "{tag}[{}]: {}\n  where: {}\n  try: {}{fixable}", self.code, self.what, self.place, self.hint)
    }
}

/// Frames of one state.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct StateFrames {
    /// The state that is counted.
    pub state: usize,
    /// Training frames that can be fitted: not wholly occluded.
    pub usable: usize,
    /// Of these, with some pixels hidden by an occluder mask.
    pub partly_hidden: usize,
    /// Left out because the person hides the object.
    pub occluded: usize,
    /// Held-out frames.
    pub test: usize,
}

/// What `check` found.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct CheckReport {
    /// Errors first, then in the order of the recording.
    pub findings: Vec<Finding>,
    /// One entry a state, in order; empty when the recording cannot be read.
    pub states: Vec<StateFrames>,
    /// Share of the surface of one state that another sees at the same place, over the share that the
    /// state's own views do, 0..1; empty where states have no frame in common, or more than 25.
    /// `[state][other]`
    pub shared: Vec<Vec<f64>>,
}

/// Findings of one kind that [`CheckReport::summary`] shows before it counts the rest.
const SHOWN_PER_CODE: usize = 3;

impl CheckReport {
    /// True when `build` cannot go on.
    pub fn has_errors(&self) -> bool {
        self.findings.iter().any(|f| f.severity == Severity::Error)
    }

    /// What makes a whole build worthless, rather than a frame or two of it.
    pub fn grave(&self) -> impl Iterator<Item = &Finding> {
        const GRAVE: [&str; 8] = [
            "camera-axes",
            "depth-unit",
            "views-disagree",
            "view-apart",
            "state-unmasked",
            "one-place",
            "states-apart",
            "nothing-moves",
        ];
        self.findings.iter().filter(|f| f.severity == Severity::Error && GRAVE.contains(&f.code))
    }

    /// The findings for a person: of many alike the first few, the last of them saying how many
    /// more there are.
    pub fn summary(&self) -> Vec<Finding> {
        let count = |code: &str| self.findings.iter().filter(|f| f.code == code).count();
        let mut shown = std::collections::BTreeMap::<&str, usize>::new();
        let mut out = Vec::new();
        for f in &self.findings {
            let n = shown.entry(f.code).or_default();
            *n += 1;
            if *n > SHOWN_PER_CODE {
                continue;
            }
            let mut f = f.clone();
            let more = count(f.code) - SHOWN_PER_CODE.min(count(f.code));
            if *n == SHOWN_PER_CODE && more > 0 {
                f.place += &format!(" (and {more} more like it)");
            }
            out.push(f);
        }
        out
    }
}

/// Checks the recording at `path`. Only being stopped is an error; everything else is a finding.
///
/// # Errors
/// When the person asked to stop.
pub fn check(path: &Path, progress: &Progress) -> Result<CheckReport, CaptureError> {
    let mut findings = Vec::new();
    let documents = match transforms::read(path) {
        Ok(documents) => documents,
        Err(e) => {
            findings.push(error("unreadable", e));
            return Ok(CheckReport { findings, states: Vec::new(), shared: Vec::new() });
        }
    };
    let mut problems = Vec::new();
    let recording = Recording::from_documents(&documents, &mut problems);
    findings.extend(recording.uncut().map(|e| error("uncut-film", e)));
    description::check(&documents, &recording, problems, &mut findings);
    let looks = pixels::check(&documents, &recording, progress, &mut findings)?;
    let shared = space::check(&documents, &recording, &looks, &mut findings);
    findings.sort_by_key(|f| f.severity);
    // Those that are there: a number may be mistyped by many zeros.
    let there: BTreeSet<usize> = recording.frames.iter().map(|f| f.state).collect();
    let states = there
        .into_iter()
        .map(|state| {
            let count = |wanted: &dyn Fn(&crate::Frame) -> bool| {
                recording.frames.iter().filter(|f| f.state == state && wanted(f)).count()
            };
            let train = |f: &crate::Frame| f.split == Split::Train;
            StateFrames {
                state,
                usable: count(&|f| train(f) && !f.occluded),
                partly_hidden: count(&|f| train(f) && !f.occluded && f.occluder_mask.is_some()),
                occluded: count(&|f| train(f) && f.occluded),
                test: count(&|f| !train(f)),
            }
        })
        .collect();
    Ok(CheckReport { findings, states, shared })
}

fn error(code: &'static str, e: CaptureError) -> Finding {
    Finding { severity: Severity::Error, code, what: e.what, place: e.place, hint: e.hint, fix: None, state: None }
}

fn warning(code: &'static str, what: String, place: String, hint: &str) -> Finding {
    Finding { severity: Severity::Warning, code, what, place, hint: hint.into(), fix: None, state: None }
}

/// Where frame `i` of the recording stands in its file: frames with problems were left out, so
/// positions differ.
fn address(documents: &[transforms::Document], recording: &Recording, i: usize) -> (PathBuf, usize, String) {
    let color = &recording.frames[i].color;
    let state = recording.frames[i].state;
    documents
        .iter()
        .flat_map(|d| d.entries.iter().map(move |e| (d, e)))
        .filter(|(_, e)| e.color == *color && e.state == state)
        .map(|(d, e)| (d.file.clone(), e.index, e.place.clone()))
        .nth(recording.frames[..i].iter().filter(|f| f.color == *color && f.state == state).count())
        .unwrap_or_default()
}
