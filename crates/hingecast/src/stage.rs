//! The run folder: which stages are done, by stamp, and what is remembered of the run.
//!
//! A stage's stamp is a hash of what it depends on (the recording's fingerprint, its own settings, the stamp of
//! the stage before, the format version). Same stamp: the stage is kept. So the same command resumes.

use crate::failure::{Failure, Result};
use hingecast_geom::folder::may_become;
use hingecast_geom::staging::write_whole;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Grows when the meaning of files in a run changes.
const FORMAT: u32 = 8;

/// Name, time and memory of one finished stage.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct StageRecord {
    pub name: String,
    pub stamp: String,
    pub secs: f64,
    /// Peak resident memory of the process when the stage ended, bytes.
    pub peak_memory: u64,
}

/// `run.json`.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct RunRecord {
    pub version: String,
    pub recording: PathBuf,
    pub fingerprint: String,
    pub threads: usize,
    pub stages: Vec<StageRecord>,
    pub doubts: Vec<String>,
}

impl RunRecord {
    pub fn total_secs(&self) -> f64 {
        self.stages.iter().map(|s| s.secs).sum()
    }

    pub fn peak_memory(&self) -> u64 {
        self.stages.iter().map(|s| s.peak_memory).max().unwrap_or(0)
    }
}

pub struct RunFolder {
    pub root: PathBuf,
    pub record: RunRecord,
}

impl RunFolder {
    /// Whether a build may write into `root`: it is new, empty, or a run. Stages empty their folders and `--fresh`
    /// the whole, so nothing of a person's may be in there.
    pub fn may_become_run(root: &Path) -> Result<()> {
        let hint = "give a new folder: hingecast build RECORDING -o RUN";
        Ok(may_become("run folder", root, &["run.json", "config.toml"], hint)?)
    }

    /// Opens a run, or starts one. A `run.json` that cannot be read starts anew.
    pub fn create(root: &Path) -> Result<Self> {
        std::fs::create_dir_all(root).map_err(Failure::io(root))?;
        let record = Self::read(root).unwrap_or_default();
        Ok(Self { root: root.to_path_buf(), record })
    }

    /// Opens a finished (or half-finished) run.
    pub fn open(root: &Path) -> Result<Self> {
        let record = Self::read(root).ok_or_else(|| {
            let hint = "build one: hingecast build RECORDING -o RUN";
            Failure::new("not a run: run.json is missing or damaged", root.join("run.json").display().to_string(), hint)
        })?;
        Ok(Self { root: root.to_path_buf(), record })
    }

    fn read(root: &Path) -> Option<RunRecord> {
        serde_json::from_slice(&std::fs::read(root.join("run.json")).ok()?).ok()
    }

    pub fn folder(&self, stage: &str) -> PathBuf {
        self.root.join(stage)
    }

    /// Whether `stage` is done with this stamp.
    pub fn is_done(&self, stage: &str, stamp: &str) -> bool {
        self.record.stages.iter().any(|s| s.name == stage && s.stamp == stamp) && self.folder(stage).is_dir()
    }

    /// Whether `stage` is done, with whatever stamp.
    pub fn has(&self, stage: &str) -> bool {
        self.record.stages.iter().any(|s| s.name == stage)
    }

    /// Empties the stage's folder unless it holds a checkpoint of the same stamp; drops it and all later ones
    /// from the record.
    pub fn begin(&mut self, stage: &str, stamp: &str) -> Result<PathBuf> {
        let folder = self.folder(stage);
        let mark = folder.join("stamp");
        if std::fs::read_to_string(&mark).ok().as_deref() != Some(stamp) {
            if folder.exists() {
                std::fs::remove_dir_all(&folder).map_err(Failure::io(&folder))?;
            }
            std::fs::create_dir_all(&folder).map_err(Failure::io(&folder))?;
            write_whole(&mark, stamp.as_bytes()).map_err(Failure::io(&mark))?;
        }
        if let Some(at) = self.record.stages.iter().position(|s| s.name == stage) {
            self.record.stages.truncate(at);
        }
        self.save()?;
        Ok(folder)
    }

    pub fn finish(&mut self, stage: &str, stamp: &str, secs: f64) -> Result<()> {
        self.record.stages.push(StageRecord {
            name: stage.to_string(),
            stamp: stamp.to_string(),
            secs,
            peak_memory: crate::ui::peak_memory(),
        });
        self.save()
    }

    pub fn save(&self) -> Result<()> {
        write_json(&self.root.join("run.json"), &self.record)
    }
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
    pub trait Json {
        fn json(&self) -> Vec<u8>;
    }

    impl<T: serde::Serialize> Json for T {
        fn json(&self) -> Vec<u8> {
            serde_json::to_vec(self).expect("plain data")
        }
    }
}

pub fn write_json<T: Serialize>(path: &Path, value: &T) -> Result<()> {
    let text = serde_json::to_string_pretty(value).expect("plain data") + "\n";
    write_whole(path, text.as_bytes()).map_err(Failure::io(path))
}

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
