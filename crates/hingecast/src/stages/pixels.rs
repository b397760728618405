//! The measured surface of a state: masked depth pixels as points with normals, world frame.

use glam::{DVec2, DVec3, Vec3};
use hingecast_capture::View;

/// Calls `emit(point, pixel index)` for every `stride`-th usable depth pixel of the object.
pub fn unproject(view: &View, stride: usize, emit: &mut dyn FnMut(DVec3, usize)) {
    if view.depth.is_empty() {
        return;
    }
    let world_from_camera = view.camera.camera_from_world.inverse();
    let c = &view.camera;
    for y in (stride / 2..c.height).step_by(stride) {
        for x in (stride / 2..c.width).step_by(stride) {
            let i = y * c.width + x;
            let z = view.depth[i] as f64;
            if view.mask[i] == 1 && view.usable[i] == 1 && z > 0.0 {
                let ray = DVec3::new((x as f64 + 0.5 - c.cx) / c.fx, (y as f64 + 0.5 - c.cy) / c.fy, 1.0);
                emit(world_from_camera.apply(ray * z), i);
            }
        }
    }
}

/// Normal at pixel `i` from its neighbours' depth, towards the camera; `None` at edges and grazing
/// angles.
pub fn normal(view: &View, i: usize) -> Option<Vec3> {
    let c = &view.camera;
    let (x, y) = (i % c.width, i / c.width);
    if x == 0 || y == 0 || x + 1 >= c.width || y + 1 >= c.height {
        return None;
    }
    let at = |x: usize, y: usize| {
        let j = y * c.width + x;
        let z = view.depth[j] as f64;
        (view.mask[j] == 1 && z > 0.0).then(|| c.unproject(DVec2::new(x as f64 + 0.5, y as f64 + 0.5), z))
    };
    let (l, r, u, d) = (at(x - 1, y)?, at(x + 1, y)?, at(x, y - 1)?, at(x, y + 1)?);
    let n = (r - l).cross(d - u).try_normalize()?;
    let to_camera = (c.centre() - (l + r) * 0.5).normalize();
    let n = if n.dot(to_camera) < 0.0 { -n } else { n };
    // A step of depth between neighbours makes a "surface" that nearly faces sideways.
    (n.dot(to_camera) > 0.25).then(|| n.as_vec3())
}
