//! Pictures without a graphics driver: one ray a pixel against the collision shapes, shaded by one lamp and the sky.
//!
//! Enough to see what an arm did, on every machine alike, and it needs no window system, GPU or GL library.

use crate::env::Env;
use glam::DVec3;

/// Where the picture is taken from, and what its middle shows; world frame, metres. From the side: the hand comes from one end,
/// the object faces it.
const EYE: DVec3 = DVec3::new(-0.1, -1.05, 1.4);
const MIDDLE: DVec3 = DVec3::new(-0.03, 0.0, 0.95);
/// Half the picture's height at distance 1.
const HALF_HEIGHT: f64 = 0.36;
const LAMP: DVec3 = DVec3::new(0.35, -0.5, 0.79);
const SKY: [f64; 3] = [0.93, 0.95, 0.97];

/// RGB, row by row from the top.
pub fn take(env: &mut Env, width: usize, height: usize) -> Vec<u8> {
    let ahead = (MIDDLE - EYE).normalize();
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
            let ray = (ahead + HALF_HEIGHT * (x * right + y * up)).normalize();
            let mut normal = [0.0; 3];
            let (geom, _) = data.ray(&EYE.to_array(), &ray.to_array(), None, true, None, Some(&mut normal));
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
