//! How a long computation tells how far it is and learns that it should stop.
//!
//! Libraries only call [`Progress::report`]; the binary decides what a person sees (bar, line or
//! JSON).

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The person asked to stop (Ctrl-C). Work so far is in the stage's checkpoint.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("stopped on request")]
pub struct Cancelled;

type Sink = Arc<dyn Fn(usize, usize, &str) + Send + Sync>;

/// A handle that is cheap to clone. `Progress::default()` is silent and never cancelled.
#[derive(Clone, Default)]
pub struct Progress {
    sink: Option<Sink>,
    cancel: Option<Arc<AtomicBool>>,
}

impl Progress {
    /// `sink(done, total, note)` is called from any thread; `cancel` turns true when work should
    /// stop.
    pub fn new(sink: impl Fn(usize, usize, &str) + Send + Sync + 'static, cancel: Arc<AtomicBool>) -> Self {
        Self { sink: Some(Arc::new(sink)), cancel: Some(cancel) }
    }

    /// The same wish to stop, and nobody who listens: for steps within a step.
    pub fn silent(&self) -> Self {
        Self { sink: None, cancel: self.cancel.clone() }
    }

    /// Says that `done` of `total` steps are finished; `note` is a short figure such as "psnr
    /// 31.2". A `total` of 0: nobody knows yet how many there will be.
    ///
    /// # Errors
    /// [`Cancelled`] when the person asked to stop: pass it up with `?`.
    pub fn report(&self, done: usize, total: usize, note: &str) -> Result<(), Cancelled> {
        if let Some(sink) = &self.sink {
            sink(done, total, note);
        }
        self.check()
    }

    /// Only asks whether to stop.
    ///
    /// # Errors
    /// [`Cancelled`] when the person asked to stop.
    pub fn check(&self) -> Result<(), Cancelled> {
        match &self.cancel {
            Some(flag) if flag.load(Ordering::Relaxed) => Err(Cancelled),
            _ => Ok(()),
        }
    }
}
