//! Scans as people make them: a world each, a room, no masks, a push; by the commands of the README.

mod common;

use common::{ROOM, hingecast};

#[test]
fn scans_with_a_world_each_and_no_masks_become_a_twin() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    hingecast(dir, &format!("synth microwave -o rec --states 5 --views 14 {ROOM} --frames per-state --push 40")).done();
    let json: serde_json::Value =
        serde_json::from_slice(&std::fs::read(dir.join("rec/transforms.json")).unwrap()).unwrap();
    assert_eq!(json["registered"], false);
    let built = hingecast(dir, "build rec -o run --preset fast").done();
    let said = built.stderr.clone();
    assert!(said.contains("brought into one frame") && said.contains("no masks"), "{said}");
    assert!(said.contains("was taken to stand") && said.contains("brought back"), "the push is named: {said}");
    assert!(dir.join("run/prepare/masks.png").is_file());
    hingecast(dir, "eval run --truth rec.truth").done();
    let figures: serde_json::Value =
        serde_json::from_slice(&std::fs::read(dir.join("run/eval.json")).unwrap()).unwrap();
    assert_eq!(figures["found_parts"], figures["true_parts"], "{figures}");
    for joint in figures["joints"].as_array().unwrap() {
        assert_eq!(joint["found_type"], joint["true_type"], "{figures}");
        assert!(joint["axis_deg"].as_f64().unwrap() < 0.2, "{figures}");
    }
    // The same again is kept, and the recording is as it was.
    let again = hingecast(dir, "build rec -o run --preset fast").done();
    assert!(again.stderr.contains("prepare kept"), "{}", again.stderr);
    let now: serde_json::Value =
        serde_json::from_slice(&std::fs::read(dir.join("rec/transforms.json")).unwrap()).unwrap();
    assert_eq!(json, now);
}
