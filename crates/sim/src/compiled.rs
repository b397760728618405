//! The model that MuJoCo compiles, as an [`ArticulatedObject`]: whatever MJCF may say (includes,
//! frames, defaults, reference poses, inline meshes ...), MuJoCo has understood it by then.
//!
//! Values of joints are MuJoCo's `qpos`; the canonical configuration is every hinge and slide at 0.
//! Seen is what MuJoCo's viewer shows: geoms of groups 0 to 2 that are not transparent. What is
//! left out is said in the object's notes; what a tree of hinges and slides cannot say is refused.

pub(crate) mod couplings;
mod geometry;

use crate::object::{body_pose, name_or};
use crate::{SimError, log};
use glam::DVec3;
use hingecast_capture::object::{ArticulatedObject, PartGeometry};
use hingecast_geom::{Joint, JointKind, Screw};
use mujoco_rs::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Loads an MJCF file as MuJoCo does.
///
/// # Errors
/// When MuJoCo refuses the file; when it holds what a tree of hinges and slides cannot say (ball
/// joints, several joints of one body, loops, cloth, height fields); when nothing of it is seen.
pub fn load(file: &Path) -> Result<ArticulatedObject, SimError> {
    let (model, said) = log::collect(|| {
        let mut spec = MjSpec::from_xml(file).map_err(|e| SimError::load(file, e))?;
        let name = spec.modelname().to_string();
        Ok::<_, SimError>((spec.compile().map_err(|e| SimError::load(file, e))?, name))
    });
    let (model, name) = model?;
    let reader = Reader { file, model: &model };
    let mut object = reader.object(&name)?;
    object.notes.extend(said.into_iter().map(|line| format!("MuJoCo: {line}")));
    Ok(object)
}

struct Reader<'a> {
    file: &'a Path,
    model: &'a MjModel,
}

/// What MuJoCo calls a model without a name.
const NAMELESS: &str = "MuJoCo Model";

impl Reader<'_> {
    fn refuse(&self, what: impl Into<String>, hint: &str) -> SimError {
        SimError::task(what, self.file.display().to_string(), hint)
    }

    fn name(&self, kind: MjtObjBase, id: usize) -> String {
        let word = match kind {
            MjtObjBase::mjOBJ_BODY => "body",
            MjtObjBase::mjOBJ_JOINT => "joint",
            _ => "geom",
        };
        name_or(self.model, kind, id, word)
    }

    fn object(&self, name: &str) -> Result<ArticulatedObject, SimError> {
        let model = self.model;
        let mut data = MjData::new(model);
        let joints: Vec<usize> = (0..model.ffi().njnt as usize).collect();
        for &j in joints.iter().filter(|&&j| moves(model, j)) {
            data.qpos_mut()[model.jnt_qposadr()[j] as usize] = 0.0;
        }
        data.kinematics();

        let mut object = ArticulatedObject {
            name: if name == NAMELESS { "object".into() } else { name.to_string() },
            source: self.file.to_path_buf(),
            metric: true,
            parts: vec![PartGeometry { links: vec!["world".into()], ..Default::default() }],
            ..Default::default()
        };
        // Parents come before their children.
        let mut part_of = vec![0; model.ffi().nbody as usize];
        // MuJoCo's joint id -> that of the tree.
        let mut ids = BTreeMap::new();
        for body in 1..part_of.len() {
            let own: Vec<usize> = joints.iter().copied().filter(|&j| model.jnt_bodyid()[j] as usize == body).collect();
            let parent = part_of[model.body_parentid()[body] as usize];
            let name = self.name(MjtObjBase::mjOBJ_BODY, body);
            part_of[body] = match self.only_joint(&own, &mut object.notes)? {
                None => {
                    object.parts[parent].links.push(name);
                    parent
                }
                Some(id) => {
                    object.parts.push(PartGeometry { links: vec![name], ..Default::default() });
                    let child = object.parts.len() - 1;
                    let pose = body_pose(&data, body);
                    let screw = Screw {
                        kind: self.kind(id),
                        axis: pose.rotate(DVec3::from(model.jnt_axis()[id])).normalize(),
                        pivot: pose.apply(DVec3::from(model.jnt_pos()[id])),
                    };
                    ids.insert(id, object.tree.joints.len());
                    let limits = self.limits(id)?;
                    let name = self.joint_name(id, body);
                    object.tree.joints.push(Joint { name, parent, child, screw, values: Vec::new(), limits });
                    child
                }
            };
        }
        let seen = self.geometry(&data, &part_of, &mut object)?;
        self.couplings(&ids, &part_of, &mut object)?;
        let hint = "correct the bodies and joints";
        let mut object =
            object.finished(&BTreeMap::new(), |link| seen.contains(link)).map_err(|e| self.refuse(e, hint))?;
        self.bound_free_slides(&mut object);
        Ok(object)
    }

    /// The hinge or slide of a body; free joints stay where they are.
    fn only_joint(&self, own: &[usize], notes: &mut Vec<String>) -> Result<Option<usize>, SimError> {
        let type_of = |j: usize| self.model.jnt_type()[j];
        let named = |j: usize| self.name(MjtObjBase::mjOBJ_JOINT, j);
        if let Some(&ball) = own.iter().find(|&&j| type_of(j) == MjtJoint::mjJNT_BALL) {
            return Err(self.refuse(format!("'{}' is a ball joint", named(ball)), "use hinges and slides"));
        }
        match own.iter().filter(|&&j| moves(self.model, j)).collect::<Vec<_>>()[..] {
            [] => {
                let free = |j: &usize| format!("'{}' is free: its body stays where it is modelled", named(*j));
                notes.extend(own.iter().map(free));
                Ok(None)
            }
            [&one] => Ok(Some(one)),
            [_, second, ..] => {
                let what = format!("'{}' is the second joint of its body", named(*second));
                Err(self.refuse(what, "put each joint into a body of its own, with something to see in it"))
            }
        }
    }

    fn joint_name(&self, id: usize, body: usize) -> String {
        let own = self.model.id_to_name(MjtObjBase::mjOBJ_JOINT, id).filter(|n| !n.is_empty());
        own.map_or_else(|| format!("{}_joint", self.name(MjtObjBase::mjOBJ_BODY, body)), String::from)
    }

    fn kind(&self, id: usize) -> JointKind {
        match (self.model.jnt_type()[id], self.model.jnt_limited()[id]) {
            (MjtJoint::mjJNT_SLIDE, _) => JointKind::Prismatic,
            (_, true) => JointKind::Revolute,
            (_, false) => JointKind::Continuous,
        }
    }

    fn limits(&self, id: usize) -> Result<[f64; 2], SimError> {
        if !self.model.jnt_limited()[id] {
            let pi = std::f64::consts::PI;
            return Ok(if self.kind(id) == JointKind::Prismatic { [f64::NAN; 2] } else { [-pi, pi] });
        }
        let [lower, upper] = self.model.jnt_range()[id];
        if lower.is_finite() && upper.is_finite() && lower <= upper {
            return Ok([lower, upper]);
        }
        let what = format!("the range {lower} .. {upper} of {} is none", self.name(MjtObjBase::mjOBJ_JOINT, id));
        Err(self.refuse(what, "the lower end comes first"))
    }

    /// A slide without a range gets one: as far as the object is large, either way.
    fn bound_free_slides(&self, object: &mut ArticulatedObject) {
        let diagonal = object.diagonal();
        for joint in object.tree.joints.iter_mut().filter(|j| j.limits[0].is_nan()) {
            joint.limits = [-diagonal, diagonal];
            object.notes.push(format!(
                "joint '{}' has no range: -{diagonal:.3} .. {diagonal:.3}, the object's size, is taken",
                joint.name
            ));
        }
    }
}

/// Whether a joint is a hinge or a slide.
fn moves(model: &MjModel, joint: usize) -> bool {
    matches!(model.jnt_type()[joint], MjtJoint::mjJNT_HINGE | MjtJoint::mjJNT_SLIDE)
}

/// Names of bodies with something to see.
type Seen = BTreeSet<String>;
