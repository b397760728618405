//! One environment: reset from a seed, 20 control steps a second, observations under robomimic's
//! names, success, states.
//!
//! A step of 50 ms is 25 steps of physics. On the first, the goal is set: x* = x + 0.05 a[0..3]
//! (m), R* = exp(0.5 a[3..6]) R (rad), and the fingers' target moves by a tenth of its range
//! towards closed (a`[6]` > 0) or open; then `control::torques` every 2 ms. Same scene, seed and
//! actions: same states, to the bit.

mod arm_state;
mod moment;

pub use moment::Moment;

use crate::SimError;
use crate::control::{self, ArmState, Goal, N};
use crate::object::{self, body_pose, matrix, pose_of, write_pose, wxyz};
use crate::path::SpotPath;
use crate::scene::Scene;
use crate::task::{CLOSE_FROM, TABLE, TaskKind};
use arm_state::arm_state;
use glam::{DMat3, DQuat, DVec3};
use hingecast_geom::pose::quat_from_rotation_vector;
use hingecast_geom::random::normal;
use hingecast_geom::{Pose, Screw};
use mujoco_rs::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::sync::Arc;

/// Length of an action: three of position, three of rotation, one of the gripper, each in [-1, 1].
pub const ACTION: usize = 7;
/// Control 20 Hz, physics 500 Hz.
const SUBSTEPS: usize = 25;
/// Joint angles at reset, rad.
const START: [f64; N] = [0.0, PI / 16.0, 0.0, -5.0 * PI / 6.0, 0.0, PI - 0.2, PI / 4.0];
/// Their noise, rad.
const START_NOISE: f64 = 0.02;
/// Fingers at reset, m: half open.
const START_FINGER: f64 = 0.020833;
/// The gripper points down at reset. A quaternion and its negative are one rotation; the sign that
/// is nearer to this one is shown, so that observations never jump.
pub(crate) const GRIPPER_DOWN: DQuat = DQuat::from_xyzw(1.0, 0.0, 0.0, 0.0);
/// A free base that went so far has been knocked away, m.
const KNOCKED: f64 = 0.1;

/// Where an episode begins: enough to replay it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Start {
    /// `world_from_base` of a welded object.
    pub place: Pose,
    /// time, qpos, qvel.
    pub state: Vec<f64>,
}

/// How an episode ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// The joint stands where the task wants it.
    Success,
    /// No finger ever touched the moving part.
    NeverReached,
    /// Both fingers held it at some time, but not at the end.
    LostGrasp,
    /// It was touched or is still held, but has not moved far enough.
    MovedTooLittle,
    /// The object (free base) was pushed off its place, or the simulation diverged.
    KnockedAway,
}

/// A scene in motion: one episode after the other.
pub struct Env {
    /// The world that is simulated.
    pub scene: Scene,
    data: MjData<Arc<MjModel>>,
    goal: Goal,
    /// Finger targets in [-1, 1].
    gripper: [f64; 2],
    posture: [f64; N],
    place: Pose,
    grasp_sign: DQuat,
    touched: bool,
    held: bool,
    holding: bool,
    finite: bool,
    base_start: DVec3,
    moved_start: f64,
    moved_most: f64,
}

impl Env {
    /// The scene at the start of the episode of seed 0.
    pub fn new(scene: &Scene) -> Self {
        let goal = Goal { position: DVec3::ZERO, rotation: DMat3::IDENTITY };
        let grasp_sign = scene.task.place.rot * scene.task.grasp.rot;
        let mut env = Self {
            data: MjData::new(scene.model.clone()),
            scene: scene.clone(),
            goal,
            gripper: [0.0; 2],
            posture: START,
            place: Pose::IDENTITY,
            grasp_sign,
            touched: false,
            held: false,
            holding: false,
            finite: true,
            base_start: DVec3::ZERO,
            moved_start: 0.0,
            moved_most: 0.0,
        };
        env.reset(0);
        env
    }

    /// A new episode: the object's place, the joint's value (task `close`) and the arm's posture
    /// come from `seed`.
    pub fn reset(&mut self, seed: u64) {
        let mut rng = fastrand::Rng::with_seed(seed ^ 0x6570_6973_6f64_6531);
        let (scene, ids) = (&self.scene, &self.scene.ids);
        let place = scene.task.draw_place(&mut rng);
        self.data.reset();
        let qpos = self.data.qpos_mut();
        for k in 0..N {
            qpos[ids.arm_qpos[k]] = START[k] + START_NOISE * normal(&mut rng);
        }
        qpos[ids.fingers_qpos[0]] = START_FINGER;
        qpos[ids.fingers_qpos[1]] = -START_FINGER;
        let target = &scene.target;
        let share = if scene.task.kind == TaskKind::Close { CLOSE_FROM + 0.2 * rng.f64() } else { 0.0 };
        qpos[target.joint.qpos] = target.closed + share * (target.open - target.closed);
        if let Some(at) = ids.free_qpos {
            let base = place * pose_of(&qpos[at..at + 7]);
            write_pose(&mut qpos[at..at + 7], &base);
        }
        self.begin(place);
    }

    /// The episode that a [`Start`] describes.
    ///
    /// # Errors
    /// When the state is of another model.
    pub fn start_from(&mut self, start: &Start) -> Result<(), SimError> {
        self.data.reset();
        self.write_state(&start.state)?;
        self.begin(start.place);
        Ok(())
    }

    /// What [`Env::start_from`] wants back; ask right after a reset.
    pub fn start(&self) -> Start {
        Start { place: self.place, state: self.state() }
    }

    fn begin(&mut self, place: Pose) {
        self.place = place;
        if let Some(row) = self.scene.ids.mocap {
            self.data.mocap_pos_mut()[row] = place.trans.to_array();
            self.data.mocap_quat_mut()[row] = wxyz(place.rot);
        }
        self.data.forward();
        self.posture = self.scene.ids.arm_qpos.map(|a| self.data.qpos()[a]);
        self.gripper = [0.0; 2];
        (self.touched, self.held, self.holding, self.finite) = (false, false, false, true);
        self.base_start = self.base();
        self.moved_start = self.moved();
        self.moved_most = self.moved_start;
    }

    /// 50 ms under `action`, each number cut to [-1, 1].
    ///
    /// # Errors
    /// When a number is not finite: a policy that has diverged.
    pub fn step(&mut self, action: &[f64; ACTION]) -> Result<(), SimError> {
        if let Some(k) = action.iter().position(|a| !a.is_finite()) {
            return Err(SimError::task(
                format!("the action has a number that is not finite: {}", action[k]),
                format!("action[{k}]"),
                "train again with a lower learning rate, or check the demonstrations",
            ));
        }
        let a = action.map(|x| x.clamp(-1.0, 1.0));
        for substep in 0..SUBSTEPS {
            self.data.step1();
            let arm = arm_state(&self.data, &self.scene);
            if substep == 0 {
                self.set_goal(&arm, &a);
            }
            let torques = control::torques(&arm, &self.goal, &self.posture);
            let ctrl = self.data.ctrl_mut();
            ctrl[..N].copy_from_slice(&torques);
            ctrl[N] = 0.02 + 0.02 * self.gripper[0];
            ctrl[N + 1] = -0.02 + 0.02 * self.gripper[1];
            self.data.step2();
        }
        // Poses belong to the new state from here on; no solver runs, so the next step is not
        // touched by it.
        self.data.kinematics();
        self.look_at_contacts();
        Ok(())
    }

    fn set_goal(&mut self, arm: &ArmState, a: &[f64; ACTION]) {
        let turn = quat_from_rotation_vector(0.5 * DVec3::new(a[3], a[4], a[5]));
        self.goal = Goal {
            position: arm.position + 0.05 * DVec3::new(a[0], a[1], a[2]),
            rotation: DMat3::from_quat(turn) * arm.rotation,
        };
        let sign = if a[6] > 0.0 {
            1.0
        } else if a[6] < 0.0 {
            -1.0
        } else {
            0.0
        };
        self.gripper[0] = (self.gripper[0] - 0.2 * sign).clamp(-1.0, 1.0);
        self.gripper[1] = (self.gripper[1] + 0.2 * sign).clamp(-1.0, 1.0);
    }

    fn look_at_contacts(&mut self) {
        let ids = &self.scene.ids;
        let (mut left, mut right) = (false, false);
        for c in self.data.contact() {
            let [a, b] = c.geom.map(|g| g.max(0) as usize);
            for (finger, other) in [(a, b), (b, a)] {
                if ids.part[other] {
                    left |= ids.left[finger];
                    right |= ids.right[finger];
                }
            }
        }
        self.touched |= left || right;
        self.holding = left && right;
        self.held |= self.holding;
        let finite = self.data.qpos().iter().chain(self.data.qvel()).all(|x| x.is_finite());
        self.finite &= finite && self.data.warning().iter().all(|w| w.number == 0);
        let moved = self.moved();
        let farther = match self.scene.task.kind {
            TaskKind::Close => moved < self.moved_most,
            _ => moved > self.moved_most,
        };
        if farther {
            self.moved_most = moved;
        }
    }

    /// How far the joint is from closed, as a share of the *task's* range: that of the object which
    /// the task was made from, whatever limits this world's joint has.
    pub fn moved(&self) -> f64 {
        let t = &self.scene.target;
        (self.data.qpos()[t.joint.qpos] - t.closed) * (t.open - t.closed).signum() / self.scene.task.travel
    }

    /// How far the joint came at most from where it began, share of the task's range.
    pub fn moved_at_most(&self) -> f64 {
        (self.moved_most - self.moved_start).abs()
    }

    /// Whether the task is done at this moment.
    pub fn success(&self) -> bool {
        self.finite && self.scene.task.done(self.moved())
    }

    /// What became of an episode that ends now.
    pub fn outcome(&self) -> Outcome {
        if self.success() {
            Outcome::Success
        } else if !self.finite || self.base().distance(self.base_start) > KNOCKED {
            Outcome::KnockedAway
        } else if !self.touched {
            Outcome::NeverReached
        } else if self.held && !self.holding {
            Outcome::LostGrasp
        } else {
            Outcome::MovedTooLittle
        }
    }

    /// How far the grasped spot of the part is from the way on which the joint of `truth` would
    /// lead it, m; infinite once the simulation has diverged.
    pub fn off(&self, truth: &SpotPath) -> f64 {
        if !self.finite {
            return f64::INFINITY;
        }
        let world_from_base = match self.scene.ids.free_qpos {
            None => self.place,
            Some(at) => {
                pose_of(&self.data.qpos()[at..at + 7]) * pose_of(&self.scene.model.qpos0()[at..at + 7]).inverse()
            }
        };
        truth.off(world_from_base.inverse().apply(self.grasp().trans))
    }

    /// robomimic's low-dimensional keys: `object` (grasp frame: position, quaternion xyzw; from the
    /// gripper to it), `robot0_eef_pos`, `robot0_eef_quat` (xyzw), `robot0_gripper_qpos`. World
    /// frame, metres.
    pub fn observe(&self) -> BTreeMap<String, Vec<f64>> {
        let (grip, grasp) = (self.grip(), self.grasp());
        let mut object = grasp.trans.to_array().to_vec();
        object.extend(near(grasp.rot, self.grasp_sign).to_array());
        object.extend((grasp.trans - grip.trans).to_array());
        let fingers = self.scene.ids.fingers_qpos.map(|a| self.data.qpos()[a]);
        BTreeMap::from([
            ("object".to_string(), object),
            ("robot0_eef_pos".to_string(), grip.trans.to_array().to_vec()),
            ("robot0_eef_quat".to_string(), near(grip.rot, GRIPPER_DOWN).to_array().to_vec()),
            ("robot0_gripper_qpos".to_string(), fingers.to_vec()),
        ])
    }

    /// `world_from_grip`.
    pub fn grip(&self) -> Pose {
        let site = self.scene.ids.grip;
        Pose::from_mat3_trans(matrix(&self.data.site_xmat()[site]), DVec3::from(self.data.site_xpos()[site]))
    }

    /// `world_from_grasp`: the frame that is fixed to the moving part.
    pub fn grasp(&self) -> Pose {
        let target = &self.scene.target;
        body_pose(&self.data, target.joint.body) * target.body_from_grasp
    }

    /// The target joint where it stands now, world frame.
    pub fn screw(&self) -> Screw {
        object::screw(&self.data, &self.scene.target.joint)
    }

    /// Where the task's joint stands, in its own coordinate: rad or simulated metres.
    pub fn joint_value(&self) -> f64 {
        self.data.qpos()[self.scene.target.joint.qpos]
    }

    /// Whether both fingers touch the moving part at this moment.
    pub fn holding(&self) -> bool {
        self.holding
    }

    fn base(&self) -> DVec3 {
        self.scene.ids.free_qpos.map_or(DVec3::ZERO, |at| {
            // Lifting is not knocking away: only the way along the table counts.
            DVec3::new(self.data.qpos()[at], self.data.qpos()[at + 1], TABLE)
        })
    }

    /// time, qpos, qvel.
    pub fn state(&self) -> Vec<f64> {
        let mut out = vec![self.data.ffi().time];
        out.extend_from_slice(self.data.qpos());
        out.extend_from_slice(self.data.qvel());
        out
    }

    /// Puts the world into a recorded state, to look at it; to go on from one, [`Env::start_from`].
    ///
    /// # Errors
    /// When the state is of another model.
    pub fn set_state(&mut self, state: &[f64]) -> Result<(), SimError> {
        self.write_state(state)?;
        self.data.kinematics();
        Ok(())
    }

    fn write_state(&mut self, state: &[f64]) -> Result<(), SimError> {
        let (nq, nv) = (self.data.qpos().len(), self.data.qvel().len());
        if state.len() != 1 + nq + nv {
            return Err(SimError::task(
                format!("a state of this scene has {} numbers, not {}", 1 + nq + nv, state.len()),
                "states",
                "replay with the object that the demonstrations were recorded on",
            ));
        }
        // SAFETY: only the time is written; no pointer or size of the data changes.
        unsafe { self.data.ffi_mut().time = state[0] };
        self.data.qpos_mut().copy_from_slice(&state[1..=nq]);
        self.data.qvel_mut().copy_from_slice(&state[1 + nq..]);
        Ok(())
    }

    /// For renderers.
    pub fn data_mut(&mut self) -> &mut MjData<Arc<MjModel>> {
        &mut self.data
    }
}

/// Of a quaternion and its negative, the one nearer to `reference`.
fn near(q: DQuat, reference: DQuat) -> DQuat {
    if q.dot(reference) < 0.0 { -q } else { q }
}
