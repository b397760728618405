//! What somebody stumbles over on the first day.

mod common;

use common::{TINY, files, hingecast, objects, tiny_recording};
use std::fs;
use std::path::Path;
use std::process::Command;

/// They were found in the repository's root alone.
#[test]
fn samples_are_found_from_anywhere_by_where_the_program_lies() {
    let dir = tempfile::tempdir().unwrap();
    let built = dir.path().join("sources/target/release");
    fs::create_dir_all(&built).unwrap();
    std::os::unix::fs::symlink(objects(), dir.path().join("sources/objects")).unwrap();
    let (program, own) = (built.join("hingecast"), env!("CARGO_BIN_EXE_hingecast"));
    if fs::hard_link(own, &program).is_err() {
        fs::copy(own, &program).unwrap();
    }
    let elsewhere = dir.path().join("elsewhere");
    fs::create_dir(&elsewhere).unwrap();
    let run = |object: &str| {
        let mut command = Command::new(&program);
        command.args(["synth", object, "-o", "rec", "--states", "2", "--views", "3", "--size", "32"]);
        command.current_dir(&elsewhere).env_remove("HINGECAST_OBJECTS").output().unwrap()
    };
    let made = run("hinged_box");
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    let missing = String::from_utf8_lossy(&run("nosuch").stderr).into_owned();
    assert!(missing.contains("sources/objects") && missing.contains("HINGECAST_OBJECTS"), "{missing}");
}

#[test]
fn a_source_that_is_not_there_is_no_unknown_layout() {
    let dir = tempfile::tempdir().unwrap();
    hingecast(dir.path(), "import nosuch -o rec").refused("no such file or folder", "nosuch");
}

/// A run whose recording changed and could not be built from: the twin of before still lies there.
#[test]
fn readers_refuse_a_run_that_is_not_finished() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    fs::create_dir_all(dir.join("run/twin")).unwrap();
    fs::copy(objects().join("hinged_box/object.xml"), dir.join("run/twin/robot.xml")).unwrap();
    let record = serde_json::json!({
        "version": "0.1.0", "recording": dir.join("rec"), "fingerprint": "00", "threads": 1, "stages": [], "doubts": [],
    });
    fs::write(dir.join("run/run.json"), record.to_string()).unwrap();
    let before = files(dir);
    let readers = [
        "eval run --truth rec.truth",
        "report run",
        "demos --twin run -o d.hdf5",
        "demos --twin run/twin/robot.xml -o d.hdf5",
        "demos --object run/twin -o d.hdf5",
    ];
    for reader in readers {
        hingecast(dir, reader).refused("the run is not finished for its recording", "run.json");
    }
    assert_eq!(files(dir), before);
}

/// Limits that are too short were reported as the range that was seen; a build without the preset
/// and the corrections of before said nothing.
#[test]
fn corrections_that_are_short_or_forgotten_are_said() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    tiny_recording(dir);
    hingecast(dir, &format!("build rec -o run -q {TINY}")).done();
    let range = |cell: usize| {
        let page = fs::read_to_string(dir.join("run/report/index.html")).unwrap();
        let row = page.split("<h2>Joints</h2>").nth(1).unwrap().split("<tr>").nth(2).unwrap().to_string();
        row.split("<td").nth(cell).unwrap().trim_start_matches('>').trim_end_matches("</td>").to_string()
    };
    let (seen, limits) = (range(7), range(8));
    assert!(seen.ends_with(" deg") && seen == limits, "{seen}, {limits}");

    fs::write(dir.join("mine.toml"), "[[joint]]\njoint = \"joint_1\"\nname = \"lid\"\nlimits = [-10, 20]\n").unwrap();
    let line = format!("build rec -o run {TINY} --config mine.toml");
    let short = hingecast(dir, &line).done();
    assert!(short.stderr.contains("doubt: joint 'lid': its limits leave out state"), "{short}");
    assert!(short.stderr.contains("with the stages of earlier builds"), "{short}");
    assert_eq!((range(7), range(8).as_str()), (seen, "-10.0 .. 20.0 deg"));
    assert!(!hingecast(dir, &line).done().stderr.contains("other settings"), "the same again");

    let forgotten = hingecast(dir, &format!("build rec -o run {TINY} --preset fast --to parts")).done();
    let said = forgotten.stderr.lines().find(|l| l.starts_with("other settings than this run had: ")).unwrap();
    assert!(said.contains("[[joint]] joint_1 ") && said.contains("preset \"default\" -> \"fast\""), "{said}");
    unfinished(dir);
}

/// `--to parts` dropped the stages behind it.
fn unfinished(dir: &Path) {
    hingecast(dir, "report run").refused("the last stage done is parts", "run.json");
}
