//! The resolved configuration of a build: preset < config file < flags and `--set`.

use crate::failure::{Failure, Result};
use hingecast_articulate as articulate;
use serde::{Deserialize, Serialize};
use std::path::Path;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Preset {
    /// A look within a minute or two.
    Fast,
    Default,
    /// More gaussians, more steps.
    Best,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// The classical way: Dynamic 3D Gaussians' tracking, distance clustering, ICP, RANSAC axis.
    Track,
}

/// Everything that decides the bytes of a run; saved as `config.toml` in it.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    pub method: Method,
    pub preset: Preset,
    pub seed: u64,
    /// Decoded images kept in memory, MB.
    pub memory_mb: usize,
    pub fit: Fit,
    pub track: articulate::track::Config,
    pub parts: articulate::segment::Config,
    pub joints: articulate::joints::Config,
    pub twin: hingecast_twin::Config,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Fit {
    /// Number of gaussians.
    pub gaussians: usize,
    /// Optimisation steps; one view each.
    pub steps: usize,
}

impl Default for Fit {
    fn default() -> Self {
        Self { gaussians: 24_000, steps: 4000 }
    }
}

impl Default for Config {
    fn default() -> Self {
        Self {
            method: Method::Track,
            preset: Preset::Default,
            seed: 0,
            memory_mb: 1000,
            fit: Fit::default(),
            track: Default::default(),
            parts: Default::default(),
            joints: Default::default(),
            twin: Default::default(),
        }
    }
}

impl Config {
    pub fn preset(preset: Preset) -> Self {
        let mut c = Self { preset, ..Default::default() };
        match preset {
            Preset::Fast => {
                c.fit = Fit { gaussians: 12_000, steps: 1500 };
                c.track.steps = c.track.steps.div_ceil(2);
                c.twin.voxel = 1.0 / 160.0;
            }
            Preset::Default => {}
            Preset::Best => {
                c.fit = Fit { gaussians: 40_000, steps: 10_000 };
                c.track.steps *= 2;
                c.twin.voxel = 1.0 / 384.0;
            }
        }
        c
    }

    /// Preset, then the file's keys, then `--set` pairs such as `fit.steps=2000`.
    ///
    /// # Errors
    /// Unknown keys, wrong types, files that are not TOML: by name.
    pub fn resolve(preset: Preset, file: Option<&Path>, set: &[String]) -> Result<Self> {
        let mut table = toml::Table::try_from(Self::preset(preset)).expect("a config is a table");
        if let Some(path) = file {
            let text = std::fs::read_to_string(path).map_err(Failure::io(path))?;
            let given: toml::Table = text.parse().map_err(|e: toml::de::Error| {
                Failure::new(
                    format!("not TOML: {}", e.message()),
                    path.display().to_string(),
                    "see config.toml of any run",
                )
            })?;
            merge(&mut table, given);
        }
        for pair in set {
            let (key, value) = pair.split_once('=').ok_or_else(|| {
                Failure::new(format!("'{pair}' is not key=value"), "--set", "for instance --set fit.steps=2000")
            })?;
            // A bare word is a string: --set parts.cluster=hdbscan.
            let parsed: toml::Table = format!("x = {value}")
                .parse()
                .or_else(|_| format!("x = {value:?}").parse())
                .map_err(|_| Failure::new(format!("cannot read the value of '{pair}'"), "--set", "quote strings"))?;
            let mut nested = parsed["x"].clone();
            for part in key.rsplit('.') {
                nested = toml::Value::Table([(part.to_string(), nested)].into_iter().collect());
            }
            if let toml::Value::Table(t) = nested {
                merge(&mut table, t);
            }
        }
        toml::Value::Table(table).try_into().map_err(|e: toml::de::Error| {
            let place = file.map_or("--set".to_string(), |f| f.display().to_string());
            Failure::new(
                e.message().lines().collect::<Vec<_>>().join("; "),
                place,
                "see config.toml of any run for all keys",
            )
        })
    }
}

fn merge(into: &mut toml::Table, from: toml::Table) {
    for (key, value) in from {
        match (into.get_mut(&key), value) {
            (Some(toml::Value::Table(inner)), toml::Value::Table(new)) => merge(inner, new),
            (_, value) => {
                into.insert(key, value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn set_beats_file_beats_preset() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("c.toml");
        std::fs::write(&file, "seed = 3\n[fit]\nsteps = 7\n").unwrap();
        let c = Config::resolve(Preset::Fast, Some(&file), &["fit.steps=9".into(), "parts.cluster=hdbscan".into()])
            .unwrap();
        assert_eq!((c.seed, c.fit.steps, c.fit.gaussians), (3, 9, 12_000));
        assert_eq!(c.parts.cluster, articulate::segment::Clusterer::Hdbscan);
    }

    #[test]
    fn unknown_keys_are_named() {
        let e = Config::resolve(Preset::Default, None, &["fit.stepz=9".into()]).unwrap_err();
        assert!(e.what.contains("stepz"), "{e}");
    }
}
