//! Gaussians of several joint states -> parts, joints, a kinematic tree.
//!
//! The classical way (`--method track`), in the order of its files:
//!
//! ```text
//! track         gaussians of the first state carried from state to state (Dynamic 3D Gaussians)
//! physics       its rigidity, rotation and isometry losses
//! segment       gaussians grouped by how their pairwise distances change (cluster: k-means, HDBSCAN)
//! motion, icp   one rigid motion per part and state: robust Kabsch, then ICP against the depth
//! joints        revolute or prismatic, axis through the points that the motion leaves in place (fixed_points)
//! ```
//! World frame and scene units throughout; state 0 is the canonical configuration.

pub mod cluster;
pub mod fixed_points;
pub mod icp;
pub mod joints;
pub mod motion;
pub mod physics;
pub mod screw;
pub mod segment;
pub mod track;

/// Positions and rotations of `n` gaussians in every state.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trajectories {
    /// World positions. [state][n]
    pub means: Vec<Vec<[f32; 3]>>,
    /// Unit quaternions w x y z. [state][n]
    pub quats: Vec<Vec<[f32; 4]>>,
}

#[derive(Debug, thiserror::Error)]
pub enum ArticulateError {
    #[error("{what}\n  where: {place}\n  try: {hint}")]
    Input { what: String, place: String, hint: String },
    #[error(transparent)]
    Cancelled(#[from] hingecast_geom::Cancelled),
}
