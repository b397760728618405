//! `find` on parts that hang on other moving parts.

mod common;

use common::objects::{joint, swivel_seat, tree};
use common::scene::{Scene, cuboid};
use common::truth::{COARSE, USUAL, assert_tree};
use glam::DVec3;
use hingecast_geom::JointKind::Revolute;

/// A desk lamp: an arm on a foot, a head on the arm.
#[test]
fn a_joint_on_a_joint() {
    let boxes = vec![
        vec![cuboid([-0.3, -0.2, -0.3], [0.3, 0.2, -0.22]), cuboid([-0.06, -0.14, -0.22], [0.06, -0.08, 0.0])],
        vec![cuboid([-0.05, -0.08, -0.1], [0.05, -0.02, 0.55])],
        vec![cuboid([-0.08, -0.02, 0.42], [0.4, 0.1, 0.52]), cuboid([0.25, -0.06, 0.3], [0.4, 0.14, 0.42])],
    ];
    let tree = tree(vec![
        joint(0, 1, Revolute, DVec3::Y, DVec3::new(0.0, 0.0, -0.05), &[0.0, 0.3, 0.6, 0.4, -0.2]),
        joint(1, 2, Revolute, DVec3::Y, DVec3::new(0.0, 0.0, 0.47), &[0.0, 0.5, 0.2, -0.3, 0.6]),
    ]);
    let scene = Scene::new(boxes, tree);
    assert_tree(&scene.find().tree, &scene, &USUAL);
}

/// A turn and a slide along its axis commute: the seat does not know which comes first, the lever
/// that only rises does.
#[test]
fn a_seat_that_rises_and_then_turns() {
    let scene = swivel_seat().coarse();
    assert_tree(&scene.find().tree, &scene, &COARSE);
}
