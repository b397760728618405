//! Which cells of the lattice a camera looks through.

use super::depth_view::{BACKGROUND, DepthView, OBJECT, OTHER};
use super::lattice::Lattice;
use glam::{IVec3, Vec3};

/// A view made ready for carving: per pixel the z up to which its neighbourhood is empty.
pub(super) struct Carver {
    empty_to: Vec<f32>,
    width: i32,
    height: i32,
    rot: glam::Mat3,
    trans: Vec3,
    f: [f32; 4],
}

impl Carver {
    pub(super) fn new(view: &DepthView, margin: f32) -> Self {
        let (w, h) = (view.camera.width, view.camera.height);
        // Empty up to the depth; forever where only background is; not at all where nothing is
        // known.
        let own = |i: usize| match view.class[i] {
            OBJECT | OTHER => view.depth[i] - margin,
            BACKGROUND => f32::INFINITY,
            _ => 0.0,
        };
        let rows: Vec<f32> = (0..w * h)
            .map(|i| {
                (i.saturating_sub(usize::from(i % w > 0))..=i + usize::from(i % w + 1 < w))
                    .map(own)
                    .fold(f32::INFINITY, f32::min)
            })
            .collect();
        let at = |i: usize, y: usize| rows[y * w + i % w];
        let empty_to = (0..w * h)
            .map(|i| {
                let y = i / w;
                at(i, y).min(at(i, y.saturating_sub(1))).min(at(i, (y + 1).min(h - 1)))
            })
            .collect();
        let c = &view.camera;
        Self {
            empty_to,
            width: w as i32,
            height: h as i32,
            rot: c.camera_from_world.mat3().as_mat3(),
            trans: c.camera_from_world.trans.as_vec3(),
            f: [c.fx as f32, c.fy as f32, c.cx as f32, c.cy as f32],
        }
    }

    /// One vote for every cell of the row (y, z) that this camera looks through.
    pub(super) fn vote(&self, lattice: &Lattice, y: i32, z: i32, votes: &mut [u32]) {
        let start = self.rot * lattice.centre(IVec3::new(0, y, z)) + self.trans;
        let step = self.rot.x_axis * lattice.voxel;
        for (x, vote) in votes.iter_mut().enumerate() {
            let p = start + step * x as f32;
            if p.z <= 0.0 {
                continue;
            }
            let (u, v) = (self.f[0] * p.x / p.z + self.f[2], self.f[1] * p.y / p.z + self.f[3]);
            let (u, v) = (u.floor() as i32, v.floor() as i32);
            if u >= 0 && v >= 0 && u < self.width && v < self.height {
                *vote += u32::from(p.z < self.empty_to[(v * self.width + u) as usize]);
            }
        }
    }
}
