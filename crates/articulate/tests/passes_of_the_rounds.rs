//! What each optional pass of the rounds is worth: from a tree that is wrong by hand, all passes
//! get it right, and all but that one do not.

mod common;

use common::objects::{cupboard, cupboard_open_by, drawer_behind_door, drawers_open_by, joint, slide, tree};
use common::scene::{Scene, cuboid};
use common::settled::{discovery, off, settled};
use common::truth::{COARSE, HALF_HIDDEN, NOISY, TWO_STATES, USUAL, assert_tree};
use glam::{DQuat, DVec3};
use hingecast_articulate::passes::driver::settle;
use hingecast_articulate::passes::optional_names;
use hingecast_articulate::passes::value_search::values_beside;
use hingecast_geom::{JointKind, Pose, Progress};

/// A door and a drawer in five states.
fn door_and_drawer() -> Scene {
    cupboard_open_by(&[0.0, 0.5, 1.2, 1.2, 0.9], &[0.0, 0.0, 0.1, 0.3, 0.45]).coarse()
}

#[test]
fn every_optional_pass_has_its_test() {
    let tests = [include_str!("passes_at_first_and_last.rs"), include_str!("passes_of_the_rounds.rs")].concat();
    for name in optional_names() {
        assert!(tests.contains(&format!("#[test]\nfn {name}()")), "no test of {name}");
        assert!(tests.contains(&format!("\"{name}\"]")), "no test without {name}");
    }
}

/// A drawer was found as if it hung on the other.
#[test]
fn shorten_chains() {
    let mut boxes = cupboard();
    boxes[1] = vec![
        cuboid([-0.35, -0.7, -0.2], [-0.3, -0.2, 0.3]),
        cuboid([-0.3, -0.65, -0.1], [0.2, -0.25, -0.05]),
        cuboid([-0.3, -0.65, -0.05], [0.2, -0.61, 0.2]),
        cuboid([-0.3, -0.29, -0.05], [0.2, -0.25, 0.2]),
        cuboid([-0.4, -0.5, 0.1], [-0.35, -0.4, 0.15]),
    ];
    let values = [[0.0, 0.25, 0.1, 0.4, 0.0], [0.0, 0.0, 0.15, 0.3, 0.45]];
    let slides = [1, 2].map(|k| slide(k, DVec3::NEG_X, &values[k - 1]));
    let scene = Scene::new(boxes, tree(slides.to_vec())).coarse();
    let mut chain = scene.tree.clone();
    chain.joints[1].parent = 1;
    chain.joints[1].values.iter_mut().zip(values[0]).for_each(|(v, up)| *v -= up);
    assert_tree(&settled(&scene, &chain, &[]), &scene, &COARSE);
    let without = settled(&scene, &chain, &["shorten_chains"]);
    assert!(without.joints.iter().any(|j| j.parent != 0), "{without:?}");
}

/// Noisy depth, and every state believes that it is a third of a voxel from where it is.
#[test]
fn align_states() {
    let mut scene = door_and_drawer();
    scene.noise = 0.003;
    let third = 0.3 * scene.voxel();
    let beside = |k: f64| Pose::from_trans(DVec3::new((2.3 * k).sin(), (1.7 * k).cos(), (3.1 * k).sin()) * third);
    scene.believed_from_world = (0..5).map(|state| beside(state as f64)).collect();
    let with = settled(&scene, &scene.tree, &[]);
    assert_tree(&with, &scene, &NOISY);
    let without = settled(&scene, &scene.tree, &["align_states"]);
    for joint in 0..2 {
        assert!(off(&without, &scene, joint).value > 5.0 * off(&with, &scene, joint).value);
    }
    assert!(off(&without, &scene, 0).pivot > 3.0 * off(&with, &scene, 0).pivot);
}

/// A value is beside the right one, farther than Gauss-Newton reaches. Mostly `ask_values` has
/// brought it back before.
#[test]
fn search_values() {
    let scene = door_and_drawer();
    let mut tree = scene.tree.clone();
    tree.joints[1].values[3] += 2.6 * scene.voxel();
    assert_tree(&settled(&scene, &tree, &["ask_values"]), &scene, &COARSE);
    let without = settled(&scene, &tree, &["ask_values", "search_values"]);
    assert!(off(&without, &scene, 1).value > scene.voxel());
}

/// Two drawers side by side, open nearly as far as each other: the front of one is a voxel or two
/// beside where the other's would be. A value that is off by so much is brought back, and right
/// ones stay.
#[test]
fn a_value_beside_the_right_one() {
    let scene = drawers_open_by(&[[0.0, 0.316, 0.384, 0.353, 0.211], [0.0, 0.018, 0.345, 0.384, 0.384]]);
    let evidence = scene.evidence();
    let found = discovery(&evidence, &scene.tree);
    let (evidence, settled, _) = settle(evidence, found, 0, &[], &Progress::default()).unwrap();
    assert_tree(&settled.tree, &scene, &USUAL);
    for voxels in [-2.6, -1.2, 0.0, 0.8, 1.7] {
        let mut off = settled.tree.clone();
        off.joints[1].values[2] += voxels * scene.voxel();
        values_beside(&evidence, &mut off, &settled.owners, 0);
        for (joint, right) in off.joints.iter().zip(&settled.tree.joints) {
            let far = joint.values.iter().zip(&right.values).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(far < 0.3 * scene.voxel(), "{voxels} voxels off: {:?} for {:?}", joint.values, right.values);
        }
    }
}

/// Everything is off by about a voxel.
#[test]
fn refine_joints() {
    let scene = door_and_drawer();
    let mut tree = scene.tree.clone();
    for (voxels, joint) in [0.6, 1.0].into_iter().zip(&mut tree.joints) {
        let off = [0.0, -1.0, 1.0, -1.0, 1.0].map(|sign| sign * voxels * scene.voxel());
        joint.values.iter_mut().zip(off).for_each(|(v, off)| *v += off);
    }
    tree.joints[0].screw.pivot += DVec3::new(0.6, -0.5, 0.0) * scene.voxel();
    assert_tree(&settled(&scene, &tree, &[]), &scene, &COARSE);
    let without = settled(&scene, &tree, &["refine_joints"]);
    let (hinge, slide) = (off(&without, &scene, 0), off(&without, &scene, 1));
    assert!(hinge.pivot > 3.0 * COARSE.pivot && hinge.value > 3.0 * COARSE.angle, "{hinge:?}");
    assert!(slide.value > 3.0 * COARSE.length, "{slide:?}");
}

/// In two states a shut drawer's front alone does not tell whether it rises on its way.
#[test]
fn align_axes() {
    let scene = cupboard_open_by(&[0.0, 1.3], &[0.0, 0.4]).coarse();
    let mut tree = scene.tree.clone();
    let axis = &mut tree.joints[1].screw.axis;
    *axis = DQuat::from_rotation_y(0.02) * *axis;
    assert_tree(&settled(&scene, &tree, &[]), &scene, &TWO_STATES);
    assert!(off(&settled(&scene, &tree, &["align_axes"]), &scene, 1).axis > 3.0 * TWO_STATES.axis);
}

/// Bars like the temples of glasses, whose hinges are a degree askew of their faces: five states show it.
#[test]
fn an_axis_that_is_askew_of_its_faces_stays() {
    let frame = vec![cuboid([-0.6, -0.62, -0.2], [-0.52, 0.62, 0.1])];
    let bar = |y: f64| vec![cuboid([-0.5, y - 0.04, -0.1], [0.6, y + 0.04, -0.02])];
    let values = [[0.0, 0.4, 0.9, 1.2, 0.6], [0.0, -0.5, -0.2, -1.1, -0.8]];
    let hinge = |k: usize, y: f64| {
        let axis = DQuat::from_rotation_y(if k == 1 { 0.017 } else { -0.017 }) * DVec3::Z;
        joint(0, k, JointKind::Revolute, axis, DVec3::new(-0.5, y, 0.0), &values[k - 1])
    };
    let scene = Scene::new(vec![frame, bar(-0.55), bar(0.55)], tree(vec![hinge(1, -0.55), hinge(2, 0.55)]));
    let found = settled(&scene, &scene.tree, &[]);
    for k in 0..2 {
        assert!(off(&found, &scene, k).axis < COARSE.axis, "{found:?}");
    }
}

/// The drawer's values are off by most of a voxel, to and fro: the one behind the door is that of a
/// state which is corrected later.
#[test]
fn hold_hidden() {
    let scene = drawer_behind_door().coarse();
    let mut tree = scene.tree.clone();
    for (k, value) in tree.joints[1].values.iter_mut().enumerate() {
        *value += if k % 2 == 0 { 0.7 } else { -0.7 } * scene.voxel();
    }
    let right = settled(&scene, &tree, &[]);
    assert_tree(&right, &scene, &HALF_HIDDEN);
    let (with, without) = (off(&right, &scene, 1), off(&settled(&scene, &tree, &["hold_hidden"]), &scene, 1));
    assert!(without.value > 10.0 * with.value);
}
