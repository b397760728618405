//! The surface that a pixel shows: the gaussian at which half of the light is gone.
//!
//! The mean depth sum(w z) / alpha lies between front and back at every depth edge; the median does
//! not mix (as in 2D Gaussian Splatting, Huang et al. 2024), but jumps from centre to centre of the
//! gaussians. So the depth here is the mean over the gaussians near the median. Scalar code: it
//! runs once per picture, not once per step.

use crate::bins::Entry;
use crate::pool::{Pool, Shards};
use crate::project::{MIN_LOG2_ALPHA, Splat};
use crate::raster::{MAX_ALPHA, MIN_TRANSMITTANCE, PLANES};
use crate::view::{TILE, View};

/// What a pixel shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Mean z of the gaussians near the median, scene units.
    pub depth: f32,
    /// The one of them that contributes most.
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

/// Gaussians whose z differs by less than this share from the median's are of the same surface.
const SAME_SURFACE: f32 = 0.01;

/// Contribution w of a gaussian to the pixel, and what transmittance it leaves.
#[inline]
fn blend(q: &Splat, x: f32, y: f32, transmittance: f32) -> Option<(f32, f32)> {
    let (dx, dy) = (x - q.mx, y - q.my);
    let e = q.a * dx * dx + q.b * dx * dy + q.c * dy * dy + q.l2o;
    let w = transmittance * e.exp2().min(MAX_ALPHA);
    (e >= MIN_LOG2_ALPHA).then_some((w, transmittance - w))
}

fn walk(list: &[Entry], splats: &[Splat], x: f32, y: f32) -> Option<Hit> {
    let mut transmittance = 1.0;
    let mut median = None;
    for entry in list {
        let q = &splats[entry.id as usize];
        let Some((_, left)) = blend(q, x, y, transmittance) else { continue };
        transmittance = left;
        median = Some(q.z);
        if transmittance < 0.5 {
            break;
        }
    }
    let median = median?;
    let mut transmittance = 1.0;
    let (mut sum, mut total, mut best) = (0.0, 0.0, (0.0, 0));
    for entry in list {
        let q = &splats[entry.id as usize];
        if q.z > median * (1.0 + SAME_SURFACE) || transmittance < MIN_TRANSMITTANCE {
            break; // sorted by z
        }
        let Some((w, left)) = blend(q, x, y, transmittance) else { continue };
        transmittance = left;
        if q.z >= median * (1.0 - SAME_SURFACE) {
            sum += w * q.z;
            total += w;
            if w > best.0 {
                best = (w, entry.id);
            }
        }
    }
    (total > 0.0).then(|| Hit { depth: sum / total, gaussian: best.1 })
}
