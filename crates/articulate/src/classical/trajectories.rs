//! Where gaussians are in every state.

/// Positions and rotations of `n` gaussians in every state.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trajectories {
    /// World positions, scene units. `[state][n]`
    pub means: Vec<Vec<[f32; 3]>>,
    /// Unit quaternions w x y z. `[state][n]`
    pub quats: Vec<Vec<[f32; 4]>>,
}
