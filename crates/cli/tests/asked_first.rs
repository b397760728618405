//! What a build asks before it begins, and what is refused rather than taken for something else.

mod common;

use common::{ROOM, TINY, files, hingecast, tiny_recording};
use std::fs;
use std::path::Path;

fn transforms(dir: &Path, change: impl Fn(&mut serde_json::Value)) {
    let path = dir.join("rec/transforms.json");
    let mut json: serde_json::Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    change(&mut json);
    fs::write(path, json.to_string()).unwrap();
}

/// `build` never asked `check`: from depth in the wrong unit it built for minutes, and exited 0.
#[test]
fn a_build_stops_at_what_makes_it_vain() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    tiny_recording(dir);
    transforms(dir, |json| {
        for frame in json["frames"].as_array_mut().unwrap() {
            frame["depth_unit_scale_factor"] = (10.0 * frame["depth_unit_scale_factor"].as_f64().unwrap()).into();
        }
    });
    hingecast(dir, "build rec -o run -q").refused("depth is in the wrong unit", "depth_unit_scale_factor");
    // The same on a page, which takes no other file's place.
    assert_eq!(hingecast(dir, "check rec -o look.html -q").code, Some(1));
    let page = fs::read_to_string(dir.join("look.html")).unwrap();
    assert!(page.contains("depth is in the wrong unit") && page.contains("From above"), "{page}");
    assert!(dir.join("look.png").is_file() && page.contains("look.png"));
    hingecast(dir, "check rec -o rec/transforms.json -q").refused("does not end in .html", "transforms.json");
    fs::write(dir.join("mine.html"), "<p>years").unwrap();
    hingecast(dir, "check rec -o mine.html -q").refused("no page of check", "mine.html");
    let line = "synth hinged_box -o still --states 3 --views 10 --test-views 0 --size 80 --range lid_hinge=0:0 -q";
    hingecast(dir, line).done();
    hingecast(dir, "build still -o run -q").refused("nothing moves between the states", "still");
    let forced = hingecast(dir, &format!("build still -o run --force -q --json {TINY}")).done();
    assert!(forced.json()["doubts"].to_string().contains("nothing moves"), "{forced}");
}

/// Two flawless recordings of a laptop were refused: its lid is most of it. And a state that stands
/// elsewhere went into the twin as a part.
#[test]
fn states_that_lie_apart_are_brought_back_and_others_left_alone() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    hingecast(dir, &format!("synth microwave -o rec --states 4 --views 14 {ROOM} -q")).done();
    let built = hingecast(dir, "build rec -o run --preset fast --to parts").done();
    assert!(!built.stderr.contains("brought into one frame"), "{built}");
    let tree = |run: &str| -> serde_json::Value {
        let parts: serde_json::Value =
            serde_json::from_slice(&fs::read(dir.join(run).join("parts/parts.json")).unwrap()).unwrap();
        parts["tree"].clone()
    };
    let before = tree("run");
    // State 2 gets a frame of its own: a quarter turn about z, and a step aside.
    transforms(dir, |json| {
        for frame in json["frames"].as_array_mut().unwrap().iter_mut().filter(|f| f["state"] == 2) {
            let rows = frame["transform_matrix"].clone();
            for k in 0..4 {
                frame["transform_matrix"][0][k] = (-rows[1][k].as_f64().unwrap()).into();
                frame["transform_matrix"][1][k] = rows[0][k].clone();
            }
            let x = frame["transform_matrix"][0][3].as_f64().unwrap();
            frame["transform_matrix"][0][3] = (x + 1.5).into();
        }
    });
    let built = hingecast(dir, "build rec -o moved --preset fast --to parts").done();
    assert!(built.stderr.contains("brought into one frame"), "{built}");
    let after = tree("moved");
    assert_eq!(before["parts"], after["parts"]);
    for k in 0..4 {
        let value = |tree: &serde_json::Value| tree["joints"][0]["values"][k].as_f64().unwrap();
        assert!((value(&before).abs() - value(&after).abs()).abs() < 0.01, "{before} {after}");
    }
}

/// `eval` and `report` once put the parts of one recording over the photographs of another.
#[test]
fn a_recording_that_changed_since_is_no_recording_of_the_run() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    tiny_recording(dir);
    hingecast(dir, &format!("build rec -o run -q {TINY}")).done();
    hingecast(dir, "eval run --truth rec.truth -q").done();
    // A name that is used twice, control characters and none at all made models that nobody loads.
    for (name, what) in [("a\\u0001b", "no name for a joint"), ("", "no name for a joint")] {
        fs::write(dir.join("mine.toml"), format!("[[joint]]\njoint = \"joint_1\"\nname = \"{name}\"\n")).unwrap();
        hingecast(dir, &format!("build rec -o run -q {TINY} --config mine.toml")).refused(what, "[[joint]] number 1");
    }
    hingecast(dir, &format!("build rec -o run -q {TINY}")).done();
    // A pass that does not exist was refused when all stages had been thrown away.
    let whole = files(&dir.join("run"));
    hingecast(dir, &format!("build rec -o run -q {TINY} --set passes.skip=[\"nope\"]"))
        .refused("no pass 'nope'", "passes.skip");
    assert_eq!(files(&dir.join("run")), whole);
    hingecast(dir, "report run -q").done();

    transforms(dir, |json| json["frames"].as_array_mut().unwrap().swap(0, 1));
    hingecast(dir, "eval run --truth rec.truth -q").refused("the recording has changed", "rec");
    hingecast(dir, "report run -q").refused("the recording has changed", "rec");
}

/// Each of these wrote over what was there.
#[test]
fn what_is_there_is_no_place_for_answers() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    tiny_recording(dir);
    let before = files(dir);
    for line in ["import rec -o rec -q", "import rec -o ./rec/../rec -q"] {
        hingecast(dir, line).refused("take the place of a source", "rec");
    }
    if cfg!(feature = "mujoco") {
        hingecast(dir, "demos --object hinged_box -n 1 -o rec/transforms.json -q")
            .refused("not demonstrations that hingecast recorded", "transforms.json");
    }
    hingecast(dir, "demo hinged_box -o rec -q").refused("the demo's folder holds something else", "rec");
    hingecast(dir, "bench hinged_box -o bench --protocol 5x48 -q").refused("for the bench of joints", "--protocol");
    assert_eq!(files(dir), before);
}

/// A person says where the object is, in a room in which nothing moves.
#[test]
fn masks_by_a_box_or_a_pixel() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    hingecast(dir, &format!("synth microwave -o rec --states 2 --views 10 {ROOM} --range door_hinge=0:0 -q")).done();
    hingecast(dir, "mask rec -q").refused("nothing moves", "rec");
    hingecast(dir, "mask rec --box 1,2,3 -q").refused("not understood", "--box 1,2,3");
    hingecast(dir, "mask rec --at rgb/s000_v000.png:9000,1 -q").refused("the pixel is not in the picture", "--at");
    let answer = hingecast(dir, "mask rec --at rgb/s000_v005.png:80,60 -q --json").done();
    let share = answer.json()["report"]["shares"][0].as_f64().unwrap();
    assert!(share > 0.02 && share < 0.6, "{answer}");
}
