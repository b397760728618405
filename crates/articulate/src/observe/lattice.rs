//! The grid that all states share.

use glam::{IVec3, Vec3};

/// Grid that all states share.
/// Cubic cells of one size.
#[derive(Clone, Copy, Debug)]
pub struct Lattice {
    /// Lowest corner, world frame.
    pub lo: Vec3,
    /// Edge of a cell, scene units.
    pub voxel: f32,
    /// Cells along x, y, z.
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

    /// Number of cells.
    pub fn len(&self) -> usize {
        (self.size.x * self.size.y * self.size.z) as usize
    }

    /// Whether there is no cell.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The cell that holds `x`, which may be outside.
    pub fn cell(&self, x: Vec3) -> IVec3 {
        ((x - self.lo) * self.per_voxel).floor().as_ivec3()
    }

    /// Index of a cell; `None` outside.
    pub fn index_of(&self, c: IVec3) -> Option<usize> {
        let inside = c.cmpge(IVec3::ZERO).all() && c.cmplt(self.size).all();
        inside.then(|| ((c.z * self.size.y + c.y) * self.size.x + c.x) as usize)
    }

    /// Index of the cell that holds `x`. Asked hundreds of millions of times, so it rounds by
    /// cutting off decimals: what is inside is not negative.
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

    /// The cell of an index.
    pub fn coords(&self, index: usize) -> IVec3 {
        let (i, size) = (index as i32, self.size);
        IVec3::new(i % size.x, i / size.x % size.y, i / (size.x * size.y))
    }

    /// The middle of a cell, world frame.
    pub fn centre(&self, c: IVec3) -> Vec3 {
        self.lo + (c.as_vec3() + 0.5) * self.voxel
    }
}
