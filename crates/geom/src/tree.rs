//! Screws and kinematic trees: which part moves relative to which, how, and where it was in each
//! state.

use crate::Pose;
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

/// The kinds of joint a twin may have. `Continuous` is revolute without limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum JointKind {
    /// Does not move: the child is welded to its parent.
    Fixed,
    /// Turns about the axis within limits; the value is in radians.
    Revolute,
    /// Turns about the axis without limits; the value is in radians.
    Continuous,
    /// Slides along the axis; the value is in metres or scene units.
    Prismatic,
}

impl JointKind {
    /// True for joints whose value is an angle.
    pub fn turns(self) -> bool {
        matches!(self, JointKind::Revolute | JointKind::Continuous)
    }
}

/// One degree of freedom: a line in space and how to move about or along it.
/// `axis` is unit length; `pivot` is a point on the axis (ignored by prismatic joints).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Screw {
    /// How the child moves.
    pub kind: JointKind,
    /// Direction of the axis, unit length; positive values turn right-handed about it or slide
    /// along it.
    pub axis: DVec3,
    /// A point on the axis, scene units.
    pub pivot: DVec3,
}

impl Screw {
    /// The motion by `q` (radians or metres): revolute x' = R(axis, q)(x - pivot) + pivot,
    /// prismatic x' = x + q axis.
    pub fn motion(&self, q: f64) -> Pose {
        match self.kind {
            JointKind::Fixed => Pose::IDENTITY,
            JointKind::Prismatic => Pose::from_trans(self.axis * q),
            JointKind::Revolute | JointKind::Continuous => {
                let rot = DQuat::from_axis_angle(self.axis, q);
                Pose::new(rot, self.pivot - rot * self.pivot)
            }
        }
    }

    /// The same screw after `b_from_a` moved the frame (or the parent) it lives in.
    pub fn transformed(&self, b_from_a: &Pose) -> Self {
        Self { kind: self.kind, axis: b_from_a.rotate(self.axis), pivot: b_from_a.apply(self.pivot) }
    }

    /// Distance of `x` from the axis line.
    pub fn distance(&self, x: DVec3) -> f64 {
        (x - self.pivot).cross(self.axis).length()
    }

    /// Foot of the perpendicular from `x` to the axis line.
    pub fn foot(&self, x: DVec3) -> DVec3 {
        self.pivot + self.axis * (x - self.pivot).dot(self.axis)
    }
}

/// The joint that carries part `child` on part `parent`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Joint {
    /// Name, as the simulator files have it.
    pub name: String,
    /// Part id that carries.
    pub parent: usize,
    /// Part id that is carried.
    pub child: usize,
    /// In the world frame, with every joint of the tree at 0 (the canonical configuration).
    pub screw: Screw,
    /// Joint value per state of the recording, radians or metres; index = state.
    pub values: Vec<f64>,
    /// Lowest and highest value (of the true object) or of the recording (of a twin).
    pub limits: [f64; 2],
}

impl Joint {
    /// Lowest and highest value of the recording, the first state's 0 included: what [`Self::limits`]
    /// are until a person says otherwise.
    pub fn seen(&self) -> [f64; 2] {
        self.values.iter().fold([0.0; 2], |[lo, hi], v| [lo.min(*v), hi.max(*v)])
    }
}

/// How sure the depth makes one of a joint: standard deviations, and what else it might be.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Certainty {
    /// Of the axis' direction, degrees.
    pub axis_deg: f64,
    /// Scene units; 0 for a slide.
    pub pivot: f64,
    /// Of a state's value, mean over the states; radians or scene units.
    pub value: f64,
    /// The other type that was tried.
    pub rival: JointKind,
    /// How much worse the rival explains the recording, nats; below 10 it is not refuted.
    pub nats: f64,
}

/// One joint's value is a function of another's: URDF's `<mimic>`, MJCF's `<equality><joint>`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Coupling {
    /// Joint id of the one that follows; of each joint at most one.
    pub follower: usize,
    /// Joint id of the one that it follows.
    pub leader: usize,
    /// Follower's value = sum of `polynomial[k] * leader^k`, radians or scene units.
    pub polynomial: [f64; 5],
}

impl Coupling {
    /// The follower's value when the leader stands at `q` (Horner).
    pub fn value(&self, q: f64) -> f64 {
        self.polynomial.iter().rev().fold(0.0, |sum, c| sum * q + c)
    }

    /// Offset and multiplier, where the function is a line (all that URDF can say).
    pub fn line(&self) -> Option<[f64; 2]> {
        let [offset, multiplier, higher @ ..] = self.polynomial;
        (higher == [0.0; 3]).then_some([offset, multiplier])
    }
}

/// Parts and joints. Each part but the roots is the child of exactly one joint.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct KinematicTree {
    /// Part names; index = part id.
    pub parts: Vec<String>,
    /// In any order; index = joint id.
    pub joints: Vec<Joint>,
    /// Which joints follow others. [`Self::poses`] takes the values it is given:
    /// [`Self::follow`] makes them consistent.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub couplings: Vec<Coupling>,
}

impl KinematicTree {
    /// The joint whose child is `part`; `None` for a root.
    pub fn joint_of(&self, part: usize) -> Option<&Joint> {
        self.joints.iter().find(|j| j.child == part)
    }

    /// The joints (as indices) between `part` and its root, its own first. A cyclic (invalid) tree
    /// ends too.
    pub fn ancestry(&self, part: usize) -> Vec<usize> {
        let up = |part: usize| self.joints.iter().position(|j| j.child == part);
        std::iter::successors(up(part), |&j| up(self.joints[j].parent)).take(self.parts.len()).collect()
    }

    /// `world_from_canonical` of every part when joint `j` stands at `q[j]`: pose = parent's pose *
    /// screw motion.
    ///
    /// # Panics
    /// When `q` is shorter than the joints.
    pub fn poses(&self, q: &[f64]) -> Vec<Pose> {
        (0..self.parts.len()).map(|part| self.pose(part, q)).collect()
    }

    fn pose(&self, part: usize, q: &[f64]) -> Pose {
        let carried = |pose: Pose, j: usize| self.joints[j].screw.motion(q[j]) * pose;
        self.ancestry(part).into_iter().fold(Pose::IDENTITY, carried)
    }

    /// The joint values of recording state `state`, one a joint.
    ///
    /// # Panics
    /// When a joint has no value of that state.
    pub fn values_at(&self, state: usize) -> Vec<f64> {
        self.joints.iter().map(|j| j.values[state]).collect()
    }

    /// `world_from_canonical` of every part in recording state `state`.
    ///
    /// # Panics
    /// When a joint has no value of that state.
    pub fn poses_at(&self, state: usize) -> Vec<Pose> {
        self.poses(&self.values_at(state))
    }

    /// Sets the values of the joints that follow others; those of the others stay.
    ///
    /// # Panics
    /// When `q` is shorter than the joints.
    pub fn follow(&self, q: &mut [f64]) {
        // Chains are as long as there are couplings, at most.
        for _ in 0..self.couplings.len() {
            self.couplings.iter().for_each(|c| q[c.follower] = c.value(q[c.leader]));
        }
    }

    /// The coupling by which joint `j` follows another.
    pub fn coupling_of(&self, j: usize) -> Option<&Coupling> {
        self.couplings.iter().find(|c| c.follower == j)
    }

    /// Checks the invariants; the message names the offending joint.
    ///
    /// # Errors
    /// A joint names a part that is not there, a part is the child of two joints or hangs on
    /// itself, an axis is not of unit length, or a number is not finite.
    pub fn validate(&self) -> Result<(), String> {
        let n = self.parts.len();
        let mut child_of = vec![None; n];
        for j in &self.joints {
            if j.parent >= n || j.child >= n || j.parent == j.child {
                return Err(format!("joint '{}' connects parts {} and {} of {n}", j.name, j.parent, j.child));
            }
            if child_of[j.child].replace(j.parent).is_some() {
                return Err(format!("part '{}' is the child of two joints", self.parts[j.child]));
            }
            if (j.screw.axis.length() - 1.0).abs() >= 1e-6 && j.screw.kind != JointKind::Fixed {
                return Err(format!("joint '{}' has an axis of length {}", j.name, j.screw.axis.length()));
            }
            if !(j.screw.axis.is_finite() && j.screw.pivot.is_finite() && j.values.iter().all(|v| v.is_finite())) {
                return Err(format!("joint '{}' has a number that is not finite", j.name));
            }
        }
        for start in 0..n {
            let (mut at, mut steps) = (start, 0);
            while let Some(p) = child_of[at] {
                (at, steps) = (p, steps + 1);
                if steps > n {
                    return Err(format!("part '{}' hangs on itself", self.parts[start]));
                }
            }
        }
        self.validate_couplings()
    }

    fn validate_couplings(&self) -> Result<(), String> {
        let n = self.joints.len();
        for (i, c) in self.couplings.iter().enumerate() {
            if c.follower >= n || c.leader >= n || !c.polynomial.iter().all(|x| x.is_finite()) {
                return Err(format!("joint {} cannot follow joint {} of {n}", c.follower, c.leader));
            }
            if self.couplings[..i].iter().any(|other| other.follower == c.follower) {
                return Err(format!("joint '{}' follows two joints", self.joints[c.follower].name));
            }
            let up = |j: &usize| self.coupling_of(*j).map(|c| c.leader);
            if std::iter::successors(Some(c.leader), up).take(n + 1).any(|j| j == c.follower) {
                return Err(format!("joint '{}' follows itself", self.joints[c.follower].name));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    fn hinge(parent: usize, child: usize, pivot: DVec3) -> Joint {
        let screw = Screw { kind: JointKind::Revolute, axis: DVec3::Z, pivot };
        Joint { name: format!("j{child}"), parent, child, screw, values: vec![], limits: [0.0, 1.0] }
    }

    #[test]
    fn a_chain_of_two_hinges_moves_like_an_arm() {
        let tree = KinematicTree {
            parts: ["base", "upper", "fore"].map(String::from).to_vec(),
            joints: vec![hinge(0, 1, DVec3::ZERO), hinge(1, 2, DVec3::X)],
            ..Default::default()
        };
        tree.validate().unwrap();
        // Elbow bent back by 90 deg on a shoulder turned by 90 deg: the hand at (2,0,0) ends at
        // (1,1,0).
        let hand = tree.poses(&[FRAC_PI_2, -FRAC_PI_2])[2].apply(DVec3::X * 2.0);
        assert!((hand - DVec3::new(1.0, 1.0, 0.0)).length() < 1e-12);
    }

    #[test]
    fn cycles_and_double_parents_are_refused() {
        let parts = ["a", "b", "c"].map(String::from).to_vec();
        let cycle = vec![hinge(1, 2, DVec3::ZERO), hinge(2, 1, DVec3::ZERO)];
        assert!(KinematicTree { parts: parts.clone(), joints: cycle, ..Default::default() }.validate().is_err());
        let twice = vec![hinge(0, 2, DVec3::ZERO), hinge(1, 2, DVec3::ZERO)];
        assert!(KinematicTree { parts, joints: twice, ..Default::default() }.validate().is_err());
    }

    #[test]
    fn followers_follow_along_chains_and_never_themselves() {
        let joints = vec![hinge(0, 1, DVec3::ZERO), hinge(0, 2, DVec3::X), hinge(0, 3, DVec3::Y)];
        let coupling = |follower, leader, polynomial| Coupling { follower, leader, polynomial };
        let mut tree = KinematicTree {
            parts: ["a", "b", "c", "d"].map(String::from).to_vec(),
            joints,
            // The chain's end comes first.
            couplings: vec![coupling(0, 1, [0.1, -1.0, 0.0, 0.0, 0.0]), coupling(1, 2, [0.0, 0.0, 2.0, 0.0, 0.0])],
        };
        tree.validate().unwrap();
        let mut q = [9.0, 9.0, 0.5];
        tree.follow(&mut q);
        assert_eq!(q, [0.1 - 0.5, 0.5, 0.5]);
        assert_eq!((tree.couplings[0].line(), tree.couplings[1].line()), (Some([0.1, -1.0]), None));
        tree.couplings.push(coupling(2, 0, [0.0; 5]));
        assert!(tree.validate().unwrap_err().contains("follows itself"));
        tree.couplings[2] = coupling(1, 0, [0.0; 5]);
        assert!(tree.validate().unwrap_err().contains("follows two"));
        tree.couplings[2] = coupling(7, 0, [0.0; 5]);
        assert!(tree.validate().is_err());
    }
}
