//! What URDF and MJCF are written with.

use glam::{DQuat, DVec3};

/// Three numbers as an attribute.
pub(crate) fn xyz(v: DVec3) -> String {
    format!("{:.9} {:.9} {:.9}", v.x, v.y, v.z)
}

/// A rotation as MuJoCo takes it, w first.
pub(crate) fn wxyz(q: DQuat) -> String {
    format!("{:.9} {:.9} {:.9} {:.9}", q.w, q.x, q.y, q.z)
}

/// Names come from users' folders: the five XML characters must not break the file.
pub(crate) fn escape(name: &str) -> String {
    name.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;").replace('\'', "&apos;")
}
