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
            let known = bar.style();
            let unknown = ProgressStyle::with_template("{prefix} {elapsed}  {msg}").expect("a fixed template");
            let pace = Mutex::new((Pace::default(), Instant::now()));
            return Progress::new(
                move |done, total, note| {
                    let mut pace = pace.lock().unwrap_or_else(|e| e.into_inner());
                    let now = pace.1.elapsed().as_secs_f64();
                    if (pace.0.total == 0) != (total == 0) {
                        bar.set_style(if total == 0 { unknown.clone() } else { known.clone() });
                    }
                    bar.set_length(total as u64);
                    bar.set_position(done as u64);
                    if pace.0.begins(done, total, now) {
                        bar.reset_eta();
                    }
                    if !note.is_empty() {
                        bar.set_message(note.to_string());
                    }
                },
                cancel,
            );
        }
        let (name, start) = (name.to_string(), Instant::now());
        let said = Mutex::new((start, Pace::default()));
        Progress::new(
            move |done, total, note| {
                let mut said = said.lock().unwrap_or_else(|e| e.into_inner());
                let (last, pace) = &mut *said;
                let spent = start.elapsed().as_secs_f64();
                pace.begins(done, total, spent);
                if last.elapsed() >= LINE_EVERY && done > 0 {
                    *last = Instant::now();
                    let eta = pace.eta(done, spent).map_or(String::new(), |s| format!(", eta {s:.0} s"));
                    let percent = 100.0 * done as f64 / total as f64;
                    let share = if total > 0 { format!("{percent:>3.0} %") } else { "     ".to_string() };
                    tell(&format!("{name:<7} {share}  {spent:.0} s{eta}  {note}"));
                }
            },
            cancel,
        )
    }
}

/// How fast the work goes, by what was done since the stage first told of it: a training that goes
/// on from a checkpoint did not do the steps before within these seconds.
#[derive(Default)]
struct Pace {
    total: usize,
    /// Done, and seconds since the stage began, when this was first told.
    from: (usize, f64),
    last: usize,
}

impl Pace {
    /// Whether another stretch of work begins: the first, another number of steps, or far fewer done
    /// than before (a few: threads that told of theirs out of order).
    fn begins(&mut self, done: usize, total: usize, now: f64) -> bool {
        let other = total != self.total || done < self.last / 2;
        if other {
            // A first step was done just before it is told, unless it is a late one.
            let late = self.total > 0 || done > 1;
            self.from = if late { (done, now) } else { (0, 0.0) };
            self.total = total;
        }
        self.last = if other { done } else { done.max(self.last) };
        other
    }

    /// Seconds to go; `None` where nothing tells.
    fn eta(&self, done: usize, now: f64) -> Option<f64> {
        let (from, since) = self.from;
        let steps = done.checked_sub(from).filter(|n| *n > 0 && self.total > 0)?;
        Some((now - since) / steps as f64 * self.total.saturating_sub(done) as f64)
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Steps before a resumption counted as if they had been done since: 10 s instead of 90.
    #[test]
    fn the_time_to_go_leaves_out_earlier_work() {
        let mut pace = Pace::default();
        assert!(pace.begins(901, 1000, 1.0));
        assert_eq!(pace.eta(901, 1.0), None);
        assert!(!pace.begins(911, 1000, 11.0));
        assert_eq!(pace.eta(911, 11.0), Some(89.0));
        // A fresh one, which tells of each step.
        let mut pace = Pace::default();
        pace.begins(1, 5, 10.0);
        assert_eq!(pace.eta(1, 10.0), Some(40.0));
        // Two threads, one late.
        assert!(!pace.begins(4, 5, 40.0) && !pace.begins(3, 5, 40.1));
        // The next stretch of the same stage.
        assert!(pace.begins(0, 50, 60.0));
        assert_eq!(pace.eta(10, 80.0), Some(80.0));
        // Nobody knows how many there will be.
        pace.begins(1, 0, 90.0);
        pace.begins(2, 0, 95.0);
        assert_eq!(pace.eta(2, 99.0), None);
    }
}
