//! What a person sees while a stage runs: a bar with ETA on a terminal, a line now and then
//! elsewhere. Everything human goes to stderr; stdout is for `--json`. Nobody else writes there:
//! `println!` and `eprintln!` panic when the reader has gone, which is nothing to lose a build of
//! an hour for.

use hingecast::failure::{Failure, Result};
use hingecast::watcher::Watcher;
use hingecast_geom::Progress;
use indicatif::{ProgressBar, ProgressStyle};
use std::io::{ErrorKind, IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Lines in a log file: often enough to see that it lives, seldom enough to read.
const LINE_EVERY: Duration = Duration::from_secs(10);

/// A line for people. Where nobody reads any more, the work goes on.
pub fn tell(text: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{text}");
}

/// The machine's answer, one line. A reader that has gone wants none.
///
/// # Errors
/// It cannot be written: a full disk behind `>`.
pub fn answer(text: &str) -> Result<()> {
    let mut out = std::io::stdout().lock();
    match writeln!(out, "{text}").and_then(|()| out.flush()) {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => {
            let hint = "free some disk space, or send the answer elsewhere";
            Err(Failure::new(format!("the answer cannot be written: {e}"), "stdout", hint))
        }
        _ => Ok(()),
    }
}

#[derive(Clone)]
pub struct Ui {
    cancel: Arc<AtomicBool>,
    quiet: bool,
}

impl Ui {
    /// Installs the Ctrl-C handler: the first one asks every stage to stop at its next checkpoint,
    /// the second kills.
    pub fn new(quiet: bool) -> Self {
        let cancel = Arc::new(AtomicBool::new(false));
        let flag = cancel.clone();
        // Fails only when a handler is there already (tests make several): that one serves.
        let _ = ctrlc::set_handler(move || {
            if flag.swap(true, Ordering::Relaxed) {
                std::process::exit(130);
            }
            tell("\nstopping at the next safe point (Ctrl-C again to kill) ...");
        });
        Self { cancel, quiet }
    }

    /// A line for people.
    pub fn say(&self, text: &str) {
        if !self.quiet {
            tell(text);
        }
    }

    /// Something failed and the work goes on; also said with --quiet.
    pub fn complain(&self, failure: &Failure) {
        tell(&format!("error: {failure}"));
    }

    /// A progress handle for the stage `name`; the bar goes when the handle is dropped.
    pub fn stage(&self, name: &str) -> Progress {
        let cancel = self.cancel.clone();
        if self.quiet {
            return Progress::new(|_, _, _| {}, cancel);
        }
        if std::io::stderr().is_terminal() {
            let bar = ProgressBar::new(1).with_prefix(format!("{name:<7}"));
            let style = ProgressStyle::with_template("{prefix} [{bar:30}] {percent:>3} %  {elapsed} eta {eta}  {msg}");
            bar.set_style(style.expect("a fixed template").progress_chars("=> "));
            return Progress::new(
                move |done, total, note| {
                    bar.set_length(total as u64);
                    bar.set_position(done as u64);
                    if !note.is_empty() {
                        bar.set_message(note.to_string());
                    }
                },
                cancel,
            );
        }
        let (name, start) = (name.to_string(), Instant::now());
        let last = Mutex::new(start);
        Progress::new(
            move |done, total, note| {
                let mut last = last.lock().unwrap_or_else(|e| e.into_inner());
                if last.elapsed() >= LINE_EVERY && done > 0 {
                    *last = Instant::now();
                    let spent = start.elapsed().as_secs_f64();
                    let eta = spent * (total as f64 / done as f64 - 1.0);
                    let percent = 100.0 * done as f64 / total as f64;
                    tell(&format!("{name:<7} {percent:>3.0} %  {spent:.0} s, eta {eta:.0} s  {note}"));
                }
            },
            cancel,
        )
    }
}

impl Watcher for Ui {
    fn stage(&self, name: &str) -> Progress {
        self.stage(name)
    }

    fn say(&self, line: &str) {
        self.say(line);
    }

    fn complain(&self, failure: &Failure) {
        self.complain(failure);
    }
}
