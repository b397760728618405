//! A real object (PartNet-Mobility) through the whole path, where `HINGECAST_DATA` says that it is at hand.

mod common;

use common::{assert_finite, hingecast};

/// The trash can with a fraction of the default pictures, pixels and steps: the lid's hinge is found all the same.
#[test]
fn the_trash_can_has_its_hinge() {
    if std::env::var_os("HINGECAST_DATA").is_none() {
        eprintln!("skipped: HINGECAST_DATA is not set");
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    hingecast(dir, "synth trashcan_102209 -o rec --states 13 --views 24 --test-views 2 --size 128 -q").done();
    let settings = "--set fit.steps=500 --set fit.gaussians=5000 --set track.steps=240 --set twin.voxel=0.01";
    let built = hingecast(dir, &format!("build rec -o run {settings}")).done();
    let answer = hingecast(dir, "eval run --truth rec.truth --json").done();
    let figures = answer.json();
    assert_finite(&figures, "eval");
    assert_eq!(figures["found_parts"], figures["true_parts"], "{built}{answer}");
    assert_eq!(figures["joint_type_accuracy"], 1.0, "{answer}");
    let joint = &figures["joints"][0];
    let pivot = joint["pivot"].as_f64().unwrap() / figures["diagonal"].as_f64().unwrap();
    assert!(joint["axis_deg"].as_f64().unwrap() < 2.0, "{answer}");
    assert!(pivot < 0.02, "pivot off by {pivot} of the diagonal\n{answer}");
}
