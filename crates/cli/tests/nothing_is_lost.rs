//! Whatever a command writes, nobody's files are lost; and a run is never taken for more than it
//! is.

mod common;

use common::{TINY, assert_same_bytes, hingecast, start, tiny_recording};
use std::fs;
use std::io::Read;
use std::path::Path;
use std::process::Stdio;

/// A folder with work of years in it.
fn thesis(folder: &Path) {
    fs::create_dir_all(folder).unwrap();
    fs::write(folder.join("thesis.tex"), "years").unwrap();
}

fn is_there(folder: &Path) {
    assert_eq!(fs::read_to_string(folder.join("thesis.tex")).unwrap(), "years", "{}", folder.display());
}

#[test]
fn folders_that_nobody_named_stay() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let neighbours = ["rec.part", "rec.tmp", "box.tmp", "v1.tmp", "v1.2.tmp", "box.part"];
    neighbours.iter().for_each(|name| thesis(&dir.join(name)));
    let synth = "synth hinged_box -o rec --states 2 --views 3 --size 24 --test-views 1 -q";
    hingecast(dir, synth).done();
    hingecast(dir, synth).done();
    hingecast(dir, "import-object hinged_box -o box -q").done();
    hingecast(dir, "import-object hinged_box -o v1.2 -q").done();
    hingecast(dir, "import-object hinged_box -o v1.2 -q").done();
    neighbours.iter().for_each(|name| is_there(&dir.join(name)));
    let hidden = fs::read_dir(dir).unwrap().flatten().filter(|e| e.file_name().to_string_lossy().starts_with('.'));
    assert_eq!(hidden.count(), 0, "nothing is left beside");

    // A recording or an object that holds more than we wrote is a person's by now.
    thesis(&dir.join("rec/rgb"));
    hingecast(dir, synth).refused("the output folder holds something else", "thesis.tex");
    is_there(&dir.join("rec/rgb"));
    thesis(&dir.join("v1.2"));
    hingecast(dir, "import-object hinged_box -o v1.2 -q").refused("holds something else", "thesis.tex");
    // A capture of a person's has a transforms.json, too.
    fs::create_dir(dir.join("capture")).unwrap();
    fs::write(dir.join("capture/transforms.json"), r#"{"frames": [], "camera_model": "OPENCV"}"#).unwrap();
    hingecast(dir, &synth.replace("-o rec", "-o capture")).refused("holds something else", "transforms.json");
}

#[test]
fn a_project_with_a_config_toml_is_no_run() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    tiny_recording(dir);
    thesis(&dir.join("proj/src"));
    thesis(&dir.join("proj/parts"));
    fs::write(dir.join("proj/config.toml"), "x = 1\n").unwrap();
    for more in ["", " --fresh"] {
        let line = format!("build rec -o proj --to parts {TINY}{more}");
        hingecast(dir, &line).refused("the run folder holds something else", "proj");
        // Another program's run.json makes it no run either.
        fs::write(dir.join("proj/run.json"), r#"{"name": "marathon"}"#).unwrap();
        hingecast(dir, &line).refused("the run folder holds something else", "proj");
        fs::remove_file(dir.join("proj/run.json")).unwrap();
    }
    is_there(&dir.join("proj/src"));
    is_there(&dir.join("proj/parts"));
    assert_eq!(fs::read_to_string(dir.join("proj/config.toml")).unwrap(), "x = 1\n");
    // What a build leaves that was killed before its first file.
    fs::create_dir(dir.join("bare")).unwrap();
    fs::write(dir.join("bare/.lock"), "").unwrap();
    hingecast(dir, &format!("build rec -o bare --to parts -q {TINY}")).done();
}

/// Changes one of the run's JSON files and answers what stood there.
fn edit(path: &Path, change: &dyn Fn(&mut serde_json::Value)) -> Vec<u8> {
    let before = fs::read(path).unwrap();
    let mut json: serde_json::Value = serde_json::from_slice(&before).unwrap();
    change(&mut json);
    fs::write(path, json.to_string()).unwrap();
    before
}

#[test]
fn a_kept_stage_is_a_whole_stage() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    tiny_recording(dir);
    let line = format!("build rec -o run {TINY}");
    hingecast(dir, &line).done();
    let run = dir.join("run");
    let copied = std::process::Command::new("cp").args(["-r", "run", "whole"]).current_dir(dir).status().unwrap();
    assert!(copied.success());
    let whole = dir.join("whole/twin");
    assert_eq!(hingecast(dir, &line).done().stderr.matches("kept").count(), 4);

    // A file less, a byte changed: the stage is built again, with the same bytes.
    fs::remove_file(run.join("twin/robot.urdf")).unwrap();
    let again = hingecast(dir, &line).done();
    assert!(again.stderr.matches("kept").count() == 3 && !again.stderr.contains("twin    kept"), "{again}");
    assert_same_bytes(&whole, &run.join("twin"));
    let mut ply = fs::read(run.join("splat/gaussians.ply")).unwrap();
    let middle = ply.len() / 2;
    ply[middle] ^= 1;
    fs::write(run.join("splat/gaussians.ply"), ply).unwrap();
    let again = hingecast(dir, &line).done();
    assert_eq!(again.stderr.matches("kept").count(), 1, "{again}");
    assert_same_bytes(&whole, &run.join("twin"));

    // Another build is at work.
    let lock = fs::File::open(run.join(".lock")).unwrap();
    lock.lock().unwrap();
    hingecast(dir, &format!("{line} -q")).refused("another build is at work", "run");
    drop(lock);

    // A person's notes within a stage, and beside the stages.
    for (place, more) in [("run/twin", " --from twin"), ("run/twin/meshes", " --fresh"), ("run/notes", " --fresh")] {
        thesis(&dir.join(place));
        hingecast(dir, &format!("{line} -q{more}")).refused("holds something else", "thesis.tex");
        is_there(&dir.join(place));
        let kept = hingecast(dir, &line).done().stderr.matches("kept").count();
        assert_eq!(kept, 4, "a refusal changes nothing");
        fs::remove_file(dir.join(place).join("thesis.tex")).unwrap();
    }

    numbers_that_point_nowhere(dir, &run);

    let fresh = hingecast(dir, &format!("{line} --fresh")).done();
    assert!(!fresh.stderr.contains("kept"), "{fresh}");
    assert_same_bytes(&whole, &run.join("twin"));
}

fn numbers_that_point_nowhere(dir: &Path, run: &Path) {
    let (joints, twin) = (run.join("joints/joints.json"), run.join("twin/twin.json"));
    type Change<'a> = &'a dyn Fn(&mut serde_json::Value);
    let first = |t: &mut serde_json::Value, key: &str, value: serde_json::Value| t["tree"]["joints"][0][key] = value;
    let changes: [(&str, Change); 6] = [
        ("connects parts", &|t| first(t, "child", 40.into())),
        ("connects parts", &|t| first(t, "parent", 40.into())),
        ("has 0 values", &|t| first(t, "values", serde_json::json!([]))),
        ("of 4 states", &|t| first(t, "values", serde_json::json!([0.0, 0.1, 0.2, 0.3]))),
        ("no parts", &|t| t["tree"]["parts"] = serde_json::json!([])),
        ("parts", &|t| drop(t["tree"]["parts"].as_array_mut().unwrap().remove(0))),
    ];
    for (what, change) in changes {
        for file in [&joints, &twin] {
            let before = edit(file, change);
            hingecast(dir, "report run").refused(what, file.file_name().unwrap().to_str().unwrap());
            fs::write(file, before).unwrap();
        }
    }
    let labels: [(&str, Change); 2] = [
        ("label 3 names part 200", &|t| t["labels"][3] = 200.into()),
        ("labels for", &|t| drop(t["labels"].as_array_mut().unwrap().pop())),
    ];
    for (what, change) in labels {
        let before = edit(&joints, change);
        hingecast(dir, "report run").refused(what, "joints.json");
        fs::write(&joints, before).unwrap();
    }
    let before = edit(&twin, &|t| drop(t["parts"].as_array_mut().unwrap().pop()));
    hingecast(dir, "report run").refused("parts of its tree", "twin.json");
    fs::write(&twin, before).unwrap();
    hingecast(dir, "report run -q").done();
}

/// `hingecast ... | true` once died of "failed printing to stdout", and a build of its `2>&1 |
/// head`.
#[test]
fn nobody_reads_any_more() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    tiny_recording(dir);
    let spawned = |line: &str, close_stdout: bool, close_stderr: bool| {
        let mut child = start(dir, line);
        if close_stdout {
            drop(child.stdout.take());
        }
        if close_stderr {
            drop(child.stderr.take());
        }
        let mut heard = String::new();
        if let Some(mut err) = child.stderr.take() {
            err.read_to_string(&mut heard).unwrap();
        }
        (child.wait().unwrap().code(), heard)
    };
    assert_eq!(spawned("check rec --json", true, false).0, Some(0));
    assert_eq!(spawned("check rec --json", true, true).0, Some(0));
    assert_eq!(spawned("--help", true, true).0, Some(0));
    let (code, heard) = spawned("check nowhere --json", true, false);
    assert!(!heard.contains("panicked"), "{heard}");
    assert_ne!(code, Some(101));
    assert_eq!(spawned(&format!("build rec -o run {TINY}"), true, true).0, Some(0));
    assert!(dir.join("run/report/index.html").is_file(), "the build went on");
    assert_eq!(spawned("build nowhere -o other", true, true).0, Some(2));
}

/// An answer that a full disk swallowed is no answer.
#[cfg(target_os = "linux")]
#[test]
fn an_answer_that_cannot_be_written_is_an_error() {
    let dir = tempfile::tempdir().unwrap();
    let full = fs::File::options().write(true).open("/dev/full").unwrap();
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_hingecast"));
    let output = command.args(["doctor", "--json"]).current_dir(dir.path()).stdout(Stdio::from(full)).output().unwrap();
    let heard = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(2) && heard.contains("the answer cannot be written"), "{heard}");
}

#[test]
fn threads_are_bounded() {
    let dir = tempfile::tempdir().unwrap();
    hingecast(dir.path(), "doctor --threads 1000000").refused("more threads than", "--threads 1000000");
}

/// `bench --tidy` once deleted whatever lay where it wanted to record, also when it was refused for
/// that.
#[test]
fn tidying_leaves_what_it_did_not_record() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    thesis(&dir.join("bench/recordings/hinged_box"));
    thesis(&dir.join("other"));
    hingecast(dir, "bench hinged_box -o other").refused("the bench folder holds something else", "other");
    fs::write(dir.join("bench/bench.json"), "[]").unwrap();
    let answer = hingecast(dir, "bench hinged_box -o bench --tidy");
    assert_eq!(answer.code, Some(1), "{answer}");
    is_there(&dir.join("bench/recordings/hinged_box"));
}
