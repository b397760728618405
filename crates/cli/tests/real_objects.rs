//! A real object (PartNet-Mobility) through the whole path, where `HINGECAST_DATA` says that it is
//! at hand.

mod common;

use common::{assert_finite, hingecast};

/// The trash can with a fraction of the default pictures, pixels and steps: both methods find the
/// lid's hinge all the same, and the default one to a tenth of a degree.
#[test]
fn the_trash_can_has_its_hinge() {
    if std::env::var_os("HINGECAST_DATA").is_none() {
        eprintln!("skipped: HINGECAST_DATA is not set");
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    hingecast(dir, "synth trashcan_102209 -o rec --states 13 --views 24 --test-views 2 --size 128 -q").done();
    for (method, axis_deg, pivot_share) in [("screw", 0.1, 0.003), ("track", 2.0, 0.02)] {
        let settings = "--set fit.steps=500 --set fit.gaussians=5000 --set track.steps=240 --set twin.voxel=0.01";
        let built = hingecast(dir, &format!("build rec -o {method} --method {method} {settings}")).done();
        let answer = hingecast(dir, &format!("eval {method} --truth rec.truth --json")).done();
        let figures = answer.json();
        assert_finite(&figures, "eval");
        assert_eq!(figures["found_parts"], figures["true_parts"], "{built}{answer}");
        assert_eq!(figures["joint_type_accuracy"], 1.0, "{answer}");
        let joint = &figures["joints"][0];
        let pivot = joint["pivot"].as_f64().unwrap() / figures["diagonal"].as_f64().unwrap();
        assert!(joint["axis_deg"].as_f64().unwrap() < axis_deg, "{answer}");
        assert!(pivot < pivot_share, "pivot off by {pivot} of the diagonal\n{answer}");
    }
}

/// The glasses and the two-door cabinet, on which the classical way is known to fail.
#[test]
fn glasses_and_a_cabinet_have_all_their_parts() {
    if std::env::var_os("HINGECAST_DATA").is_none() {
        eprintln!("skipped: HINGECAST_DATA is not set");
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let line = "bench eyeglasses_101287 cabinet2door_45305 --joints --protocol 5x48 --size 160 -o bench --json -q";
    let answer = hingecast(dir.path(), line).done();
    for object in answer.json().as_array().unwrap() {
        assert_eq!(object["found_parts"], object["true_parts"], "{answer}");
        assert_eq!(object["tree_accuracy"], 1.0, "{answer}");
        for joint in object["joints"].as_array().unwrap() {
            assert_eq!(joint["type_right"], true, "{answer}");
            assert!(joint["axis_deg"].as_f64().unwrap() < 0.5, "{answer}");
        }
    }
}
