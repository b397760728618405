//! Rooms, masks, frames of reference and pushes around a rendered object.

mod common;

use common::{made, small, with};
use glam::{DVec2, DVec3};
use hingecast_capture::synth::{Frames, Masks, Push, Scenery, SynthConfig, World};
use hingecast_capture::{Recording, Split, Truth};
use hingecast_geom::Pose;

/// Points of the world that the object's (`own`) or the other pixels of a frame show.
fn points(recording: &Recording, truth: &Truth, frame: usize, own: bool) -> Vec<DVec3> {
    let view = recording.load(frame).unwrap();
    let labels = truth.labels(&recording.frames[frame].color).unwrap();
    let camera = &truth.cameras[frame];
    let at = |p: usize| DVec2::new((p % camera.width) as f64 + 0.5, (p / camera.width) as f64 + 0.5);
    let wanted = |p: &usize| view.depth[*p] > 0.0 && (labels[*p] > 0) == own;
    (0..labels.len()).filter(wanted).map(|p| camera.unproject(at(p), f64::from(view.depth[p]))).collect()
}

#[test]
fn a_room_fills_the_pictures_and_keeps_away_from_object_and_cameras() {
    let dir = tempfile::tempdir().unwrap();
    for seed in 0..3 {
        let config = SynthConfig { seed, ..with(World { scene: Scenery::Room, ..Default::default() }) };
        let (recording, truth) = made(dir.path(), &config);
        // The lid opens from the front at -y: the wall is at +y, 1 to 3 cm behind what comes
        // nearest.
        let object: Vec<DVec3> =
            (0..recording.frames.len()).flat_map(|f| points(&recording, &truth, f, true)).collect();
        let around: Vec<DVec3> =
            (0..recording.frames.len()).flat_map(|f| points(&recording, &truth, f, false)).collect();
        let back = object.iter().map(|x| x.y).fold(f64::MIN, f64::max);
        let wall = around.iter().map(|x| x.y).fold(f64::MIN, f64::max);
        let behind = around.iter().filter(|x| (x.y - wall).abs() < 2e-3).count();
        assert!(behind > around.len() / 20, "{behind} of {} points are of a wall", around.len());
        assert!((0.01..0.045).contains(&(wall - back)), "the wall is {} m behind", wall - back);
        let floor = around.iter().map(|x| x.z).fold(f64::MAX, f64::min);
        assert!((floor + 0.1005).abs() < 1e-3, "the floor is at {floor}");
        // Clutter: neither wall nor floor; 10 cm from all that the object ever needs.
        let clutter: Vec<&DVec3> = around.iter().filter(|x| x.z > floor + 0.01 && x.y < wall - 0.01).collect();
        assert!(clutter.len() > 200, "{} points of clutter", clutter.len());
        let (lo, hi) = object.iter().fold((object[0], object[0]), |(lo, hi), x| (lo.min(*x), hi.max(*x)));
        let apart = |x: &DVec3| (lo - *x).max(*x - hi).max(DVec3::ZERO).truncate().length();
        let nearest = clutter.iter().map(|x| apart(x)).fold(f64::MAX, f64::min);
        assert!(nearest > 0.095, "clutter {nearest} m from the object");
        let centre = 0.5 * (lo + hi);
        for camera in &truth.cameras {
            let eye = camera.centre();
            assert!(eye.y < centre.y && eye.z > floor + 0.01, "a camera at {eye}");
            assert!(clutter.iter().all(|x| x.distance(eye) > 0.1), "a camera in the clutter at {eye}");
        }
        // The background shows in corners at most.
        for frame in 0..recording.frames.len() {
            let view = recording.load(frame).unwrap();
            let empty = view.depth.iter().filter(|z| **z == 0.0).count();
            assert!(empty < view.depth.len() / 4, "{empty} pixels of frame {frame} are empty");
        }
    }
}

#[test]
fn a_room_changes_neither_masks_nor_joint_values() {
    let dir = tempfile::tempdir().unwrap();
    let (recording, truth) = made(dir.path(), &with(World { scene: Scenery::Room, ..Default::default() }));
    let bare = tempfile::tempdir().unwrap();
    let (_, without) = made(bare.path(), &small());
    assert_eq!(truth.tree, without.tree);
    for frame in 0..recording.frames.len() {
        let (view, labels) = (recording.load(frame).unwrap(), truth.labels(&recording.frames[frame].color).unwrap());
        assert!(labels.iter().zip(&view.mask).all(|(l, m)| (*l > 0) == (*m == 1)));
        assert!(labels.iter().all(|l| *l <= 2) && labels.contains(&1) && labels.contains(&0));
    }
}

#[test]
fn hands_in_a_room_are_hands_and_the_room_is_none() {
    let dir = tempfile::tempdir().unwrap();
    let world = World { scene: Scenery::Room, ..Default::default() };
    let (recording, truth) = made(dir.path(), &SynthConfig { play: true, ..with(world) });
    let (mut hands, mut room) = (0, 0);
    for frame in 0..recording.frames.len() {
        let (view, labels) = (recording.load(frame).unwrap(), truth.labels(&recording.frames[frame].color).unwrap());
        hands += view.usable.iter().filter(|u| **u == 0).count();
        room += view.usable.iter().zip(&labels).filter(|(u, l)| **u == 1 && **l == 0).count();
    }
    assert!(hands > 500 && room > 10 * hands, "{hands} pixels of hands, {room} of the room");
}

#[test]
fn masks_can_be_left_out_or_be_a_segmenters() {
    let dir = tempfile::tempdir().unwrap();
    let (recording, _) = made(dir.path(), &with(World { masks: Masks::None, ..Default::default() }));
    assert!(recording.frames.iter().all(|f| f.mask.is_none()) && !recording.root.join("mask").exists());

    let world = World { masks: Masks::Sam, scene: Scenery::Room, ..Default::default() };
    let (recording, truth) = made(dir.path(), &with(world));
    for (i, frame) in recording.frames.iter().enumerate() {
        let (view, labels) = (recording.load(i).unwrap(), truth.labels(&frame.color).unwrap());
        let wrong = labels.iter().zip(&view.mask).filter(|(l, m)| (**l > 0) != (**m == 1)).count();
        let own = labels.iter().filter(|l| **l > 0).count();
        match frame.split {
            Split::Train => assert!(wrong > 10 && wrong < own, "frame {i}: {wrong} of {own}"),
            Split::Test => assert_eq!(wrong, 0, "frame {i}"),
        }
    }
}

fn stated_from_true(recording: &Recording, truth: &Truth, frame: usize) -> Pose {
    let stated = recording.frames[frame].camera.camera_from_world;
    stated.inverse() * truth.cameras[frame].camera_from_world
}

#[test]
fn states_can_have_frames_of_their_own() {
    let dir = tempfile::tempdir().unwrap();
    for frames in [Frames::PerState, Frames::Tilted] {
        let (recording, truth) = made(dir.path(), &with(World { frames, ..Default::default() }));
        let mut seen: Vec<Pose> = Vec::new();
        for (i, frame) in recording.frames.iter().enumerate() {
            let found = stated_from_true(&recording, &truth, i);
            let told = truth.recording_from_world_at(frame.state);
            assert!((found * told.inverse()).angle() < 1e-6 && found.trans.distance(told.trans) < 1e-6);
            assert!(told.trans.length() <= 2.0);
            if frame.state == 0 || frame.state >= truth.n_states {
                assert!(found.angle() < 1e-6 && found.trans.length() < 1e-6, "{found:?}");
            } else {
                seen.push(told);
            }
            let tilt = told.rotate(DVec3::Z).angle_between(DVec3::Z);
            assert!(frames == Frames::Tilted || tilt < 1e-6, "{tilt}");
        }
        assert!(seen[0].angle() > 0.05 && seen[0].trans.length() > 0.1, "{:?}", seen[0]);
        let (first, last) = (seen[0], seen[seen.len() - 1]);
        assert!((first.inverse() * last).angle() > 0.05, "both states share a frame");
        let tilted = seen.iter().any(|p| p.rotate(DVec3::Z).angle_between(DVec3::Z) > 0.2);
        assert_eq!(tilted, frames == Frames::Tilted);
    }
}

#[test]
fn a_push_moves_the_object_and_not_the_room() {
    let dir = tempfile::tempdir().unwrap();
    let push = Push { mm: 30.0, deg: 4.0, states: vec![2] };
    let world = World { scene: Scenery::Room, push: Some(push), ..Default::default() };
    let config = SynthConfig { states: 4, ..with(world) };
    let (recording, truth) = made(dir.path(), &config);
    let bare = tempfile::tempdir().unwrap();
    let (_, without) = made(bare.path(), &SynthConfig { states: 4, ..small() });
    assert_eq!(truth.tree, without.tree, "joint values are those of the unpushed object");
    let pose = |s| truth.world_from_object_at(s);
    assert_eq!((pose(0), pose(1)), (Pose::IDENTITY, Pose::IDENTITY));
    assert_eq!(pose(2), pose(3));
    assert!((pose(2).angle().to_degrees() - 4.0).abs() < 1e-9 && pose(2).rotate(DVec3::Z).distance(DVec3::Z) < 1e-12);
    // The middle of the box with its lid.
    let middle = DVec3::new(0.0, 0.0, 0.0175);
    let way = pose(2).apply(middle) - middle;
    assert!((way.length() - 0.03).abs() < 1e-9 && way.z.abs() < 1e-12 && way.y < 0.0, "{way}");
    let mut worst = 0f64;
    let (mut floor, mut wall) = (Vec::new(), Vec::new());
    for (i, frame) in recording.frames.iter().enumerate().filter(|(_, f)| f.state < 4) {
        // What the frame shows of the body lies on the body where the truth says that it is.
        let labels = truth.labels(&frame.color).unwrap();
        let view = recording.load(i).unwrap();
        let body = pose(frame.state) * truth.tree.poses_at(frame.state)[0];
        for p in (0..labels.len()).filter(|p| labels[*p] == 1) {
            let uv = DVec2::new((p % 64) as f64 + 0.5, (p / 64) as f64 + 0.5);
            let x = body.inverse().apply(truth.cameras[i].unproject(uv, f64::from(view.depth[p])));
            worst = worst.max((x.abs() - DVec3::new(0.2, 0.15, 0.1)).max_element().abs());
        }
        let around = points(&recording, &truth, i, false);
        floor.push(around.iter().map(|x| x.z).fold(f64::MAX, f64::min));
        wall.push(around.iter().map(|x| x.y).fold(f64::MIN, f64::max));
    }
    assert!(worst < 3e-4, "{worst}");
    let spread = |v: &[f64]| v.iter().copied().fold(f64::MIN, f64::max) - v.iter().copied().fold(f64::MAX, f64::min);
    assert!(spread(&floor) < 1e-3 && spread(&wall) < 1e-3, "{floor:?} {wall:?}");
    // Pushed once more, and at once: the seed picks the state.
    let again = World { push: Some("30".parse().unwrap()), ..Default::default() };
    let (_, truth) = made(dir.path(), &SynthConfig { states: 4, ..with(again) });
    assert_eq!(truth.world_from_object[0], Pose::IDENTITY);
    assert!((truth.world_from_object[3].angle().to_degrees() - 2.0).abs() < 1e-9);
}

#[test]
fn pushes_that_make_no_sense_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let object = common::hinged_box(dir.path());
    for states in [vec![0], vec![3], vec![1, 9]] {
        let push = Some(Push { mm: 10.0, deg: 1.0, states });
        let config = with(World { push, ..Default::default() });
        let error = hingecast_capture::synth::synth(&object, &config, &dir.path().join("rec"), &Default::default());
        assert!(error.unwrap_err().to_string().contains("push = "));
    }
    for text in ["", "a", "3:", "3:b", "-3", "nan"] {
        assert!(text.parse::<Push>().is_err(), "{text}");
    }
    assert_eq!("12:1.5".parse(), Ok(Push { mm: 12.0, deg: 1.5, states: vec![] }));
}

/// Settings of older versions are read, and settings without a world are written as they wrote
/// them.
#[test]
fn settings_without_a_world_do_not_mention_it() {
    let plain = serde_json::to_value(small()).unwrap();
    assert!(plain.get("world").is_none());
    assert_eq!(serde_json::from_value::<SynthConfig>(plain).unwrap(), small());
    let config = with(World { masks: Masks::Sam, ..Default::default() });
    assert_eq!(serde_json::from_value::<SynthConfig>(serde_json::to_value(&config).unwrap()).unwrap(), config);
}
