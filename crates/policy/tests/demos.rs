//! robomimic's files: there and back, and what damaged ones say.

use hingecast_policy::demos::{read, write};
use hingecast_policy::{Demos, Episode, PolicyError};
use rust_hdf5::{H5File, H5Group};
use std::collections::BTreeMap;
use std::path::Path;

fn episode(seed: u64, steps: usize) -> Episode {
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut rows = |width: usize| -> Vec<Vec<f64>> {
        (0..steps).map(|_| (0..width).map(|_| 2.0 * rng.f64() - 1.0).collect()).collect()
    };
    let obs: BTreeMap<_, _> =
        [("object", 10), ("robot0_eef_pos", 3)].map(|(key, width)| (key.to_string(), rows(width))).into();
    Episode {
        model_file: format!("<mujoco model=\"é\">{}</mujoco>", "<geom/>".repeat(20_000)),
        actions: rows(7).into_iter().map(|a| a.try_into().unwrap()).collect(),
        states: rows(32),
        rewards: (0..steps).map(|t| f64::from(t + 1 == steps)).collect(),
        dones: (0..steps).map(|t| t + 1 == steps).collect(),
        next_obs: obs.clone(),
        obs,
    }
}

fn demos(count: usize) -> Demos {
    Demos {
        env_args: serde_json::json!({ "env_name": "Open", "type": 1, "env_kwargs": { "control_freq": 20 } }),
        episodes: (0..count).map(|i| episode(i as u64, 5 + i)).collect(),
        masks: [("train", vec!["demo_0", "demo_10"]), ("valid", vec!["demo_1"])]
            .map(|(mask, names)| (mask.to_string(), names.into_iter().map(str::to_string).collect()))
            .into(),
    }
}

/// Every byte of every number, in the order of the numbers in the names (demo_10 after demo_9).
#[test]
fn what_is_written_is_read_back() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("demos.hdf5");
    let demos = demos(12);
    write(&path, &demos).unwrap();
    assert_eq!(read(&path).unwrap(), demos);
    assert_eq!(demos.subset("train"), Some(vec![0, 10]));
    assert_eq!(demos.subset("test"), None);
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1, "a temporary file was left");
}

/// A file made by h5py and laid out by robomimic 0.3 (a gap in the numbers, f32, f64,
/// bytes and booleans, compression, pictures):
/// scripts/policy_reference.py writes it.
#[test]
fn robomimic_files_are_read() {
    let demos = read(Path::new("tests/data/robomimic.hdf5")).unwrap();
    assert_eq!(demos.env_args["env_name"], "Lift");
    assert_eq!(demos.episodes.len(), 2);
    assert_eq!(demos.masks["train"], ["demo_0"]);
    assert_eq!(demos.masks["valid"], ["demo_1"], "demo_2 of the file moves up");
    let e = &demos.episodes[1];
    assert_eq!(e.actions[1], [0.25, -0.5, 0.0, 0.0, 0.0, 0.0, 1.0]);
    assert_eq!(e.obs["object"][2], [2.0, 2.5]);
    assert_eq!((&e.dones[..], &e.rewards[..]), (&[false, false, true][..], &[0.0, 0.0, 1.0][..]));
    assert_eq!(demos.episodes[0].dones, e.dones);
    assert_eq!(e.states[1], [1.5, 0.1f32 as f64]);
    assert!(!e.obs.contains_key("agentview_image"));
    assert!(e.next_obs.is_empty() && e.model_file.is_empty());
}

/// `read` of what `build` put into an HDF5 file.
fn refuse(build: impl Fn(&H5File)) -> PolicyError {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("d.hdf5");
    let file = H5File::create(&path).unwrap();
    build(&file);
    file.close().unwrap();
    let error = read(&path).unwrap_err();
    assert_eq!(error.to_string().lines().count(), 3, "{error}");
    assert!(error.place.contains("d.hdf5"), "{error}");
    error
}

fn table(group: &H5Group, name: &str, rows: usize, width: usize, value: f64) {
    let dataset = group.new_dataset::<f64>().shape([rows, width]).create(name).unwrap();
    dataset.write_raw(&vec![value; rows * width]).unwrap();
}

fn one_demo(file: &H5File) -> H5Group {
    let data = file.create_group("data").unwrap();
    data.set_attr_string("env_args", "{}").unwrap();
    data.create_group("demo_0").unwrap()
}

#[test]
fn what_is_wrong_is_named() {
    let says = |e: PolicyError, place: &str| assert!(e.place.ends_with(place), "{e}");
    says(refuse(|_| ()), "data: not there");
    says(refuse(|f| drop(f.create_group("data").unwrap())), "data, attribute env_args: not there");
    let odd = |f: &H5File| f.create_group("data").unwrap().set_attr_string("env_args", "{").unwrap();
    says(refuse(odd), "data, attribute env_args");
    let empty = |f: &H5File| f.create_group("data").unwrap().set_attr_string("env_args", "{}").unwrap();
    says(refuse(empty), "data: 0 groups demo_<i>");
    says(refuse(|f| drop(one_demo(f))), "data/demo_0/actions: not there");
    says(refuse(|f| table(&one_demo(f), "actions", 4, 7, 0.0)), "data/demo_0/obs: not there");
    says(refuse(|f| table(&one_demo(f), "actions", 4, 14, 0.0)), "data/demo_0/actions: shape (4, 14)");
    let nan = |f: &H5File| {
        let demo = one_demo(f);
        table(&demo, "actions", 4, 7, f64::NAN);
        table(&demo.create_group("obs").unwrap(), "object", 4, 10, 0.0);
    };
    says(refuse(nan), "data/demo_0/actions[0][0] = NaN");
    let short = |f: &H5File| {
        let demo = one_demo(f);
        table(&demo, "actions", 4, 7, 0.0);
        table(&demo.create_group("obs").unwrap(), "object", 3, 10, 0.0);
    };
    says(refuse(short), "data/demo_0/obs/object: 3 rows, 4 actions");
    let text = |f: &H5File| {
        let demo = one_demo(f);
        demo.write_vlen_strings("actions", &["left", "right"]).unwrap();
    };
    says(refuse(text), "data/demo_0/actions");
    let mask = |f: &H5File| {
        let demo = one_demo(f);
        table(&demo, "actions", 4, 7, 0.0);
        table(&demo.create_group("obs").unwrap(), "object", 4, 10, 0.0);
        f.create_group("mask").unwrap().write_vlen_strings("train", &["demo_7"]).unwrap();
    };
    says(refuse(mask), "mask/train: demo_7");
}

#[test]
fn different_keys_are_named() {
    let dir = tempfile::tempdir().unwrap();
    let mut demos = demos(12);
    demos.episodes[3].obs.remove("object");
    let e = write(&dir.path().join("d.hdf5"), &demos).unwrap_err();
    assert!(e.place.ends_with("data/demo_3/obs/object: missing, demo_0: 10 numbers"), "{e}");
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
}

#[test]
fn no_file_and_no_hdf5_are_told_apart() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("d.hdf5");
    assert!(read(&path).unwrap_err().what.starts_with("cannot read the file"));
    std::fs::write(&path, "PK").unwrap();
    assert_eq!(read(&path).unwrap_err().what, "not an HDF5 file");
}

/// Cut off anywhere, or with any byte changed: an error or a reading, never a panic or an endless
/// one.
#[test]
fn damaged_files_do_not_panic() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("d.hdf5");
    let mut small = demos(12);
    small.episodes.truncate(2);
    small.masks.remove("train");
    small.episodes.iter_mut().for_each(|e| e.model_file.truncate(100));
    write(&path, &small).unwrap();
    let whole = std::fs::read(&path).unwrap();
    let mut rng = fastrand::Rng::with_seed(7);
    let mut refused = 0;
    for round in 0..600 {
        let mut bytes = whole.clone();
        if round % 4 == 0 {
            bytes.truncate(rng.usize(..whole.len()));
        } else {
            for _ in 0..rng.usize(1..20) {
                bytes[rng.usize(..whole.len())] = rng.u8(..);
            }
        }
        std::fs::write(&path, &bytes).unwrap();
        if let Err(e) = read(&path) {
            refused += 1;
            assert_eq!(e.to_string().lines().count(), 3, "{e}");
        }
    }
    assert!(refused > 300, "{refused}");
}

/// HINGECAST_PYTHON names an interpreter with h5py, torch and robomimic: their loader reads our
/// file.
#[test]
fn robomimic_reads_what_we_write() {
    let Ok(python) = std::env::var("HINGECAST_PYTHON") else {
        println!("skipped: HINGECAST_PYTHON names no interpreter with h5py, torch and robomimic");
        return;
    };
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("demos.hdf5");
    write(&path, &demos(12)).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scripts/policy_reference.py");
    let said = std::process::Command::new(python).arg(script).arg("sequences").arg(&path).output().unwrap();
    println!("{}", String::from_utf8_lossy(&said.stdout));
    assert!(said.status.success(), "{}", String::from_utf8_lossy(&said.stderr));
}
