//! MuJoCo, the simulator of this field: loads what `twin` wrote and tries it before a user does.

pub mod check;
mod log;

pub use check::{CheckConfig, FileCheck, JointSweep, check_file, check_twin};

/// Why a model could not be tried at all. What a working model does wrong is a doubt, not an error.
#[derive(Debug, thiserror::Error)]
pub enum SimError {
    #[error(
        "MuJoCo cannot load the model: {what}\n  where: {path}\n  try: open it with `python -m mujoco.viewer --mjcf={path}`, or build the twin again"
    )]
    Load { path: String, what: String },
}
