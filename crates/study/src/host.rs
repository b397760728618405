//! What a study runs on, and whom it tells.

use hingecast::build::Options;
use hingecast::watcher::Watcher;

/// The machine's threads, and a listener.
#[derive(Clone, Copy)]
pub struct Host<'a> {
    /// Hears of steps and stages, and may wish to stop.
    pub watcher: &'a dyn Watcher,
    /// Worker threads of builds.
    pub threads: usize,
}

impl Host<'_> {
    /// How builds run here.
    pub fn options(&self) -> Options {
        Options { threads: self.threads, ..Options::default() }
    }
}
