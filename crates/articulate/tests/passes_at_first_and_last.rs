//! What each optional pass that runs once is worth: from a tree that is wrong by hand, all passes
//! get it right, and all but that one do not.

mod common;

use common::objects::{cupboard_open_by, drawer_behind_door, drawers_open_by, swivel_seat};
use common::scene::Scene;
use common::settled::{off, settled};
use common::truth::{COARSE, HALF_HIDDEN, assert_joint, assert_tree};
use glam::{DQuat, DVec3};
use hingecast_geom::JointKind;

/// A door and a drawer in five states.
fn cupboard() -> Scene {
    cupboard_open_by(&[0.0, 0.5, 1.2, 1.2, 0.9], &[0.0, 0.0, 0.1, 0.3, 0.45]).coarse()
}

/// The search knew two of five values of the drawer. Later passes only look around values, or at
/// states that hide a part.
#[test]
fn ask_values() {
    let scene = cupboard();
    let mut tree = scene.tree.clone();
    tree.joints[1].values = vec![0.0, 0.0, 0.0, 0.3, 0.0];
    assert_tree(&settled(&scene, &tree, &[]), &scene, &COARSE);
    let without = settled(&scene, &tree, &["ask_values"]);
    assert!(off(&without, &scene, 1).value > 0.1);
}

/// The drawer was found twice.
#[test]
fn prune() {
    let scene = cupboard();
    let mut tree = scene.tree.clone();
    let mut again = tree.joints[1].clone();
    again.child = 3;
    again.values[3] += 0.3 * scene.voxel();
    tree.joints.push(again);
    tree.parts.push("p3".into());
    assert_tree(&settled(&scene, &tree, &[]), &scene, &COARSE);
    assert_eq!(settled(&scene, &tree, &["prune"]).parts.len(), 4);
}

/// The seat first turns and then rises: so does the seat, but not the lever.
#[test]
fn order_links() {
    let scene = swivel_seat().coarse();
    let mut tree = scene.tree.clone();
    let (lift, turn) = (scene.tree.joints[0].clone(), scene.tree.joints[1].clone());
    (tree.joints[0].screw, tree.joints[0].values) = (turn.screw, turn.values);
    (tree.joints[1].screw, tree.joints[1].values) = (lift.screw, lift.values);
    assert_tree(&settled(&scene, &tree, &[]), &scene, &COARSE);
    let without = settled(&scene, &tree, &["order_links"]);
    let turn = assert_joint(&without, &scene.tree.joints[1], &COARSE);
    assert_eq!(without.joints[turn].parent, 0, "{without:?}");
}

/// Where the drawer stands behind the shut door, the back of the door looks like its front.
#[test]
fn find_hidden() {
    let scene = drawer_behind_door().coarse();
    let right = settled(&scene, &scene.tree, &[]);
    assert_tree(&right, &scene, &HALF_HIDDEN);
    let (with, without) = (off(&right, &scene, 1), off(&settled(&scene, &scene.tree, &["find_hidden"]), &scene, 1));
    assert!(without.value > 0.1 && without.value > 100.0 * with.value);
}

/// The drawer was found 17 deg askew.
#[test]
fn turn_axes() {
    let scene = cupboard();
    let mut tree = scene.tree.clone();
    let axis = &mut tree.joints[1].screw.axis;
    *axis = DQuat::from_rotation_z(17f64.to_radians()) * *axis;
    assert_tree(&settled(&scene, &tree, &[]), &scene, &COARSE);
    assert!(off(&settled(&scene, &tree, &["turn_axes"]), &scene, 1).axis > 0.1);
}

/// The drawer was found as a hinge eight units away, four times as far as the object is long.
#[test]
fn far_hinges() {
    let scene = cupboard();
    let (mut tree, far) = (scene.tree.clone(), 8.0);
    let drawer = &mut tree.joints[1];
    (drawer.screw.kind, drawer.screw.axis) = (JointKind::Revolute, DVec3::Z);
    drawer.screw.pivot = DVec3::new(0.0, -far, 0.0);
    drawer.values.iter_mut().for_each(|q| *q /= far);
    assert_tree(&settled(&scene, &tree, &[]), &scene, &COARSE);
    let without = settled(&scene, &tree, &["far_hinges"]);
    assert!(without.joints.iter().all(|j| j.screw.kind == JointKind::Revolute), "{without:?}");
}

/// Two drawers, on the grid one thing, were found as one.
#[test]
fn split_coupled() {
    let scene = drawers_open_by(&[[0.0, 0.166, 0.248, 0.278, 0.266], [0.0, 0.2, 0.237, 0.255, 0.245]]).coarse();
    let mut tree = scene.tree.clone();
    tree.joints.pop();
    tree.parts.pop();
    assert_tree(&settled(&scene, &tree, &[]), &scene, &COARSE);
    assert_eq!(settled(&scene, &tree, &["split_coupled"]).parts.len(), 2);
}
