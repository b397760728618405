//! Where parts are in every state, and how they get from one state to another.

use crate::observe::sample::{Motion, Sample};
use hingecast_geom::{Joint, KinematicTree, Pose};

/// World from canonical of a part in every state.
pub fn poses_of(tree: &KinematicTree, part: usize, n_states: usize) -> Vec<Pose> {
    (0..n_states).map(|s| tree.poses_at(s)[part]).collect()
}

/// World at state `t` from world at state `a`, for something that moves with `poses` (world from
/// canonical). `[a][t]`
pub fn state_to_state(poses: &[Pose]) -> Vec<Vec<Motion>> {
    let inverse: Vec<Pose> = poses.iter().map(Pose::inverse).collect();
    inverse.iter().map(|i| poses.iter().map(|p| Motion::from(*p * *i)).collect()).collect()
}

/// World at state t from world at state a, for every part. `[part][a][t]`
pub fn motions_of(tree: &KinematicTree, n_states: usize) -> Vec<Vec<Vec<Motion>>> {
    (0..tree.parts.len()).map(|p| state_to_state(&poses_of(tree, p, n_states))).collect()
}

/// Samples of a joint's child in its parent's frame as of value 0. `parent_poses`: world from that
/// frame, per state.
pub fn in_parent_frame(joint: &Joint, members: &[Sample], parent_poses: &[Pose]) -> Vec<Sample> {
    let back = |s: &Sample| Motion::from((parent_poses[s.state] * joint.screw.motion(joint.values[s.state])).inverse());
    members.iter().map(|s| s.moved(&back(s))).collect()
}
