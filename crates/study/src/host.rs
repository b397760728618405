//! What a study runs on, and whom it tells.

use hingecast::build::Options;
use hingecast::watcher::Watcher;

/// The machine's threads, and a listener.
#[derive(Clone, Copy)]
pub struct Host<'a> {
    /// Hears of steps and stages, and may wish to stop.
    pub watcher: &'a dyn Watcher,
    /// Worker threads of builds; 0 = as many as the machine has cores. Results do not depend on it.
    pub threads: usize,
}

impl Host<'_> {
    /// All stages that are missing, on this many threads.
    pub(crate) fn options(&self) -> Options {
        Options { threads: self.threads, ..Options::default() }
    }
}
