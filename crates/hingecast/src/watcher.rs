//! What a build tells whoever started it: the library has no terminal.

use crate::failure::Failure;
use hingecast_geom::Progress;

/// Hears of stages and results, and may wish the build to stop.
pub trait Watcher: Sync {
    /// The progress handle of a stage; the stage asks it whether to stop.
    fn stage(&self, name: &str) -> Progress;

    /// A line for people.
    fn say(&self, line: &str);

    /// Something failed and the work goes on.
    fn complain(&self, failure: &Failure);
}

/// Hears nothing, stops nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Watcher for Silent {
    fn stage(&self, _: &str) -> Progress {
        Progress::default()
    }

    fn say(&self, _: &str) {}

    fn complain(&self, _: &Failure) {}
}
