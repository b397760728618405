//! What goes wrong on the command line ends in three lines: what, where, what to try. Never in a
//! panic.

mod common;

use common::{Answer, TINY, hingecast, tiny_recording};
use std::fs;
use std::path::Path;
use tempfile::TempDir;

fn dir() -> TempDir {
    tempfile::tempdir().unwrap()
}

/// A recording that `build` opens; its pictures are too few and small for more.
fn small_recording(dir: &Path, name: &str, object: &str, states: usize) {
    let line = format!("synth {object} -o {name} --states {states} --views 4 --test-views 1 --size 32 -q");
    hingecast(dir, &line).done();
}

/// Rewrites `transforms.json` of the recording `rec`.
fn edit(dir: &Path, change: impl FnOnce(&mut serde_json::Value)) {
    let path = dir.join("rec/transforms.json");
    let mut json: serde_json::Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    change(&mut json);
    fs::write(&path, json.to_string()).unwrap();
}

#[test]
fn a_recording_that_is_not_there() {
    let d = dir();
    hingecast(d.path(), "build nowhere -o run").refused("there is no recording here", "nowhere");
    assert!(!d.path().join("run").exists(), "nothing is left behind");
}

#[test]
fn a_folder_without_transforms_json() {
    let d = dir();
    fs::create_dir(d.path().join("empty")).unwrap();
    hingecast(d.path(), "build empty -o run").refused("transforms.json is missing", "empty");
    let checked = hingecast(d.path(), "check empty --json");
    assert_eq!(checked.code, Some(1), "{checked}");
    assert_eq!(checked.json()["findings"].as_array().unwrap().len(), 1, "{checked}");
}

#[test]
fn a_truncated_transforms_json() {
    let d = dir();
    fs::create_dir(d.path().join("rec")).unwrap();
    fs::write(d.path().join("rec/transforms.json"), "{\"frames\": [").unwrap();
    hingecast(d.path(), "build rec -o run").refused("not JSON", "transforms.json");
}

#[test]
fn a_single_state() {
    let d = dir();
    small_recording(d.path(), "rec", "hinged_box", 1);
    hingecast(d.path(), "build rec -o run").refused("1 state", "transforms.json");
}

#[test]
fn too_few_views_of_a_state() {
    let d = dir();
    small_recording(d.path(), "rec", "hinged_box", 3);
    edit(d.path(), |json| {
        let frames = json["frames"].as_array_mut().unwrap();
        // Frames stand in the order of states and views; the last of each state is held out.
        frames.retain(|f| f["state"] != 1 || f["view"].as_u64().unwrap() < 2);
    });
    hingecast(d.path(), "build rec -o run").refused("state 1 has", "transforms.json");
}

#[test]
fn a_recording_without_depth() {
    let d = dir();
    small_recording(d.path(), "rec", "hinged_box", 3);
    edit(d.path(), |json| {
        for f in json["frames"].as_array_mut().unwrap() {
            f.as_object_mut().unwrap().remove("depth_file_path");
        }
    });
    hingecast(d.path(), "build rec -o run").refused("no depth", "transforms.json");
}

#[test]
fn a_picture_that_is_missing_is_noticed_before_any_work() {
    let d = dir();
    small_recording(d.path(), "rec", "hinged_box", 3);
    let last = fs::read_dir(d.path().join("rec/rgb")).unwrap().flatten().map(|e| e.path()).max().unwrap();
    fs::remove_file(&last).unwrap();
    hingecast(d.path(), "build rec -o run").refused("cannot read", last.file_name().unwrap().to_str().unwrap());
    assert!(!d.path().join("run/splat").exists());
}

#[test]
fn a_pose_that_is_not_rigid() {
    let d = dir();
    small_recording(d.path(), "rec", "hinged_box", 3);
    edit(d.path(), |json| json["frames"][2]["transform_matrix"][0][0] = serde_json::json!(7.5));
    hingecast(d.path(), "build rec -o run").refused("rigid", "frames[2]");
}

#[test]
fn masks_that_are_all_black() {
    let d = dir();
    small_recording(d.path(), "rec", "hinged_box", 3);
    let black = image::GrayImage::new(32, 32);
    for entry in fs::read_dir(d.path().join("rec/mask")).unwrap().flatten() {
        black.save(entry.path()).unwrap();
    }
    hingecast(d.path(), "build rec -o run").refused("have a mask that shows the object", "rec: state 0");
}

#[test]
fn settings() {
    let d = dir();
    small_recording(d.path(), "rec", "hinged_box", 3);
    let build = |flags: &str| hingecast(d.path(), &format!("build rec -o run {flags}"));
    build("--set fit.stepz=9").refused("stepz", "--set fit.stepz=9");
    build("--set nonsense=1").refused("nonsense", "--set nonsense=1");
    build("--set fit.steps").refused("not key=value", "--set");
    build("--set fit.steps=many").refused("many", "--set fit.steps=many");
    build("--set fit.steps=-3").refused("-3", "--set fit.steps=-3");
    build("--set fit.steps=0").refused("out of range", "fit.steps = 0");
    build("--set twin.voxel=0").refused("out of range", "twin.voxel = 0");
    build("--set twin.voxel=nan").refused("out of range", "twin.voxel = NaN");
    build("--config nowhere.toml").refused("cannot read", "nowhere.toml");
    fs::write(d.path().join("bad.toml"), "fit = [").unwrap();
    build("--config bad.toml").refused("not TOML", "bad.toml");
    fs::write(d.path().join("unknown.toml"), "[fit]\nstepz = 3\n").unwrap();
    build("--config unknown.toml").refused("stepz", "unknown.toml");
    assert!(!d.path().join("run").exists(), "nothing was begun");
}

#[test]
fn stages() {
    let d = dir();
    small_recording(d.path(), "rec", "hinged_box", 3);
    hingecast(d.path(), "build rec -o run --from polish").refused("no stage 'polish'", "--from");
    hingecast(d.path(), "build rec -o run --to polish").refused("no stage 'polish'", "--to");
    hingecast(d.path(), "build rec -o run --from twin --to splat").refused("nothing is left to do", "--from");
}

/// A build empties the folders of its stages, and `--fresh` the whole run: never somebody's own
/// folder.
#[test]
fn a_run_folder_that_holds_something_else() {
    let d = dir();
    small_recording(d.path(), "rec", "hinged_box", 3);
    fs::create_dir_all(d.path().join("thesis/motion")).unwrap();
    fs::write(d.path().join("thesis/motion/chapter.txt"), "years of work").unwrap();
    for flags in ["", "--fresh"] {
        let answer = hingecast(d.path(), &format!("build rec -o thesis {flags}"));
        answer.refused("holds something else", "thesis");
        assert!(d.path().join("thesis/motion/chapter.txt").exists());
    }
    hingecast(d.path(), "build rec -o rec --fresh").refused("holds something else", "rec");
    hingecast(d.path(), "synth hinged_box -o thesis").refused("holds something else", "thesis");
    assert!(d.path().join("thesis/motion/chapter.txt").exists());
}

#[test]
fn places_that_cannot_be_written() {
    let d = dir();
    small_recording(d.path(), "rec", "hinged_box", 3);
    fs::write(d.path().join("file"), "").unwrap();
    hingecast(d.path(), "build rec -o file/run").refused("cannot", "file");
    hingecast(d.path(), "build rec -o file").refused("cannot", "file");
    hingecast(d.path(), "synth hinged_box -o file/rec --states 2 --views 2 --size 16").refused("cannot write", "file");
    // Root may write anywhere but where the kernel says no.
    if cfg!(target_os = "linux") {
        hingecast(d.path(), "build rec -o /proc/hingecast").refused("cannot", "/proc/hingecast");
    }
}

#[test]
fn runs_that_are_none() {
    let d = dir();
    fs::create_dir(d.path().join("empty")).unwrap();
    for run in ["empty", "nowhere"] {
        hingecast(d.path(), &format!("eval {run} --truth t")).refused("not a run", run);
        hingecast(d.path(), &format!("report {run}")).refused("not a run", run);
    }
    fs::write(d.path().join("empty/run.json"), "{").unwrap();
    hingecast(d.path(), "eval empty --truth t").refused("not a run", "run.json");
}

#[test]
fn truths_that_do_not_belong_to_the_run() {
    let d = dir();
    tiny_recording(d.path());
    small_recording(d.path(), "longer", "hinged_box", 6);
    small_recording(d.path(), "other", "microwave", 5);
    // Unfinished: nothing to evaluate or to report.
    hingecast(d.path(), &format!("build rec -o run --to splat -q {TINY}")).done();
    hingecast(d.path(), "eval run --truth rec.truth").refused("the run is not finished", "run.json");
    hingecast(d.path(), "report run").refused("the run is not finished", "run.json");
    hingecast(d.path(), &format!("build rec -o run -q {TINY}")).done();
    let eval = |truth: &str| hingecast(d.path(), &format!("eval run --truth {truth}"));
    eval("nowhere").refused("cannot read", "nowhere");
    eval("rec").refused("cannot read", "rec");
    eval("longer.truth").refused("5 states", "longer.truth");
    eval("other.truth").refused("microwave", "other.truth");
    hingecast(d.path(), "eval run --truth rec.truth --fail-under speed=1").refused("not a bar", "--fail-under");
    hingecast(d.path(), "eval run --truth rec.truth --fail-under psnr=high").refused("not a bar", "--fail-under");
    // The recording went away after the build.
    fs::rename(d.path().join("rec"), d.path().join("moved")).unwrap();
    eval("rec.truth").refused("no recording", "rec");
}

#[test]
fn objects() {
    let d = dir();
    let synth = |line: &str| hingecast(d.path(), &format!("synth {line}"));
    synth("no_such_thing -o rec").refused("no object", "objects");
    hingecast(d.path(), "demo no_such_thing").refused("no object", "objects");
    hingecast(d.path(), "bench no_such_thing").refused("no object", "objects");
    hingecast(d.path(), "bench hinged_box --against nowhere.json").refused("cannot read", "nowhere.json");
    synth("hinged_box -o rec --size 0").refused("size", "0");
    synth("hinged_box -o rec --states 0").refused("states", "0");
    synth("hinged_box -o rec --occluders 7").refused("occluders", "7");
    synth("hinged_box -o rec --range lid").refused("JOINT=FROM:TO", "--range");
    synth("hinged_box -o rec --range lid=0:1").refused("no such joint", "--range lid");
    synth("hinged_box -o rec --range lid_hinge=0:nan").refused("not finite", "lid_hinge");
    fs::write(d.path().join("bad.urdf"), "<robot name='x'><link").unwrap();
    synth("./bad.urdf -o rec").refused("XML", "bad.urdf");
    assert!(!d.path().join("rec").exists());
}

#[test]
fn imports() {
    let d = dir();
    fs::create_dir(d.path().join("empty")).unwrap();
    hingecast(d.path(), "import empty -o rec").refused("", "empty");
    hingecast(d.path(), "import nowhere -o rec").refused("", "nowhere");
    hingecast(d.path(), "import empty -o rec --format polaroid").refused("no such format", "polaroid");
    assert!(!d.path().join("rec").exists());
}

/// clap's own complaints take our form.
#[test]
fn flags() {
    let d = dir();
    let run = |line: &str| -> Answer { hingecast(d.path(), line) };
    run("build rec --frob").refused("--frob", "hingecast build");
    run("build").refused("required", "hingecast build");
    run("bulid rec").refused("bulid", "hingecast bulid");
    run("doctor --threads 0").refused("--threads", "hingecast doctor");
    run("synth box -o rec --noise loud").refused("loud", "hingecast synth");
    run("synth box -o rec --states few").refused("few", "hingecast synth");
    let typo = run("build rec --freshh");
    assert!(typo.stderr.contains("--fresh"), "{typo}");
}

/// With `--json` an error is one JSON object on stdout; the three lines stay on stderr.
#[test]
fn errors_as_json() {
    let d = dir();
    for line in ["build nowhere --json", "build rec --frob --json", "--json report nowhere"] {
        let answer = hingecast(d.path(), line);
        assert_eq!(answer.code, Some(2), "{answer}");
        let json = answer.json();
        for key in ["error", "where", "try"] {
            assert!(!json[key].as_str().unwrap().is_empty(), "{answer}");
        }
    }
}

/// Names that are not UTF-8 once ended in a panic after the first file was written.
#[cfg(unix)]
#[test]
fn names_that_are_not_utf8_are_refused_before_anything_is_written() {
    use std::os::unix::ffi::OsStrExt;
    let d = dir();
    let name = std::ffi::OsStr::from_bytes(b"n\xffu");
    let run = |at: &Path, words: &[&std::ffi::OsStr]| {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_hingecast"));
        let output = command.args(words).current_dir(at).output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    let strange = d.path().join(name);
    std::fs::create_dir(&strange).unwrap();
    let words = ["synth", "hinged_box", "-o"].map(std::ffi::OsStr::new);
    let outputs = [
        run(d.path(), &[&words[..], &[name]].concat()),
        run(d.path(), &[name]),
        run(&strange, &[&words[..], &[std::ffi::OsStr::new("rec")]].concat()),
    ];
    for (code, stderr) in outputs {
        assert_eq!(code, Some(2), "{stderr}");
        assert!(stderr.contains("not UTF-8") && stderr.lines().count() == 3, "{stderr}");
    }
    assert_eq!(std::fs::read_dir(&strange).unwrap().count(), 0);
}
