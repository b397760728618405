//! Training as a whole: it learns, resumes to the same bytes, saves what acts the same, refuses
//! what it cannot use.

use hingecast_geom::Progress;
use hingecast_policy::net::Head;
use hingecast_policy::train::{Preset, TrainConfig, TrainReport, train};
use hingecast_policy::{Actor, Demos, Episode, Normalization, Policy, PolicyError};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// What the demonstrator does: steers the first number to zero; the second says only in the first
/// three steps which way the gripper goes, so it must be remembered.
fn expert(seed: u64, steps: usize) -> Episode {
    let mut rng = fastrand::Rng::with_seed(seed);
    let (mut x, grip) = (2.0 * rng.f64() - 1.0, if rng.bool() { 1.0 } else { -1.0 });
    let mut episode = Episode::default();
    let mut rows = Vec::new();
    for t in 0..steps {
        rows.push(vec![x, if t < 3 { grip } else { 0.0 }]);
        let move_x = (-0.5 * x + 0.02 * (2.0 * rng.f64() - 1.0)).clamp(-1.0, 1.0);
        episode.actions.push([move_x, 0.0, 0.0, 0.1, -0.1, 0.3, 0.9 * grip]);
        x += move_x;
    }
    episode.obs = [("object".to_string(), rows)].into();
    episode
}

fn demos() -> Demos {
    Demos { episodes: (0..80).map(|i| expert(i, 8 + i as usize % 5)).collect(), ..Default::default() }
}

fn config() -> TrainConfig {
    let mut c = TrainConfig::preset(Preset::BcRnnFast);
    (c.steps, c.batch, c.validate_every, c.checkpoint_every) = (500, 60, 100, 40);
    c.obs = vec!["object".into()];
    (c.net.rnn_hidden, c.learning_rate) = (24, 5e-3);
    c
}

fn run(config: &TrainConfig, folder: &Path) -> Result<TrainReport, PolicyError> {
    train(&demos(), config, folder, &Progress::default())
}

/// Asks to stop after `step`.
fn run_until(step: usize, config: &TrainConfig, folder: &Path) -> PolicyError {
    let flag = Arc::new(AtomicBool::new(false));
    let set = flag.clone();
    let progress = Progress::new(move |done, _, _| set.store(done >= step, Ordering::Relaxed), flag);
    train(&demos(), config, folder, &progress).unwrap_err()
}

fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = std::fs::read_dir(folder).unwrap().flatten().filter(|e| e.path().is_file());
    entries.map(|e| (e.file_name().to_string_lossy().into_owned(), std::fs::read(e.path()).unwrap())).collect()
}

fn assert_same(a: &Path, b: &Path) {
    let (a, b) = (files(a), files(b));
    assert_eq!(a.keys().collect::<Vec<_>>(), b.keys().collect::<Vec<_>>());
    a.iter().for_each(|(name, bytes)| assert!(*bytes == b[name], "{name} differs"));
}

fn observation(x: f64, sign: f64) -> BTreeMap<String, Vec<f64>> {
    [("object".to_string(), vec![x, sign])].into()
}

#[test]
fn it_learns_saves_and_acts() {
    let dir = tempfile::tempdir().unwrap();
    let report = run(&config(), dir.path()).unwrap();
    let (first, last) = (report.history[0], report.last());
    assert_eq!((report.train_demos, report.valid_demos, last.step), (72, 8, 500));
    assert!(last.train < first.train - 5.0 && last.valid.unwrap() < first.train, "{first:?} {last:?}");
    assert_eq!(report.history.iter().filter(|r| r.valid.is_some()).count(), 5);
    let names: Vec<String> = files(dir.path()).into_keys().collect();
    assert_eq!(names, ["checkpoint.safetensors", "losses.csv", "policy.json", "policy.safetensors"]);

    let policy = Policy::load(dir.path()).unwrap();
    let mut actor = Actor::new(&policy, 7);
    let mut x = 0.6;
    for t in 0..6 {
        let action = actor.act(&observation(x, if t < 3 { 1.0 } else { 0.0 })).unwrap();
        assert!((action[0] + 0.5 * x).abs() < 0.1, "step {t}: {action:?} at {x}");
        x += action[0];
    }
    // Same seed: same dice. Forgotten after the horizon: as if it began anew.
    let acts = |seed: u64, n: usize| -> Vec<[f64; 7]> {
        let mut actor = Actor::new(&policy, seed);
        (0..n).map(|_| actor.act(&observation(0.3, 1.0)).unwrap()).collect()
    };
    assert_eq!(acts(1, 12), acts(1, 12));
    assert_ne!(acts(1, 1), acts(2, 1));
    let long = acts(3, 11);
    assert!(long[10].iter().zip(&long[0]).all(|(a, b)| (a - b).abs() < 1e-3), "{long:?}");
}

/// The gripper's way was shown in the first three steps only.
#[test]
fn it_remembers() {
    let dir = tempfile::tempdir().unwrap();
    let mut config = config();
    config.net.head = Head::Action;
    run(&config, dir.path()).unwrap();
    let policy = Policy::load(dir.path()).unwrap();
    for sign in [1.0, -1.0] {
        let mut actor = Actor::new(&policy, 0);
        let acts: Vec<f64> = (0..9)
            .map(|t| actor.act(&observation(0.6 * 0.5f64.powi(t), if t < 3 { sign } else { 0.0 })).unwrap()[6])
            .collect();
        assert!(acts.iter().all(|a| a * sign > 0.6), "{sign}: {acts:?}");
    }
}

#[test]
fn a_stopped_training_goes_on_to_the_same_bytes() {
    let dir = tempfile::tempdir().unwrap();
    let (whole, parts) = (dir.path().join("whole"), dir.path().join("parts"));
    let config = TrainConfig { steps: 130, snapshot_every: 65, ..config() };
    run(&config, &whole).unwrap();
    // Between two records, between two checkpoints.
    for step in [23, 71] {
        let e = run_until(step, &config, &parts);
        assert!(e.cancelled && e.to_string().lines().count() == 3, "{e}");
        assert!(!parts.join("policy.json").exists());
    }
    assert_eq!(run(&config, &parts).unwrap().resumed_from, 71);
    assert_same(&whole, &parts);
    assert_same(&whole.join("snapshots/step_0000065"), &parts.join("snapshots/step_0000065"));
    // Once more: nothing to do.
    assert_eq!(run(&config, &parts).unwrap().resumed_from, 130);
    assert_same(&whole, &parts);
}

#[test]
fn threads_do_not_change_a_byte() {
    let dir = tempfile::tempdir().unwrap();
    // Two parts to a batch.
    let config = TrainConfig { steps: 60, ..config() };
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| run(&config, &dir.path().join(threads.to_string()))).unwrap();
    }
    assert_same(&dir.path().join("1"), &dir.path().join("3"));
}

#[test]
fn other_settings_begin_anew_and_more_steps_go_on() {
    let dir = tempfile::tempdir().unwrap();
    let constant = TrainConfig { steps: 40, learning_rate: 1e-3, final_learning_rate: 1e-3, ..config() };
    run(&constant, dir.path()).unwrap();
    let longer = run(&TrainConfig { steps: 60, ..constant.clone() }, dir.path()).unwrap();
    assert_eq!((longer.resumed_from, longer.steps), (40, 60));
    let fresh = run(&TrainConfig { seed: 1, ..constant.clone() }, dir.path()).unwrap();
    assert_eq!(fresh.resumed_from, 0);
    // With a falling rate the steps are part of what a training is.
    let falling = TrainConfig { final_learning_rate: 1e-4, ..constant };
    run(&falling, dir.path()).unwrap();
    assert_eq!(run(&TrainConfig { steps: 60, ..falling }, dir.path()).unwrap().resumed_from, 0);
}

#[test]
fn every_preset_trains() {
    let dir = tempfile::tempdir().unwrap();
    for preset in [Preset::Bc, Preset::BcRnn, Preset::BcRnnFast] {
        let mut c = TrainConfig { steps: 2, obs: vec!["object".into()], ..TrainConfig::preset(preset) };
        c.net.rnn_hidden = c.net.rnn_hidden.min(30);
        let folder = dir.path().join(format!("{preset:?}"));
        run(&c, &folder).unwrap();
        let action = Actor::new(&Policy::load(&folder).unwrap(), 0).act(&observation(0.1, 0.0)).unwrap();
        assert!(action.iter().all(|a| a.abs() <= 1.001), "{action:?}");
    }
}

#[test]
fn settings_and_files_that_cannot_be_used_are_named() {
    let dir = tempfile::tempdir().unwrap();
    let refused = |change: fn(&mut TrainConfig)| {
        let mut c = config();
        change(&mut c);
        let e = run(&c, dir.path()).unwrap_err();
        assert_eq!(e.to_string().lines().count(), 3);
        e.place
    };
    assert_eq!(refused(|c| c.steps = 0), "steps = 0");
    assert_eq!(refused(|c| c.learning_rate = f64::NAN), "learning_rate = NaN");
    assert_eq!(refused(|c| c.net.min_std = -1.0), "net.min_std = -1, above 0 and at most 7.5 is expected");
    assert_eq!(refused(|c| c.obs = vec!["lid".into()]), "data/demo_0/obs: object");
    assert_eq!(refused(|c| c.seq_length = 0), "seq_length = 0");
}

#[test]
fn damaged_policies_are_named() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path();
    let e = Policy::load(path).unwrap_err();
    assert!(e.what.starts_with("not a policy") && e.place.ends_with("policy.json"), "{e}");
    run(&TrainConfig { steps: 2, ..config() }, path).unwrap();
    let policy = Policy::load(path).unwrap();

    let e = policy.input(&observation(f64::NAN, 0.0)).unwrap_err();
    assert_eq!(e.place, "observation object: [0] = NaN");
    let e = policy.input(&BTreeMap::new()).unwrap_err();
    assert!(e.place.starts_with("observation object: not among"), "{e}");
    let e = policy.input(&[("object".to_string(), vec![0.0])].into()).unwrap_err();
    assert_eq!(e.place, "observation object: 1 numbers, 2 expected");

    // Two numbers are observed: three means would have moved every later observation by one.
    let mut odd = policy.config.clone();
    let n = Normalization { mean: vec![0.0; 3], std: vec![1.0; 3] };
    odd.normalization = Some(n);
    let e = Policy::new(odd, policy.parameters.clone()).unwrap_err();
    assert!(e.what.ends_with("3 means, 3 stds, 2 observed numbers"), "{e}");
    let e = Policy::new(policy.config.clone(), vec![0.0; 3]).unwrap_err();
    assert!(e.what.starts_with("3 weights, "), "{e}");

    let mut odd = policy.clone();
    odd.parameters[5] = f32::INFINITY;
    odd.save(path).unwrap();
    let e = Policy::load(path).unwrap_err();
    assert!(e.place.ends_with("policy.nets.rnn.nets.weight_ih_l0: [5] = inf"), "{e}");
    let weights = path.join("policy.safetensors");
    let bytes = std::fs::read(&weights).unwrap();
    std::fs::write(&weights, &bytes[..bytes.len() / 2]).unwrap();
    assert!(Policy::load(path).unwrap_err().what.starts_with("not a whole safetensors file"));
    let text = std::fs::read_to_string(path.join("policy.json")).unwrap();
    std::fs::write(&weights, &bytes).unwrap();
    std::fs::write(path.join("policy.json"), text.replace("\"rnn_hidden\": 24", "\"rnn_hidden\": 25")).unwrap();
    let e = Policy::load(path).unwrap_err();
    assert_eq!(e.what, "a weight of another shape or type");
    std::fs::write(path.join("policy.json"), text.replace("\"rnn_hidden\": 24", "\"rnn_hidden\": 99999999")).unwrap();
    assert!(Policy::load(path).unwrap_err().what.contains("rnn_hidden"));
}
