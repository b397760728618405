//! Demonstrations, rollouts and imported objects through the real binary.
#![cfg(feature = "mujoco")]

mod common;

use common::hingecast;
use std::path::Path;

#[test]
fn demonstrations_are_the_same_for_any_number_of_threads_and_replay_to_the_bit() {
    let d = tempfile::tempdir().unwrap();
    let one = hingecast(d.path(), "demos -n 12 -o one.hdf5 --threads 1 --json").done();
    hingecast(d.path(), "demos -n 12 -o two.hdf5 --threads 2").done();
    assert_eq!(one.json()["kept"], 12);
    let bytes = |name: &str| std::fs::read(d.path().join(name)).unwrap();
    assert!(bytes("one.hdf5") == bytes("two.hdf5"), "one and two threads wrote different files");
    hingecast(d.path(), "demos -n 12 -o other.hdf5 --seed 1").done();
    assert!(bytes("one.hdf5") != bytes("other.hdf5"), "another seed wrote the same file");
    let seen = hingecast(d.path(), "demos --inspect one.hdf5 --json").done().json();
    assert_eq!((&seen["replay"]["equal"], &seen["replay"]["successes"]), (&12.into(), &12.into()), "{seen}");
    assert!(d.path().join("one.svg").is_file());
}

#[test]
fn a_policy_is_rolled_out_in_pairs_and_its_episodes_are_drawn() {
    let d = tempfile::tempdir().unwrap();
    hingecast(d.path(), "demos -n 4 -o few.hdf5").done();
    // Far too short a training: what it cannot do is told, not hidden.
    hingecast(d.path(), "train few.hdf5 -o policy --steps 20 --set net.rnn_hidden=8 --quiet").done();
    let line = "rollout policy --object covered_box --spoil edge -n 3 -o out --json";
    let one = hingecast(d.path(), &format!("{line} --threads 1")).done().json();
    let two = hingecast(d.path(), &format!("{line} --threads 2")).done().json();
    assert_eq!(one["worlds"], two["worlds"]);
    let worlds = one["worlds"].as_array().unwrap();
    assert_eq!(worlds.len(), 2);
    assert_eq!((&worlds[0]["name"], &worlds[1]["name"]), (&"true".into(), &"edge".into()));
    assert!(worlds[0]["against_first"].is_null() && worlds[1]["against_first"]["interval"].is_array(), "{one}");
    // On the true object both ways of counting agree; on the wrong edge nothing opens as it should.
    assert_eq!(worlds[0]["as_true"], worlds[0]["successes"], "{one}");
    assert_eq!(worlds[1]["as_true"], 0, "{one}");
    assert!(worlds[1]["as_true_against_first"]["interval"].is_array(), "{one}");
    let seeds = |w: &serde_json::Value| -> Vec<u64> {
        w["results"].as_array().unwrap().iter().map(|r| r["seed"].as_u64().unwrap()).collect()
    };
    assert_eq!(seeds(&worlds[0]), seeds(&worlds[1]));
    for strip in worlds[0]["strips"].as_object().unwrap().values() {
        let picture = image::open(d.path().join(strip.as_str().unwrap())).unwrap().to_rgb8();
        // Six pictures, and the arm moved: the first differs from the last.
        let tile = |k: u32| image::imageops::crop_imm(&picture, k * 244, 0, 240, 200).to_image();
        assert_ne!(tile(0), tile(5));
    }
}

#[test]
fn a_urdf_becomes_an_object_that_the_arm_can_be_asked_about() {
    let d = tempfile::tempdir().unwrap();
    write_cupboard(d.path());
    let answer = hingecast(d.path(), "import-object cupboard.urdf -o object --json").done();
    let json = answer.json();
    assert_eq!(json["imported"]["parts"], 2, "{answer}");
    assert!(json["imported"]["mass"].as_f64().unwrap() > 0.1, "{answer}");
    assert!(answer.stderr.contains("changed: masses"), "{answer}");
    assert!(d.path().join("object/robot.xml").is_file());
    // The same command again replaces its own folder, and nothing else's.
    hingecast(d.path(), "import-object cupboard.urdf -o object").done();
    hingecast(d.path(), "import-object cupboard.urdf -o .").refused("something else", ".");
    hingecast(d.path(), "import-object cupboard.urdf -o o --scale 0").refused("0 is not", "--scale");
}

/// A drawer with a bar to pull, made of boxes.
fn write_cupboard(dir: &Path) {
    let solid = |x: [f64; 3], at: [f64; 3]| {
        format!(
            "<visual><origin xyz=\"{} {} {}\"/><geometry><box size=\"{} {} {}\"/></geometry></visual>",
            at[0], at[1], at[2], x[0], x[1], x[2]
        )
    };
    let text = format!(
        r#"<robot name="cupboard"><link name="case">{}{}</link><link name="drawer">{}{}</link>
<joint name="slide" type="prismatic"><parent link="case"/><child link="drawer"/><axis xyz="0 -1 0"/>
<limit lower="0" upper="0.15" effort="1" velocity="1"/></joint></robot>"#,
        solid([0.3, 0.3, 0.02], [0.0, 0.0, 0.01]),
        solid([0.3, 0.02, 0.2], [0.0, 0.14, 0.12]),
        solid([0.26, 0.26, 0.1], [0.0, 0.0, 0.1]),
        solid([0.12, 0.02, 0.02], [0.0, -0.18, 0.1]),
    );
    std::fs::write(dir.join("cupboard.urdf"), text).unwrap();
}

#[test]
fn bad_input_is_named() {
    let d = tempfile::tempdir().unwrap();
    hingecast(d.path(), "demos -n 2").refused("where to write", "--out");
    hingecast(d.path(), "demos -n 2 -o x.hdf5 --object no_such").refused("no object", "objects");
    hingecast(d.path(), "demos -n 2 -o x.hdf5 --twin nowhere").refused("no model", "nowhere");
    hingecast(d.path(), "demos -n 2 -o x.hdf5 --joint door").refused("no joint 'door'", "covered_box");
    let stone = r#"<mujoco><worldbody><body><geom size=".1"/></body></worldbody></mujoco>"#;
    std::fs::write(d.path().join("stone.xml"), stone).unwrap();
    hingecast(d.path(), "demos -n 2 -o x.hdf5 --object stone.xml").refused("nothing moves", "stone");
    hingecast(d.path(), "demos -n 2 -o x.hdf5 --scale 0.05").refused("gripper", "covered_box");
    hingecast(d.path(), "demos -n 2 -o x.hdf5 --scale nan").refused("not a size", "--scale");
    hingecast(d.path(), "demos --inspect nothing.hdf5").refused("cannot read", "nothing.hdf5");
    hingecast(d.path(), "rollout nowhere --object covered_box").refused("not a policy", "nowhere");
    hingecast(d.path(), "demos -n 4 -o few.hdf5").done();
    hingecast(d.path(), "train few.hdf5 -o policy --steps 2 --set net.rnn_hidden=8").done();
    hingecast(d.path(), "rollout policy --object covered_box --spoil bend=3").refused("bend=3", "--spoil");
    hingecast(d.path(), "rollout policy --object microwave -n 2").refused("no part stands where", "microwave");
}
