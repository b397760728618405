//! Oriented points of measured surface, and rigid motions that carry them.

use glam::{Mat3, Vec3};
use hingecast_geom::Pose;
use hingecast_geom::icp::Surface;

/// A rigid motion in f32, quick to apply.
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    /// Rotation.
    pub rot: Mat3,
    /// Translation, scene units.
    pub trans: Vec3,
}

impl Motion {
    /// Where a point goes.
    #[inline]
    pub fn apply(&self, x: Vec3) -> Vec3 {
        self.rot * x + self.trans
    }
}

impl From<Pose> for Motion {
    fn from(p: Pose) -> Self {
        Self { rot: p.mat3().as_mat3(), trans: p.trans.as_vec3() }
    }
}

/// One oriented point of one state's surface, world frame.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// The state that measured it.
    pub state: usize,
    /// World frame, scene units.
    pub point: Vec3,
    /// Unit, towards the cameras.
    pub normal: Vec3,
}

impl Sample {
    /// Point `i` of what `state` measured.
    pub fn of(cloud: &Surface, state: usize, i: usize) -> Self {
        Self { state, point: cloud.points[i], normal: cloud.normals[i] }
    }

    /// The sample where a motion takes it.
    pub fn moved(&self, m: &Motion) -> Self {
        Self { state: self.state, point: m.apply(self.point), normal: m.rot * self.normal }
    }
}
