//! How a joint's parameters move what hangs on it.
//!
//! Twists of a joint in its parent's frame, with motion T = T(q), axis a through c, and b square to
//! a: its value: the screw itself; its axis turned about b at c, or shifted along b: e - Ad_T e,
//! since the new motion is exp(e) T exp(-e).

use glam::DVec3;
use hingecast_geom::{KinematicTree, Pose};
use nalgebra::Vector6;

/// Angular and linear velocity of a rigid motion about the world's origin.
#[derive(Clone, Copy, Debug)]
pub struct Twist {
    w: DVec3,
    v: DVec3,
}

impl Twist {
    fn about(axis: DVec3, through: DVec3) -> Self {
        Self { w: axis, v: through.cross(axis) }
    }

    fn shift(direction: DVec3) -> Self {
        Self { w: DVec3::ZERO, v: direction }
    }

    /// The same twist seen from the frame that `pose` leads to.
    pub fn moved(&self, pose: &Pose) -> Self {
        let w = pose.rotate(self.w);
        Self { w, v: pose.rotate(self.v) + pose.trans.cross(w) }
    }

    fn minus(&self, o: &Self) -> Self {
        Self { w: self.w - o.w, v: self.v - o.v }
    }

    /// Linear velocity of the world's origin, then angular velocity.
    pub fn vector(&self) -> Vector6<f64> {
        let (v, w) = (self.v, self.w);
        Vector6::new(v.x, v.y, v.z, w.x, w.y, w.z)
    }

    /// Velocity of the point `x`.
    pub fn at(&self, x: DVec3) -> DVec3 {
        self.v + self.w.cross(x)
    }
}

/// How far a twist [`Twist::vector`] takes the point `x` along `n`: n . (v + w x X) as a row over
/// (v, w).
pub fn along(n: DVec3, x: DVec3) -> Vector6<f64> {
    let turn = x.cross(n);
    Vector6::new(n.x, n.y, n.z, turn.x, turn.y, turn.z)
}

/// Directions square to `a`.
pub fn square(a: DVec3) -> [DVec3; 2] {
    let b = a.any_orthonormal_vector();
    [b, a.cross(b)]
}

/// World twists at state s of joint j: axis tilts 2, pivot shifts 2, value.
pub fn twists(tree: &KinematicTree, j: usize, s: usize, poses: &[Pose]) -> Vec<Twist> {
    let joint = &tree.joints[j];
    let (axis, pivot) = (joint.screw.axis, joint.screw.pivot);
    let motion = joint.screw.motion(joint.values[s]);
    let parent = poses[joint.parent];
    let world = |e: Twist| e.minus(&e.moved(&motion)).moved(&parent);
    let [b1, b2] = square(axis);
    let value = if joint.screw.kind.turns() { Twist::about(axis, pivot) } else { Twist::shift(axis) };
    vec![
        world(Twist::about(b1, pivot)),
        world(Twist::about(b2, pivot)),
        world(Twist::shift(b1)),
        world(Twist::shift(b2)),
        value.moved(&parent),
    ]
}
