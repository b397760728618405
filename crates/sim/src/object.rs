//! An object (MJCF, URDF or a twin folder) as a MuJoCo specification, and its moving parts.

use crate::SimError;
use crate::task::TaskSpec;
use glam::{DMat3, DQuat, DVec3};
use hingecast_geom::{JointKind, Pose, Screw};
use mujoco_rs::prelude::*;
use mujoco_rs::wrappers::mj_model::traits::ModelType;
use std::path::{Path, PathBuf};

/// The prefix of everything of the object's inside a scene.
pub const PREFIX: &str = "object/";

/// The seed's two blocks need no file: this name stands for them.
pub const HINGED_BLOCKS: &str = "hinged_blocks";

/// The model file of `path`: a file itself, a run (its twin), a twin folder or an object folder.
///
/// # Errors
/// When nothing of that kind is there.
pub fn model_file(path: &Path) -> Result<PathBuf, SimError> {
    if path.is_file() || path == Path::new(HINGED_BLOCKS) {
        return Ok(path.to_path_buf());
    }
    let names = ["twin/robot.xml", "robot.xml", "object.xml", "robot.urdf"];
    names.iter().map(|n| path.join(n)).find(|p| p.is_file()).ok_or_else(|| {
        let hint = "an MJCF file, a folder with object.xml, or a run that `hingecast build` has finished";
        SimError::task("no model to simulate", path.display().to_string(), hint)
    })
}

/// Reads the file; `visuals` keeps what only pictures need (loading a twin's fine meshes takes
/// seconds).
pub(crate) fn read(path: &Path, visuals: bool) -> Result<MjSpec, SimError> {
    let spec = if path == Path::new(HINGED_BLOCKS) {
        MjSpec::from_xml_string(include_str!("../assets/hinged_blocks.xml"))
    } else {
        MjSpec::from_xml(path)
    };
    let mut spec = spec.map_err(|e| SimError::load(path, e))?;
    if !visuals {
        spec.discard_visual().map_err(|e| SimError::load(path, e))?;
    }
    Ok(spec)
}

/// Whether the base can move by itself.
pub(crate) fn stands_free(spec: &MjSpec) -> bool {
    spec.joint_iter().any(|j| j.type_() == MjtJoint::mjJNT_FREE)
}

/// A hinge or slide of the object in a compiled model.
#[derive(Clone, Debug)]
pub struct ObjectJoint {
    /// As in the object's file.
    pub name: String,
    /// Joint number in the compiled model.
    pub id: usize,
    /// Where its value stands in `qpos`.
    pub qpos: usize,
    /// Where its speed stands in `qvel`.
    pub dof: usize,
    /// The body that it moves.
    pub body: usize,
    /// True for a slide, false for a hinge.
    pub slides: bool,
    /// Its limits, or one turn.
    pub range: [f64; 2],
}

/// All hinges and slides of the object.
pub(crate) fn joints(model: &MjModel) -> Vec<ObjectJoint> {
    (0..model.ffi().njnt as usize)
        .filter_map(|id| {
            let name = model.id_to_name(MjtObjBase::mjOBJ_JOINT, id)?.strip_prefix(PREFIX)?.to_string();
            let slides = match model.jnt_type()[id] {
                MjtJoint::mjJNT_HINGE => false,
                MjtJoint::mjJNT_SLIDE => true,
                _ => return None,
            };
            Some(ObjectJoint {
                name,
                id,
                qpos: model.jnt_qposadr()[id] as usize,
                dof: model.jnt_dofadr()[id] as usize,
                body: model.jnt_bodyid()[id] as usize,
                slides,
                range: joint_range(model, id),
            })
        })
        .collect()
}

/// A joint's limits, or one turn where it has none.
pub(crate) fn joint_range(model: &MjModel, joint: usize) -> [f64; 2] {
    if model.jnt_limited()[joint] { model.jnt_range()[joint] } else { [0.0, std::f64::consts::TAU] }
}

/// The name of something in the model, or its kind and number.
pub(crate) fn name_or(model: &MjModel, kind: MjtObjBase, id: usize, word: &str) -> String {
    let own = model.id_to_name(kind, id).filter(|n| !n.is_empty());
    own.map_or_else(|| format!("{word}_{id}"), String::from)
}

/// Whether `body` is `root` or hangs on it.
pub(crate) fn hangs_on(model: &MjModel, body: usize, root: usize) -> bool {
    let mut at = body;
    while at > root {
        at = model.body_parentid()[at] as usize;
    }
    at == root
}

/// Geoms that can collide and satisfy `which`, as a box in the world: lower and upper corner.
pub(crate) fn bounds<M: ModelType>(data: &MjData<M>, which: impl Fn(usize) -> bool) -> Option<[DVec3; 2]> {
    let model = data.model();
    let mut out: Option<[DVec3; 2]> = None;
    for g in 0..model.ffi().ngeom as usize {
        let collides = model.geom_contype()[g] != 0 || model.geom_conaffinity()[g] != 0;
        if !collides || !which(g) {
            continue;
        }
        let [cx, cy, cz, sx, sy, sz] = model.geom_aabb()[g];
        let rotation = matrix(&data.geom_xmat()[g]);
        let centre = DVec3::from(data.geom_xpos()[g]) + rotation * DVec3::new(cx, cy, cz);
        let half = rotation.x_axis.abs() * sx + rotation.y_axis.abs() * sy + rotation.z_axis.abs() * sz;
        let (lo, hi) = (centre - half, centre + half);
        out = Some(out.map_or([lo, hi], |[a, b]| [a.min(lo), b.max(hi)]));
    }
    out
}

/// MuJoCo's row-major 3 x 3.
pub(crate) fn matrix(m: &[f64; 9]) -> DMat3 {
    DMat3::from_cols_array(m).transpose()
}

/// MuJoCo's order of a quaternion.
pub(crate) fn wxyz(q: DQuat) -> [f64; 4] {
    [q.w, q.x, q.y, q.z]
}

/// A pose as MuJoCo writes it into the seven numbers of a free joint: position, quaternion w x y z.
pub(crate) fn pose_of(free: &[f64]) -> Pose {
    let rot = DQuat::from_xyzw(free[4], free[5], free[6], free[3]);
    Pose::new(rot, DVec3::from_slice(&free[..3]))
}

/// The other way.
pub(crate) fn write_pose(free: &mut [f64], pose: &Pose) {
    free[..3].copy_from_slice(&pose.trans.to_array());
    free[3..7].copy_from_slice(&wxyz(pose.rot));
}

pub(crate) fn body_pose<M: ModelType>(data: &MjData<M>, body: usize) -> Pose {
    Pose::from_mat3_trans(matrix(&data.xmat()[body]), DVec3::from(data.xpos()[body]))
}

/// The screw of a joint where it stands now, world frame.
pub(crate) fn screw<M: ModelType>(data: &MjData<M>, joint: &ObjectJoint) -> Screw {
    let pose = body_pose(data, joint.body);
    let model = data.model();
    Screw {
        kind: if joint.slides { JointKind::Prismatic } else { JointKind::Revolute },
        axis: pose.rotate(DVec3::from(model.jnt_axis()[joint.id])),
        pivot: pose.apply(DVec3::from(model.jnt_pos()[joint.id])),
    }
}

/// The joint that the task is about, in this object or twin.
#[derive(Clone, Debug)]
pub struct Target {
    /// The joint in the compiled model.
    pub joint: ObjectJoint,
    /// Joint value when closed, rad or simulated metres.
    pub closed: f64,
    /// Joint value when open.
    pub open: f64,
    /// The grasp frame, fixed to the moving body.
    pub body_from_grasp: Pose,
    /// The joint as it stands when closed, base frame; the sign is the model's own.
    pub screw: Screw,
}

impl Target {
    /// Recognises the task's joint by where its part is when closed: names and zeros of a twin are
    /// its own. `data` holds the scaled object with its base frame in the world's origin.
    pub(crate) fn find<M: ModelType>(data: &mut MjData<M>, task: &TaskSpec, place: &str) -> Result<Self, SimError> {
        let all = joints(data.model());
        let rest: Vec<f64> = data.qpos().to_vec();
        let mut best: Option<(f64, Target)> = None;
        for joint in all {
            let part = joint.body;
            for (closed, open) in [(joint.range[0], joint.range[1]), (joint.range[1], joint.range[0])] {
                data.qpos_mut().copy_from_slice(&rest);
                data.qpos_mut()[joint.qpos] = closed;
                data.kinematics();
                let in_part = |g: usize| hangs_on(data.model(), data.model().geom_bodyid()[g] as usize, part);
                let Some([lo, hi]) = bounds(data, in_part) else { continue };
                // What is grasped must be there; the centre decides between parts and ends that
                // both have something there. Not the centre alone: a twin whose drawer lost its
                // inside to its neighbour has it elsewhere.
                let spot = task.grasp.trans;
                let distance = spot.distance(spot.clamp(lo, hi)) + 0.25 * (0.5 * (lo + hi)).distance(task.part_centre);
                let body_from_grasp = body_pose(data, part).inverse() * task.grasp;
                if best.as_ref().is_none_or(|(d, _)| distance < *d) {
                    let screw = screw(data, &joint);
                    best = Some((distance, Self { joint: joint.clone(), closed, open, body_from_grasp, screw }));
                }
            }
        }
        data.qpos_mut().copy_from_slice(&rest);
        let reach = 0.5 * task.grasp.trans.distance(task.part_centre) + 0.1;
        match best {
            Some((distance, target)) if distance <= reach => Ok(target),
            Some((distance, _)) => Err(SimError::task(
                format!(
                    "no part stands where '{}' is when closed: the nearest is {:.0} mm away",
                    task.joint,
                    1e3 * distance
                ),
                place,
                "is this the twin of that object, recorded in the same frame?",
            )),
            None => Err(SimError::nothing_moves(place)),
        }
    }
}
