//! What is wrong with something a person gave: three lines to act on. The crates that read files
//! share it.

use crate::Cancelled;
use std::path::Path;

/// What is wrong, where, and what to try. `Display` prints exactly these three lines.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{what}\n  where: {place}\n  try: {hint}")]
pub struct InputError {
    /// What is wrong, in one sentence.
    pub what: String,
    /// File, field and value.
    pub place: String,
    /// What to try.
    pub hint: String,
    /// True when nothing is wrong but the person asked to stop.
    pub cancelled: bool,
}

impl InputError {
    /// Line breaks inside an argument (parser messages have them) become spaces, so that three
    /// lines stay three.
    pub fn new(what: impl Into<String>, place: impl Into<String>, hint: impl Into<String>) -> Self {
        let line = |s: String| s.split_whitespace().collect::<Vec<_>>().join(" ");
        Self { what: line(what.into()), place: line(place.into()), hint: line(hint.into()), cancelled: false }
    }

    /// The file at `path` cannot be read, for the reason `error`.
    pub fn read(path: &Path, error: impl std::fmt::Display) -> Self {
        Self::new(format!("cannot read the file: {error}"), path.display().to_string(), "check the path and its rights")
    }

    /// The file at `path` cannot be written, for the reason `error`.
    pub fn write(path: &Path, error: impl std::fmt::Display) -> Self {
        Self::new(
            format!("cannot write the file: {error}"),
            path.display().to_string(),
            "check the rights of the folder and the free space of the disk",
        )
    }
}

impl From<Cancelled> for InputError {
    fn from(c: Cancelled) -> Self {
        let hint = "run the same command again";
        Self { cancelled: true, ..Self::new(c.to_string(), "interrupted by the person at the keyboard", hint) }
    }
}
