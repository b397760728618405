//! What one camera measured, and the planes that its depth lies on.
//!
//! Normals come from planes fitted to inverse depth: over a plane n . X = 1 in the camera's frame,
//! 1/z is affine in the ray's slopes u = x/z, v = y/z: 1/z = n . (u, v, 1). So a plane's normal is
//! exact where the depth is, whatever the slant. The window grows with the measured noise.

use super::robust::deviation;
use glam::Vec3;
use hingecast_geom::Camera;

/// Pixel classes of a [`DepthView`].
pub const BACKGROUND: u8 = 0;
/// The object, at a known depth.
pub const OBJECT: u8 = 1;
/// Something else at a known depth - floor, wall, what a ragged mask leaves out -: the camera looked
/// through everything before it.
pub const OTHER: u8 = 3;
/// Says nothing: a hand, a hole in the depth.
pub const UNKNOWN: u8 = 2;

/// What one camera measured. (h, w)
#[derive(Clone, Debug)]
pub struct DepthView {
    /// OpenCV camera; its pose is `camera_from_world`.
    pub camera: Camera,
    /// z, scene units; only read where `class` is [`OBJECT`] or [`OTHER`].
    pub depth: Vec<f32>,
    /// [`OBJECT`], [`OTHER`], [`BACKGROUND`] or [`UNKNOWN`] of every pixel.
    pub class: Vec<u8>,
}

/// Largest error of a normal's slope that a pixel's plane may have before its window grows.
const SLOPE_ERROR: f32 = 0.08;
/// A window that bends by this many pixels weighs half.
const BENT: f32 = 0.02;
/// Steeper views than this (cosine between normal and ray) measure little.
const GRAZING: f32 = 0.2;

impl DepthView {
    /// A view of the object alone: whatever has depth is the object, whatever has none (0) is
    /// background that the camera looked through. `depth`: z, scene units. (h, w)
    pub fn new(camera: Camera, depth: Vec<f32>) -> Self {
        let class = depth.iter().map(|z| if *z > 0.0 { OBJECT } else { BACKGROUND }).collect();
        Self { camera, depth, class }
    }

    /// Standard deviation of z over z, from second differences of inverse depth along the rows.
    pub fn noise(&self) -> f32 {
        let w = self.camera.width;
        let mut second: Vec<f32> = (0..self.depth.len())
            .skip(1)
            .step_by(7)
            .filter(|i| i % w > 0 && i % w + 1 < w && (i - 1..=i + 1).all(|j| self.class[j] == OBJECT))
            .map(|i| (1.0 - 0.5 * self.depth[i] * (1.0 / self.depth[i - 1] + 1.0 / self.depth[i + 1])).abs())
            .collect();
        if second.len() < 20 {
            return 0.0;
        }
        // Of the variance of a - (b + c)/2.
        deviation(&mut second) / 1.5f32.sqrt()
    }

    /// Every so many pixels along rows and columns give about `count` points of the object.
    pub fn stride_for(&self, count: usize) -> usize {
        let pixels = self.class.iter().filter(|c| **c == OBJECT).count();
        ((pixels as f64 / count as f64).sqrt().round() as usize).max(1)
    }

    /// Half the window that makes normals good enough at this noise, pixels.
    fn window(&self, noise: f32) -> usize {
        let noise = noise * self.camera.fx as f32;
        // Sum of dx^2 over the window.
        [(1, 6.0f32), (2, 50.0), (3, 196.0)]
            .into_iter()
            .find(|(_, sum)| noise / sum.sqrt() < SLOPE_ERROR)
            .map_or(4, |(r, _)| r)
    }

    /// Calls `emit(point, normal, weight)` in the world frame for every `stride`-th pixel with a
    /// plane. The weight is 1 where the window is one, and less where it bends over an edge.
    pub fn planes(&self, stride: usize, emit: &mut dyn FnMut(Vec3, Vec3, f32)) {
        let (w, h, c) = (self.camera.width, self.camera.height, &self.camera);
        let world_from_camera = c.camera_from_world.inverse();
        let (rot, trans) = (world_from_camera.mat3().as_mat3(), world_from_camera.trans);
        let noise = self.noise();
        let r = self.window(noise) as isize;
        let slope = |x: f64, centre: f64, f: f64| ((x + 0.5 - centre) / f) as f32;
        // Beyond this share of z a neighbour lies on another surface.
        let jump = (2.5 / c.fx as f32) * r as f32 + 4.0 * noise;
        for y in (stride / 2..h).step_by(stride) {
            for x in (stride / 2..w).step_by(stride) {
                let i = y * w + x;
                if self.class[i] != OBJECT {
                    continue;
                }
                let z = self.depth[i];
                // Least squares of z0/z - 1 = a du + b dv + e over the window.
                let (mut m, mut rhs, mut n) = ([0.0f32; 6], [0.0f32; 3], 0);
                let mut rows: [(f32, f32, f32); 81] = [(0.0, 0.0, 0.0); 81];
                for dy in -r..=r {
                    for dx in -r..=r {
                        let (xx, yy) = (x as isize + dx, y as isize + dy);
                        if xx < 0 || yy < 0 || xx >= w as isize || yy >= h as isize {
                            continue;
                        }
                        let j = yy as usize * w + xx as usize;
                        if self.class[j] != OBJECT || (self.depth[j] - z).abs() > jump * z {
                            continue;
                        }
                        let (du, dv, k) = (dx as f32, dy as f32, z / self.depth[j] - 1.0);
                        rows[n] = (du, dv, k);
                        n += 1;
                        for (s, v) in m.iter_mut().zip([du * du, du * dv, du, dv * dv, dv, 1.0]) {
                            *s += v;
                        }
                        for (s, v) in rhs.iter_mut().zip([du * k, dv * k, k]) {
                            *s += v;
                        }
                    }
                }
                if n < 6 {
                    continue;
                }
                let a = glam::Mat3::from_cols(
                    Vec3::new(m[0], m[1], m[2]),
                    Vec3::new(m[1], m[3], m[4]),
                    Vec3::new(m[2], m[4], m[5]),
                );
                if a.determinant() < 1e-3 * (n as f32).powi(3) {
                    continue;
                }
                let solved = a.inverse() * Vec3::from(rhs);
                let worst = rows[..n]
                    .iter()
                    .map(|(u, v, k)| (k - solved.x * u - solved.y * v - solved.z).abs())
                    .fold(0.0, f32::max);
                // A crease or a rim inside the window: no plane here.
                if worst > 0.6 / c.fx as f32 + 4.0 * noise {
                    continue;
                }
                let (u, v) = (slope(x as f64, c.cx, c.fx), slope(y as f64, c.cy, c.fy));
                let (nu, nv) = (solved.x * c.fx as f32, solved.y * c.fy as f32);
                // 1/z = nu u + nv v + nw, in units of 1/z0.
                let normal = Vec3::new(nu, nv, 1.0 + solved.z - nu * u - nv * v).normalize();
                let ray = Vec3::new(u, v, 1.0);
                let normal = if normal.dot(ray) > 0.0 { -normal } else { normal };
                if -normal.dot(ray.normalize()) < GRAZING {
                    continue;
                }
                let point = rot.as_dmat3() * (ray * (z / (1.0 + solved.z))).as_dvec3() + trans;
                let bent = worst / (BENT / c.fx as f32 + 4.0 * noise);
                emit(point.as_vec3(), rot * normal, 1.0 / (1.0 + bent * bent));
            }
        }
    }
}
