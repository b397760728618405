//! Demonstrations -> behaviour cloning -> a policy that acts, and the statistics of success rates.
//!
//! Knows no simulator: observations and actions are plain numbers. `docs/policy.md` has the
//! formulas and says where this follows robomimic to the digit and where it does not.

#![warn(missing_docs)]

mod actor;
pub mod demos;
pub mod net;
mod policy;
pub mod statistics;
pub mod train;

pub use actor::Actor;
pub use demos::{Demos, Episode};
/// What is wrong with demonstrations, settings or a policy.
pub use hingecast_geom::InputError as PolicyError;
pub use policy::{Normalization, ObsKey, Policy, PolicyConfig};

/// Numbers of an action: three of translation, three of rotation (axis times angle), one of the
/// gripper; each in [-1, 1].
pub const ACTION_SIZE: usize = 7;
