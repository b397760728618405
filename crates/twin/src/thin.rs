//! Sheets and bars thinner than a voxel: front and back, averaged, leave nothing negative, and
//! pixels beside a bar look past it. What many pixels saw all the same is made solid again.

use crate::field::Field;
use crate::fuse::{BLOCK, COVER_UNIT, PartVolume};
use glam::Vec3;
use std::collections::BTreeSet;
use std::sync::atomic::Ordering;

/// A sheet is nowhere deeper than this, where it is not lost altogether.
const SHEET: f32 = 0.1;
/// Surface pixels that a voxel needs.
const HITS: u32 = 4;
/// Kept when the average distance to the surface is below three quarters of a voxel ...
const VALUE: f32 = 0.25;
/// ... or when the pixels cover this share of the voxel's face in the mean over all views, and
/// together with the best of the six beside it (a bar seldom lies in the middle of its voxels) that
/// share.
const COVER: f32 = 0.2;
const COVER_OF_TWO: f32 = 0.3;

impl PartVolume {
    /// Notes in `field` which voxels hold surface for sure, and makes those of thin things solid
    /// that the average has lost.
    pub(crate) fn keep_thin(&self, field: &mut Field) {
        let mut cover = vec![0.0f32; field.values.len()];
        let mut touched = Vec::new();
        for block in &self.blocks {
            for i in (0..BLOCK).filter(|&i| block.weight[i] > 0.0) {
                let at = self.index(field.dims, &block.key, i);
                cover[at] = block.cover[i].load(Ordering::Relaxed) as f32 / COVER_UNIT / block.weight[i];
                if block.hits[i].load(Ordering::Relaxed) >= HITS {
                    touched.push(at);
                }
            }
        }
        let (mut lost, mut beside_solid) = (Vec::new(), Vec::new());
        for at in touched {
            let best = field.beside(at).map(|j| cover[j]).fold(0.0, f32::max);
            field.firm[at] = cover[at] >= COVER && cover[at] + best >= COVER_OF_TWO;
            if field.values[at] >= 0.0 && (field.firm[at] || field.values[at] < VALUE) {
                let solid = field.around(at).any(|j| field.values[j] < -SHEET);
                if solid { beside_solid.push(at) } else { lost.push(at) }
            }
        }
        // Where a bar meets its post, what lies between them is the bar's.
        let thin: BTreeSet<usize> = lost.iter().copied().collect();
        lost.extend(beside_solid.into_iter().filter(|&i| field.around(i).any(|j| thin.contains(&j))));
        let depth = |i: usize| {
            let outside: Vec<f32> = field.beside(i).map(|j| field.values[j]).filter(|v| *v > 0.0).collect();
            // The surface comes out a third of a voxel from the voxel's middle.
            -0.5 * outside.iter().sum::<f32>() / outside.len().max(1) as f32
        };
        let depths: Vec<f32> = lost.iter().map(|&i| depth(i).min(-1e-3)).collect();
        lost.iter().zip(depths).for_each(|(&i, depth)| field.values[i] = depth);
    }
}

impl Field {
    /// The six voxels that share a face with voxel `i`, which is not on the border.
    fn beside(&self, i: usize) -> impl Iterator<Item = usize> + use<> {
        let row = self.dims[0];
        [1, row, row * self.dims[1]].into_iter().flat_map(move |step| [i - step, i + step])
    }

    /// The voxels within one of `i` along each axis, itself included; `i` is not on the border.
    fn around(&self, i: usize) -> impl Iterator<Item = usize> + use<> {
        let (row, slab) = (self.dims[0], self.dims[0] * self.dims[1]);
        let first = i - slab - row - 1;
        (0..27).map(move |k| first + k % 3 + k / 3 % 3 * row + k / 9 * slab)
    }

    /// Whether views agree on a surface in one of the eight voxels around `x`.
    pub fn firm_near(&self, x: Vec3) -> bool {
        let p = ((x - self.origin) / self.voxel).floor();
        let n = Vec3::from(self.dims.map(|n| n as f32));
        if self.firm.is_empty() || p.cmplt(Vec3::ZERO).any() || (p + 1.0).cmpge(n).any() {
            return false;
        }
        let at = |k: usize| self.index(p.x as usize + k % 2, p.y as usize + k / 2 % 2, p.z as usize + k / 4);
        (0..8).any(|k| self.firm[at(k)])
    }
}
