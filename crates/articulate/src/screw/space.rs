//! A state's space as a grid: where surface was measured (and which way it faces), what cameras saw empty, what nobody saw.

use super::cloud::{BACKGROUND, Cloud, DepthView, OBJECT};
use glam::{IVec3, Vec3};
use rayon::prelude::*;

/// Grid that all states share.
#[derive(Clone, Copy, Debug)]
pub struct Lattice {
    pub lo: Vec3,
    pub voxel: f32,
    pub size: IVec3,
    /// 1 / voxel.
    per_voxel: f32,
}

impl Lattice {
    /// Covers `lo..hi` with a margin of 3 voxels; `cells` along the longest side.
    pub fn new(lo: Vec3, hi: Vec3, cells: usize) -> Self {
        let voxel = (hi - lo).max_element() / cells as f32;
        let size = ((hi - lo) / voxel).ceil().as_ivec3() + IVec3::splat(7);
        Self { lo: lo - Vec3::splat(3.0 * voxel), voxel, size, per_voxel: 1.0 / voxel }
    }

    pub fn len(&self) -> usize {
        (self.size.x * self.size.y * self.size.z) as usize
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    fn cell(&self, x: Vec3) -> IVec3 {
        ((x - self.lo) * self.per_voxel).floor().as_ivec3()
    }

    fn index_of(&self, c: IVec3) -> Option<usize> {
        let inside = c.cmpge(IVec3::ZERO).all() && c.cmplt(self.size).all();
        inside.then(|| ((c.z * self.size.y + c.y) * self.size.x + c.x) as usize)
    }

    /// Index of the cell that holds `x`. Asked hundreds of millions of times, so it rounds by cutting off decimals: what is inside
    /// is not negative.
    #[inline]
    pub fn index(&self, x: Vec3) -> Option<usize> {
        let t = (x - self.lo) * self.per_voxel;
        let inside = t.cmpge(Vec3::ZERO).all() && t.cmplt(self.size.as_vec3()).all();
        let c = t.as_ivec3();
        inside.then(|| ((c.z * self.size.y + c.y) * self.size.x + c.x) as usize)
    }

    /// Calls `visit` with the index of the cell that holds `x` and of the 26 around it.
    pub fn around(&self, x: Vec3, visit: &mut dyn FnMut(usize)) {
        let c = self.cell(x);
        for k in 0..27 {
            if let Some(i) = self.index_of(c + IVec3::new(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1)) {
                visit(i);
            }
        }
    }

    fn centre(&self, c: IVec3) -> Vec3 {
        self.lo + (c.as_vec3() + 0.5) * self.voxel
    }
}

/// What a state says about a place, asked with the normal that a surface there would have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    /// A surface that faces the same way was measured here, and no known part explains it.
    Surface,
    /// The same, but a known part could explain it: nothing speaks against that.
    Possible,
    /// The same, but a known part explains it.
    Taken,
    /// Cameras looked through this place.
    Free,
    /// Nobody saw, or another surface is here.
    Silent,
}

/// One state's space.
pub struct Space {
    pub lattice: Lattice,
    /// Bits 0..26: facings (see [`facing_bit`]) of surface within a voxel or so; [`FREE`].
    pub cells: Vec<u32>,
}

pub const FREE: u32 = 1 << 27;
/// A surface cell that a known part explains.
pub const TAKEN: u32 = 1 << 28;
/// A surface cell that a known part could explain: nothing speaks against it, but nobody saw it elsewhere.
pub const POSSIBLE: u32 = 1 << 29;

/// The bit of the 26 directions of a cube's faces, edges and corners that is nearest to `n`.
#[inline]
pub fn facing_bit(n: Vec3) -> u32 {
    let t = |v: f32| if v > 0.38 { 2u32 } else { u32::from(v >= -0.38) };
    let code = t(n.x) + 3 * t(n.y) + 9 * t(n.z);
    // The middle code (13) never occurs for a unit vector.
    1 << code
}

/// Facing bits that a surface with normal `n` agrees with: within 50 degrees.
fn facing_mask(n: Vec3) -> u32 {
    let mut mask = 0;
    for code in (0..27i32).filter(|c| *c != 13) {
        let d = Vec3::new((code % 3 - 1) as f32, (code / 3 % 3 - 1) as f32, (code / 9 - 1) as f32).normalize();
        if d.dot(n) > 0.64 {
            mask |= 1 << code;
        }
    }
    mask
}

impl Space {
    /// `cloud` marks surface within `reach` voxels of its samples; `views` carve free space.
    pub fn new(lattice: Lattice, cloud: &Cloud, views: &[DepthView], reach: f32) -> Self {
        let mut cells = vec![0u32; lattice.len()];
        let radius = reach.ceil() as i32;
        // Cells that are too near to a surface to be called free.
        let mut near = vec![false; lattice.len()];
        for (x, n) in cloud.points.iter().zip(&cloud.normals) {
            let (c, mask) = (lattice.cell(*x), facing_mask(*n));
            for dz in -radius..=radius {
                for dy in -radius..=radius {
                    for dx in -radius..=radius {
                        let at = c + IVec3::new(dx, dy, dz);
                        let Some(i) = lattice.index_of(at) else { continue };
                        near[i] = true;
                        if lattice.centre(at).distance(*x) < reach * lattice.voxel {
                            cells[i] |= mask;
                        }
                    }
                }
            }
        }
        let carvers: Vec<Carver> = views.par_iter().map(|v| Carver::new(v, 0.5 * lattice.voxel)).collect();
        let needed = ((0.06 * views.len() as f32).round() as u32).max(1);
        let row = lattice.size.x as usize;
        cells.par_chunks_mut(row).enumerate().for_each(|(k, cells)| {
            let (y, z) = (k as i32 % lattice.size.y, k as i32 / lattice.size.y);
            let mut votes = vec![0u32; row];
            for carver in &carvers {
                carver.vote(&lattice, y, z, &mut votes);
            }
            for (x, cell) in cells.iter_mut().enumerate() {
                if votes[x] >= needed && !near[k * row + x] {
                    *cell |= FREE;
                }
            }
        });
        Self { lattice, cells }
    }

    /// Marks the cells around these points as explained and as possibly explained, and unmarks all others.
    pub fn mark(&mut self, taken: &[Vec3], possible: &[Vec3]) {
        self.cells.iter_mut().for_each(|c| *c &= !(TAKEN | POSSIBLE));
        for (points, bit) in [(taken, TAKEN), (possible, POSSIBLE)] {
            for x in points {
                let cells = &mut self.cells;
                self.lattice.around(*x, &mut |i| cells[i] |= bit);
            }
        }
    }

    /// The raw bits at `x`; nothing is beyond the lattice.
    #[inline]
    pub fn bits(&self, x: Vec3) -> u32 {
        self.lattice.index(x).map_or(FREE, |i| self.cells[i])
    }

    #[inline]
    pub fn ask(&self, x: Vec3, n: Vec3) -> Answer {
        // Beyond the lattice no state has anything.
        let Some(i) = self.lattice.index(x) else { return Answer::Free };
        let cell = self.cells[i];
        if cell & facing_bit(n) != 0 {
            match cell & (TAKEN | POSSIBLE) {
                0 => Answer::Surface,
                POSSIBLE => Answer::Possible,
                _ => Answer::Taken,
            }
        } else if cell & FREE != 0 {
            Answer::Free
        } else {
            Answer::Silent
        }
    }
}

/// A view made ready for carving: per pixel the z up to which its neighbourhood is empty.
struct Carver {
    empty_to: Vec<f32>,
    width: i32,
    height: i32,
    rot: glam::Mat3,
    trans: Vec3,
    f: [f32; 4],
}

impl Carver {
    fn new(view: &DepthView, margin: f32) -> Self {
        let (w, h) = (view.camera.width, view.camera.height);
        // Empty up to the depth; forever where only background is; not at all where nothing is known. A pixel with
        // depth outside the mask is a ragged mask's, not background.
        let own = |i: usize| match view.class[i] {
            OBJECT => view.depth[i] - margin,
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
    fn vote(&self, lattice: &Lattice, y: i32, z: i32, votes: &mut [u32]) {
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
