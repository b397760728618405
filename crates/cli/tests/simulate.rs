//! Demonstrations, rollouts and imported objects through the real binary.
#![cfg(feature = "mujoco")]

mod common;

use common::hingecast;
use hingecast_policy::{Demos, demos};
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
    let page = std::fs::read_to_string(d.path().join(one["report"].as_str().unwrap())).unwrap();
    let mut shown: Vec<&str> = page.split("<img src=\"").skip(1).map(|rest| rest.split('"').next().unwrap()).collect();
    shown.sort_unstable();
    let strips = worlds.iter().flat_map(|w| w["strips"].as_object().unwrap().values());
    let mut written: Vec<&str> = strips.map(|s| s.as_str().unwrap().rsplit('/').next().unwrap()).collect();
    written.sort_unstable();
    assert_eq!(shown, written, "the report shows every strip once");
    // The numbers are those of the answer.
    for w in worlds {
        let row = format!("<td>{}</td><td class=n>{} / 3</td>", w["name"].as_str().unwrap(), w["successes"]);
        assert!(page.contains(&row), "'{row}' is not in {page}");
    }
    assert!(page.contains("Paired differences to 'true'") && page.contains("3 episodes are few"), "{page}");
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

/// The four demonstrations of `few.hdf5`, changed and written under another name.
fn changed(dir: &Path, name: &str, change: impl FnOnce(&mut Demos)) {
    let mut demos = demos::read(&dir.join("few.hdf5")).unwrap();
    change(&mut demos);
    demos::write(&dir.join(name), &demos).unwrap();
}

#[test]
fn damaged_demonstrations_are_named() {
    let d = tempfile::tempdir().unwrap();
    hingecast(d.path(), "demos -n 4 -o few.hdf5").done();
    let both = |file: &str, what: &str, place: &str| {
        hingecast(d.path(), &format!("demos --inspect {file} -q")).refused(what, place);
        hingecast(d.path(), &format!("train {file} -o p --steps 2 --set net.rnn_hidden=8")).refused(what, place);
    };
    let whole = std::fs::read(d.path().join("few.hdf5")).unwrap();
    for eighth in 1..8 {
        std::fs::write(d.path().join("cut.hdf5"), &whole[..eighth * whole.len() / 8]).unwrap();
        both("cut.hdf5", "HDF5", "cut.hdf5");
    }
    // One number of an action becomes NaN, in the file's bytes: no writer of ours would write it.
    let action = demos::read(&d.path().join("few.hdf5")).unwrap().episodes[2].actions[3];
    let bytes: Vec<u8> = action.iter().flat_map(|x| x.to_le_bytes()).collect();
    let at = whole.windows(bytes.len()).position(|w| w == bytes).expect("actions are stored as they are");
    let mut nan = whole.clone();
    nan[at + 4 * 8..at + 5 * 8].copy_from_slice(&f64::NAN.to_le_bytes());
    std::fs::write(d.path().join("nan.hdf5"), nan).unwrap();
    both("nan.hdf5", "not finite", "nan.hdf5, data/demo_2/actions[3][4] = NaN");
    hingecast(d.path(), "rollout p --demos nan.hdf5").refused("not a policy", "p");

    // What training does without, replay needs.
    let inspect = |what: &str, place: &str| hingecast(d.path(), "demos --inspect odd.hdf5 -q").refused(what, place);
    changed(d.path(), "odd.hdf5", |demos| demos.episodes[1].states.clear());
    inspect("no states", "data/demo_1/states");
    changed(d.path(), "odd.hdf5", |demos| demos.episodes[1].model_file.clear());
    inspect("where the object stood", "data/demo_1, attribute model_file");
    changed(d.path(), "odd.hdf5", |demos| demos.episodes[1].model_file = "<body name=\"object\"/>".into());
    inspect("no place", "model_file");
    changed(d.path(), "odd.hdf5", |demos| demos.episodes[0].states.iter_mut().for_each(|s| s.truncate(9)));
    inspect("21 numbers, not 9", "states");
    changed(d.path(), "odd.hdf5", |demos| demos.env_args["env_kwargs"]["object"] = "/gone/object.xml".into());
    inspect("the model file is not there", "/gone/object.xml");
    changed(d.path(), "odd.hdf5", |demos| demos.env_args = serde_json::json!({"env_name": "Lift", "type": 1}));
    inspect("another simulator", "odd.hdf5, data, attribute env_args");
    changed(d.path(), "odd.hdf5", |demos| {
        demos.episodes.iter_mut().for_each(|e| drop((e.obs.remove("object"), e.next_obs.remove("object"))));
    });
    hingecast(d.path(), "train odd.hdf5 -o p").refused("lack the observation object", "data/demo_0/obs");
    changed(d.path(), "odd.hdf5", |demos| demos.episodes[2].actions[3][4] = 50.0);
    hingecast(d.path(), "train odd.hdf5 -o p").refused("outside [-1, 1]", "data/demo_2/actions[3][4] = 50");
}

#[test]
fn damaged_policies_and_twins_are_named() {
    let d = tempfile::tempdir().unwrap();
    hingecast(d.path(), "demos -n 4 -o few.hdf5").done();
    hingecast(d.path(), "train few.hdf5 -o policy --steps 2 --set net.rnn_hidden=8").done();
    let kept: Vec<(std::path::PathBuf, Vec<u8>)> = common::files(&d.path().join("policy"))
        .into_iter()
        .map(|f| d.path().join("policy").join(f))
        .map(|f| (f.clone(), std::fs::read(f).unwrap()))
        .collect();
    let damaged = |file: &str, damage: &dyn Fn(&mut Vec<u8>), what: &str, place: &str| {
        kept.iter().for_each(|(path, bytes)| std::fs::write(path, bytes).unwrap());
        let path = d.path().join("policy").join(file);
        let mut bytes = std::fs::read(&path).unwrap();
        damage(&mut bytes);
        std::fs::write(&path, bytes).unwrap();
        hingecast(d.path(), "rollout policy -n 2").refused(what, place);
    };
    let nan = |b: &mut Vec<u8>| *b.last_chunk_mut().unwrap() = f32::NAN.to_le_bytes();
    damaged("policy.safetensors", &nan, "not finite", "policy.safetensors");
    damaged("policy.safetensors", &|b| b.truncate(300), "safetensors", "policy.safetensors");
    damaged("policy.json", &|b| b.truncate(40), "not a policy's configuration", "policy.json");
    let renamed = |b: &mut Vec<u8>| *b = String::from_utf8_lossy(b).replace("\"object\"", "\"lid\"").into_bytes();
    damaged("policy.json", &renamed, "an observation is missing", "observation lid");
    let other_task = |b: &mut Vec<u8>| *b = String::from_utf8_lossy(b).replace("\"grasp\"", "\"grip\"").into_bytes();
    damaged("env_args.json", &other_task, "missing field `grasp`", "env_args.json");
    kept.iter().for_each(|(path, bytes)| std::fs::write(path, bytes).unwrap());

    // Twins: without the joint, with a joint elsewhere, with one that is no number, without the
    // file.
    let xml = std::fs::read_to_string(common::objects().join("covered_box/object.xml")).unwrap();
    let joint = &xml[xml.find("<joint").unwrap()..];
    let joint = &joint[..=joint.find('>').unwrap()];
    let twin = |xml: &str, what: &str| {
        std::fs::create_dir_all(d.path().join("run/twin")).unwrap();
        std::fs::write(d.path().join("run/twin/robot.xml"), xml).unwrap();
        for texture in ["wall.png", "lid.png"] {
            let to = d.path().join("run/twin").join(texture);
            std::fs::copy(common::objects().join("covered_box").join(texture), to).unwrap();
        }
        let answer = hingecast(d.path(), "rollout policy --object covered_box --twin run -n 2 -o out");
        answer.refused(what, "run/twin/robot.xml");
    };
    twin(&xml.replace(joint, ""), "nothing moves");
    twin(
        &xml.replace("<body name=\"box\" pos=\"0 0 0\">", "<body name=\"box\" pos=\"0.5 0 0\">"),
        "no part stands where",
    );
    twin(&xml.replace("axis=\"0 1 0\"", "axis=\"0 nan 0\""), "the axis of a joint is not finite");
    twin(&xml[..xml.len() / 2], "MuJoCo cannot load");
    hingecast(d.path(), "rollout policy --twin out -n 2").refused("no model", "out");
    // Noticed before the episodes, not after them.
    hingecast(d.path(), "rollout policy -n 100000 -o few.hdf5").refused("cannot", "few.hdf5");
    hingecast(d.path(), "demos -n 100000 -o nowhere/x.hdf5").refused("cannot", "nowhere/x.hdf5");
}

#[test]
fn an_object_out_of_reach_is_named() {
    let d = tempfile::tempdir().unwrap();
    // A flap three metres up on a mast.
    let mast = r#"<mujoco><worldbody><body name="mast"><geom type="box" size=".05 .05 1.5" pos="0 0 1.5"/>
<body name="flap" pos="0 0 3"><joint name="hinge" type="hinge" axis="0 1 0" range="0 90"/>
<geom type="box" size=".01 .03 .03" pos="0 0 .03"/></body></body></worldbody></mujoco>"#;
    std::fs::write(d.path().join("mast.xml"), mast).unwrap();
    hingecast(d.path(), "demos -n 2 -o x.hdf5 --object mast.xml --scale 1").refused("none of", "mast.xml");
    hingecast(d.path(), "demos -n 2 -o x.hdf5 --scale 4").refused("none of", "places it stands where the arm begins");
    hingecast(d.path(), "demos -n 2 -o x.hdf5 --scale 1e-9").refused("not a size", "--scale");
    assert!(!d.path().join("x.hdf5").exists());
}
