//! The resolved configuration of a build: preset < config file < flags and `--set`.

pub mod difference;

use crate::failure::{Failure, Result};
use crate::overrides::JointOverride;
use hingecast_articulate as articulate;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// How much time a build may take.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Preset {
    /// A look within a minute or two.
    Fast,
    /// 24 k gaussians, 4000 steps.
    Default,
    /// More gaussians, more steps.
    Best,
}

/// How parts and joints are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// Parts and joints from the depth of all states at once.
    Screw,
    /// The classical way: Dynamic 3D Gaussians' tracking, distance clustering, ICP, RANSAC axis.
    Track,
}

/// Everything that decides the bytes of a run; saved as `config.toml` in it.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// How parts and joints are found.
    pub method: Method,
    /// What the rest is measured from.
    pub preset: Preset,
    /// Seed of everything random.
    pub seed: u64,
    /// Decoded images kept in memory, MB.
    pub memory_mb: usize,
    /// The gaussians.
    pub fit: Fit,
    /// The search for parts and joints.
    pub screw: articulate::Config,
    /// Which passes of it are left out.
    pub passes: Passes,
    /// Tracking, by `--method track` alone.
    pub track: articulate::classical::track::Config,
    /// Grouping, by `--method track` alone.
    pub parts: articulate::classical::segment::Config,
    /// Axes, by `--method track` alone.
    pub joints: articulate::classical::joints::Config,
    /// Meshes, masses, collision pieces.
    pub twin: hingecast_twin::Config,
    /// A person's corrections.
    pub joint: Vec<JointOverride>,
}

/// Ablations of the search for parts.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Passes {
    /// Names of passes to leave out, as in `parts/trace.json`.
    pub skip: Vec<String>,
}

/// The fit of gaussians.
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
            method: Method::Screw,
            preset: Preset::Default,
            seed: 0,
            memory_mb: 1000,
            fit: Fit::default(),
            screw: Default::default(),
            passes: Default::default(),
            track: Default::default(),
            parts: Default::default(),
            joints: Default::default(),
            twin: Default::default(),
            joint: Vec::new(),
        }
    }
}

impl Config {
    /// The settings of a preset.
    pub fn preset(preset: Preset) -> Self {
        let mut c = Self { preset, ..Default::default() };
        match preset {
            Preset::Fast => {
                c.fit = Fit { gaussians: 12_000, steps: 1500 };
                // Fewer steps must be longer ones, or wide moves between states are lost.
                c.track.steps = 240;
                c.track.rate[0] = 1.6e-3;
                c.screw.cells = 72;
                c.screw.borders = false;
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
        let words = Words { example: "fit.steps=2000", saved: "config.toml of any run" };
        let config: Self = layered(&Self::preset(preset), file, set, &words)?;
        config.check()?;
        Ok(config)
    }

    /// Refuses values that no stage can work with.
    fn check(&self) -> Result<()> {
        let from = |least: usize| (least as f64, f64::INFINITY);
        let share = (0.0, 1.0);
        // Positive means above this: a voxel of nothing would fill any memory.
        let (finest, coarsest) = (1.0 / 2048.0, 0.2);
        let checks = [
            ("memory_mb", self.memory_mb as f64, (1.0, 1e9), "MB"),
            ("fit.gaussians", self.fit.gaussians as f64, (100.0, 1e7), "a number"),
            ("fit.steps", self.fit.steps as f64, from(1), "steps"),
            ("screw.cells", self.screw.cells as f64, (24.0, 400.0), "cells"),
            ("screw.max_parts", self.screw.max_parts as f64, (0.0, 100.0), "moving parts"),
            ("track.steps", self.track.steps as f64, from(1), "steps per state"),
            ("track.rate[0]", self.track.rate[0] as f64, share, "share of the diagonal"),
            ("track.rate[1]", self.track.rate[1] as f64, share, "share of the diagonal"),
            ("track.quat_rate", self.track.quat_rate.into(), share, "radians or so a step"),
            ("track.depth", self.track.depth.into(), from(0), "weight"),
            ("track.physics.rigid", self.track.physics.rigid.into(), from(0), "weight"),
            ("track.physics.rotation", self.track.physics.rotation.into(), from(0), "weight"),
            ("track.physics.isometry", self.track.physics.isometry.into(), from(0), "weight"),
            ("parts.parts", self.parts.parts as f64, (0.0, 250.0), "a number, 0 = find out"),
            ("parts.max_parts", self.parts.max_parts as f64, (1.0, 250.0), "a number"),
            ("parts.sample", self.parts.sample as f64, (50.0, 20_000.0), "gaussians"),
            ("parts.min_share", self.parts.min_share, share, "share of the gaussians"),
            ("parts.noise", self.parts.noise, share, "share of the diagonal"),
            ("joints.lattice", self.joints.lattice, (0.001, 1.0), "share of the diagonal"),
            ("joints.margin", self.joints.margin, (0.0, 2.0), "share of the diagonal"),
            ("joints.prismatic_share", self.joints.prismatic_share, share, "share"),
            ("twin.voxel", self.twin.voxel, (finest, coarsest), "share of the diagonal"),
            ("twin.density", self.twin.density, (1e-3, 1e6), "kg/m^3"),
            ("twin.max_faces", self.twin.max_faces as f64, from(4), "faces"),
            ("twin.max_hulls", self.twin.max_hulls as f64, (1.0, 1024.0), "hulls"),
            ("twin.simplify_error", self.twin.simplify_error, share, "share of the diagonal"),
            ("twin.color_views", self.twin.color_views as f64, from(1), "images"),
            ("twin.max_texels", self.twin.max_texels as f64, (0.0, 64e6), "texels"),
            ("twin.crumbs", self.twin.crumbs, share, "share of the largest piece"),
        ];
        match checks.into_iter().find(|(_, value, (lo, hi), _)| !(value >= lo && value <= hi)) {
            None => Ok(hingecast_articulate::passes::known(&self.passes.skip)?),
            Some((key, value, (lo, hi), unit)) => {
                let range = if hi.is_finite() { format!("{lo} to {hi}") } else { format!("{lo} or more") };
                let hint = format!("{key} = {range} ({unit})");
                Err(Failure::new("a setting is out of range", format!("{key} = {value}"), hint))
            }
        }
    }
}

/// What the errors of [`layered`] point at.
pub struct Words<'a> {
    /// A `--set` pair that exists.
    pub example: &'a str,
    /// Where all keys can be seen.
    pub saved: &'a str,
}

/// `base`, then the file's keys, then `key=value` pairs with dots for tables.
///
/// # Errors
/// Unknown keys, wrong types, files that are not TOML: by name.
pub fn layered<T: Serialize + DeserializeOwned>(
    base: &T,
    file: Option<&Path>,
    set: &[String],
    words: &Words,
) -> Result<T> {
    let mut table = toml::Table::try_from(base).expect("a config is a table");
    if let Some(path) = file {
        let text = std::fs::read_to_string(path).map_err(Failure::io(path))?;
        let given: toml::Table = text.parse().map_err(|e: toml::de::Error| {
            let what = format!("not TOML: {}", e.message());
            Failure::new(what, path.display().to_string(), format!("see {}", words.saved))
        })?;
        merge(&mut table, given);
        typed::<T>(&table, &path.display().to_string(), words)?;
    }
    for pair in set {
        let (key, value) = pair.split_once('=').ok_or_else(|| {
            let hint = format!("for instance --set {}", words.example);
            Failure::new(format!("'{pair}' is not key=value"), "--set", hint)
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
        typed::<T>(&table, &format!("--set {pair}"), words)?;
    }
    typed(&table, "--set, --config", words)
}

/// The table as a config; `place` is where its last keys came from.
fn typed<T: DeserializeOwned>(table: &toml::Table, place: &str, words: &Words) -> Result<T> {
    toml::Value::Table(table.clone()).try_into().map_err(|e: toml::de::Error| {
        let what = e.message().lines().collect::<Vec<_>>().join("; ");
        let what = ["usize", "u64", "u32"].iter().fold(what, |text, kind| text.replace(kind, "a whole number from 0"));
        Failure::new(what, place, format!("see {} for all keys", words.saved))
    })
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
        assert_eq!(c.parts.cluster, articulate::classical::segment::Clusterer::Hdbscan);
    }

    #[test]
    fn unknown_keys_are_named() {
        let e = Config::resolve(Preset::Default, None, &["fit.stepz=9".into()]).unwrap_err();
        assert!(e.what.contains("stepz"), "{e}");
        assert_eq!(e.place, "--set fit.stepz=9");
        let e = Config::resolve(Preset::Default, None, &["seed=-1".into()]).unwrap_err();
        assert!(e.what.contains("a whole number from 0"), "{e}");
    }

    #[test]
    fn settings_that_no_stage_can_work_with_are_refused() {
        let pairs = ["fit.steps=0", "twin.voxel=0", "twin.voxel=nan", "twin.density=-1", "parts.sample=1"];
        for pair in pairs.into_iter().chain(["track.physics.rigid=nan", "twin.color_views=0"]) {
            let e = Config::resolve(Preset::Default, None, &[pair.to_string()]).unwrap_err();
            assert!(e.place.starts_with(pair.split('=').next().unwrap()), "{e}");
        }
    }

    #[test]
    fn every_preset_is_in_range() {
        for preset in [Preset::Fast, Preset::Default, Preset::Best] {
            Config::resolve(preset, None, &[]).unwrap();
        }
    }
}
