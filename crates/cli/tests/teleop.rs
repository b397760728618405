//! Tele-operation in the real simulator, driven by key events: recorded, undone, discarded, kept,
//! written, read, replayed to the bit.
#![cfg(feature = "mujoco")]

mod common;

use common::{hingecast, objects};
use glam::DVec3;
use hingecast_policy::demos;
use hingecast_sim::trial::make_task;
use hingecast_sim::{Env, Scene, SceneConfig, TaskKind};
use hingecast_study::simulate::record::WorldArgs;
use hingecast_study::simulate::replay::replay;
use hingecast_study::simulate::teleop::keys::{Command, Key, Stroke};
use hingecast_study::simulate::teleop::session::{Session, UNDO_STEPS};
use std::time::Duration;

/// What was pressed when.
type Event = (Duration, Key, Stroke);

/// A session, and a person of few words: presses what brings the hand where it shall go.
struct Typist {
    session: Session,
    now: Duration,
    events: Vec<Event>,
    down: Vec<Key>,
}

impl Typist {
    fn new(scene: &Scene, world: &WorldArgs) -> Self {
        let session = Session::new(scene, world.clone(), None, true);
        Self { session, now: Duration::ZERO, events: Vec::new(), down: Vec::new() }
    }

    fn event(&mut self, key: Key, stroke: Stroke) {
        self.events.push((self.now, key, stroke));
        self.session.key(key, stroke, self.now);
    }

    fn tap(&mut self, key: Key) {
        self.event(key, Stroke::Down);
        self.event(key, Stroke::Up);
    }

    fn command(&mut self, command: Command) {
        self.tap(Key::Command(command));
    }

    /// Holds the keys that go along `way`, where it is longer than 4 mm; a step of 50 ms.
    fn go(&mut self, way: DVec3) {
        let mut wanted = Vec::new();
        for axis in 0..3 {
            if way[axis].abs() > 0.004 {
                wanted.push(Key::Move { axis, forward: way[axis] > 0.0 });
            }
        }
        for key in std::mem::take(&mut self.down) {
            if !wanted.contains(&key) {
                self.event(key, Stroke::Up);
            }
        }
        for &key in &wanted {
            self.event(key, Stroke::Down);
        }
        self.down = wanted;
        self.step();
    }

    fn step(&mut self) {
        self.session.step(self.now).unwrap();
        self.now += Duration::from_millis(50);
    }

    /// Goes above the grasp, down, closes, and follows the lid; `each` is asked before every step
    /// whether to go on.
    fn open(&mut self, mut each: impl FnMut(&mut Self) -> bool) {
        let mut closing = 0;
        for _ in 0..600 {
            if !each(self) {
                return;
            }
            let env = &self.session.env;
            let to_grasp = env.grasp().trans - env.grip().trans;
            let across = DVec3::new(to_grasp.x, to_grasp.y, 0.0);
            let lid_way = tangent(env);
            // An undo may have opened the fingers again.
            if !self.session.status().closed {
                closing = 0;
            }
            match closing {
                0 if across.length() > 0.01 => {
                    let up = if to_grasp.z > -0.05 { DVec3::Z * (0.05 + to_grasp.z) } else { DVec3::ZERO };
                    self.go(across + up);
                }
                0 if to_grasp.z < -0.008 => self.go(to_grasp),
                0 => {
                    self.tap(Key::Gripper);
                    closing = 1;
                }
                1..10 => {
                    self.go(DVec3::ZERO);
                    closing += 1;
                }
                _ => self.go(0.02 * lid_way),
            }
        }
    }
}

/// Where the held spot goes when the lid opens.
fn tangent(env: &Env) -> DVec3 {
    let screw = env.screw();
    screw.axis.cross(env.grasp().trans - screw.pivot).normalize()
        * (env.scene.target.open - env.scene.target.closed).signum()
}

fn world() -> (Scene, WorldArgs) {
    let object = hingecast_sim::object::model_file(&objects().join("covered_box")).unwrap();
    let task = make_task(&object, TaskKind::Open, None, None).unwrap().task;
    let config = SceneConfig { object: object.clone(), spoil: Vec::new(), visuals: false };
    let scene = Scene::new(&config, &task).unwrap();
    (scene, WorldArgs { object, task, control_freq: 20, seed: 5 })
}

fn bits(state: &[f64]) -> Vec<u64> {
    state.iter().map(|x| x.to_bits()).collect()
}

#[test]
fn a_session_by_keys_is_recorded_undone_and_replays_to_the_bit() {
    let (scene, world) = world();
    let mut typist = Typist::new(&scene, &world);
    let start = bits(&typist.session.env.state());

    // Practice is not recorded, and the recording begins at the start all the same.
    for _ in 0..10 {
        typist.go(DVec3::X);
    }
    assert_ne!(bits(&typist.session.env.state()), start);
    typist.command(Command::Record);
    assert_eq!(bits(&typist.session.env.state()), start);
    typist.go(DVec3::ZERO);
    typist.step();
    assert_eq!(typist.session.status().steps, 0, "time stands still until a key moves the hand");

    // Two undos on the way to a success.
    let mut states = Vec::new();
    let mut undo_at = vec![50, 30];
    typist.open(|t| {
        let steps = t.session.status().steps;
        if t.session.status().recording && undo_at.last().is_some_and(|&at| steps == at) {
            undo_at.pop();
            t.command(Command::Undo);
            assert_eq!(t.session.status().steps, steps - UNDO_STEPS);
            let before: &Vec<u64> = &states[steps - UNDO_STEPS];
            assert_eq!(&bits(&t.session.env.state()), before, "the world of {UNDO_STEPS} steps before");
        }
        states.truncate(t.session.status().steps);
        states.push(bits(&t.session.env.state()));
        t.session.status().kept == 0
    });
    assert!(undo_at.is_empty(), "it was over too soon");
    assert!(typist.session.take_changed() && !typist.session.take_changed());
    let status = typist.session.status();
    assert!(status.kept == 1 && !status.recording && status.notice.contains("success"), "{status:?}");

    // Undo while the lid is in the hand, slowly pulled: the closed fingers come back with the
    // world.
    typist.tap(Key::Slower);
    typist.tap(Key::Slower);
    typist.command(Command::Record);
    let mut undone = false;
    typist.open(|t| {
        let s = t.session.status();
        if !undone && s.holding && s.moved > 0.4 {
            t.command(Command::Undo);
            let now = t.session.status();
            assert!(now.closed && now.moved < s.moved && now.steps + UNDO_STEPS == s.steps, "{now:?}");
            undone = true;
        }
        t.session.status().kept == 1
    });
    assert!(undone && typist.session.status().kept == 2, "{:?}", typist.session.status());

    // Discarded: the same start again. Stopped: kept, but no success. Taken back: gone.
    typist.command(Command::Record);
    let third = bits(&typist.session.env.state());
    assert_ne!(third, start);
    typist.go(DVec3::Z);
    typist.command(Command::Discard);
    assert_eq!((typist.session.status().kept, bits(&typist.session.env.state())), (2, third));
    typist.command(Command::Record);
    typist.go(DVec3::Z);
    typist.go(-DVec3::Z);
    typist.command(Command::Record);
    let stopped = typist.session.demos.clone();
    assert!(
        stopped.episodes.len() == 3 && stopped.episodes[2].rewards == [0.0, 0.0],
        "{:?}",
        stopped.episodes[2].rewards
    );
    typist.command(Command::TakeBack);
    typist.command(Command::Quit);
    assert!(typist.session.wants_to_quit());

    // Written and read back, and replayed from the file.
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("demos.hdf5");
    demos::write(&file, &stopped).unwrap();
    demos::write(&file, &typist.session.demos).unwrap();
    let read = demos::read(&file).unwrap();
    let same = read.episodes == typist.session.demos.episodes && read.masks == typist.session.demos.masks;
    assert!(same, "what was read is not what was written");
    assert_eq!(read.masks["train"], ["demo_0", "demo_1"]);
    let replayed = replay(&read, &world, &Default::default()).unwrap();
    assert_eq!((replayed.episodes, replayed.equal, replayed.successes), (2, 2, 2), "{replayed:?}");
    for e in &read.episodes {
        assert!(e.dones.ends_with(&[true]) && e.next_obs["object"].len() == e.actions.len());
        assert_eq!(e.next_obs["object"][..e.actions.len() - 1], e.obs["object"][1..], "no seam where it was undone");
    }

    // The list of events alone is the session.
    let mut again = Session::new(&scene, world, None, true);
    let mut events = typist.events.iter().peekable();
    let mut now = Duration::ZERO;
    while now < typist.now {
        while let Some((_, key, stroke)) = events.next_if(|e| e.0 <= now) {
            again.key(*key, *stroke, now);
        }
        again.step(now).unwrap();
        now += Duration::from_millis(50);
    }
    for (_, key, stroke) in events {
        again.key(*key, *stroke, now);
    }
    for (i, (a, b)) in again.demos.episodes.iter().zip(&typist.session.demos.episodes).enumerate() {
        assert_eq!(a.actions, b.actions, "demo_{i}");
    }
    assert!(again.demos == typist.session.demos, "the same keys gave another session");
}

#[test]
fn what_tele_operation_refuses() {
    let d = tempfile::tempdir().unwrap();
    hingecast(d.path(), "demos --expert teleop").refused("where to write", "--out");
    // Tests have no terminal: stdin is a pipe.
    hingecast(d.path(), "demos --expert teleop -o new.hdf5").refused("needs a terminal", "stdin");
    assert!(!d.path().join("new.hdf5").exists());
    hingecast(d.path(), "demos -n 2 -o box.hdf5").done();
    let bytes = std::fs::read(d.path().join("box.hdf5")).unwrap();
    let teleop = |flags: &str| hingecast(d.path(), &format!("demos --expert teleop -o box.hdf5 {flags}"));
    teleop("--object three_drawers").refused("another object", "box.hdf5");
    teleop("--task close").refused("another task", "box.hdf5");
    teleop("--joint knob").refused("another joint: lid_hinge, not knob", "box.hdf5");
    teleop("--scale 0.5").refused("another scale", "box.hdf5");
    teleop("").refused("needs a terminal", "stdin");
    hingecast(d.path(), "demos --expert teleop -o nowhere/x.hdf5").refused("cannot", "nowhere");
    std::fs::write(d.path().join("notes.hdf5"), "no demonstrations").unwrap();
    hingecast(d.path(), "demos --expert teleop -o notes.hdf5").refused("not an HDF5 file", "notes.hdf5");
    assert!(std::fs::read(d.path().join("box.hdf5")).unwrap() == bytes, "the file was touched");
}
