//! `hingecast experiment` through the real binary, as small as it can be: it shows the chain, not
//! the quality.
#![cfg(feature = "mujoco")]

mod common;

use common::{TINY, hingecast};
use std::path::Path;

const SMALL: &str =
    "-d 4 -e 3 --spoiled-episodes 2 --train-seeds 2 --policy-set steps=12 --policy-set net.rnn_hidden=8";

fn small(objects: &str, worlds: &[&str]) -> String {
    let worlds: String = worlds.iter().map(|w| format!(" --world {w}")).collect();
    format!(
        "experiment {objects} -o out {SMALL}{worlds} --preset fast {TINY} --states 5 --views 10 --test-views 1 --size 80 --json"
    )
}

/// The steps that were not skipped.
fn steps(stderr: &str) -> Vec<&str> {
    stderr.lines().filter(|l| l.starts_with("== ")).map(|l| l.split(" (about").next().unwrap()).collect()
}

#[test]
fn an_experiment_has_all_its_rows_and_goes_on_where_it_was() {
    let d = tempfile::tempdir().unwrap();
    let line = small("covered_box", &["twin", "axis=30", "back"]);
    let first = hingecast(d.path(), &line).done();
    let json = first.json();
    let rows = json["rows"].as_array().unwrap();
    let names: Vec<&str> = rows.iter().map(|r| r["world"].as_str().unwrap()).collect();
    assert_eq!(names, ["true", "twin", "axis=30", "back"]);
    let episodes: Vec<u64> = rows.iter().map(|r| r["episodes"].as_u64().unwrap()).collect();
    // Two training seeds; fewer episodes on the spoiled one.
    assert_eq!(episodes, [6, 6, 4, 6], "{first}");
    for row in rows {
        assert!(row["failed"].is_null() && row["success"]["per_seed"].as_array().unwrap().len() == 2, "{first}");
    }
    let error = |k: usize, key: &str| rows[k]["error"][key].as_f64().unwrap();
    assert!(error(0, "goal_mm") < 1e-9 && error(1, "axis_deg") < 2.0 && error(1, "goal_mm") < 5.0, "{first}");
    assert!((error(2, "axis_deg") - 30.0).abs() < 1e-3 && error(2, "goal_mm") > 30.0, "{first}");
    // Pairs with the true object, but for a policy that is another one.
    assert!(rows[1]["success"]["against_true"]["interval"].is_array() && rows[3]["success"]["against_true"].is_null());

    let files = ["experiment.md", "experiment.csv", "experiment.json", "experiment.svg"];
    let bytes = || files.map(|f| std::fs::read(d.path().join("out").join(f)).unwrap());
    let before = bytes();
    let csv = String::from_utf8(before[1].clone()).unwrap();
    let widths: Vec<usize> = csv.lines().map(|l| l.split(',').count()).collect();
    assert!(widths.len() == 5 && widths.iter().all(|w| *w == widths[0]), "{csv}");
    assert!(String::from_utf8(before[3].clone()).unwrap().contains("as true"));

    let again = hingecast(d.path(), &line).done();
    assert_eq!(steps(&again.stderr), Vec::<&str>::new(), "{again}");
    assert!(before == bytes(), "the same command wrote another table");
    // What a kill took away is made again, to the byte, and nothing else.
    std::fs::remove_file(d.path().join("out/covered_box/rollouts_true_1/axis_30.json")).unwrap();
    let again = hingecast(d.path(), &line).done();
    assert_eq!(steps(&again.stderr), ["== covered_box: rollout true 1 axis=30"], "{again}");
    assert!(before == bytes(), "the remade step gave another table");
    // More episodes need neither new demonstrations nor new policies.
    let again = hingecast(d.path(), &line.replace("-e 3", "-e 4")).done();
    assert!(steps(&again.stderr).iter().all(|s| s.contains("rollout")), "{again}");
    assert_eq!(again.json()["rows"][0]["episodes"], 8);
}

#[test]
fn what_cannot_be_done_is_a_row_that_says_why() {
    let d = tempfile::tempdir().unwrap();
    write_stone(&d.path().join("stone"));
    let answer = hingecast(d.path(), &small("stone three_drawers", &["pivot=3", "axis=10"])).done();
    let json = answer.json();
    let rows = json["rows"].as_array().unwrap();
    let why = |k: usize| rows[k]["failed"].as_str().unwrap_or("");
    assert!((0..3).all(|k| rows[k]["object"] == "stone" && why(k).contains("nothing moves")), "{answer}");
    assert_eq!((&rows[3]["world"], &rows[3]["episodes"]), (&"true".into(), &6.into()), "{answer}");
    assert!(why(4).contains("no pivot") && rows[5]["episodes"] == 4, "{answer}");
    // A drawer needs no recording where no world is a twin.
    assert!(!d.path().join("out/three_drawers/recording").exists());
    let table = std::fs::read_to_string(d.path().join("out/experiment.md")).unwrap();
    assert!(table.contains("a slide has no pivot to move"), "{table}");
}

fn write_stone(folder: &Path) {
    std::fs::create_dir(folder).unwrap();
    let stone = r#"<mujoco><worldbody><body name="stone"><geom size=".1"/></body></worldbody></mujoco>"#;
    std::fs::write(folder.join("object.xml"), stone).unwrap();
}

#[test]
fn bad_input_is_refused_before_any_work() {
    let d = tempfile::tempdir().unwrap();
    hingecast(d.path(), "experiment covered_box -o out --world moon").refused("no world 'moon'", "--world");
    hingecast(d.path(), "experiment no_such -o out").refused("no object", "objects");
    hingecast(d.path(), "experiment covered_box -o out --policy-set stepz=3").refused("stepz", "--set");
    assert!(!d.path().join("out").exists());
    std::fs::create_dir(d.path().join("full")).unwrap();
    std::fs::write(d.path().join("full/letter.txt"), "dear").unwrap();
    hingecast(d.path(), "experiment covered_box -o full").refused("something else", "full");
}
