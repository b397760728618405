//! A state's space as a grid: where surface was measured (and which way it faces), what cameras saw
//! empty, what nobody saw.

use super::carver::Carver;
use super::cloud::Cloud;
use super::depth_view::DepthView;
use super::lattice::Lattice;
use glam::{IVec3, Vec3};
use rayon::prelude::*;

/// What a state says about a place, asked with the normal that a surface there would have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    /// A surface that faces the same way was measured here.
    Surface,
    /// Cameras looked through this place.
    Free,
    /// Nobody saw, or another surface is here.
    Silent,
}

/// One state's space.
pub struct Occupancy {
    /// The grid.
    pub lattice: Lattice,
    /// Bits 0..26: facings (see [`facing_bit`]) of surface within a voxel or so; [`FREE`].
    cells: Vec<u32>,
}

/// Cameras looked through this cell.
const FREE: u32 = 1 << 27;
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

impl Occupancy {
    /// `cloud` marks surface within `reach` voxels of its samples; `views` carve free space where at least
    /// `least` of them look through.
    pub fn new(lattice: Lattice, cloud: &Cloud, views: &[DepthView], reach: f32, least: u32) -> Self {
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
        let needed = ((0.06 * views.len() as f32).round() as u32).max(least);
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

    /// What the state says about a place, and the cell of a place inside the lattice.
    #[inline]
    pub fn ask_cell(&self, x: Vec3, n: Vec3) -> (Answer, usize) {
        // Beyond the lattice no state has anything.
        let Some(i) = self.lattice.index(x) else { return (Answer::Free, 0) };
        let cell = self.cells[i];
        if cell & facing_bit(n) != 0 {
            (Answer::Surface, i)
        } else if cell & FREE != 0 {
            (Answer::Free, i)
        } else {
            (Answer::Silent, i)
        }
    }

    /// What the state says about a place where a surface with normal `n` would be.
    #[inline]
    pub fn ask(&self, x: Vec3, n: Vec3) -> Answer {
        self.ask_cell(x, n).0
    }
}
