//! Signed distance on a dense grid, and what becomes of space that nobody saw.

use crate::slabs::Slabs;
use glam::Vec3;
use rayon::prelude::*;

/// Voxels from the surface beyond which unseen space is nobody's shell.
const SHELL: usize = 4;

/// Distances are kept up to here, voxels.
pub const TRUNCATION: f32 = 3.0;
/// A field's value one voxel outside a surface: fields end at [`TRUNCATION`].
pub const ONE_VOXEL: f32 = 1.0 / TRUNCATION;

/// Signed distance on a dense grid, in units of the truncation: -1 inside .. +1 outside.
pub struct Field {
    /// Centre of voxel (0, 0, 0) in the canonical world frame, scene units.
    pub origin: Vec3,
    /// Edge of a voxel, scene units.
    pub voxel: f32,
    /// Voxels along x, y and z.
    pub dims: [usize; 3],
    /// The distances, x fastest. (z, y, x)
    pub values: Vec<f32>,
    /// True where a ray or a surface said something.
    pub known: Vec<bool>,
    /// True where views agree on a surface in the voxel.
    pub firm: Vec<bool>,
}

impl Field {
    /// All known to be empty.
    pub fn empty(origin: Vec3, voxel: f32, dims: [usize; 3]) -> Self {
        let n = dims.iter().product();
        Self { origin, voxel, dims, values: vec![1.0; n], known: vec![true; n], firm: vec![false; n] }
    }

    /// Decides about what nobody saw. `taken(x, deep)` says that canonical point `x` is another
    /// part's room: space that no ray reached is then not this part's; `deep`: it is far from all
    /// seen surface of this part. With `enclosed`, unreached space is solid only where the part's
    /// own surface encloses it; without (the root, whose underside no camera sees) everywhere.
    /// Nothing is solid beyond all surface that was seen.
    pub fn close(&mut self, taken: &(dyn Fn(Vec3, bool) -> bool + Sync), enclosed: bool) {
        self.open_beyond_seen();
        if enclosed {
            self.open_unreached();
        }
        let shell = self.shell();
        let open: Vec<usize> = (0..self.values.len())
            .into_par_iter()
            .filter(|&i| !self.known[i] && self.values[i] < 0.0 && taken(self.place(i), !shell[i]))
            .collect();
        open.into_iter().for_each(|i| self.values[i] = 1.0);
    }

    /// Where voxel `i` is.
    pub fn place(&self, i: usize) -> Vec3 {
        let [nx, ny, _] = self.dims;
        self.origin + Vec3::new((i % nx) as f32, (i / nx % ny) as f32, (i / (nx * ny)) as f32) * self.voxel
    }

    /// What all solid voxels lie within.
    pub fn hull(&self) -> Slabs {
        Slabs::around((0..self.values.len()).filter(|&i| self.values[i] < 0.0).map(|i| self.place(i)))
    }

    fn seen_solid(&self, i: usize) -> bool {
        self.known[i] && self.values[i] < 0.0
    }

    /// Empties what lies beyond all surface that was seen: below the walls of a cabinet whose
    /// underside nobody saw there is no cabinet, and a blade seen from above is not thicker than
    /// its rim.
    fn open_beyond_seen(&mut self) {
        let surface = |i: &usize| self.known[*i] && (-ONE_VOXEL..0.0).contains(&self.values[*i]);
        let seen = Slabs::around((0..self.values.len()).filter(surface).map(|i| self.place(i)));
        let beyond: Vec<usize> = (0..self.values.len())
            .into_par_iter()
            .filter(|&i| self.values[i] < 0.0 && !seen.hold(self.place(i)))
            .collect();
        beyond.into_iter().for_each(|i| self.values[i] = 1.0);
    }

    /// Whether a voxel is within [`SHELL`] voxels (along the axes) of solid that a ray reached.
    fn shell(&self) -> Vec<bool> {
        let mut near: Vec<bool> = (0..self.values.len()).map(|i| self.seen_solid(i)).collect();
        let [nx, ny, nz] = self.dims;
        for (n, stride) in [(nx, 1), (ny, nx), (nz, nx * ny)] {
            let from = near.clone();
            near.par_iter_mut().enumerate().for_each(|(i, near)| {
                let at = i / stride % n;
                let (back, forth) = (at.min(SHELL), (n - 1 - at).min(SHELL));
                *near = (i - back * stride..=i + forth * stride).step_by(stride).any(|j| from[j]);
            });
        }
        near
    }

    /// Empties unknown space that connects to the grid's border without crossing the surface.
    fn open_unreached(&mut self) {
        let [nx, ny, nz] = self.dims;
        let passable = |f: &Field, i: usize| !f.known[i] || f.values[i] >= 0.0;
        let mut seen = vec![false; self.values.len()];
        // The border is empty all around, so one corner reaches all of it.
        let mut stack = vec![0usize];
        seen[0] = true;
        while let Some(i) = stack.pop() {
            if !self.known[i] {
                self.values[i] = 1.0;
            }
            let (x, y, z) = (i % nx, i / nx % ny, i / (nx * ny));
            let mut visit = |ok: bool, j: usize| {
                if ok && !seen[j] && passable(self, j) {
                    seen[j] = true;
                    stack.push(j);
                }
            };
            visit(x > 0, i.wrapping_sub(1));
            visit(x + 1 < nx, i + 1);
            visit(y > 0, i.wrapping_sub(nx));
            visit(y + 1 < ny, i + nx);
            visit(z > 0, i.wrapping_sub(nx * ny));
            visit(z + 1 < nz, i + nx * ny);
        }
    }

    /// Where voxel (x, y, z) stands in `values`.
    pub fn index(&self, x: usize, y: usize, z: usize) -> usize {
        (z * self.dims[1] + y) * self.dims[0] + x
    }

    /// Value at the voxel nearest to `x`; outside the grid is empty.
    pub fn at(&self, x: Vec3) -> f32 {
        let p = (x - self.origin) / self.voxel + 0.5;
        let inside = |v: f32, n: usize| v >= 0.0 && v < n as f32;
        if inside(p.x, self.dims[0]) && inside(p.y, self.dims[1]) && inside(p.z, self.dims[2]) {
            self.values[self.index(p.x as usize, p.y as usize, p.z as usize)]
        } else {
            1.0
        }
    }
}
