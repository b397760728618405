//! Several sources become one recording: a state each, in the order given.

mod common;

use common::dots::*;
use glam::DVec3;
use hingecast_capture::Recording;
use hingecast_capture::import::{Config, import};
use serde_json::{Value, json};
use std::path::Path;

/// One scan: a `transforms.json` with the dot of a state. `top` adds keys.
fn scan(folder: &Path, state: usize, top: Value) {
    let mut frames = Vec::new();
    for (i, c) in cameras().iter().enumerate() {
        let (uv, z) = c.project(POINTS[state]);
        rgb(folder.join(format!("images/{i}.png")), uv);
        depth(folder.join(format!("depth/{i}.png")), uv, z, 1);
        frames.push(json!({ "file_path": format!("images/{i}.png"), "depth_file_path": format!("depth/{i}.png"),
            "transform_matrix": gl(c), "time": i as f64 }));
    }
    let c = cameras()[0];
    let mut all = json!({ "w": W, "h": H, "fl_x": c.fx, "fl_y": c.fy, "cx": c.cx, "cy": c.cy, "frames": frames });
    all.as_object_mut().unwrap().extend(top.as_object().unwrap().clone());
    write_json(folder.join("transforms.json"), all);
}

#[test]
fn two_scans_are_two_states_of_separate_worlds() {
    let dir = tempfile::tempdir().unwrap();
    let [a, b, out] = ["a", "b", "rec"].map(|n| dir.path().join(n));
    scan(&a, 0, json!({ "metric": true }));
    scan(&b, 1, json!({ "metric": true }));
    let report = import(&[&b, &a], &out, &Config::default(), &Default::default()).unwrap();
    assert_eq!((report.states, report.frames, report.notes.len()), (2, 10, 1));
    let recording = Recording::open(&out).unwrap();
    assert!(!recording.registered && recording.metric && recording.up == DVec3::Z);
    assert_eq!(recording.name, "rec");
    for (i, f) in recording.frames.iter().enumerate() {
        // b came first.
        let (uv, z) = f.camera.project(POINTS[1 - f.state]);
        let depth = recording.load(i).unwrap().depth[uv.y as usize * W + uv.x as usize];
        assert!((f64::from(depth) - z).abs() < 1e-3, "state {}: {depth} {z}", f.state);
    }
    // It says so when it is written and read again; and one scan alone needs no registration.
    recording.write().unwrap();
    let read = Recording::open(&out).unwrap();
    assert_eq!((read.registered, read.n_states, read.up), (false, 2, recording.up));
    let again = dir.path().join("again");
    import(&[&out], &again, &Config::default(), &Default::default()).unwrap();
    assert!(!Recording::open(&again).unwrap().registered);
    import(&[&a], &out, &Config::default(), &Default::default()).unwrap_err();
    let first = dir.path().join("first");
    std::fs::write(
        a.join("transforms.json"),
        std::fs::read_to_string(a.join("transforms.json")).unwrap().replace("\"time\"", "\"when\""),
    )
    .unwrap();
    import(&[&a], &first, &Config::default(), &Default::default()).unwrap();
    assert!(Recording::open(&first).unwrap().registered);
}

/// Scans know where they are, not how far that is from each other; and what came out before is replaced
/// only by what opens.
#[test]
fn a_scan_far_away_is_no_stray_and_a_bad_one_replaces_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let [a, b, out] = ["a", "b", "rec"].map(|n| dir.path().join(n));
    let both = json!({ "metric": true, "name": "cupboard", "doubts": ["a turn was guessed"] });
    scan(&a, 0, both.clone());
    scan(&b, 1, both);
    let change = |change: &dyn Fn(&mut Value)| {
        let path = b.join("transforms.json");
        let mut json: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
        change(&mut json);
        write_json(path, json);
    };
    change(&|scan| {
        for frame in scan["frames"].as_array_mut().unwrap() {
            frame["transform_matrix"][0][3] = json!(frame["transform_matrix"][0][3].as_f64().unwrap() + 6000.0);
        }
    });
    import(&[&a, &b], &out, &Config::default(), &Default::default()).unwrap();
    let recording = Recording::open(&out).unwrap();
    assert_eq!((recording.frames.len(), &*recording.name), (10, "cupboard"));
    assert_eq!(recording.doubts, ["a turn was guessed", "a turn was guessed"]);
    recording.write().unwrap();
    assert_eq!(Recording::open(&out).unwrap().doubts, recording.doubts);
    let before = std::fs::read(out.join("transforms.json")).unwrap();
    change(&|scan| scan["frames"][2]["transform_matrix"][0][3] = json!(1e9));
    import(&[&a, &b], &out, &Config::default(), &Default::default()).unwrap_err();
    assert_eq!(std::fs::read(out.join("transforms.json")).unwrap(), before);
}

/// Only where the sources disagree are their worlds turned.
#[test]
fn ups_that_differ_become_z() {
    let dir = tempfile::tempdir().unwrap();
    let [a, b, out] = ["a", "b", "rec"].map(|n| dir.path().join(n));
    scan(&a, 0, json!({ "up": [0, 1, 0] }));
    scan(&b, 1, json!({ "up": [0, 1, 0] }));
    import(&[&a, &b], &out, &Config::default(), &Default::default()).unwrap();
    let same = Recording::open(&out).unwrap();
    assert_eq!(same.up, DVec3::Y);
    assert!((same.frames[0].camera.centre() - cameras()[0].centre()).length() < 1e-9);

    scan(&b, 1, json!({ "up": [0, 0, 1] }));
    import(&[&a, &b], &out, &Config::default(), &Default::default()).unwrap();
    let turned = Recording::open(&out).unwrap();
    assert_eq!(turned.up, DVec3::Z);
    for f in &turned.frames {
        let centre = cameras()[f.view].centre();
        // y up to z up: a quarter turn about x.
        let expected = if f.state == 0 { DVec3::new(centre.x, -centre.z, centre.y) } else { centre };
        assert!((f.camera.centre() - expected).length() < 1e-9, "{} {expected}", f.camera.centre());
        let point = POINTS[f.state];
        let point = if f.state == 0 { DVec3::new(point.x, -point.z, point.y) } else { point };
        let (uv, expected) = (f.camera.project(point).0, cameras()[f.view].project(POINTS[f.state]).0);
        assert!((uv - expected).length() < 1e-6);
    }
}

#[test]
fn what_cannot_be_put_together_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let [a, b, out] = ["a", "b", "rec"].map(|n| dir.path().join(n));
    scan(&a, 0, json!({ "metric": true }));
    scan(&b, 1, json!({}));
    let e = import(&[&a, &b], &out, &Config::default(), &Default::default()).unwrap_err();
    assert!(e.what.contains("metres") && e.place.contains("/b"), "{e}");
    scan(&a.join("x"), 0, json!({}));
    scan(&a.join("y"), 1, json!({}));
    std::fs::remove_file(a.join("transforms.json")).unwrap();
    let e = import(&[&b, &a], &out, &Config::default(), &Default::default()).unwrap_err();
    assert!(e.what.contains("2 states") && e.to_string().lines().count() == 3, "{e}");
    assert!(!out.exists());
}
