//! The classical way (`--method track`): gaussians of several states, carried from one to the next,
//! grouped, and their axes fitted.
//!
//! ```text
//! track         gaussians of the first state carried from state to state (Dynamic 3D Gaussians)
//! physics       its rigidity, rotation and isometry losses
//! segment       gaussians grouped by how their pairwise distances change (cluster: k-means, HDBSCAN)
//! motion        one rigid motion per part and state: robust Kabsch, then ICP against the depth
//! joints        revolute or prismatic, axis through the points that the motion leaves in place (fixed_points)
//! ```
//! World frame and scene units throughout; state 0 is the canonical configuration.

pub mod cluster;
pub mod fixed_points;
pub mod joints;
pub mod motion;
pub mod neighbours;
pub mod physics;
pub mod segment;
pub mod track;
pub mod trajectories;
