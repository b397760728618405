//! One view: supersampled colour; exact depth, mask and part at pixel centres.

use super::scene::{Hit, Scene};
use super::shade::Looks;
use crate::object::texture::srgb_from_linear;
use glam::{DVec2, Vec3, Vec3A};
use hingecast_geom::{Camera, Pose};

/// A rendered view, row-major. `depth` in scene units, 0 where nothing is hit; `part` is part id +
/// 1, 0 = background.
pub(crate) struct Picture {
    pub rgb: Vec<u8>,
    pub depth: Vec<f32>,
    pub part: Vec<u16>,
}

/// Colour samples per pixel side: everywhere, and in pixels that hold an edge. Print needs no finer
/// samples, its texture is filtered already.
const COARSE: usize = 2;
const FINE: usize = 4;
/// Two hits belong to one smooth surface when their normals are closer than this cosine (14
/// degrees) and their depths within this share.
const SMOOTH_COS: f32 = 0.97;
const SMOOTH_DEPTH: f32 = 0.02;

/// Origin and direction (camera z 1) of the ray through the centre of pixel (x, y).
pub(crate) fn centre_ray(camera: &Camera, x: usize, y: usize) -> (Vec3A, Vec3A) {
    let direction = camera.ray(DVec2::new(x as f64 + 0.5, y as f64 + 0.5));
    (Vec3A::from(camera.centre().as_vec3()), Vec3A::from(direction.as_vec3()))
}

/// Renders `scene`, whose parts stand at `poses`. `background` is linear light.
pub(crate) fn render(scene: &Scene, looks: &Looks, poses: &[Pose], camera: &Camera, background: Vec3) -> Picture {
    let (w, h) = (camera.width, camera.height);
    let world_from_camera = camera.camera_from_world.inverse();
    let origin = Vec3A::from(world_from_camera.trans.as_vec3());
    // Directions have camera z 1, so a hit's t is its depth. Affine in the pixel: base + x * dx + y * dy.
    let dx = Vec3A::from(world_from_camera.rotate(glam::DVec3::X / camera.fx).as_vec3());
    let dy = Vec3A::from(world_from_camera.rotate(glam::DVec3::Y / camera.fy).as_vec3());
    let base = Vec3A::from(camera.ray(DVec2::ZERO).as_vec3());
    let turns: Vec<glam::Quat> = poses.iter().map(|p| p.rot.as_quat()).collect();
    let pixel_angle = (1.0 / camera.fx) as f32;

    let cast = |x: f32, y: f32| -> (Option<Hit>, Vec3A) {
        let direction = base + dx * x + dy * y;
        (scene.cast(origin, direction, f32::INFINITY), direction)
    };
    // Colour of a pixel's side x side samples, and whether they see different surfaces.
    let mean = |x: usize, y: usize, side: usize| -> (Vec3, bool) {
        let (mut sum, mut edge) = (Vec3::ZERO, false);
        let mut first: Option<Option<Hit>> = None;
        for i in 0..side * side {
            let offset = |k: usize| (k as f32 + 0.5) / side as f32;
            let (hit, direction) = cast(x as f32 + offset(i % side), y as f32 + offset(i / side));
            sum += match &hit {
                Some(hit) => looks.shade(hit, direction, hit.t * pixel_angle / side as f32, turns[hit.part]),
                None => background,
            };
            edge |= match (first.get_or_insert(hit), &hit) {
                (Some(a), Some(b)) => !looks.alike(a, b) || !smooth(a, b),
                (None, None) => false,
                _ => true,
            };
        }
        (sum / (side * side) as f32, edge)
    };

    let mut out = Picture { rgb: vec![0; 3 * w * h], depth: vec![0.0; w * h], part: vec![0; w * h] };
    for y in 0..h {
        for x in 0..w {
            let i = y * w + x;
            if let (Some(hit), _) = cast(x as f32 + 0.5, y as f32 + 0.5) {
                out.depth[i] = hit.t;
                out.part[i] = hit.part as u16 + 1;
            }
            let (mut c, edge) = mean(x, y, COARSE);
            if edge {
                (c, _) = mean(x, y, FINE);
            }
            for k in 0..3 {
                out.rgb[3 * i + k] = (srgb_from_linear(c[k]).clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
            }
        }
    }
    out
}

fn smooth(a: &Hit, b: &Hit) -> bool {
    a.normal.dot(b.normal).abs() > SMOOTH_COS && (a.t - b.t).abs() < SMOOTH_DEPTH * a.t
}
