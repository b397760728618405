//! What each state believes about the parts of its surface.

use crate::observe::lattice::Lattice;
use glam::Vec3;
use hingecast_geom::icp::Surface;

/// One state's opinion which part the surface in a cell belongs to.
pub struct Beliefs {
    lattice: Lattice,
    n_parts: usize,
    /// Cell of the lattice -> row of `rows`; u32::MAX: no surface near.
    row_of: Vec<u32>,
    /// Sum over the samples near a cell. `[row][part]`
    rows: Vec<f32>,
    /// Their number. `[row]`
    counts: Vec<f32>,
}

impl Beliefs {
    /// `costs`: `[point][part]`.
    pub fn new(lattice: &Lattice, cloud: &Surface, costs: &[f32], n_parts: usize) -> Self {
        let (mut row_of, mut rows, mut counts) = (vec![u32::MAX; lattice.len()], Vec::new(), Vec::new());
        let mut own = vec![0.0; n_parts];
        for (x, costs) in cloud.points.iter().zip(costs.chunks_exact(n_parts)) {
            let least = costs.iter().copied().fold(f32::INFINITY, f32::min);
            own.iter_mut().zip(costs).for_each(|(b, c)| *b = (least - c).exp());
            let sum: f32 = own.iter().sum();
            lattice.around(*x, &mut |cell| {
                if row_of[cell] == u32::MAX {
                    row_of[cell] = counts.len() as u32;
                    counts.push(0.0);
                    rows.resize(rows.len() + n_parts, 0.0);
                }
                let row = row_of[cell] as usize;
                counts[row] += 1.0;
                for (slot, b) in rows[row * n_parts..].iter_mut().zip(&own) {
                    *slot += b / sum;
                }
            });
        }
        Self { lattice: *lattice, n_parts, row_of, rows, counts }
    }

    /// The belief that the surface at a place is the part's, 0 where there is none.
    pub fn at(&self, x: Vec3, part: usize) -> f32 {
        let row = self.lattice.index(x).map_or(u32::MAX, |cell| self.row_of[cell]);
        if row == u32::MAX { 0.0 } else { self.rows[row as usize * self.n_parts + part] / self.counts[row as usize] }
    }
}
