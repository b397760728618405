//! Objects whose files were written for another robot: masks of contacts, joints that hardly move,
//! joints that follow others.

use hingecast_geom::JointKind;
use hingecast_sim::trial::{demonstrate, make_task};
use hingecast_sim::{CheckConfig, Env, Outcome, Scene, SceneConfig, TaskKind, check_file};
use std::path::{Path, PathBuf};

fn covered_box() -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../objects/covered_box");
    let text = std::fs::read_to_string(folder.join("object.xml")).unwrap();
    let textures = ["wall.png", "lid.png"];
    textures.iter().fold(text, |t, name| t.replace(name, &folder.join(name).display().to_string()))
}

fn write(dir: &Path, text: &str) -> PathBuf {
    let file = dir.join("object.xml");
    std::fs::write(&file, text).unwrap();
    file
}

/// Ends of four attempts to open it.
fn attempts(file: &Path) -> Vec<Outcome> {
    let task = make_task(file, TaskKind::Open, None, None).unwrap().task;
    let config = SceneConfig { object: file.to_path_buf(), spoil: Vec::new(), visuals: false };
    let mut env = Env::new(&Scene::new(&config, &task).unwrap());
    (0..4).map(|seed| demonstrate(&mut env, seed, |_, _| ()).unwrap()).collect()
}

/// Kitchens are published so that furniture has contype 0: once the fingers went through it.
#[test]
fn whatever_collides_with_anything_collides_with_the_arm() {
    let dir = tempfile::tempdir().unwrap();
    let usual = attempts(&write(dir.path(), &covered_box()));
    assert!(usual.iter().filter(|o| **o == Outcome::Success).count() >= 3, "{usual:?}");
    for masks in ["contype=\"0\" conaffinity=\"1\"", "contype=\"4\" conaffinity=\"4\""] {
        let text = covered_box().replace("<geom ", &format!("<geom {masks} "));
        assert!(text.matches(masks).count() > 5);
        assert_eq!(attempts(&write(dir.path(), &text)), usual, "{masks}");
    }
}

#[test]
fn a_joint_that_hardly_moves_is_said_before_anything_is_tried() {
    let dir = tempfile::tempdir().unwrap();
    let range = "range=\"0 1.57\"";
    assert!(covered_box().contains(range));
    let file = write(dir.path(), &covered_box().replace(range, "range=\"0 0.005\""));
    let e = make_task(&file, TaskKind::Open, None, None).unwrap_err().to_string();
    assert!(e.contains("hardly moves: 0.29 deg") && e.lines().count() == 3, "{e}");
}

/// Pushed open by shapes that overlap, it once counted as opened, in two steps.
#[test]
fn a_part_that_moves_by_itself_is_no_demonstration() {
    let dir = tempfile::tempdir().unwrap();
    // A spring that wants the lid open.
    let sprung = covered_box().replace("range=\"0 1.57\"", "range=\"0 1.57\" stiffness=\"5\" springref=\"1.5\"");
    let file = write(dir.path(), &sprung);
    let e = make_task(&file, TaskKind::Open, None, None).unwrap_err().to_string();
    assert!(e.contains("moves by itself") && e.lines().count() == 3, "{e}");
}

/// A joint that follows another is swept with it, not against it.
#[test]
fn doors_that_open_together_sweep_together() {
    let door = |name: &str, x: f64, range: &str| {
        let joint = format!(r#"<joint name="{name}" axis="0 0 1" range="{range}" damping=".05"/>"#);
        let leaf = format!(r#"<geom type="box" size=".09 .01 .2" pos="{} 0 0"/>"#, -0.5 * x);
        format!(r#"<body name="{name}_door" pos="{x} .3 0">{joint}{leaf}</body>"#)
    };
    let doors = door("left", -0.2, "0 1.4") + &door("right", 0.2, "-1.4 0");
    let text = format!(
        r#"<mujoco><compiler angle="radian"/><worldbody><geom type="box" size=".2 .2 .2"/>{doors}</worldbody>
        <equality><joint joint1="right" joint2="left" polycoef="0 -1 0 0 0"/></equality></mujoco>"#
    );
    let dir = tempfile::tempdir().unwrap();
    let file = write(dir.path(), &text);
    let check = check_file(&file, &CheckConfig::default()).unwrap();
    let names: Vec<&str> = check.sweeps.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(names, ["left"], "the one that leads");
    assert!(check.sweeps[0].reached > 0.98 && check.doubts(0.7).is_empty(), "{check:?}");
    let object = hingecast_sim::compiled::load(&file).unwrap();
    assert_eq!(object.tree.joints[1].screw.kind, JointKind::Revolute);
    assert_eq!(object.tree.couplings[0].line(), Some([0.0, -1.0]));
}
