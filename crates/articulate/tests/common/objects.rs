//! Furniture of boxes, and joints.

use super::scene::{Boxes, Scene, cuboid};
use glam::DVec3;
use hingecast_geom::{Joint, JointKind, KinematicTree, Screw};

pub fn joint(parent: usize, child: usize, kind: JointKind, axis: DVec3, pivot: DVec3, values: &[f64]) -> Joint {
    let screw = Screw { kind, axis, pivot };
    Joint { name: format!("j{child}"), parent, child, screw, values: values.to_vec(), limits: [0.0, 1.0] }
}

/// A slide of a child of the base.
pub fn slide(child: usize, axis: DVec3, values: &[f64]) -> Joint {
    joint(0, child, JointKind::Prismatic, axis, DVec3::ZERO, values)
}

pub fn tree(joints: Vec<Joint>) -> KinematicTree {
    KinematicTree { parts: (0..=joints.len()).map(|i| format!("p{i}")).collect(), joints, ..Default::default() }
}

/// A case from x = `front` to 0.5, open in front; y from -`half` to `half`, z from -0.3 to 0.4.
pub fn case(front: f64, half: f64) -> Boxes {
    let (outer, inner) = (half, half - 0.04);
    vec![
        cuboid([front, -outer, -0.3], [0.5, outer, -0.26]),
        cuboid([front, -outer, 0.36], [0.5, outer, 0.4]),
        cuboid([front, -outer, -0.26], [0.5, -inner, 0.36]),
        cuboid([front, inner, -0.26], [0.5, outer, 0.36]),
        cuboid([0.46, -inner, -0.26], [0.5, inner, 0.36]),
    ]
}

/// A case with a door (with a handle) on the left and a drawer on the right.
pub fn cupboard() -> Vec<Boxes> {
    let mut carcass = case(-0.3, 0.7);
    carcass.push(cuboid([-0.3, -0.02, -0.26], [0.46, 0.02, 0.36]));
    carcass.push(cuboid([-0.35, 0.01, 0.16], [-0.3, 0.7, 0.4]));
    vec![
        carcass,
        vec![cuboid([-0.35, -0.7, -0.3], [-0.3, -0.01, 0.4]), cuboid([-0.42, -0.12, 0.0], [-0.35, -0.08, 0.15])],
        vec![
            cuboid([-0.35, 0.01, -0.3], [-0.3, 0.7, 0.15]),
            cuboid([-0.3, 0.05, -0.25], [0.3, 0.63, -0.2]),
            cuboid([-0.3, 0.05, -0.2], [0.3, 0.09, 0.1]),
            cuboid([-0.3, 0.59, -0.2], [0.3, 0.63, 0.1]),
        ],
    ]
}

/// The cupboard, its door and drawer open by so much.
pub fn cupboard_open_by(door: &[f64], drawer: &[f64]) -> Scene {
    let hinge = joint(0, 1, JointKind::Revolute, DVec3::Z, DVec3::new(-0.35, -0.7, 0.0), door);
    Scene::new(cupboard(), tree(vec![hinge, slide(2, DVec3::NEG_X, drawer)]))
}

/// A case with two equal drawers side by side.
pub fn two_drawers() -> Vec<Boxes> {
    let mut boxes = vec![case(-0.3, 0.8)];
    boxes[0].push(cuboid([-0.3, -0.02, -0.26], [0.46, 0.02, 0.36]));
    boxes[0].push(cuboid([-0.3, -0.76, 0.02], [0.46, 0.76, 0.06]));
    for left in [-0.76, 0.02] {
        boxes.push(vec![
            cuboid([-0.34, left + 0.01, 0.07], [-0.3, left + 0.73, 0.35]),
            cuboid([-0.3, left + 0.03, 0.08], [0.3, left + 0.71, 0.1]),
            cuboid([-0.3, left + 0.03, 0.1], [0.3, left + 0.05, 0.3]),
            cuboid([-0.3, left + 0.69, 0.1], [0.3, left + 0.71, 0.3]),
            cuboid([0.28, left + 0.05, 0.1], [0.3, left + 0.69, 0.3]),
        ]);
    }
    boxes
}

/// Two drawers, open by so much.
pub fn drawers_open_by(values: &[[f64; 5]; 2]) -> Scene {
    Scene::new(two_drawers(), tree((1..3).map(|k| slide(k, DVec3::NEG_X, &values[k - 1])).collect()))
}

/// A door, and a drawer that comes out once the door is open.
pub fn drawer_behind_door() -> Scene {
    let boxes = vec![
        case(-0.2, 0.4),
        vec![cuboid([-0.26, -0.4, -0.3], [-0.21, 0.3, 0.4]), cuboid([-0.33, 0.18, 0.0], [-0.26, 0.22, 0.15])],
        vec![
            cuboid([-0.14, -0.3, -0.2], [-0.1, 0.3, 0.1]),
            cuboid([-0.1, -0.3, -0.2], [0.4, 0.3, -0.16]),
            cuboid([-0.1, -0.3, -0.16], [0.4, -0.26, 0.05]),
            cuboid([-0.1, 0.26, -0.16], [0.4, 0.3, 0.05]),
        ],
    ];
    let open = [0.0, 0.4, 0.8, 1.2, 1.6, 1.6, 1.6, 1.6];
    let out = [0.0, 0.0, 0.0, 0.0, 0.0, 0.15, 0.3, 0.45];
    let door = joint(0, 1, JointKind::Revolute, DVec3::Z, DVec3::new(-0.26, -0.4, 0.0), &open);
    Scene::new(boxes, tree(vec![door, slide(2, DVec3::NEG_X, &out)]))
}

/// A stool with a lever that rises with the seat but does not turn with it.
pub fn swivel_seat() -> Scene {
    let boxes = vec![
        vec![cuboid([-0.4, -0.3, -0.3], [0.4, 0.3, -0.24]), cuboid([-0.06, -0.06, -0.24], [0.06, 0.06, 0.0])],
        vec![cuboid([-0.04, -0.04, -0.2], [0.04, 0.04, 0.2]), cuboid([0.04, -0.05, 0.08], [0.35, 0.05, 0.16])],
        vec![cuboid([-0.3, -0.2, 0.25], [0.3, 0.2, 0.33]), cuboid([-0.3, 0.2, 0.25], [0.3, 0.26, 0.7])],
    ];
    let turn = joint(1, 2, JointKind::Revolute, DVec3::Z, DVec3::ZERO, &[0.0, 0.6, 1.2, 1.7, 1.1]);
    Scene::new(boxes, tree(vec![slide(1, DVec3::Z, &[0.0, 0.0, 0.05, 0.12, 0.2]), turn]))
}
