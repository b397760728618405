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
    // Once, for all states after it.
    let prepared = std::fs::read_to_string(dir.join("run/prepare/prepare.json")).unwrap();
    assert_eq!(prepared.matches("was taken to stand").count(), 1, "{prepared}");
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

/// Files that say nothing of up, or the wrong thing: one scan of three stands on its head.
#[test]
fn a_scan_upside_down_is_turned() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let world = "--states 3 --views 12 --test-views 0 --camera 160,120,132,132,80,60 --scene room --masks none";
    hingecast(dir, &format!("synth microwave -o rec {world}")).done();
    let read = |path: &str| -> serde_json::Value {
        serde_json::from_slice(&std::fs::read(dir.join(path).join("transforms.json")).unwrap()).unwrap()
    };
    let truth = read("rec");
    for state in 0..3 {
        let mut scan = truth.clone();
        scan.as_object_mut().unwrap().remove("up");
        let frames = scan["frames"].as_array_mut().unwrap();
        frames.retain(|f| f["state"] == state);
        for f in frames {
            f.as_object_mut().unwrap().remove("state");
            for key in ["file_path", "depth_file_path"] {
                f[key] = dir.join("rec").join(f[key].as_str().unwrap()).to_str().unwrap().into();
            }
            for row in 1..3 {
                for column in (0..4).filter(|_| state == 1) {
                    let x = f["transform_matrix"][row][column].as_f64().unwrap();
                    f["transform_matrix"][row][column] = (-x).into();
                }
            }
        }
        std::fs::create_dir(dir.join(format!("scan_{state}"))).unwrap();
        std::fs::write(dir.join(format!("scan_{state}/transforms.json")), scan.to_string()).unwrap();
    }
    let imported = hingecast(dir, "import scan_0 scan_1 scan_2 -o out").done();
    assert!(!imported.stderr.contains("doubt"), "{imported}");
    let out = read("out");
    for (f, t) in out["frames"].as_array().unwrap().iter().zip(truth["frames"].as_array().unwrap()) {
        for (row, column) in (0..3).flat_map(|r| (0..4).map(move |c| (r, c))) {
            let [is, should] = [f, t].map(|f| f["transform_matrix"][row][column].as_f64().unwrap());
            assert!((is - should).abs() < 0.01, "{}: {is}, should be {should}", t["file_path"]);
        }
    }
    // One scan's depth in another unit: two ways to lie, it was said, or that little agrees.
    let path = dir.join("scan_2/transforms.json");
    let mut scan = read("scan_2");
    for f in scan["frames"].as_array_mut().unwrap() {
        let unit = f["depth_unit_scale_factor"].as_f64().unwrap();
        f["depth_unit_scale_factor"] = (0.1 * unit).into();
    }
    std::fs::write(path, scan.to_string()).unwrap();
    hingecast(dir, "import scan_0 scan_1 scan_2 -o other -q").refused("depth is in the wrong unit", "state 2");
}
