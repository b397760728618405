//! Policies from demonstrations: one training with its settings and loss plot, and sweeps over
//! settings.

mod plot;
pub mod sweep;

use hingecast::config::{Words, layered};
use hingecast::failure::{Failure, Result};
use hingecast_geom::Progress;
use hingecast_geom::folder::may_become;
use hingecast_geom::staging::write_whole;
use hingecast_policy::Demos;
use hingecast_policy::train::{Preset, TrainConfig, TrainReport};
use std::path::Path;

/// Preset, then the file's keys, then pairs such as `net.rnn_hidden=200`; the later one counts.
/// `file`: TOML, only the keys that differ; `None` for the preset and the pairs alone.
///
/// # Errors
/// A file that cannot be read or is no TOML; unknown keys, wrong types, values that no training can
/// work with: by name.
pub fn resolve(preset: Preset, file: Option<&Path>, set: &[String]) -> Result<TrainConfig> {
    let words = Words { example: "learning_rate=3e-4", saved: "train.toml of any policy" };
    let config: TrainConfig = layered(&TrainConfig::preset(preset), file, set, &words)?;
    config.check()?;
    Ok(config)
}

/// Whether a training may write into `folder`: it is new, empty, or one of ours. A training of
/// other settings begins by removing what is there.
///
/// # Errors
/// The folder holds something else.
pub fn may_become_policy(folder: &Path) -> Result<()> {
    let hint = "give a new folder: hingecast train DEMOS.hdf5 -o POLICY";
    Ok(may_become("policy folder", folder, &["train.toml", "policy.json", "sweep.json"], hint)?)
}

/// Trains into `folder`, or goes on there: `train.toml`, `env_args.json`, the policy, `loss.svg`.
/// Runs on the calling thread's rayon pool.
///
/// # Errors
/// Those of [`hingecast_policy::train::train`]; a folder that cannot be made or written.
pub fn train(demos: &Demos, config: &TrainConfig, folder: &Path, progress: &Progress) -> Result<TrainReport> {
    std::fs::create_dir_all(folder).map_err(Failure::io(folder))?;
    let write = |name: &str, text: &str| {
        let path = folder.join(name);
        write_whole(&path, text.as_bytes()).map_err(Failure::io(&path))
    };
    write("train.toml", &toml::to_string_pretty(config).expect("a config is a table"))?;
    // The world of the demonstrations: rollouts put the policy back into it.
    write("env_args.json", &(serde_json::to_string_pretty(&demos.env_args).expect("plain data") + "\n"))?;
    let report = hingecast_policy::train::train(demos, config, folder, progress)?;
    write("loss.svg", &plot::losses(&report.history))?;
    Ok(report)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_come_in_layers() {
        let set = ["net.rnn_hidden=64".to_string(), "obs=[\"object\"]".into(), "net.head=gaussian".into()];
        let c = resolve(Preset::BcRnn, None, &set).unwrap();
        assert_eq!((c.net.rnn_hidden, c.obs.len(), c.learning_rate), (64, 1, 1e-4));
        let e = resolve(Preset::BcRnn, None, &["net.hidden=64".into()]).unwrap_err();
        assert!(e.what.contains("hidden") && e.place == "--set net.hidden=64", "{e}");
        let e = resolve(Preset::BcRnn, None, &["learning_rate=0".into()]).unwrap_err();
        assert_eq!(e.place, "learning_rate = 0");
    }
}
