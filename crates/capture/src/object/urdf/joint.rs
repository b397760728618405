//! Joints of a URDF: kind, axis, limits, and which joint follows which.

use crate::CaptureError;
use crate::object::xml::{Reader, children};
use glam::{DMat3, DQuat, DVec3};
use hingecast_geom::{Coupling, JointKind, KinematicTree, Pose};
use roxmltree::Node;
use std::collections::BTreeMap;

pub(super) struct UrdfJoint {
    pub name: String,
    pub kind: JointKind,
    pub parent: String,
    pub child: String,
    pub parent_from_joint: Pose,
    pub axis: DVec3,
    pub limits: [f64; 2],
    /// The joint that leads this one, the multiplier and the offset: q = multiplier * leader +
    /// offset. After [`resolve_followers`] the leader follows nobody.
    pub follows: Option<(String, f64, f64)>,
}

impl Reader<'_> {
    /// `<origin xyz rpy>` of an element: rotation about fixed x, then y, then z.
    pub(super) fn origin(&self, node: Node) -> Result<Pose, CaptureError> {
        let Some(origin) = children(node, "origin").next() else { return Ok(Pose::IDENTITY) };
        let xyz = self.numbers::<3>(origin, "xyz")?.unwrap_or_default();
        let [r, p, y] = self.numbers::<3>(origin, "rpy")?.unwrap_or_default();
        let rot = DMat3::from_rotation_z(y) * DMat3::from_rotation_y(p) * DMat3::from_rotation_x(r);
        Ok(Pose::new(DQuat::from_mat3(&rot).normalize(), xyz.into()))
    }

    pub(super) fn joint(&self, node: Node) -> Result<UrdfJoint, CaptureError> {
        let end = |key: &'static str| {
            let hint = "give <parent link=.../> and <child link=.../>";
            let found = children(node, key).next().and_then(|n| n.attribute("link"));
            found.map(String::from).ok_or_else(|| self.at(node, format!("the joint's {key} is missing"), hint))
        };
        let kind = match self.text(node, "type")?.as_str() {
            "fixed" => JointKind::Fixed,
            "revolute" => JointKind::Revolute,
            "continuous" => JointKind::Continuous,
            "prismatic" => JointKind::Prismatic,
            other => {
                let hint = "use fixed, revolute, continuous or prismatic";
                return Err(self.at(node, format!("joints of type {other} are not supported"), hint));
            }
        };
        let axis = match children(node, "axis").next() {
            Some(a) => self.numbers::<3>(a, "xyz")?.map_or(DVec3::X, DVec3::from),
            None => DVec3::X,
        };
        let Some(axis) = axis.try_normalize() else {
            return Err(self.at(node, "the joint's axis is zero", "give a direction"));
        };
        Ok(UrdfJoint {
            name: self.text(node, "name")?,
            kind,
            parent: end("parent")?,
            child: end("child")?,
            parent_from_joint: self.origin(node)?,
            axis,
            limits: self.limits(node, kind)?,
            follows: self.follows(node)?,
        })
    }

    /// Radians or metres. The standard asks revolute and prismatic joints for `<limit>`; without it
    /// the joint would stay at 0.
    fn limits(&self, node: Node, kind: JointKind) -> Result<[f64; 2], CaptureError> {
        let limit = match (kind, children(node, "limit").next()) {
            (JointKind::Fixed, _) => return Ok([0.0, 0.0]),
            (JointKind::Continuous, _) => return Ok([-std::f64::consts::PI, std::f64::consts::PI]),
            (_, Some(limit)) => limit,
            (JointKind::Prismatic, None) => {
                let hint = "add for instance <limit lower=\"0\" upper=\"0.3\" effort=\"10\" velocity=\"1\"/>";
                return Err(self.at(node, "the prismatic joint has no <limit>", hint));
            }
            (_, None) => {
                let hint = "add <limit lower=.. upper=.. effort=.. velocity=../> (radians), or make it continuous";
                return Err(self.at(node, "the revolute joint has no <limit>", hint));
            }
        };
        let value = |key| Ok::<_, CaptureError>(self.numbers::<1>(limit, key)?.map_or(0.0, |v| v[0]));
        let limits = [value("lower")?, value("upper")?];
        if limits[0] > limits[1] {
            return Err(self.at(node, format!("the joint's limits {limits:?} are reversed"), "lower comes first"));
        }
        Ok(limits)
    }

    /// `<mimic joint multiplier offset>`.
    fn follows(&self, node: Node) -> Result<Option<(String, f64, f64)>, CaptureError> {
        let Some(mimic) = children(node, "mimic").next() else { return Ok(None) };
        let value = |key, usual| Ok::<_, CaptureError>(self.numbers::<1>(mimic, key)?.map_or(usual, |v| v[0]));
        Ok(Some((self.text(mimic, "joint")?, value("multiplier", 1.0)?, value("offset", 0.0)?)))
    }

    /// Chains of followers become followers of the one that leads: q = m (m2 x + o2) + o.
    pub(super) fn resolve_followers(&self, joints: &mut [UrdfJoint]) -> Result<(), CaptureError> {
        let named: BTreeMap<String, Option<(String, f64, f64)>> =
            joints.iter().map(|j| (j.name.clone(), j.follows.clone())).collect();
        for joint in joints {
            let Some((mut leader, mut m, mut o)) = joint.follows.clone() else { continue };
            for _ in 0..=named.len() {
                let hint = "name in <mimic> a joint that moves by itself";
                let next = named.get(&leader).ok_or_else(|| {
                    self.error(format!("joint {} follows the joint {leader}, which is not there", joint.name), hint)
                })?;
                match next {
                    Some((before, m2, o2)) => (leader, m, o) = (before.clone(), m * m2, m * o2 + o),
                    None => {
                        joint.follows = Some((leader.clone(), m, o));
                        break;
                    }
                }
            }
            if named[&leader].is_some() {
                let hint = "let one of them move by itself: take away its <mimic>";
                return Err(self.error(format!("joint {} follows itself in a circle", joint.name), hint));
            }
        }
        Ok(())
    }
}

/// What of a joint is not as one would expect, as a sentence.
pub(super) fn note(joint: &UrdfJoint) -> Option<String> {
    let still = matches!(joint.kind, JointKind::Revolute | JointKind::Prismatic) && joint.limits[0] == joint.limits[1];
    still.then(|| format!("joint '{}' does not move: its limits are {1} .. {1}", joint.name, joint.limits[0]))
}

/// Hands followers on to the tree; sentences of those whose leader does not move.
pub(super) fn couple(joints: &[UrdfJoint], tree: &mut KinematicTree) -> Vec<String> {
    let mut notes = Vec::new();
    let id = |tree: &KinematicTree, name: &str| tree.joints.iter().position(|j| j.name == name);
    for joint in joints {
        let (Some((leader, multiplier, offset)), Some(follower)) = (&joint.follows, id(tree, &joint.name)) else {
            continue;
        };
        match id(tree, leader) {
            Some(leader) => {
                let polynomial = [*offset, *multiplier, 0.0, 0.0, 0.0];
                tree.couplings.push(Coupling { follower, leader, polynomial });
            }
            // As yourdfpy: a leader that does not move stands at 0.
            None => {
                tree.joints[follower].limits = [*offset; 2];
                notes.push(format!("joint '{}' stays at {offset}: it follows '{leader}', which is fixed", joint.name));
            }
        }
    }
    notes
}
