//! How a depth image looks around a pixel: edges and slopes.

use hingecast_geom::Camera;

/// A jump of more than this share of z is an edge.
const EDGE_JUMP: f32 = 0.03;
/// Steeper than this against the ray, sensors start to lose a surface; at the second slope they
/// have lost it. Tangents of 70 and 82 degrees.
const GRAZING: [f64; 2] = [2.75, 7.1];

/// Around one pixel.
pub(super) struct Shape {
    /// One of the four neighbours is far nearer or farther.
    pub edge: bool,
    /// The same, and no plane through this pixel explains it: a floor at a low angle has no edges.
    pub step: bool,
    /// Tangent of the angle between the surface's normal and the ray.
    pub steep: f64,
}

impl Shape {
    /// Of the pixel (x, y) of `depth`, which is known there.
    pub fn at(depth: &[f32], camera: &Camera, x: usize, y: usize) -> Self {
        let (w, h) = (camera.width, camera.height);
        let z = depth[y * w + x];
        let at = |dx: isize, dy: isize| {
            let (x, y) = (x as isize + dx, y as isize + dy);
            let inside = x >= 0 && y >= 0 && x < w as isize && y < h as isize;
            if inside { depth[y as usize * w + x as usize] } else { z }
        };
        let edge = [(-1, 0), (1, 0), (0, -1), (0, 1)].iter().any(|&(dx, dy)| (at(dx, dy) - z).abs() > EDGE_JUMP * z);
        // The smaller of the two one-sided differences: an edge on one side is not a slope.
        let slope = |a: f32, b: f32, focal: f64| f64::from((a - z).abs().min((b - z).abs())) * focal / f64::from(z);
        let (sx, sy) = (slope(at(-1, 0), at(1, 0), camera.fx), slope(at(0, -1), at(0, 1), camera.fy));
        // Along a row, 1 / z of a plane is linear. An unknown neighbour makes it infinite.
        let bend = |a: f32, b: f32| ((z / a + z / b) - 2.0).abs();
        let step = edge && bend(at(-1, 0), at(1, 0)).max(bend(at(0, -1), at(0, 1))) > EDGE_JUMP;
        Self { edge, step, steep: sx.hypot(sy) }
    }

    /// Chance that the surface is lost because it is seen at a grazing angle.
    pub fn grazing_loss(&self) -> f64 {
        ((self.steep - GRAZING[0]) / (GRAZING[1] - GRAZING[0])).clamp(0.0, 1.0)
    }
}
