//! What URDF and MJCF are written with.

use glam::DVec3;

/// Three numbers as an attribute.
pub(crate) fn xyz(v: DVec3) -> String {
    format!("{:.9} {:.9} {:.9}", v.x, v.y, v.z)
}

/// Names come from users' folders: the five XML characters must not break the file.
pub(crate) fn escape(name: &str) -> String {
    name.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;").replace('\'', "&apos;")
}
