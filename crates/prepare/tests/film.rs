//! A film of somebody who opens a cupboard: its pictures on the scan, its states, the hand in it.

mod common;

use common::{Block, block, cupboard, picture, room, views};
use glam::{DQuat, DVec3, Vec3};
use hingecast_articulate::{Config, DepthView, Labelled, OBJECT, OTHER, UNKNOWN, find};
use hingecast_geom::{Camera, Joint, JointKind, KinematicTree, Pose, Progress, Screw};
use hingecast_prepare::film::{cut, onto};
use hingecast_prepare::hands::{Belief, hands};

/// A forearm that holds the handle of a door that is open by `deg`, and moves with it.
fn arm(deg: f64) -> Block {
    let hinge = Pose::new(DQuat::from_rotation_z(-deg.to_radians()), DVec3::new(-0.3, 0.57, 0.45));
    Block {
        half: DVec3::new(0.05, 0.2, 0.05),
        world_from_block: hinge * Pose::from_trans(DVec3::new(0.74, -0.26, 0.0)),
    }
}

fn scene(deg: f64, hand: bool) -> Vec<Block> {
    let mut all = [room(), cupboard(deg, Pose::IDENTITY)].concat();
    all.extend(hand.then(|| arm(deg)));
    all
}

/// The camera of picture `k`, which walks along slowly.
fn camera(k: usize) -> Camera {
    let turn = (-25.0 + 1.5 * k as f64).to_radians();
    let eye = DVec3::new(0.1 + 2.2 * turn.sin(), 0.6 - 2.2 * turn.cos(), 1.2);
    Camera::look_at(eye, DVec3::new(0.1, 0.6, 0.4), DVec3::Z, 128, 96, 1.0)
}

/// At rest, then opened, then at rest: angle and hand of every picture.
fn play() -> Vec<(f64, bool)> {
    let moving = (1..=12).map(|k| (6.0 * f64::from(k), true));
    [(0.0, false); 8].into_iter().chain(moving).chain([(72.0, false); 8]).collect()
}

fn film() -> Vec<DepthView> {
    let one = |(k, (deg, hand)): (usize, (f64, bool))| {
        let (depth, _) = picture(&camera(k), &scene(deg, hand));
        let class = depth.iter().map(|z| if *z > 0.0 { OBJECT } else { UNKNOWN }).collect();
        DepthView { camera: camera(k), depth, class }
    };
    play().into_iter().enumerate().map(one).collect()
}

#[test]
fn pictures_that_drifted_come_back_onto_the_scan_although_a_door_moves() {
    let scan = views(&scene(0.0, false), &Pose::IDENTITY, 16, 5);
    let mut film = film();
    let n = film.len() as f64;
    for (k, view) in film.iter_mut().enumerate() {
        let t = k as f64 / n;
        let off = Pose::new(DQuat::from_rotation_z(0.01 * t), DVec3::new(0.0, 0.02 * t, -0.01 * t));
        view.camera.camera_from_world = view.camera.camera_from_world * off.inverse();
    }
    let placing = onto(&scan, &mut film, &Progress::default()).unwrap();
    assert_eq!(placing.lost, 0);
    for (k, view) in film.iter().enumerate() {
        let off = view.camera.camera_from_world.inverse() * camera(k).camera_from_world;
        let shift = view.camera.centre().distance(camera(k).centre());
        assert!(off.angle() < 0.002 && shift < 0.004, "picture {k}: {} rad, {shift} m", off.angle());
    }
}

#[test]
fn a_film_is_cut_into_its_rests_and_the_motion_between() {
    let cut = cut(&film(), 10, &Progress::default()).unwrap();
    assert_eq!(cut.rests, 2, "{cut:?}");
    let (first, last) = (&cut.states[0], cut.states.last().unwrap());
    assert!(first.len() > 3 && first.iter().all(|k| *k < 8), "{cut:?}");
    assert!(last.len() > 3 && last.iter().all(|k| *k >= 19), "{cut:?}");
    assert!((8..=10).contains(&cut.states.len()), "{cut:?}");
}

/// What a camera sees, the room masked out, and the block of every pixel.
fn masked(camera: Camera, blocks: &[Block]) -> (DepthView, Vec<u8>) {
    let first = room().len() as u8 + 1;
    let (depth, which) = picture(&camera, blocks);
    let class = which.iter().map(|w| if *w >= first { OBJECT } else { OTHER }).collect();
    (DepthView { camera, depth, class }, which)
}

/// A thin lid that stands at `deg` over its base, and maybe an arm that holds its edge.
fn laptop(deg: f64, hand: bool) -> Vec<Block> {
    let hinge = Pose::new(DQuat::from_rotation_x(-deg.to_radians()), DVec3::new(0.1, 0.8, 0.05));
    let on_lid = |half: [f64; 3], middle: [f64; 3]| Block {
        half: DVec3::from(half),
        world_from_block: hinge * Pose::from_trans(DVec3::from(middle)),
    };
    let mut all = room();
    all.push(block([0.1, 0.6, 0.025], [0.6, 0.4, 0.05], 0.0));
    all.push(on_lid([0.3, 0.19, 0.008], [0.0, -0.19, 0.012]));
    all.extend(hand.then(|| on_lid([0.05, 0.2, 0.04], [0.25, -0.56, 0.03])));
    all
}

/// One picture a state, the arm in every one of them. The lid is shut: for some pictures it is seen edge-on,
/// and then from a side that the scan hardly saw.
#[test]
fn a_lid_is_found_although_an_arm_moves_with_it() {
    let scan = views(&laptop(100.0, false), &Pose::IDENTITY, 16, 5);
    let mut states = vec![scan.iter().map(|v| masked(v.camera, &laptop(100.0, false)).0).collect::<Vec<_>>()];
    let angles: Vec<f64> = (0..18).map(|k| 100.0 - 5.5 * f64::from(k)).collect();
    states.extend(angles[1..].iter().enumerate().map(|(k, deg)| vec![masked(camera(2 * k), &laptop(*deg, true)).0]));
    let config = Config { cells: 48, align_cameras: false, borders: false, film: true, ..Config::default() };
    let found = find(&mut states, &config, &Progress::default()).unwrap();
    assert_eq!(found.tree.joints.len(), 1, "{:?}", found.tree.joints);
    let hinge = &found.tree.joints[0];
    let turn = -hinge.screw.axis.x;
    assert!(hinge.screw.kind == JointKind::Revolute && turn.abs() > 1f64.to_radians().cos(), "{hinge:?}");
    for (value, deg) in hinge.values.iter().zip(&angles) {
        let off = turn.signum() * value.to_degrees() - (deg - angles[0]);
        assert!(off.abs() < 2.0, "{deg} deg: off by {off} {:?}", hinge.values);
    }
}

#[test]
fn the_hand_is_what_no_part_explains() {
    let scan = views(&scene(0.0, false), &Pose::IDENTITY, 16, 5);
    let all = [room(), cupboard(0.0, Pose::IDENTITY)].concat().len() as u8;
    let angles = [0.0, 24.0, 48.0, 72.0];
    let mut truth = Vec::new();
    let mut states = vec![scan.iter().map(|v| masked(v.camera, &scene(0.0, false)).0).collect::<Vec<_>>()];
    for (k, deg) in angles.iter().enumerate().skip(1) {
        let (view, which) = masked(camera(6 * k), &scene(*deg, true));
        states.push(vec![view]);
        truth.push(which.iter().map(|w| *w > all).collect::<Vec<bool>>());
    }
    // The door as it is, and a part that only the arm has.
    let hinge = Screw { kind: JointKind::Revolute, axis: -DVec3::Z, pivot: DVec3::new(-0.3, 0.57, 0.45) };
    let joint = |name: &str, child: usize, screw: Screw, values: Vec<f64>| Joint {
        name: name.into(),
        parent: 0,
        child,
        screw,
        limits: [0.0, 2.0],
        values,
    };
    let slide = Screw { kind: JointKind::Prismatic, axis: DVec3::Z, pivot: DVec3::ZERO };
    let tree = KinematicTree {
        parts: ["body", "door", "arm"].map(String::from).to_vec(),
        joints: vec![
            joint("hinge", 1, hinge, angles.iter().map(|a| a.to_radians()).collect()),
            joint("phantom", 2, slide, vec![0.0, 5.0, 5.0, 5.0]),
        ],
        couplings: Vec::new(),
    };
    let cameras: Vec<Vec<Pose>> =
        states.iter().map(|v| v.iter().map(|v| v.camera.camera_from_world).collect()).collect();
    let sample =
        |k: u8| Labelled { state: usize::from(k / 128), point: Vec3::ZERO, part: if k < 128 { k % 2 } else { 2 } };
    let samples: Vec<Labelled> = (0..200).map(sample).collect();
    let belief = Belief { tree: &tree, cameras: &cameras, samples: &samples };
    let hands = hands(&mut states, &belief, &Progress::default()).unwrap();
    assert_eq!(hands.phantoms, 1, "the arm is no part");
    assert!(hands.masks[0].iter().flatten().all(|h| *h == 0), "nobody is in the scan");
    for (state, hand) in truth.iter().enumerate() {
        let found = &hands.masks[state + 1][0];
        let count = |wanted: &dyn Fn(usize) -> bool| (0..hand.len()).filter(|&i| wanted(i)).count() as f64;
        let (all, missed) = (count(&|i| hand[i]), count(&|i| hand[i] && found[i] == 0));
        assert!(all > 40.0 && missed < 0.05 * all, "state {}: {missed} of {all} missed", state + 1);
        // A rim around it goes, too.
        let taken = count(&|i| !hand[i] && found[i] == 1);
        assert!(taken < 2.5 * all, "state {}: {taken} pixels of others, the hand has {all}", state + 1);
    }
}
