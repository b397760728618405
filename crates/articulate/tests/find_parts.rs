//! `find` on furniture: how many parts, which joints, and what is said where nothing can be told.

mod common;

use common::objects::{cupboard, cupboard_open_by, joint, slide, tree};
use common::scene::{Scene, cuboid};
use common::truth::{COARSE, TWO_STATES, USUAL, assert_joint, assert_tree, labelled_right};
use glam::DVec3;
use hingecast_articulate::Doubt;
use hingecast_geom::{JointKind, KinematicTree};

#[test]
fn a_door_and_a_drawer() {
    let scene = cupboard_open_by(&[0.0, 0.5, 1.2, 1.2, 0.9], &[0.0, 0.0, 0.1, 0.3, 0.45]);
    let found = scene.find();
    let names = assert_tree(&found.tree, &scene, &USUAL);
    // The walls of the drawer slide in their own planes, and its floor stays in its plane when it
    // turns with the door.
    let right = labelled_right(&found, &scene, &names);
    assert!(right > 0.99, "{right}");
    assert!(found.doubts.is_empty(), "{:?}", found.doubts);
}

#[test]
fn a_door_and_a_drawer_in_two_states() {
    let scene = cupboard_open_by(&[0.0, 1.3], &[0.0, 0.4]);
    assert_tree(&scene.find().tree, &scene, &TWO_STATES);
}

/// Three equal drawers, opened one after another and left open: what disappears from one place
/// appears where another was.
#[test]
fn equal_drawers_one_after_another() {
    let mut boxes = vec![vec![
        cuboid([-0.3, -0.4, -0.4], [0.4, -0.37, 0.8]),
        cuboid([-0.3, 0.37, -0.4], [0.4, 0.4, 0.8]),
        cuboid([0.37, -0.37, -0.4], [0.4, 0.37, 0.8]),
    ]];
    boxes[0].extend([-0.4, 0.0, 0.4, 0.77].map(|z| cuboid([-0.3, -0.37, z], [0.37, 0.37, z + 0.03])));
    for z in [-0.37, 0.03, 0.43] {
        boxes.push(vec![
            cuboid([-0.34, -0.36, z + 0.01], [-0.3, 0.36, z + 0.35]),
            cuboid([-0.3, -0.33, z + 0.03], [0.3, 0.33, z + 0.05]),
            cuboid([-0.3, -0.33, z + 0.05], [0.3, -0.31, z + 0.25]),
            cuboid([-0.3, 0.31, z + 0.05], [0.3, 0.33, z + 0.25]),
        ]);
    }
    let ramp = |from: usize, far: f64| -> Vec<f64> {
        (0..10).map(|s: usize| far * s.saturating_sub(from).min(3) as f64 / 3.0).collect()
    };
    let drawer = |k: usize| slide(k, DVec3::NEG_X, &ramp(3 * (k - 1), [0.5, 0.45, 0.55][k - 1]));
    let scene = Scene::new(boxes, tree((1..4).map(drawer).collect())).coarse();
    assert_tree(&scene.find().tree, &scene, &COARSE);
}

#[test]
fn what_never_moves_is_one_part() {
    let still = KinematicTree { parts: vec!["all".into()], ..Default::default() };
    let found = Scene::new(vec![cupboard().concat()], still).coarse().find();
    assert!(found.tree.joints.is_empty());
    assert_eq!(found.doubts[0], Doubt::NothingMoves);
}

/// Two drawers pulled together cannot be told apart, and the doubt says so.
#[test]
fn drawers_that_move_together_are_one_part_with_a_doubt() {
    let mut boxes = cupboard();
    let shift = DVec3::new(0.0, -0.71, 0.0);
    boxes[1] = boxes[2].iter().map(|(lo, hi)| (*lo + shift, *hi + shift)).collect();
    // A gap between the fronts: the pieces do not touch.
    boxes[1][0].1.y = -0.15;
    boxes[2][0].0.y = 0.15;
    let scene = Scene::new(boxes, tree((1..3).map(|k| slide(k, DVec3::NEG_X, &[0.0, 0.15, 0.4])).collect()));
    let found = scene.find();
    assert_eq!(found.tree.joints.len(), 1, "{:?}", found.tree);
    assert_joint(&found.tree, &scene.tree.joints[0], &USUAL);
    assert!(found.doubts.iter().any(|d| matches!(d, Doubt::TwoPieces { .. })), "{:?}", found.doubts);
}

/// Whatever the joint's value is there, the first state counts as 0.
#[test]
fn the_first_state_is_zero() {
    let hinge = joint(0, 1, JointKind::Revolute, DVec3::Z, DVec3::new(-0.35, -0.7, 0.0), &[0.4, 0.0, 1.2]);
    let mut boxes = cupboard();
    let drawer = boxes.pop().unwrap();
    boxes[0].extend(drawer);
    let scene = Scene::new(boxes, tree(vec![hinge])).coarse();
    let found = scene.find();
    assert_tree(&found.tree, &scene, &COARSE);
    assert_eq!(found.tree.joints[0].values[0], 0.0);
}
