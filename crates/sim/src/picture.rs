//! Pictures without a graphics driver: one ray a pixel against the collision shapes, shaded by one
//! lamp and the sky.
//!
//! Enough to see what an arm did, on every machine alike, and it needs no window system, GPU or GL
//! library.

use crate::env::Env;
use glam::DVec3;

/// Where a picture is taken from and what its middle shows; world frame, metres.
#[derive(Clone, Copy, Debug)]
pub struct View {
    eye: DVec3,
    middle: DVec3,
    /// Half the picture's height at distance 1.
    half_height: f64,
}

/// From the side: the hand comes from one end, the object faces it.
pub const SIDE: View =
    View { eye: DVec3::new(-0.1, -1.05, 1.4), middle: DVec3::new(-0.03, 0.0, 0.95), half_height: 0.36 };
/// From the far end of the table, near the object: how the hand stands to it across the arm, which
/// the side does not show.
pub const FRONT: View = View { eye: DVec3::new(0.8, 0.0, 1.2), middle: DVec3::new(0.03, 0.0, 0.95), half_height: 0.26 };

const LAMP: DVec3 = DVec3::new(0.35, -0.5, 0.79);
const SKY: [f64; 3] = [0.93, 0.95, 0.97];

/// RGB, row by row from the top.
pub fn take(env: &mut Env, view: &View, width: usize, height: usize) -> Vec<u8> {
    let ahead = (view.middle - view.eye).normalize();
    let right = ahead.cross(DVec3::Z).normalize();
    let up = right.cross(ahead);
    let colors: Vec<[f64; 3]> = (0..env.scene.model.ffi().ngeom as usize).map(|g| color(env, g)).collect();
    let part = env.scene.ids.part.clone();
    let data = env.data_mut();
    let mut out = Vec::with_capacity(3 * width * height);
    for row in 0..height {
        for column in 0..width {
            let pixel = |k: usize, n: usize| (2.0 * (k as f64 + 0.5) - n as f64) / height as f64;
            let (x, y) = (pixel(column, width), -pixel(row, height));
            let ray = (ahead + view.half_height * (x * right + y * up)).normalize();
            let mut normal = [0.0; 3];
            let (geom, _) = data.ray(&view.eye.to_array(), &ray.to_array(), None, true, None, Some(&mut normal));
            let rgb = geom.map_or(SKY, |g| {
                let facing = DVec3::from(normal) * -DVec3::from(normal).dot(ray).signum();
                let light = 0.45 + 0.55 * facing.dot(LAMP).max(0.0);
                // The moving part stands out.
                let tint = if part[g] { [1.0, 0.72, 0.55] } else { [1.0; 3] };
                std::array::from_fn(|k| colors[g][k] * tint[k] * light)
            });
            out.extend(rgb.map(|c| (255.0 * c.clamp(0.0, 1.0)).round() as u8));
        }
    }
    out
}

/// A geom's own colour, or its material's.
fn color(env: &Env, geom: usize) -> [f64; 3] {
    let model = &env.scene.model;
    let material = model.geom_matid()[geom];
    let rgba = match usize::try_from(material) {
        Ok(m) => model.mat_rgba()[m],
        Err(_) => model.geom_rgba()[geom],
    };
    [rgba[0], rgba[1], rgba[2]].map(f64::from)
}
