//! The unknowns of a tree: axes, pivots and values, one after the other in a vector.

use crate::model::twist::square;
use glam::DMat3;
use hingecast_geom::pose::quat_from_rotation_vector;
use hingecast_geom::{JointKind, KinematicTree};
use nalgebra::DVector;

/// Where a joint's parameters stand in the unknowns: axis 2, pivot 2 (hinges), values from state 1
/// on.
#[derive(Clone, Copy)]
pub struct Slot {
    /// First unknown of the shape: two tilts, and for hinges two shifts.
    pub shape: usize,
    /// Unknowns of the shape: 4 of a hinge, 2 of a slide.
    pub n_shape: usize,
    /// Unknown of the value in state 1; those of later states follow.
    pub values: usize,
}

/// Slots of the joints that are free, and the number of unknowns.
pub fn slots(tree: &KinematicTree, free: &[bool], n_states: usize) -> (Vec<Option<Slot>>, usize) {
    let mut size = 0;
    let mut slot = |n_shape: usize| {
        let slot = Slot { shape: size, n_shape, values: size + n_shape };
        size += n_shape + n_states - 1;
        slot
    };
    let joints = tree.joints.iter().zip(free);
    let slots = joints.map(|(joint, free)| {
        (*free && joint.screw.kind != JointKind::Fixed).then(|| slot(if joint.screw.kind.turns() { 4 } else { 2 }))
    });
    (slots.collect(), size)
}

/// Longest tilt of an axis and turn of a hinge in one step, radians: beyond, the linearisation knows
/// nothing.
pub const LONGEST_TURN: f64 = 0.2;

/// Adds a step to the unknowns. `longest`: how far a slide may go in one step, scene units.
pub fn update(tree: &mut KinematicTree, slots: &[Option<Slot>], step: &DVector<f64>, longest: f64) {
    for (joint, slot) in tree.joints.iter_mut().zip(slots) {
        let Some(slot) = slot else { continue };
        let [b1, b2] = square(joint.screw.axis);
        let at = |k: usize| step[slot.shape + k];
        let tilt = (b1 * at(0) + b2 * at(1)).clamp_length_max(LONGEST_TURN);
        if slot.n_shape == 4 {
            joint.screw.pivot += b1 * at(2) + b2 * at(3);
        }
        joint.screw.axis = (DMat3::from_quat(quat_from_rotation_vector(tilt)) * joint.screw.axis).normalize();
        let most = if slot.n_shape == 4 { LONGEST_TURN } else { longest };
        for (s, q) in joint.values.iter_mut().enumerate().skip(1) {
            *q += step[slot.values + s - 1].clamp(-most, most);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::twist::twists;
    use glam::DVec3;
    use hingecast_geom::{Joint, Screw};

    /// A slide on a hinge.
    fn chain_tree() -> KinematicTree {
        let joint = |parent, kind, axis: DVec3, pivot, values: [f64; 2]| Joint {
            name: "j".into(),
            parent,
            child: parent + 1,
            screw: Screw { kind, axis: axis.normalize(), pivot },
            values: values.to_vec(),
            limits: [0.0, 1.0],
        };
        KinematicTree {
            parts: vec!["a".into(), "b".into(), "c".into()],
            joints: vec![
                joint(0, JointKind::Revolute, DVec3::new(0.2, 0.1, 1.0), DVec3::new(0.3, -0.1, 0.2), [0.2, 0.9]),
                joint(1, JointKind::Prismatic, DVec3::new(1.0, 0.3, -0.2), DVec3::new(0.1, 0.5, 0.0), [0.1, 0.4]),
            ],
            ..Default::default()
        }
    }

    /// The twists against central differences of where a carried point ends, for every parameter of
    /// both joints.
    #[test]
    fn twists_are_the_derivatives_of_the_motion() {
        let tree = chain_tree();
        let x = DVec3::new(0.7, -0.4, 0.9);
        let carried = |tree: &KinematicTree| (tree.poses_at(1)[2] * tree.poses_at(0)[2].inverse()).apply(x);
        let poses = [tree.poses_at(0), tree.poses_at(1)];
        let m = poses[1][2] * poses[0][2].inverse();
        let h = 1e-6;
        for j in 0..2 {
            let (there, here) = (twists(&tree, j, 0, &poses[0]), twists(&tree, j, 1, &poses[1]));
            let n_shape = if j == 0 { 4 } else { 2 };
            for k in 0..n_shape + 2 {
                let moved = |step: f64| {
                    let mut tree = tree.clone();
                    let size = n_shape + 1;
                    let slot = Slot { shape: 0, n_shape, values: n_shape };
                    let mut by = DVector::zeros(size + 1);
                    // The last two parameters: the value at state 1, and (by hand) that at state 0.
                    if k < size {
                        by[k] = step;
                    } else {
                        tree.joints[j].values[0] += step;
                    }
                    let slots: Vec<Option<Slot>> = (0..2).map(|i| (i == j).then_some(slot)).collect();
                    update(&mut tree, &slots, &by, 1.0);
                    carried(&tree)
                };
                let numeric = (moved(h) - moved(-h)) / (2.0 * h);
                let index = if k < n_shape { k } else { 4 };
                let analytic = if k < n_shape {
                    here[index].at(m.apply(x)) - m.rotate(there[index].at(x))
                } else if k == n_shape {
                    here[4].at(m.apply(x))
                } else {
                    -m.rotate(there[4].at(x))
                };
                assert!((numeric - analytic).length() < 1e-7, "joint {j} parameter {k}: {numeric} {analytic}");
            }
        }
    }
}
