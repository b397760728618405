//! The world of an episode: table, arm, and the object (or its twin) welded to the table where the
//! task says.
//!
//! The object hangs in a body that can be put anywhere between episodes without compiling again
//! (MuJoCo calls it mocap); to the physics it is fixed. Its contents are scaled by the frame that
//! holds them, masses and forces with it, so that a small object moves like the large one in weaker
//! gravity would (mjSCALING_SIMILAR). An object with a free base stays free.

use crate::object::{self, PREFIX, Target};
use crate::spoil::{Line, Spoil};
use crate::task::TaskSpec;
use crate::{SimError, control::N, log};
use glam::{DQuat, DVec3};
use hingecast_geom::Pose;
use mujoco_rs::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::Arc;

const ARM_ON_TABLE: &str = include_str!("../assets/arm_on_table.xml");

/// The tag of the body that carries a welded object, as MuJoCo writes it.
const OBJECT_BODY: &str = "<body name=\"object\"";

/// What a scene is made of.
#[derive(Clone, Debug)]
pub struct SceneConfig {
    /// Model file of the object or twin.
    pub object: PathBuf,
    /// What is made wrong with the target joint, in this order.
    pub spoil: Vec<Spoil>,
    /// Keep what only pictures need.
    pub visuals: bool,
}

/// A compiled world; cheap to clone, shared by all its environments.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The compiled model.
    pub model: Arc<MjModel>,
    /// What shall be done in it.
    pub task: Arc<TaskSpec>,
    /// The joint that the task is about.
    pub target: Target,
    /// The model as MJCF, the object at its nominal place.
    pub xml: Arc<String>,
    pub(crate) ids: Ids,
}

/// Where things are in MuJoCo's arrays.
#[derive(Clone, Debug)]
pub(crate) struct Ids {
    pub arm_qpos: [usize; N],
    pub arm_dof: [usize; N],
    pub fingers_qpos: [usize; 2],
    pub grip: usize,
    /// The mocap body's row; `None` when the object stands free.
    pub mocap: Option<usize>,
    /// First of the seven numbers of a free base.
    pub free_qpos: Option<usize>,
    /// Per geom: does it belong to the left finger, the right finger, the moving part?
    pub left: Vec<bool>,
    pub right: Vec<bool>,
    pub part: Vec<bool>,
}

impl Scene {
    /// Puts the object on the table and compiles the whole; takes from milliseconds to seconds.
    ///
    /// # Errors
    /// When the model cannot be loaded or has no part that fits the task.
    pub fn new(config: &SceneConfig, task: &TaskSpec) -> Result<Self, SimError> {
        // MuJoCo tells on its log that the object's options give way to the scene's; nobody wants
        // to read that.
        log::collect(|| Self::compile(config, task)).0
    }

    fn compile(config: &SceneConfig, task: &TaskSpec) -> Result<Self, SimError> {
        let path = &config.object;
        let place = path.display().to_string();
        if !path.is_file() && path != Path::new(object::HINGED_BLOCKS) {
            let hint = "put the file back, or name the object or twin: --object OBJECT, --twin RUN";
            return Err(SimError::task("the model file is not there", place, hint));
        }
        let mut child = object::read(path, config.visuals)?;
        let closed = match config.spoil.is_empty() {
            true => None,
            false => Some(spoil(&mut child, config, task)?),
        };
        let free = object::stands_free(&child);
        let arm =
            ARM_ON_TABLE.replace("contype=\"2\"", &format!("contype=\"{}\"", 2 | object::make_touchable(&mut child)));
        let mut spec = MjSpec::from_xml_string(&arm).map_err(|e| SimError::load(Path::new("the arm"), e))?;
        attach(&mut spec, &mut child, task.scale, !free, path)?;
        let model = spec.compile().map_err(|e| SimError::load(path, e))?;
        let xml = spec.save_xml_string(1 << 24).map_err(|e| SimError::load(path, e))?;
        check_numbers(&model, &place)?;
        let model = Arc::new(model);
        let mut data = MjData::new(model.clone());
        if let Some(row) = mocap(&model) {
            data.mocap_pos_mut()[row] = [0.0; 3];
            data.mocap_quat_mut()[row] = [1.0, 0.0, 0.0, 0.0];
        }
        let target = Target::find(&mut data, task, &place)?;
        if let Some(closed) = closed {
            let now = (task.grasp * target.body_from_grasp.inverse()).trans;
            if now.distance(closed.trans * task.scale) > 1e-6 {
                let hint = "take the part's body out of its <frame> in the model file";
                return Err(SimError::task("the spoiled part does not stay where it is when closed", place, hint));
            }
        }
        let ids = Ids::new(&model, target.joint.body);
        Ok(Self { model, task: Arc::new(task.clone()), target, xml: Arc::new(xml), ids })
    }
}

/// MuJoCo compiles a NaN without a word, and then everything is NaN.
fn check_numbers(model: &MjModel, place: &str) -> Result<(), SimError> {
    let all = |rows: &[[f64; 3]]| rows.iter().flatten().all(|x| x.is_finite());
    let fields = [
        ("the axis of a joint", all(model.jnt_axis())),
        ("the place of a joint", all(model.jnt_pos())),
        ("the limits of a joint", model.jnt_range().iter().flatten().all(|x| x.is_finite())),
        ("the place of a body", all(model.body_pos())),
        ("the orientation of a body", model.body_quat().iter().flatten().all(|x| x.is_finite())),
        ("the mass of a body", model.body_mass().iter().all(|x| x.is_finite())),
        ("the size of a shape", all(model.geom_size())),
    ];
    match fields.into_iter().find(|(_, finite)| !finite) {
        None => Ok(()),
        Some((what, _)) => {
            let hint = "correct the file, or build or export it again";
            Err(SimError::task(format!("{what} is not finite"), place, hint))
        }
    }
}

impl Scene {
    /// The model as MJCF with the object where it stands in one episode, to the last digit: an
    /// episode's `model_file`.
    pub fn xml_at(&self, place: &Pose) -> String {
        let [x, y, z] = place.trans.to_array();
        let q = place.rot;
        let pose = format!("{OBJECT_BODY} pos=\"{x} {y} {z}\" quat=\"{} {} {} {}\"", q.w, q.x, q.y, q.z);
        self.xml.replacen(OBJECT_BODY, &pose, 1)
    }

    /// Where the object stands in a text of [`Scene::xml_at`]; the identity when it stands free and
    /// its state says where.
    ///
    /// # Errors
    /// When the text has an object but no place that can be read.
    pub fn place_in(xml: &str) -> Result<Pose, SimError> {
        let Some(at) = xml.find(OBJECT_BODY) else { return Ok(Pose::IDENTITY) };
        let tag = &xml[at..at + xml[at..].find('>').unwrap_or(0)];
        let numbers = |name: &str| -> Option<Vec<f64>> {
            let from = tag.find(&format!(" {name}=\""))? + name.len() + 3;
            tag[from..].split('"').next()?.split_whitespace().map(|n| n.parse().ok()).collect()
        };
        match (numbers("pos").as_deref(), numbers("quat").as_deref()) {
            (Some(&[x, y, z]), Some(&[w, i, j, k])) => Ok(Pose::new(DQuat::from_xyzw(i, j, k, w), DVec3::new(x, y, z))),
            _ => Err(SimError::task(
                "the object has no place in the scene",
                "model_file, body \"object\"",
                "replay demonstrations that `hingecast demos` recorded",
            )),
        }
    }
}

/// Puts the object into a scene: in a mocap body named "object", or, when it stands free, into the
/// world itself.
pub(crate) fn attach(
    spec: &mut MjSpec,
    child: &mut MjSpec,
    scale: f64,
    welded: bool,
    path: &Path,
) -> Result<(), SimError> {
    let world = spec.world_body_mut();
    let frame = if welded {
        let body = world.add_body().with_name("object");
        body.set_mocap(true);
        body.add_frame()
    } else {
        world.add_frame()
    };
    *frame.scale_mut() = [scale; 3];
    frame.attach_by_deep_copy(child, PREFIX, "").map_err(|e| SimError::load(path, e))
}

pub(crate) fn mocap(model: &MjModel) -> Option<usize> {
    let body = model.name_to_id(MjtObjBase::mjOBJ_BODY, "object")?;
    usize::try_from(model.body_mocapid()[body]).ok()
}

impl Ids {
    fn new(model: &MjModel, part: usize) -> Self {
        let joint = |name: &str| model.name_to_id(MjtObjBase::mjOBJ_JOINT, name).expect("a joint of our own arm");
        let arm: [usize; N] = std::array::from_fn(|k| joint(&format!("joint{}", k + 1)));
        let geoms = model.ffi().ngeom as usize;
        let named = |prefix: &str| -> Vec<bool> {
            let starts = |g| model.id_to_name(MjtObjBase::mjOBJ_GEOM, g).is_some_and(|n| n.starts_with(prefix));
            (0..geoms).map(starts).collect()
        };
        let free = (0..model.ffi().njnt as usize).find(|&j| model.jnt_type()[j] == MjtJoint::mjJNT_FREE);
        Self {
            arm_qpos: arm.map(|j| model.jnt_qposadr()[j] as usize),
            arm_dof: arm.map(|j| model.jnt_dofadr()[j] as usize),
            fingers_qpos: ["finger_joint1", "finger_joint2"].map(|n| model.jnt_qposadr()[joint(n)] as usize),
            grip: model.name_to_id(MjtObjBase::mjOBJ_SITE, "grip").expect("a site of our own arm"),
            mocap: mocap(model),
            free_qpos: free.map(|j| model.jnt_qposadr()[j] as usize),
            left: named("left_"),
            right: named("right_"),
            part: (0..geoms).map(|g| object::hangs_on(model, model.geom_bodyid()[g] as usize, part)).collect(),
        }
    }
}

/// The text of a hand whose geoms have the usual contype and `bit`.
fn touching(xml: &str, bit: i32) -> String {
    let default = format!("<default><geom contype=\"{}\"/></default>\n  <worldbody>", 1 | bit);
    if bit == 0 { xml.to_string() } else { xml.replacen("<worldbody>", &default, 1) }
}

/// The object alone, scaled, its base frame in the world's origin.
pub(crate) fn alone(path: &Path, scale: f64, with: Option<&str>) -> Result<MjData<Arc<MjModel>>, SimError> {
    let mut child = object::read(path, false)?;
    let bit = object::make_touchable(&mut child);
    let mut spec = match with {
        Some(xml) => MjSpec::from_xml_string(&touching(xml, bit)).map_err(|e| SimError::load(path, e))?,
        None => MjSpec::new(),
    };
    attach(&mut spec, &mut child, scale, false, path)?;
    let model = spec.compile().map_err(|e| SimError::load(path, e))?;
    let mut data = MjData::new(Arc::new(model));
    data.kinematics();
    Ok(data)
}

/// Moves the target joint of the (unscaled) specification as asked, and nothing else: closed, the
/// part stands where it stood, whatever the file's zero is. Where the file lets the part collide
/// with its base, a wrong hinge may jam it there; where it excludes that (as twins do), the part
/// passes through. Answers the part's closed pose, base frame, unscaled.
fn spoil(spec: &mut MjSpec, config: &SceneConfig, task: &TaskSpec) -> Result<Pose, SimError> {
    let path = &config.object;
    let mut data = alone(path, 1.0, None)?;
    let (grasp, part_centre) = (task.grasp.trans / task.scale, task.part_centre / task.scale);
    let mut unscaled = task.clone();
    unscaled.grasp.trans = grasp;
    unscaled.part_centre = part_centre;
    let target = Target::find(&mut data, &unscaled, &path.display().to_string())?;
    let joint = &target.joint;
    let [mut lo, mut hi] = joint.range;
    let mut line = Line { axis: target.screw.axis, pivot: target.screw.pivot };
    for s in &config.spoil {
        match *s {
            Spoil::Limits(share) if target.closed <= target.open => hi = lo + share * (hi - lo),
            Spoil::Limits(share) => lo = hi - share * (hi - lo),
            Spoil::Pivot(mm) => {
                line = line.spoiled(&Spoil::Pivot(mm / task.scale), joint.slides, grasp, part_centre);
            }
            s => line = line.spoiled(&s, joint.slides, grasp, part_centre),
        }
    }

    // The body's own pose becomes the closed one, and the joint counts from there.
    data.qpos_mut()[joint.qpos] = target.closed;
    data.kinematics();
    let closed = object::body_pose(&data, joint.body);
    let parent = data.model().body_parentid()[joint.body] as usize;
    let parent_from_body = object::body_pose(&data, parent).inverse() * closed;
    let nameless = |what: &str| {
        let hint = format!("give the {what} a name in the model file");
        SimError::task(format!("the {what} has no name"), path.display().to_string(), hint)
    };
    let body = data.model().id_to_name(MjtObjBase::mjOBJ_BODY, joint.body).and_then(|n| n.strip_prefix(PREFIX));
    let degrees = spec.compiler().degree();
    let body = body.and_then(|name| spec.world_body_mut().child_mut(name)).ok_or_else(|| nameless("part"))?;
    *body.pos_mut() = parent_from_body.trans.to_array();
    *body.quat_mut() = object::wxyz(parent_from_body.rot);
    body.alt_mut().switch_quat();
    let entry = spec.joint_mut(&joint.name).ok_or_else(|| nameless("joint"))?;
    let base = closed.inverse();
    *entry.axis_mut() = base.rotate(line.axis).to_array();
    *entry.pos_mut() = base.apply(line.pivot).to_array();
    // A file may count angles in degrees; limits then mean degrees here, too.
    let unit = if degrees && !joint.slides { 1f64.to_degrees() } else { 1.0 };
    *entry.range_mut() = [unit * lo, unit * hi];
    *entry.ref_mut() = unit * target.closed;
    Ok(closed)
}
