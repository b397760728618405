//! Ordinary files of nerfstudio's kind that were once refused or read with a loss.

mod common;

use common::{hinged_box, small};
use hingecast_capture::import::{Config, import};
use hingecast_capture::synth::{SynthConfig, synth};
use hingecast_capture::{CaptureError, Recording};
use hingecast_geom::Progress;
use serde_json::{Value, json};
use std::path::Path;

/// Records a box, changes its `transforms.json`, imports it.
fn imported(dir: &Path, config: &SynthConfig, change: impl Fn(&mut Value)) -> Result<Recording, CaptureError> {
    let rec = dir.join("rec");
    synth(&hinged_box(dir), config, &rec, &Progress::default())?;
    let file = rec.join("transforms.json");
    let mut value: Value = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
    change(&mut value);
    std::fs::write(&file, value.to_string()).unwrap();
    let out = dir.join("out");
    import(&[&rec], &out, &Config::default(), &Progress::default())?;
    Recording::open(&out)
}

fn frames(value: &mut Value) -> &mut Vec<Value> {
    value["frames"].as_array_mut().unwrap()
}

/// A lens with distortion sends people to `import`, which once lost the masks of their hands.
#[test]
fn hands_scale_and_up_survive() {
    let dir = tempfile::tempdir().unwrap();
    let config = SynthConfig { play: true, ..small() };
    let out = imported(dir.path(), &config, |t| {
        t["k1"] = json!(1e-4);
        t["up"] = json!([0.0, 1.0, 0.0]);
        frames(t)[0]["occluded"] = json!(true);
    })
    .unwrap();
    let before = Recording::open(&dir.path().join("rec")).err().map(|e| e.what).unwrap_or_default();
    assert!(before.contains("distorted"), "{before}");
    assert!(out.metric && out.up == glam::DVec3::Y);
    assert!(out.frames[0].occluded);
    let hands = out.frames.iter().filter(|f| f.occluder_mask.is_some()).count();
    assert!(hands >= 3 * 6, "{hands}");
    let hidden = |i: usize| out.load(i).unwrap().usable.iter().filter(|u| **u == 0).count();
    assert!((0..6).any(|i| hidden(i) > 10), "no hand is masked");
}

#[test]
fn lenses_of_colmap_and_names_of_windows_are_read() {
    for model in ["SIMPLE_RADIAL", "RADIAL"] {
        let dir = tempfile::tempdir().unwrap();
        let out = imported(dir.path(), &small(), |t| {
            t["camera_model"] = json!(model);
            t["k1"] = json!(1e-3);
        });
        assert_eq!(out.unwrap().n_states, 3, "{model}");
    }
    let dir = tempfile::tempdir().unwrap();
    let out = imported(dir.path(), &small(), |t| {
        for f in frames(t) {
            for key in ["file_path", "depth_file_path", "mask_path"] {
                f[key] = json!(f[key].as_str().unwrap().replace('/', "\\"));
            }
        }
    });
    assert!(out.unwrap().frames.iter().all(|f| f.depth.is_some() && f.mask.is_some()));
}

/// Every picture with a time of its own once became a state of one view.
#[test]
fn a_film_is_no_recording_of_states() {
    let stamped = |per_time: usize| {
        let dir = tempfile::tempdir().unwrap();
        imported(dir.path(), &small(), |t| {
            t.as_object_mut().unwrap().remove("test_filenames");
            for (i, f) in frames(t).iter_mut().enumerate() {
                f.as_object_mut().unwrap().remove("state");
                f["time"] = json!(1.7e9 + (i / per_time) as f64 / 30.0);
            }
        })
    };
    let e = stamped(1).unwrap_err();
    assert!(e.what.contains("are a film"), "{e}");
    assert!(stamped(8).unwrap().n_states >= 3);
}
