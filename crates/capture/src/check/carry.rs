//! Points of one view, looked for in another.

use super::pixels::Look;
use glam::DVec3;
use hingecast_geom::Camera;

/// How points fare in another view: on the object's silhouette; at the depth that is seen there;
/// all.
#[derive(Default)]
pub(super) struct Fate {
    pub on_object: usize,
    pub on_surface: usize,
    pub all: usize,
}

/// Looks where points of one view lie in another.
pub(super) fn carry(points: &[DVec3], look: &Look, camera: &Camera, scale: f64, tolerance: f64, fate: &mut Fate) {
    for &x in points {
        let (uv, z) = camera.project(x);
        fate.all += 1;
        let Some(i) = look.pixel(uv).filter(|_| z > 0.0) else { continue };
        let seen = f64::from(look.depth[i]) * scale;
        // Without masks everything is object: then only depth can agree.
        let hit = if look.has_mask { look.object[i] == 1 } else { seen > 0.0 && (seen - z).abs() < 0.1 * z };
        fate.on_object += usize::from(hit);
        fate.on_surface += usize::from(look.object[i] == 1 && seen > 0.0 && (seen - z).abs() < tolerance);
    }
}
