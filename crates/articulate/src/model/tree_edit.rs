//! Edits of a kinematic tree that keep its numbering.

use hingecast_geom::KinematicTree;
use std::f64::consts::TAU;

/// Moving parts that carry no other.
pub fn leaves(tree: &KinematicTree) -> impl Iterator<Item = usize> {
    (1..tree.parts.len()).filter(|p| tree.joints.iter().all(|j| j.parent != *p))
}

/// The tree without a part that carries no other, the others counted anew.
pub fn without(tree: &KinematicTree, part: usize) -> KinematicTree {
    let mut tree = tree.clone();
    tree.joints.retain(|j| j.child != part);
    for joint in &mut tree.joints {
        joint.child -= usize::from(joint.child > part);
        joint.parent -= usize::from(joint.parent > part);
        joint.name = format!("joint_{}", joint.child);
    }
    tree.parts.remove(part);
    for (k, name) in tree.parts.iter_mut().enumerate().skip(1) {
        *name = format!("part_{k}");
    }
    tree
}

/// Values count from the first state, mostly upwards; limits are what was seen. A hinge that is said to turn
/// more than once around is counted within half a turn of the first state: nothing tells whole turns.
pub fn count_from_first(tree: &mut KinematicTree) {
    for j in 0..tree.joints.len() {
        let (zero, screw) = (tree.joints[j].values[0], tree.joints[j].screw);
        if zero != 0.0 {
            // What hangs on it is moved along to where it is 0 now.
            let moved = screw.motion(zero);
            let hangs = |k: &usize| tree.ancestry(tree.joints[*k].parent).contains(&j);
            for k in (0..tree.joints.len()).filter(hangs).collect::<Vec<_>>() {
                tree.joints[k].screw = tree.joints[k].screw.transformed(&moved);
            }
        }
        let joint = &mut tree.joints[j];
        joint.values.iter_mut().for_each(|v| *v -= zero);
        let range = joint.seen()[1] - joint.seen()[0];
        if joint.screw.kind.turns() && range > TAU {
            joint.values.iter_mut().for_each(|v| *v -= TAU * (*v / TAU).round());
        }
        if joint.values.iter().sum::<f64>() < 0.0 {
            joint.screw.axis = -joint.screw.axis;
            joint.values.iter_mut().for_each(|v| *v = -*v);
        }
        joint.limits = joint.values.iter().fold([0.0f64; 2], |l, v| [l[0].min(*v), l[1].max(*v)]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// A shadow of a door once went from 0.6 to 651 rad, into the URDF's limits.
    #[test]
    fn no_hinge_turns_more_than_once_around() {
        let screw = Screw { kind: JointKind::Revolute, axis: DVec3::Z, pivot: DVec3::X };
        let values = vec![0.3, 651.0, -2.0];
        let joint = Joint { name: "j".into(), parent: 0, child: 1, screw, values, limits: [0.0; 2] };
        let mut tree = KinematicTree { parts: vec!["a".into(), "b".into()], joints: vec![joint], ..Default::default() };
        let before: Vec<_> = (0..3).map(|s| tree.poses_at(s)[1] * tree.poses_at(0)[1].inverse()).collect();
        count_from_first(&mut tree);
        let [lo, hi] = tree.joints[0].limits;
        assert!(hi - lo <= TAU && lo >= -PI && hi <= PI, "{lo} {hi}");
        for (s, was) in before.iter().enumerate() {
            let now = tree.poses_at(s)[1] * tree.poses_at(0)[1].inverse();
            assert!((now.apply(DVec3::Y) - was.apply(DVec3::Y)).length() < 1e-9);
        }
    }
    use glam::DVec3;
    use hingecast_geom::{Joint, JointKind, Screw};

    /// However values are counted, every part goes from state to state as before.
    #[test]
    fn counting_from_the_first_state_moves_nothing() {
        let joint = |parent: usize, axis: DVec3, values: [f64; 3]| Joint {
            name: "j".into(),
            parent,
            child: parent + 1,
            screw: Screw { kind: JointKind::Revolute, axis: axis.normalize(), pivot: DVec3::new(0.3, -0.1, 0.2) },
            values: values.to_vec(),
            limits: [0.0; 2],
        };
        let joints = vec![
            joint(0, DVec3::new(0.2, 0.1, 1.0), [0.4, 0.9, -0.3]),
            joint(1, DVec3::new(1.0, 0.3, -0.2), [-0.2, -0.4, -0.9]),
            joint(2, DVec3::new(0.0, 1.0, 0.2), [0.1, 0.5, 0.7]),
        ];
        let before =
            KinematicTree { parts: ["a", "b", "c", "d"].map(String::from).to_vec(), joints, ..Default::default() };
        let mut after = before.clone();
        count_from_first(&mut after);
        assert!(after.joints.iter().all(|j| j.values[0] == 0.0 && j.values.iter().sum::<f64>() > 0.0));
        let x = DVec3::new(0.7, -0.4, 0.9);
        for (state, part) in (1..3).flat_map(|s| (1..4).map(move |p| (s, p))) {
            let moved = |tree: &KinematicTree| (tree.poses_at(state)[part] * tree.poses_at(0)[part].inverse()).apply(x);
            assert!(moved(&before).distance(moved(&after)) < 1e-12, "state {state} part {part}");
        }
    }
}
