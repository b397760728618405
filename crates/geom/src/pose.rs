//! Rigid transforms in f64: unit quaternion and translation.

use glam::{DMat3, DMat4, DQuat, DVec3};
use serde::{Deserialize, Serialize};

/// A rigid transform `a_from_b`: x_a = rot * x_b + trans. Translation in metres (scene units).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Rotation, unit length.
    pub rot: DQuat,
    /// Translation, metres or scene units: where the origin of `b` lies in `a`.
    pub trans: DVec3,
}

impl Default for Pose {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl Pose {
    /// Moves nothing.
    pub const IDENTITY: Self = Self { rot: DQuat::IDENTITY, trans: DVec3::ZERO };

    /// From a unit quaternion and a translation.
    pub fn new(rot: DQuat, trans: DVec3) -> Self {
        Self { rot, trans }
    }

    /// A translation without rotation.
    pub fn from_trans(trans: DVec3) -> Self {
        Self { rot: DQuat::IDENTITY, trans }
    }

    /// From a rotation matrix that is already orthonormal, and a translation.
    pub fn from_mat3_trans(rot: DMat3, trans: DVec3) -> Self {
        Self { rot: DQuat::from_mat3(&rot).normalize(), trans }
    }

    /// The rigid part of a 4x4 matrix; the caller has checked that it is rigid (see
    /// [`rigidity_error`]).
    pub fn from_mat4(m: &DMat4) -> Self {
        Self::from_mat3_trans(DMat3::from_mat4(*m), m.w_axis.truncate())
    }

    /// The 4x4 matrix of the same transform, for column vectors.
    pub fn to_mat4(self) -> DMat4 {
        DMat4::from_rotation_translation(self.rot, self.trans)
    }

    /// The rotation as a matrix.
    pub fn mat3(&self) -> DMat3 {
        DMat3::from_quat(self.rot)
    }

    /// `b_from_a` of an `a_from_b`.
    pub fn inverse(&self) -> Self {
        let rot = self.rot.conjugate();
        Self { rot, trans: -(rot * self.trans) }
    }

    /// Transforms a point.
    pub fn apply(&self, x: DVec3) -> DVec3 {
        self.rot * x + self.trans
    }

    /// Rotates a direction.
    pub fn rotate(&self, v: DVec3) -> DVec3 {
        self.rot * v
    }

    /// Geodesic rotation angle, radians in [0, pi].
    pub fn angle(&self) -> f64 {
        rotation_vector(self.rot).length()
    }
}

impl std::ops::Mul for Pose {
    type Output = Pose;
    /// `a_from_b * b_from_c = a_from_c`
    fn mul(self, rhs: Pose) -> Pose {
        Pose { rot: (self.rot * rhs.rot).normalize(), trans: self.rot * rhs.trans + self.trans }
    }
}

/// Rotation vector (axis times angle, angle in [0, pi]) of a unit quaternion.
pub fn rotation_vector(q: DQuat) -> DVec3 {
    let q = if q.w < 0.0 { -q } else { q };
    let v = DVec3::new(q.x, q.y, q.z);
    let s = v.length();
    if s < 1e-12 { v * 2.0 } else { v * (2.0 * s.atan2(q.w) / s) }
}

/// Quaternion of a rotation vector (exponential map).
pub fn quat_from_rotation_vector(w: DVec3) -> DQuat {
    let angle = w.length();
    if angle < 1e-15 { DQuat::IDENTITY } else { DQuat::from_axis_angle(w / angle, angle) }
}

/// Largest entry of |R'R - 1| and of the last row's deviation from (0,0,0,1): 0 for a rigid matrix.
/// A reflection (determinant -1) counts as 2, non-finite entries as infinity.
pub fn rigidity_error(m: &DMat4) -> f64 {
    if !m.is_finite() {
        return f64::INFINITY;
    }
    let r = DMat3::from_mat4(*m);
    let e = r.transpose() * r - DMat3::IDENTITY;
    let mut worst = e.to_cols_array().iter().fold(0.0f64, |a, x| a.max(x.abs()));
    if r.determinant() < 0.0 {
        worst = worst.max(2.0);
    }
    let last = m.row(3);
    worst.max(last.x.abs()).max(last.y.abs()).max(last.z.abs()).max((last.w - 1.0).abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverse_undoes() {
        let p = Pose::new(quat_from_rotation_vector(DVec3::new(0.3, -1.0, 0.5)), DVec3::new(1.0, 2.0, 3.0));
        let x = DVec3::new(0.1, 0.2, -0.7);
        assert!((p.inverse().apply(p.apply(x)) - x).length() < 1e-14);
        assert!(((p * p.inverse()).trans).length() < 1e-14);
    }

    #[test]
    fn rotation_vector_round_trips() {
        for w in [DVec3::new(0.1, 0.2, 0.3), DVec3::new(-2.0, 1.0, 0.4), DVec3::ZERO, DVec3::new(1e-9, 0.0, 0.0)] {
            assert!((rotation_vector(quat_from_rotation_vector(w)) - w).length() < 1e-12);
        }
    }

    #[test]
    fn rigidity_finds_scale_and_mirror() {
        assert!(rigidity_error(&DMat4::IDENTITY) < 1e-15);
        assert!(rigidity_error(&DMat4::from_scale(DVec3::splat(1.1))) > 0.1);
        assert!(rigidity_error(&DMat4::from_scale(DVec3::new(1.0, 1.0, -1.0))) >= 2.0);
    }
}
