//! `hingecast train` from the command line: a policy, resumed after a kill, swept; and what it
//! refuses.

mod common;

use common::{assert_same_bytes, hingecast, start, wait};
use hingecast_policy::{Demos, Episode, demos};
use std::path::Path;
use std::time::{Duration, Instant};

/// Twelve short demonstrations with all observations that the presets ask for.
fn write_demos(path: &Path) {
    let mut rng = fastrand::Rng::with_seed(1);
    let mut rows =
        |width: usize| -> Vec<Vec<f64>> { (0..9).map(|_| (0..width).map(|_| rng.f64()).collect()).collect() };
    let mut episode = || {
        let obs = [("object", 10), ("robot0_eef_pos", 3), ("robot0_eef_quat", 4), ("robot0_gripper_qpos", 2)];
        let obs: std::collections::BTreeMap<_, _> = obs.map(|(key, width)| (key.to_string(), rows(width))).into();
        let actions = obs["object"].iter().map(|x| std::array::from_fn(|k| 0.5 - x[k])).collect();
        Episode { actions, obs, ..Default::default() }
    };
    let episodes = (0..12).map(|_| episode()).collect();
    demos::write(path, &Demos { env_args: serde_json::json!({}), episodes, ..Default::default() }).unwrap();
}

const TINY: &str = "--set net.rnn_hidden=16 --set batch=20";

#[test]
fn a_policy_from_the_command_line() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    write_demos(&dir.join("demos.hdf5"));
    let line = format!("train demos.hdf5 -o policy --steps 60 {TINY}");
    let answer = hingecast(dir, &format!("{line} --json")).done();
    let json = answer.json();
    assert_eq!((json["steps"].as_u64(), json["train_demos"].as_u64()), (Some(60), Some(11)), "{answer}");
    assert!(json["train_loss"].is_f64() && json["valid_loss"].is_f64(), "{answer}");
    let names = common::files(&dir.join("policy"));
    let names: Vec<_> = names.iter().map(|n| n.to_string_lossy()).collect();
    let all = [
        "checkpoint.safetensors",
        "env_args.json",
        "loss.svg",
        "losses.csv",
        "policy.json",
        "policy.safetensors",
        "train.toml",
    ];
    assert_eq!(names, all);
    let again = hingecast(dir, &line).done();
    assert!(again.stderr.contains("went on from step 60"), "{again}");
    // The saved settings are a config file; one thread or two.
    hingecast(dir, "train demos.hdf5 -o again --config policy/train.toml --threads 1 -q").done();
    assert_same_bytes(&dir.join("policy"), &dir.join("again"));
    let policy = hingecast_policy::Policy::load(&dir.join("policy")).unwrap();
    assert_eq!(policy.config.obs.len(), 4);
}

#[test]
fn a_killed_training_goes_on() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    write_demos(&dir.join("demos.hdf5"));
    let line = |out: &str| format!("train demos.hdf5 -o {out} --steps 2500 {TINY} --set checkpoint_every=100");
    hingecast(dir, &line("whole")).done();
    let mut child = start(dir, &line("killed"));
    let begun = Instant::now();
    while !dir.join("killed/checkpoint.safetensors").exists() && child.try_wait().unwrap().is_none() {
        assert!(begun.elapsed() < Duration::from_secs(120), "no checkpoint came");
        std::thread::sleep(Duration::from_millis(2));
    }
    child.kill().unwrap();
    wait("train", child);
    assert!(!dir.join("killed/policy.json").exists(), "it was over before it was killed");
    let resumed = hingecast(dir, &line("killed")).done();
    assert!(resumed.stderr.contains("went on from step"), "{resumed}");
    assert_same_bytes(&dir.join("whole"), &dir.join("killed"));
}

#[test]
fn a_sweep_from_the_command_line() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    write_demos(&dir.join("demos.hdf5"));
    std::fs::write(dir.join("s.toml"), "mode = 'grid'\n[settings]\nlearning_rate = [1e-3, 1e-2]\n").unwrap();
    let answer = hingecast(dir, &format!("train demos.hdf5 -o sweep --sweep s.toml --steps 30 {TINY} --json")).done();
    assert_eq!(answer.json().as_array().map(Vec::len), Some(2), "{answer}");
    assert!(answer.stderr.contains("| learning_rate |"), "{answer}");
    assert!(dir.join("sweep/learning_rate=0.01/policy.json").is_file());
    assert!(dir.join("sweep/sweep_learning_rate.svg").is_file());
}

#[test]
fn what_train_refuses() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    write_demos(&dir.join("demos.hdf5"));
    hingecast(dir, "train nowhere.hdf5 -o p").refused("cannot read the file", "nowhere.hdf5");
    std::fs::write(dir.join("text.hdf5"), "no demonstrations").unwrap();
    hingecast(dir, "train text.hdf5 -o p").refused("not an HDF5 file", "text.hdf5");
    let bytes = std::fs::read(dir.join("demos.hdf5")).unwrap();
    std::fs::write(dir.join("cut.hdf5"), &bytes[..bytes.len() / 3]).unwrap();
    hingecast(dir, "train cut.hdf5 -o p").refused("HDF5", "cut.hdf5");
    hingecast(dir, "train demos.hdf5 -o p --set obs=['lid']").refused("lack the observation lid", "data/demo_0/obs");
    hingecast(dir, "train demos.hdf5 -o p --set net.hidden=3").refused("hidden", "--set net.hidden=3");
    hingecast(dir, "train demos.hdf5 -o p --set batch=0").refused("out of range", "batch = 0");
    hingecast(dir, "train demos.hdf5 -o p --preset bc --set seq_length=5").refused("out of range", "seq_length = 5");
    std::fs::create_dir(dir.join("mine")).unwrap();
    std::fs::write(dir.join("mine/notes.txt"), "keep").unwrap();
    hingecast(dir, "train demos.hdf5 -o mine").refused("holds something else", "mine");
    hingecast(dir, "train demos.hdf5 -o p --sweep nowhere.toml").refused("cannot read", "nowhere.toml");
}
