//! What is finished of an experiment, and how long the rest may take.
//!
//! A step's stamp is a hash of its settings and of the stamps of the steps whose output it reads.
//! Same stamp, and its output is there: it is skipped. So the same command goes on after a kill,
//! and a changed setting redoes what depends on it and nothing else.

use hingecast::failure::Result;
use hingecast::stage::{erased, read_json, stamp, write_json};
use hingecast::watcher::Watcher;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

#[derive(Clone, Debug, Serialize, Deserialize)]
struct Done {
    stamp: String,
    secs: f64,
}

/// `steps.json` of one object.
pub struct Ledger {
    path: PathBuf,
    done: BTreeMap<String, Done>,
}

impl Ledger {
    /// That of the object's folder; it must be there before a step finishes. A file that cannot be
    /// read starts anew.
    pub fn open(folder: &Path) -> Self {
        let path = folder.join("steps.json");
        let done = read_json(&path).unwrap_or_default();
        Self { path, done }
    }

    fn secs_of(&self, name: &str, stamp: &str, output: &Path) -> Option<f64> {
        self.done.get(name).filter(|d| d.stamp == stamp && output.exists()).map(|d| d.secs)
    }

    fn finish(&mut self, name: &str, stamp: &str, secs: f64) -> Result<()> {
        self.done.insert(name.to_string(), Done { stamp: stamp.to_string(), secs });
        write_json(&self.path, &self.done)
    }
}

/// Time left, by the mean of each kind of step so far.
#[derive(Debug, Default)]
pub struct Clock {
    /// Steps of each kind that an object takes.
    planned: BTreeMap<&'static str, usize>,
    objects_left: usize,
    /// Of the object at hand.
    left: BTreeMap<&'static str, usize>,
    /// Sum and number of seconds.
    spent: BTreeMap<&'static str, (f64, usize)>,
}

impl Clock {
    /// `planned`: from [`Plan::steps`](super::plan::Plan::steps); `objects`: how many there are.
    pub fn new(planned: BTreeMap<&'static str, usize>, objects: usize) -> Self {
        Self { planned, objects_left: objects, ..Self::default() }
    }

    /// To be called before every object, the first included: all its steps are to come.
    pub fn next_object(&mut self) {
        self.objects_left = self.objects_left.saturating_sub(1);
        self.left = self.planned.clone();
    }

    fn tick(&mut self, kind: &'static str, secs: f64) {
        let left = self.left.entry(kind).or_default();
        *left = left.saturating_sub(1);
        let (sum, n) = self.spent.entry(kind).or_default();
        (*sum, *n) = (*sum + secs, *n + 1);
    }

    /// `None` while a kind of step that is to come has never run.
    fn secs_left(&self) -> Option<f64> {
        let mut sum = 0.0;
        for (kind, planned) in &self.planned {
            let n = self.left.get(kind).copied().unwrap_or(0) + planned * self.objects_left;
            if n > 0 {
                let (secs, runs) = self.spent.get(kind)?;
                sum += n as f64 * secs / *runs as f64;
            }
        }
        Some(sum)
    }
}

/// Runs the steps of one object.
pub struct Steps<'a> {
    /// Hears of each step that is not skipped.
    pub watcher: &'a dyn Watcher,
    /// Name of the object, for the watcher.
    pub object: &'a str,
    /// What is finished of this object.
    pub ledger: Ledger,
    /// That of the whole experiment, one object after the other.
    pub clock: &'a mut Clock,
}

impl Steps<'_> {
    /// Does `work` unless it is done: it must leave `output`. Answers the stamp.
    ///
    /// # Errors
    /// Those of `work`; it is tried again by the next run.
    pub(crate) fn step(
        &mut self,
        kind: &'static str,
        name: &str,
        inputs: &[&dyn erased::Json],
        output: &Path,
        work: impl FnOnce() -> Result<()>,
    ) -> Result<String> {
        let own = [inputs, &[&kind, &env!("CARGO_PKG_VERSION")]].concat();
        let stamp = stamp(&own);
        if let Some(secs) = self.ledger.secs_of(name, &stamp, output) {
            self.clock.tick(kind, secs);
            return Ok(stamp);
        }
        let left =
            self.clock.secs_left().map_or(String::new(), |s| format!(" (about {:.0} min left)", (s / 60.0).ceil()));
        self.watcher.say(&format!("== {}: {name}{left}", self.object));
        let start = Instant::now();
        let made = work();
        let secs = start.elapsed().as_secs_f64();
        self.clock.tick(kind, secs);
        made?;
        self.ledger.finish(name, &stamp, secs)?;
        Ok(stamp)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hingecast::failure::Failure;

    #[test]
    fn a_step_is_skipped_only_with_its_stamp_and_its_output() {
        let dir = tempfile::tempdir().unwrap();
        let (watcher, mut clock) = (hingecast::watcher::Silent, Clock::new([("a", 1)].into(), 1));
        let output = dir.path().join("out");
        let mut runs = 0;
        let mut go = |setting: usize, fails: bool| {
            let mut steps =
                Steps { watcher: &watcher, object: "box", ledger: Ledger::open(dir.path()), clock: &mut clock };
            let before = runs;
            let made = steps.step("a", "first", &[&setting], &output, || {
                runs += 1;
                std::fs::write(&output, "x").unwrap();
                if fails { Err(Failure::new("no", "here", "there")) } else { Ok(()) }
            });
            (made.is_ok(), runs > before)
        };
        assert_eq!(go(1, false), (true, true));
        assert_eq!(go(1, true), (true, false));
        assert_eq!(go(2, true), (false, true), "another setting");
        assert_eq!(go(2, false), (true, true), "what failed is tried again");
        assert_eq!(go(2, false), (true, false));
        std::fs::remove_file(&output).unwrap();
        assert_eq!(go(2, false), (true, true), "its output is gone");
    }

    #[test]
    fn the_time_left_is_that_of_all_steps_to_come() {
        let mut clock = Clock::new([("a", 2), ("b", 1)].into(), 2);
        clock.next_object();
        clock.tick("a", 10.0);
        assert_eq!(clock.secs_left(), None);
        clock.tick("b", 4.0);
        // One more a here, two a and one b with the other object.
        assert_eq!(clock.secs_left(), Some(3.0 * 10.0 + 4.0));
        clock.next_object();
        assert_eq!(clock.secs_left(), Some(2.0 * 10.0 + 4.0));
    }
}
