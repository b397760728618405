//! Whole episodes: seeds, replay to the bit, the demonstrator, spoiled objects, a twin with names
//! and zeros of its own.

use hingecast_sim::trial::{demonstrate, make_task};
use hingecast_sim::{Env, Expert, Outcome, Scene, SceneConfig, Spoil, SpotPath, TaskKind};
use std::path::{Path, PathBuf};

fn covered_box() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../objects/covered_box/object.xml")
}

fn scene(path: &Path, task_of: &Path, spoil: &[Spoil]) -> Scene {
    let made = make_task(task_of, TaskKind::Open, None, None).unwrap();
    Scene::new(&SceneConfig { object: path.to_path_buf(), spoil: spoil.to_vec(), visuals: false }, &made.task).unwrap()
}

/// States and observations of one demonstrated episode.
fn episode(env: &mut Env, seed: u64) -> (Vec<[f64; 7]>, Vec<Vec<f64>>, Vec<f64>) {
    let (mut actions, mut states, mut objects) = (Vec::new(), Vec::new(), Vec::new());
    demonstrate(env, seed, |env, action| {
        actions.push(*action);
        states.push(env.state());
        objects.extend(env.observe()["object"].clone());
    })
    .unwrap();
    states.push(env.state());
    (actions, states, objects)
}

#[test]
fn a_seed_is_an_episode_and_recorded_actions_replay_to_the_bit() {
    let scene = scene(&covered_box(), &covered_box(), &[]);
    let mut env = Env::new(&scene);
    env.reset(3);
    let start = env.start();
    let (actions, states, objects) = episode(&mut env, 3);
    assert!(actions.len() > 20, "an episode of {} steps", actions.len());
    // Another environment, used before for something else.
    let mut other = Env::new(&scene);
    episode(&mut other, 8);
    assert_eq!(episode(&mut other, 3), (actions.clone(), states.clone(), objects));
    for _ in 0..2 {
        other.start_from(&start).unwrap();
        for (t, action) in actions.iter().enumerate() {
            assert_eq!(other.state(), states[t], "step {t}");
            other.step(action).unwrap();
        }
        assert_eq!(&other.state(), states.last().unwrap());
    }
    env.reset(4);
    assert_ne!(env.start(), start, "another seed is another episode");
}

#[test]
fn the_demonstrator_opens_and_closes_the_covered_box() {
    for kind in [TaskKind::Open, TaskKind::Close] {
        let made = make_task(&covered_box(), kind, None, None).unwrap();
        let config = SceneConfig { object: covered_box(), spoil: Vec::new(), visuals: false };
        let mut env = Env::new(&Scene::new(&config, &made.task).unwrap());
        let ends: Vec<Outcome> = (0..10).map(|seed| demonstrate(&mut env, seed, |_, _| ()).unwrap()).collect();
        let good = ends.iter().filter(|o| **o == Outcome::Success).count();
        assert!(good >= 9, "{kind:?}: {ends:?}");
    }
}

#[test]
fn observations_have_robomimics_names_and_sizes_and_the_box_stands_where_it_should() {
    let mut env = Env::new(&scene(&covered_box(), &covered_box(), &[]));
    for seed in 0..50 {
        env.reset(seed);
        let obs = env.observe();
        let sizes: Vec<(&str, usize)> = obs.iter().map(|(k, v)| (k.as_str(), v.len())).collect();
        assert_eq!(sizes, [("object", 10), ("robot0_eef_pos", 3), ("robot0_eef_quat", 4), ("robot0_gripper_qpos", 2)]);
        // The knob is on the far side, 0.1 m from the hinge: hinge edge toward the arm.
        let place = env.start().place;
        assert!(place.trans.y.abs() < 0.031 && (place.trans.z - 0.8).abs() < 1e-9, "{place:?}");
        assert!((-0.005..0.06).contains(&place.trans.x), "{place:?}");
        assert!(obs["object"][0] > place.trans.x + 0.03, "{obs:?}");
        let to = &obs["object"][7..10];
        for k in 0..3 {
            assert!((obs["robot0_eef_pos"][k] + to[k] - obs["object"][k]).abs() < 1e-12);
        }
        let down = env.grip().rot * glam::DVec3::Z;
        assert!(down.z < -0.97, "the gripper points down: {down}");
    }
}

/// The same box under other names, its joint's zero half open and its axis turned around, as a twin
/// may have it.
fn a_twin(dir: &Path, hinge: f64) -> PathBuf {
    let half: f64 = 0.785;
    let (c, s) = ((half / 2.0).cos(), (half / 2.0).sin());
    // The lid's frame sits on the hinge line, turned by +0.785 about y.
    let text = format!(
        r#"<mujoco><compiler angle="radian" autolimits="true"/><worldbody><body name="base">
  <geom type="box" size="0.06 0.05 0.004" pos="0 0 0.004"/><geom type="box" size="0.004 0.05 0.036" pos="-0.056 0 0.044"/>
  <geom type="box" size="0.004 0.05 0.036" pos="0.056 0 0.044"/>
  <body name="part_1" pos="{hinge} 0 0.08" quat="{c} 0 {s} 0">
    <joint name="joint_1" type="hinge" axis="0 -1 0" range="-0.785 0.785" damping="0.01"/>
    <geom type="box" size="0.06 0.05 0.005" pos="-0.06 0 0.005" density="500"/>
    <geom type="box" size="0.008 0.018 0.020" pos="-0.1 0 0.03" density="500"/>
  </body></body></worldbody>
  <contact><exclude body1="base" body2="part_1"/></contact></mujoco>"#
    );
    let path = dir.join("robot.xml");
    std::fs::write(&path, text).unwrap();
    path
}

#[test]
fn a_twin_with_names_zero_and_sign_of_its_own_looks_the_same_to_a_policy() {
    let dir = tempfile::tempdir().unwrap();
    let twin = a_twin(dir.path(), 0.06);
    let scene_of_twin = scene(&twin, &covered_box(), &[]);
    assert_eq!((scene_of_twin.target.closed, scene_of_twin.target.open), (0.785, -0.785));
    let (mut a, mut b) = (Env::new(&scene(&covered_box(), &covered_box(), &[])), Env::new(&scene_of_twin));
    for seed in 0..5 {
        a.reset(seed);
        b.reset(seed);
        for (x, y) in a.observe()["object"].iter().zip(&b.observe()["object"]) {
            assert!((x - y).abs() < 1e-6, "{x} {y}");
        }
        assert!(b.moved().abs() < 1e-9);
    }
    // Actions of the true box open the twin as well.
    let done = (0..10).filter(|&seed| replayed(&mut a, &mut b, seed)).count();
    assert!(done >= 9, "{done} of 10");
}

/// Whether what opens `a` opens `b`: the actions are computed in `a` alone, until that is well
/// open.
fn replayed(a: &mut Env, b: &mut Env, seed: u64) -> bool {
    a.reset(seed);
    b.reset(seed);
    let mut expert = Expert::new(seed);
    (0..400).any(|_| {
        let action = expert.act(a);
        a.step(&action).unwrap();
        b.step(&action).unwrap();
        b.success() || a.moved() > 0.6
    }) && b.success()
}

#[test]
fn a_spoiled_box_does_not_open_by_what_opens_the_true_one() {
    let mut a = Env::new(&scene(&covered_box(), &covered_box(), &[]));
    let mut count = |spoil: Spoil| {
        let mut b = Env::new(&scene(&covered_box(), &covered_box(), &[spoil]));
        (0..10).filter(|&seed| replayed(&mut a, &mut b, seed)).count()
    };
    assert!(count(Spoil::Axis(1.0)) >= 9);
    // A hand that pulls may wrench a lid open at its wrong edge, too: one of ten at most.
    assert!(count(Spoil::Edge) <= 1);
}

#[test]
fn bad_input_is_named_in_three_lines() {
    let three = |e: hingecast_sim::SimError, what: &str| {
        let text = e.to_string();
        assert!(text.lines().count() == 3 && text.contains(what), "{text}");
    };
    three(make_task(Path::new("nowhere"), TaskKind::Open, None, None).unwrap_err(), "no model");
    three(make_task(&covered_box(), TaskKind::Open, Some("door"), None).unwrap_err(), "lid_hinge");
    three(Spoil::read("axis=no").unwrap_err(), "axis=DEGREES");
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("stone.xml");
    std::fs::write(&path, r#"<mujoco><worldbody><body><geom size=".1"/></body></worldbody></mujoco>"#).unwrap();
    three(make_task(&path, TaskKind::Open, None, None).unwrap_err(), "nothing moves");
    // A twin of something else.
    let made = make_task(&covered_box(), TaskKind::Open, None, None).unwrap();
    let other = SceneConfig { object: a_twin(dir.path(), 0.9), spoil: Vec::new(), visuals: false };
    three(Scene::new(&other, &made.task).unwrap_err(), "is this the twin");
    let config = SceneConfig { object: covered_box(), spoil: Vec::new(), visuals: false };
    let mut env = Env::new(&Scene::new(&config, &made.task).unwrap());
    let mut action = [0.0; 7];
    action[2] = f64::NAN;
    three(env.step(&action).unwrap_err(), "action[2]");
    three(env.set_state(&[0.0; 3]).unwrap_err(), "3");
}

/// A demonstrator that knows the joint in front of it opens many a wrong one; where the part then
/// is tells them apart.
#[test]
fn a_wrong_joint_opens_and_yet_not_as_the_true_one() {
    let truth = scene(&covered_box(), &covered_box(), &[]);
    let path = SpotPath::of(&truth);
    assert_eq!(path.tolerance(), hingecast_sim::path::TOLERANCE);
    let count = |spoil: &[Spoil]| {
        let mut env = Env::new(&scene(&covered_box(), &covered_box(), spoil));
        let ends = (0..10).map(|seed| {
            let opened = demonstrate(&mut env, seed, |_, _| ()).unwrap() == Outcome::Success;
            (opened, env.off(&path) <= path.tolerance(), env.off(&path))
        });
        ends.collect::<Vec<_>>()
    };
    let right = count(&[]);
    assert!(right.iter().all(|(opened, as_true, _)| opened == as_true), "{right:?}");
    assert!(right.iter().filter(|(opened, _, off)| *opened && *off < 1e-3).count() >= 9, "{right:?}");
    // 2 degrees stay within half a pad; 30 degrees do not, though the lid comes up.
    assert!(count(&[Spoil::Axis(2.0)]).iter().filter(|e| e.1).count() >= 9);
    for spoil in [Spoil::Axis(30.0), Spoil::Limits(0.4), Spoil::Pivot(30.0), Spoil::Edge] {
        let ends = count(&[spoil]);
        assert!(ends.iter().all(|e| !e.1), "{spoil:?}: {ends:?}");
        if matches!(spoil, Spoil::Axis(_) | Spoil::Pivot(_)) {
            assert!(ends.iter().filter(|e| e.0).count() >= 8, "{spoil:?}: {ends:?}");
        }
    }
}

/// The pads' width is written in two places: in the model of the hand and as the tolerance.
#[test]
fn the_tolerance_is_half_a_pad() {
    let scene = scene(&covered_box(), &covered_box(), &[]);
    let pad = scene.model.name_to_id(mujoco_rs::prelude::MjtObjBase::mjOBJ_GEOM, "left_pad").unwrap();
    assert_eq!(scene.model.geom_size()[pad][0], hingecast_sim::path::TOLERANCE);
}

/// Whatever the file's zero and unit of angles are: a wrong hinge moves the part otherwise, but
/// closed it stands where it stood.
#[test]
fn a_spoiled_joint_leaves_the_closed_part_where_it_was() {
    let dir = tempfile::tempdir().unwrap();
    let twin = a_twin(dir.path(), 0.06);
    let degrees = dir.path().join("degrees.xml");
    let text = std::fs::read_to_string(&twin).unwrap();
    let text = text.replace("angle=\"radian\"", "angle=\"degree\"").replace("-0.785 0.785", "-44.97718691 44.97718691");
    std::fs::write(&degrees, text).unwrap();
    for file in [covered_box(), twin, degrees] {
        let right = scene(&file, &covered_box(), &[]);
        let (mut a, path) = (Env::new(&right), SpotPath::of(&right));
        a.reset(3);
        for (spoil, axis_deg, pivot_mm) in [
            (Spoil::Axis(30.0), 30.0, 0.0),
            (Spoil::Pivot(10.0), 0.0, 10.0),
            (Spoil::Limits(0.5), 0.0, 0.0),
            (Spoil::Edge, 180.0, 120.0),
        ] {
            let wrong = scene(&file, &covered_box(), &[spoil]);
            let mut b = Env::new(&wrong);
            b.reset(3);
            let (p, q) = (a.grasp(), b.grasp());
            assert!(
                p.trans.distance(q.trans) < 1e-6 && (p.rot.inverse() * q.rot).w.abs() > 1.0 - 1e-9,
                "{spoil:?} {file:?}"
            );
            let this = SpotPath::of(&wrong);
            assert!(
                (this.screw.axis.angle_between(path.screw.axis).to_degrees() - axis_deg).abs() < 1e-4,
                "{spoil:?} {file:?}"
            );
            let off = 1e3 * this.screw.distance(path.screw.foot(path.spot));
            assert!(
                (off - pivot_mm).abs() < 12.0 * f64::from(u8::from(spoil == Spoil::Edge)) + 1e-3,
                "{spoil:?} {file:?}: {off}"
            );
            // What the task asks for is the true object's.
            assert_eq!(this.travel, path.travel, "{spoil:?} {file:?}");
        }
    }
}
