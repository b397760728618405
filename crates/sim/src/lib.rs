//! MuJoCo, the simulator of this field: tries what `twin` wrote before a user does, and lets an arm
//! act on it.
//!
//! `check` loads a model, sweeps its joints and says what is wrong. `compiled` reads MJCF as MuJoCo
//! understands it, for `synth`. The rest is a world with an
//! arm: `object` and `scene` load an object or its twin onto a table, `grasp` finds where it can be
//! held, `task` says what shall be done, `env` steps, observes and judges, `control` is the arm's
//! control law, `expert` demonstrates, `spoil` makes wrong objects on purpose, `path` says whether
//! a part ended where the true joint would have it.

#![warn(missing_docs)]

pub mod check;
pub mod compiled;
pub mod control;
pub mod env;
mod error;
pub mod expert;
pub mod grasp;
mod log;
pub mod object;
pub mod path;
pub mod picture;
pub mod scene;
pub mod spoil;
pub mod task;
pub mod trial;

pub use check::{CheckConfig, FileCheck, JointSweep, check_file, check_twin};
pub use env::{Env, Outcome, Start};
pub use error::SimError;
pub use expert::Expert;
pub use path::SpotPath;
pub use scene::{Scene, SceneConfig};
pub use spoil::Spoil;
pub use task::{TaskKind, TaskSpec};
