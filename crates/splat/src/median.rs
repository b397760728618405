//! The surface that a pixel shows: the gaussian at which half of the light is gone.
//!
//! The mean depth sum(w z) / alpha lies between front and back at every depth edge; the median does not mix
//! (as in 2D Gaussian Splatting, Huang et al. 2024). Scalar code: it runs once per picture, not once per step.

use crate::bins::Entry;
use crate::pool::{Pool, Shards};
use crate::project::{MIN_LOG2_ALPHA, Splat};
use crate::raster::{MAX_ALPHA, PLANES};
use crate::view::{TILE, View};

/// What a pixel shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// z of the gaussian's centre, scene units.
    pub depth: f32,
    /// Index of the gaussian.
    pub gaussian: u32,
}

/// (h, w), `None` where alpha stays below one half. `image` is that of the last forward pass.
pub(crate) fn median(
    pool: &mut Pool,
    view: &View,
    splats: &[Splat],
    tiles: &[Vec<Entry>],
    image: &[f32],
) -> Vec<Option<Hit>> {
    let (w, h) = (view.width, view.height);
    let mut out = vec![None; w * h];
    let shards = Shards::new(&mut out);
    let transmittance = &image[(PLANES - 1) * view.plane_len()..];
    pool.run(view.tiles_x * view.tiles_y, |tile| {
        let (tile_x, tile_y) = (tile % view.tiles_x, tile / view.tiles_x);
        for y in tile_y * TILE..((tile_y + 1) * TILE).min(h) {
            let x0 = tile_x * TILE;
            let x1 = ((tile_x + 1) * TILE).min(w);
            // SAFETY: each tile's rows belong to this call alone.
            let row = unsafe { shards.slice(y * w + x0, x1 - x0) };
            for (x, hit) in (x0..x1).zip(row) {
                if transmittance[y * view.stride() + x] < 0.5 {
                    *hit = walk(&tiles[tile], splats, x as f32 + 0.5, y as f32 + 0.5);
                }
            }
        }
    });
    out
}

fn walk(list: &[Entry], splats: &[Splat], x: f32, y: f32) -> Option<Hit> {
    let mut transmittance = 1.0;
    let mut last = None;
    for entry in list {
        let q = &splats[entry.id as usize];
        let (dx, dy) = (x - q.mx, y - q.my);
        let e = q.a * dx * dx + q.b * dx * dy + q.c * dy * dy + q.l2o;
        if e < MIN_LOG2_ALPHA {
            continue;
        }
        transmittance *= 1.0 - e.exp2().min(MAX_ALPHA);
        last = Some(Hit { depth: q.z, gaussian: entry.id });
        if transmittance < 0.5 {
            break;
        }
    }
    last
}
