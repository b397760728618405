//! What shall be done with which joint of an object, and where the object stands: everything that
//! the true object and its twin share, so that a policy meets both in the same place.
//!
//! A twin's base frame is the canonical world frame of the recorded object (docs/simulation.md). So
//! one `TaskSpec`, made from the true object (or from a twin alone), fits both: lengths are those
//! of the base frame times `scale`.

use glam::{DQuat, DVec3};
use hingecast_geom::Pose;
use serde::{Deserialize, Serialize};

/// What shall be done with a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TaskKind {
    /// Move the joint from closed through half of its range.
    Open,
    /// Move the joint from open to within a tenth of its range from closed.
    Close,
    /// `open` on the seed's two blocks that stand free: it can be solved by lifting, see
    /// docs/simulation.md.
    HingedBox,
}

impl TaskKind {
    /// The names on the command line, in the order of the variants.
    pub const NAMES: [&str; 3] = ["open", "close", "hinged-box"];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }

    /// The share of the range at which the task is done.
    pub fn goal(self) -> f64 {
        match self {
            TaskKind::Open | TaskKind::HingedBox => 0.5,
            TaskKind::Close => 0.1,
        }
    }

    /// The kind of a name on the command line; `None` when there is no such kind.
    pub fn from_name(name: &str) -> Option<Self> {
        [Self::Open, Self::Close, Self::HingedBox].into_iter().find(|k| k.name() == name)
    }
}

/// Height of the table top, m.
pub const TABLE: f64 = 0.8;
/// The covered box of simulation.md: object at x 0..0.06, y -0.03..0.03, yaw +-0.2 about its
/// nominal place.
const SPREAD: [f64; 3] = [0.03, 0.03, 0.2];
/// Where the joint stands at least when `close` begins, share of the range.
pub(crate) const CLOSE_FROM: f64 = 0.6;
/// Steps of 50 ms after which an episode has failed; robomimic's for its table tasks.
pub const HORIZON: usize = 400;

/// One task on one object, and on its twins.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TaskSpec {
    /// What shall be done.
    pub kind: TaskKind,
    /// Name of the joint in the object that the task was made from.
    pub joint: String,
    /// Simulated metres per unit of the object's file.
    pub scale: f64,
    /// Nominal `world_from_base`; lengths are simulated metres.
    pub place: Pose,
    /// Half widths of the uniform draw of x (m), y (m), yaw (rad) about `place`.
    pub spread: [f64; 3],
    /// Where the gripper holds the moving part when the joint is closed, base frame: z approaches,
    /// y closes.
    pub grasp: Pose,
    /// Thickness there, m.
    pub width: f64,
    /// Whether the wrist turns with the part.
    pub turn_wrist: bool,
    /// Centre of the moving part's box when closed, base frame: by it a twin's joint is recognised,
    /// whatever it is called.
    pub part_centre: DVec3,
    /// |open - closed| of the joint, rad or simulated metres.
    pub travel: f64,
    /// Control steps of 50 ms after which an episode has failed.
    pub horizon: usize,
}

impl TaskSpec {
    pub(crate) fn new(kind: TaskKind, joint: &str, scale: f64) -> Self {
        Self {
            kind,
            joint: joint.to_string(),
            scale,
            place: Pose::IDENTITY,
            spread: SPREAD,
            grasp: Pose::IDENTITY,
            width: 0.0,
            turn_wrist: false,
            part_centre: DVec3::ZERO,
            travel: 1.0,
            horizon: HORIZON,
        }
    }

    /// Where the object stands in the episode of this seed.
    pub(crate) fn draw_place(&self, rng: &mut fastrand::Rng) -> Pose {
        let mut uniform = |half: f64| half * (2.0 * rng.f64() - 1.0);
        let shift = DVec3::new(uniform(self.spread[0]), uniform(self.spread[1]), 0.0);
        let turn = DQuat::from_rotation_z(uniform(self.spread[2]));
        Pose::new(turn * self.place.rot, self.place.trans + shift)
    }

    /// Whether the task is done; `moved` = |q - closed| / travel.
    pub fn done(&self, moved: f64) -> bool {
        match self.kind {
            TaskKind::Open | TaskKind::HingedBox => moved >= self.kind.goal(),
            TaskKind::Close => moved <= self.kind.goal(),
        }
    }
}
