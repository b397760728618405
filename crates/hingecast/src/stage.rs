//! The run folder: which stages are done, by stamp, and what is remembered of the run.
//!
//! A stage's stamp is a hash of what it depends on (the recording's fingerprint, its own settings,
//! the stamp of the stage before, the format version). Same stamp: the stage is kept. So the same
//! command resumes.

use crate::failure::{Failure, Result};
use crate::run_files::{self, FileRecord, STAMP, files_of, unchanged};
use hingecast_geom::staging::{sweep_folder, write_whole};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Grows when the meaning of files in a run changes.
const FORMAT: u32 = 9;

/// Name, time and memory of one finished stage.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct StageRecord {
    /// As in the run folder.
    pub name: String,
    /// Of everything that the stage depends on.
    pub stamp: String,
    /// Wall time.
    pub secs: f64,
    /// Peak resident memory of the process when the stage ended, bytes.
    pub peak_memory: u64,
    /// What it left. Runs of older versions do not say; their stages are built again.
    #[serde(default)]
    pub files: Vec<FileRecord>,
}

/// `run.json`.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct RunRecord {
    /// Version of hingecast that ran last.
    pub version: String,
    /// Whole path of the recording.
    pub recording: PathBuf,
    /// Of the recording, hex.
    pub fingerprint: String,
    /// Worker threads of the last build.
    pub threads: usize,
    /// Finished stages in order.
    pub stages: Vec<StageRecord>,
    /// Of the twin, gravest first.
    pub doubts: Vec<String>,
}

impl RunRecord {
    /// Wall time of all stages together.
    pub fn total_secs(&self) -> f64 {
        self.stages.iter().map(|s| s.secs).sum()
    }

    /// Peak resident memory over all stages, bytes.
    pub fn peak_memory(&self) -> u64 {
        self.stages.iter().map(|s| s.peak_memory).max().unwrap_or(0)
    }
}

/// A run folder, and what it remembers.
pub struct RunFolder {
    /// The folder.
    pub root: PathBuf,
    /// `run.json`
    pub record: RunRecord,
}

impl RunFolder {
    /// Whether a build may write into `root`: it is new, empty, or a run, which is what has a
    /// `run.json` of ours. Many a project has folders named parts and report, and a config.toml.
    ///
    /// # Errors
    /// It holds something else.
    pub fn may_become_run(root: &Path) -> Result<()> {
        if Self::read(root).is_some() || run_files::is_bare(root)? {
            return Ok(());
        }
        let hint = "give a new folder: hingecast build RECORDING -o RUN";
        let damaged = root.join("run.json");
        if damaged.is_file() {
            let what = "the run folder holds something else: its run.json is none of ours, or damaged";
            return Err(Failure::new(what, damaged.display().to_string(), hint));
        }
        Err(Failure::new("the run folder holds something else", root.display().to_string(), hint))
    }

    /// Opens a run, or starts one: `run.json` is the first file in it, so that a run that is killed
    /// is known for one.
    ///
    /// # Errors
    /// The folder holds something else, or the disk refuses.
    pub fn create(root: &Path) -> Result<Self> {
        Self::may_become_run(root)?;
        std::fs::create_dir_all(root).map_err(Failure::io(root))?;
        sweep_folder(root);
        let run = Self { root: root.to_path_buf(), record: Self::read(root).unwrap_or_default() };
        run.save()?;
        Ok(run)
    }

    /// Throws away what is there: the files that hingecast writes into a run, and only if there are
    /// no others.
    ///
    /// # Errors
    /// There is another file, or the disk refuses.
    pub fn empty(&mut self) -> Result<()> {
        run_files::may_empty_run(&self.root)?;
        // Before anything goes; and run.json stays, or what is left of a killed one would be no
        // run.
        self.record = RunRecord::default();
        self.save()?;
        for name in run_files::FOLDERS {
            remove_stage(&self.folder(name))?;
        }
        for name in run_files::FILES {
            let path = self.root.join(name);
            gone(std::fs::remove_file(&path)).map_err(Failure::io(&path))?;
        }
        Ok(())
    }

    /// Opens a finished (or half-finished) run.
    pub fn open(root: &Path) -> Result<Self> {
        let record = Self::read(root).ok_or_else(|| {
            let hint = "build one: hingecast build RECORDING -o RUN";
            Failure::new("not a run: run.json is missing or damaged", root.join("run.json").display().to_string(), hint)
        })?;
        Ok(Self { root: root.to_path_buf(), record })
    }

    /// Opens a run that has a twin of the recording as it was when the run was last built.
    ///
    /// # Errors
    /// No run, or one that is not finished.
    pub fn open_finished(root: &Path) -> Result<Self> {
        let run = Self::open(root)?;
        run.finished()?;
        Ok(run)
    }

    /// Asked by whoever reads a run: files of an earlier build stay in its folders until their stages
    /// are done again.
    ///
    /// # Errors
    /// The stage `twin` is not done.
    pub fn finished(&self) -> Result<()> {
        if self.has("twin") {
            return Ok(());
        }
        let last = self.record.stages.last().map_or("none", |s| s.name.as_str());
        let hint = format!(
            "finish it: hingecast build {} -o {}, with the --preset, --config and --set of before",
            self.record.recording.display(),
            self.root.display()
        );
        let what =
            format!("the run is not finished for its recording: 'twin' is to come, the last stage done is {last}");
        Err(Failure::new(what, self.root.join("run.json").display().to_string(), hint))
    }

    /// The same of whatever leads to a twin: a run, its twin folder, a file in that. Anything else is
    /// nobody's run, and fine.
    ///
    /// # Errors
    /// It is that of a run that is not finished.
    pub fn refuse_unfinished(path: &Path) -> Result<()> {
        let whole = path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
        let leads = |root: &Path| root == whole || whole.strip_prefix(root).is_ok_and(|rest| rest.starts_with("twin"));
        let root = whole.ancestors().take(3).find(|root| leads(root) && Self::read(root).is_some());
        root.map_or(Ok(()), |root| Self::open(root)?.finished())
    }

    fn read(root: &Path) -> Option<RunRecord> {
        serde_json::from_slice(&std::fs::read(root.join("run.json")).ok()?).ok()
    }

    /// The folder of a stage.
    pub fn folder(&self, stage: &str) -> PathBuf {
        self.root.join(stage)
    }

    /// Whether `stage` is done with this stamp, and all that it left is there and unchanged.
    pub fn is_done(&self, stage: &str, stamp: &str) -> bool {
        let done = self.record.stages.iter().find(|s| s.name == stage && s.stamp == stamp);
        done.is_some_and(|s| unchanged(&self.folder(stage), &s.files))
    }

    /// Whether `stage` is done, with whatever stamp.
    pub fn has(&self, stage: &str) -> bool {
        self.record.stages.iter().any(|s| s.name == stage)
    }

    /// Whether all that `stage` left, with whatever stamp, is there and unchanged.
    pub fn is_whole(&self, stage: &str) -> bool {
        let done = self.record.stages.iter().find(|s| s.name == stage);
        done.is_some_and(|s| unchanged(&self.folder(stage), &s.files))
    }

    /// Drops the stage and all later ones from the record; then empties its folder, unless that
    /// holds a checkpoint of the same stamp (`redo`: also then). In this order: killed in between,
    /// half a stage is never taken for a whole one.
    ///
    /// # Errors
    /// The folder holds a file that hingecast does not write, or the disk refuses.
    pub fn begin(&mut self, stage: &str, stamp: &str, redo: bool) -> Result<PathBuf> {
        run_files::may_empty_stage(&self.root, stage)?;
        if let Some(at) = self.record.stages.iter().position(|s| s.name == stage) {
            self.record.stages.truncate(at);
        }
        self.save()?;
        let folder = self.folder(stage);
        let mark = folder.join(STAMP);
        if redo || std::fs::read_to_string(&mark).ok().as_deref() != Some(stamp) {
            remove_stage(&folder)?;
            std::fs::create_dir_all(&folder).map_err(Failure::io(&folder))?;
            write_whole(&mark, stamp.as_bytes()).map_err(Failure::io(&mark))?;
        }
        sweep_folder(&folder);
        Ok(folder)
    }

    /// # Errors
    /// When what the stage left cannot be read, or `run.json` not be written.
    pub fn finish(&mut self, stage: &str, stamp: &str, secs: f64) -> Result<()> {
        debug_assert!(
            run_files::may_empty_stage(&self.root, stage).is_ok(),
            "{stage} wrote a file that run_files does not know"
        );
        self.record.stages.push(StageRecord {
            name: stage.to_string(),
            stamp: stamp.to_string(),
            secs,
            peak_memory: crate::memory::peak_memory(),
            files: files_of(&self.folder(stage))?,
        });
        self.save()
    }

    /// Writes `run.json`.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn save(&self) -> Result<()> {
        write_json(&self.root.join("run.json"), &self.record)
    }
}

/// The stamp goes first: a folder that is half gone must not pass for one with a checkpoint.
fn remove_stage(folder: &Path) -> Result<()> {
    let mark = folder.join(STAMP);
    gone(std::fs::remove_file(&mark)).map_err(Failure::io(&mark))?;
    gone(std::fs::remove_dir_all(folder)).map_err(Failure::io(folder))
}

/// What was not there need not be removed.
fn gone(removed: std::io::Result<()>) -> std::io::Result<()> {
    removed.or_else(|e| if e.kind() == std::io::ErrorKind::NotFound { Ok(()) } else { Err(e) })
}

/// 128 bits of FNV-1a over the parts' JSON: not for adversaries, only to notice change.
pub fn stamp(parts: &[&dyn erased::Json]) -> String {
    let mut hash: u128 = 0x6c62272e07bb014262b821756295c58d;
    let mut eat = |bytes: &[u8]| {
        for b in bytes {
            hash = (hash ^ *b as u128).wrapping_mul(0x0000000001000000000000000000013B);
        }
    };
    eat(&FORMAT.to_le_bytes());
    for part in parts {
        eat(&part.json());
        eat(b"\n");
    }
    format!("{hash:032x}")
}

/// serde's `Serialize` cannot be a trait object; its JSON can.
pub mod erased {
    /// Whatever has a JSON text.
    pub trait Json {
        /// The text.
        fn json(&self) -> Vec<u8>;
    }

    impl<T: serde::Serialize> Json for T {
        fn json(&self) -> Vec<u8> {
            serde_json::to_vec(self).expect("plain data")
        }
    }
}

/// Writes a value as JSON; the file is whole or absent.
///
/// # Errors
/// When it cannot be written.
pub fn write_json<T: Serialize>(path: &Path, value: &T) -> Result<()> {
    let text = serde_json::to_string_pretty(value).expect("plain data") + "\n";
    write_whole(path, text.as_bytes()).map_err(Failure::io(path))
}

/// Reads a value from JSON.
///
/// # Errors
/// The file is missing, or not what this program writes.
pub fn read_json<T: for<'a> Deserialize<'a>>(path: &Path) -> Result<T> {
    let bytes = std::fs::read(path).map_err(Failure::io(path))?;
    serde_json::from_slice(&bytes).map_err(|e| {
        Failure::new(
            format!("not what this program writes: {e}"),
            path.display().to_string(),
            "build again with --fresh",
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// After a build that failed, the twin of the recording before was taken without a word.
    #[test]
    fn a_twin_of_an_unfinished_run_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let root = dir.path().join("run");
        let mut run = RunFolder::create(&root).unwrap();
        let model = root.join("twin/robot.xml");
        std::fs::create_dir(root.join("twin")).unwrap();
        std::fs::write(&model, "<mujoco/>").unwrap();
        for path in [&root, &root.join("twin"), &model] {
            let refused = RunFolder::refuse_unfinished(path).unwrap_err();
            assert!(refused.what.contains("not finished") && refused.place.ends_with("run.json"), "{refused}");
        }
        assert!(RunFolder::open_finished(&root).is_err());
        // Whose it is not.
        RunFolder::refuse_unfinished(dir.path()).unwrap();
        RunFolder::refuse_unfinished(&root.join("objects/robot.xml")).unwrap();

        run.finish("twin", "a stamp", 1.0).unwrap();
        RunFolder::refuse_unfinished(&model).unwrap();
        assert!(RunFolder::open_finished(&root).is_ok());
    }
}
