//! The error a person sees: what, where, what to try.

use hingecast_geom::{Cancelled, InputError};
use std::path::Path;

/// Three lines on stderr; exit code 2, or 130 when the person stopped it.
#[derive(Debug, Clone)]
pub struct Failure {
    /// What is wrong.
    pub what: String,
    /// File, field or value.
    pub place: String,
    /// What to try.
    pub hint: String,
    /// Whether a person stopped it.
    pub cancelled: bool,
}

/// What fails with three lines.
pub type Result<T> = std::result::Result<T, Failure>;

impl Failure {
    /// The three lines: what, where, what to try.
    pub fn new(what: impl Into<String>, place: impl Into<String>, hint: impl Into<String>) -> Self {
        Self { what: what.into(), place: place.into(), hint: hint.into(), cancelled: false }
    }

    /// For `map_err` on file operations.
    pub fn io<E: std::fmt::Display>(path: &Path) -> impl FnOnce(E) -> Self {
        let place = path.display().to_string();
        move |e| {
            Self::new(
                format!("cannot read or write a file: {e}"),
                place,
                "check the path, its rights and the free space",
            )
        }
    }
}

impl std::fmt::Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(f, "{}\n  where: {}\n  try: {}", self.what, self.place, self.hint)
    }
}

impl std::error::Error for Failure {}

impl From<Cancelled> for Failure {
    fn from(_: Cancelled) -> Self {
        let hint = "run the same command again: finished stages and checkpoints are kept";
        Self { cancelled: true, ..Self::new("stopped on request", "Ctrl-C", hint) }
    }
}

impl From<InputError> for Failure {
    fn from(e: InputError) -> Self {
        if e.cancelled { Cancelled.into() } else { Self::new(e.what, e.place, e.hint) }
    }
}

impl From<hingecast_articulate::ArticulateError> for Failure {
    fn from(e: hingecast_articulate::ArticulateError) -> Self {
        use hingecast_articulate::ArticulateError as A;
        match e {
            A::Input { what, place, hint } => Self::new(what, place, hint),
            A::Cancelled(c) => c.into(),
            // What our own readers fail with comes back as it went.
            A::Depths(e) => match e.downcast::<Self>() {
                Ok(own) => *own,
                Err(e) => Self::new(e.to_string(), "the recording", "run `hingecast check` on the recording"),
            },
        }
    }
}

impl From<hingecast_splat::SplatError> for Failure {
    fn from(e: hingecast_splat::SplatError) -> Self {
        match e {
            hingecast_splat::SplatError::Cancelled(c) => c.into(),
            e => Self::new(e.to_string(), "the gaussian engine", "run `hingecast check` on the recording"),
        }
    }
}

impl From<hingecast_twin::ExportError> for Failure {
    fn from(e: hingecast_twin::ExportError) -> Self {
        Self::new(
            e.to_string().lines().next().unwrap_or_default(),
            "the twin folder",
            "free some disk space, or another -o",
        )
    }
}

impl From<hingecast_geom::ply::PlyError> for Failure {
    fn from(e: hingecast_geom::ply::PlyError) -> Self {
        Self::new(e.to_string(), "a PLY file", "build again with --fresh if it is one of the run's own files")
    }
}

#[cfg(feature = "mujoco")]
impl From<hingecast_sim::SimError> for Failure {
    fn from(e: hingecast_sim::SimError) -> Self {
        use hingecast_sim::SimError as S;
        match e {
            S::Load { path, what } => Self::new(
                format!("MuJoCo cannot load the model: {what}"),
                path,
                "build, export or import it again; python -m mujoco.viewer shows whether MuJoCo alone can load it",
            ),
            S::Task { what, place, hint } => Self::new(what, place, hint),
        }
    }
}
