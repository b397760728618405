//! Labelled pieces of surface, and how near a point is to one.

use glam::Vec3;

/// A labelled piece of measured surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Labelled {
    /// Which state measured it.
    pub state: usize,
    /// World frame, scene units.
    pub point: Vec3,
    /// Index of its part in the tree.
    pub part: u8,
}

/// Square of the distance of two points, `gap` apart, that counts three times off the plane of one:
/// two blades lie closer together than their samples.
pub fn far_off_plane(gap: Vec3, normal: Vec3) -> f32 {
    gap.length_squared() + 8.0 * normal.dot(gap).powi(2)
}
