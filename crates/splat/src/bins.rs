//! Depth sort and binning: for every 16 x 16 tile the gaussians that touch it, nearest first, each
//! with one bit per 4 x 4 (or 4 x 2) pixel block that its alpha >= 1/255 ellipse reaches.

use crate::error::SplatError;
use crate::pool::Shards;
use crate::prefetch::prefetch;
use crate::project::{MIN_LOG2_ALPHA, NO_RECT, Splat};
use crate::simd::Lanes;
use crate::view::{TILE, View};

/// A slot is 64 bytes: 4 GiB. A fit at 512 x 512 with 100 000 gaussians needs 2^18.
const MOST_SLOTS: u32 = 1 << 26;

/// One gaussian in one tile.
#[derive(Clone, Copy, Default, Debug, PartialEq)]
pub(crate) struct Entry {
    pub id: u32,
    /// One bit per block of the tile.
    pub mask: u32,
    /// Where the backward pass puts this pair's gradient, so that the sum over tiles has a fixed
    /// order.
    pub slot: u32,
}

/// Visible gaussians by depth, and where their pair slots start.
#[derive(Default)]
pub(crate) struct Order {
    /// (depth bits, id), nearest first; equal depths by id.
    pub keys: Vec<(u32, u32)>,
    swap: Vec<(u32, u32)>,
    /// First pair slot of each gaussian; one more element than gaussians.
    pub slot_base: Vec<u32>,
}

/// Inclusive tile rectangle x0, x1, y0, y1.
#[inline(always)]
pub(crate) fn unpack_rect(rect: u32) -> [usize; 4] {
    [(rect & 255) as usize, (rect >> 8 & 255) as usize, (rect >> 16 & 255) as usize, (rect >> 24) as usize]
}

impl Order {
    /// Lists the visible gaussians, gives each one slot per tile of its rectangle, sorts by depth.
    ///
    /// # Errors
    /// More slots than memory: gaussians as large as the picture.
    pub fn build(&mut self, splats: &[Splat], rects: &[u32]) -> Result<(), SplatError> {
        self.keys.clear();
        self.slot_base.clear();
        let mut slots = 0u32;
        for (id, (splat, &rect)) in splats.iter().zip(rects).enumerate() {
            self.slot_base.push(slots);
            if rect != NO_RECT {
                let [x0, x1, y0, y1] = unpack_rect(rect);
                slots += ((x1 - x0 + 1) * (y1 - y0 + 1)) as u32;
                if slots > MOST_SLOTS {
                    return Err(SplatError::Range {
                        what: "number of (gaussian, tile) pairs",
                        value: slots.into(),
                        range: "0..=2^26: the gaussians have grown to the size of the picture; use smaller rates",
                    });
                }
                self.keys.push((splat.z.to_bits(), id as u32));
            }
        }
        self.slot_base.push(slots);
        self.radix_sort();
        Ok(())
    }

    pub fn slots(&self) -> usize {
        self.slot_base.last().copied().unwrap_or(0) as usize
    }

    /// Stable, three passes of 11 bits: positive floats sort like their bits.
    fn radix_sort(&mut self) {
        self.swap.resize(self.keys.len(), (0, 0));
        let mut counts = [[0u32; 2048]; 3];
        for &(key, _) in &self.keys {
            for (pass, count) in counts.iter_mut().enumerate() {
                count[(key >> (11 * pass) & 2047) as usize] += 1;
            }
        }
        for (pass, count) in counts.iter_mut().enumerate() {
            // All depths share these bits: nothing to do.
            if count.iter().any(|&c| c as usize == self.keys.len()) {
                continue;
            }
            let mut start = 0;
            for c in count.iter_mut() {
                (start, *c) = (start + *c, start);
            }
            for &key in &self.keys {
                let bucket = &mut count[(key.0 >> (11 * pass) & 2047) as usize];
                self.swap[*bucket as usize] = key;
                *bucket += 1;
            }
            std::mem::swap(&mut self.keys, &mut self.swap);
        }
    }
}

pub(crate) struct Args<'a> {
    pub view: &'a View,
    pub splats: &'a [Splat],
    pub rects: &'a [u32],
    pub order: &'a Order,
    pub tiles: Shards<'a, Vec<Entry>>,
    /// Tile rows are dealt to this many strips in turn.
    pub strips: usize,
}

/// Fills the lists of tile rows `strip`, `strip + strips`, ...
///
/// # Safety
/// The CPU has the features of `T`; each strip runs once.
#[inline(always)]
pub(crate) unsafe fn bin<T: Lanes>(args: &Args, strip: usize) {
    let (view, n) = (args.view, args.strips);
    for row in (strip..view.tiles_y).step_by(n) {
        for list in unsafe { args.tiles.slice(row * view.tiles_x, view.tiles_x) } {
            list.clear();
        }
    }
    let keys = &args.order.keys;
    for (k, &(_, id)) in keys.iter().enumerate() {
        if let Some(ahead) = keys.get(k + 8) {
            prefetch(&args.splats[ahead.1 as usize]);
        }
        let splat = &args.splats[id as usize];
        let [x0, x1, y0, y1] = unpack_rect(args.rects[id as usize]);
        let base = args.order.slot_base[id as usize] as usize;
        let mut row = y0 + (strip + n - y0 % n) % n;
        while row <= y1 {
            let lists = unsafe { args.tiles.slice(row * view.tiles_x, view.tiles_x) };
            for (column, list) in lists.iter_mut().enumerate().take(x1 + 1).skip(x0) {
                let mask = block_mask::<T>(splat, (column * TILE) as f32, (row * TILE) as f32);
                if mask != 0 {
                    let slot = base + (row - y0) * (x1 - x0 + 1) + column - x0;
                    list.push(Entry { id, mask, slot: slot as u32 });
                }
            }
            row += n;
        }
    }
}

/// One bit per block: does the ellipse alpha >= 1/255 meet the rectangle spanned by the block's
/// pixel centres?
///
/// The exponent is a concave quadratic, so over a rectangle that does not hold the centre its
/// maximum lies on an edge facing the centre: try the nearest x with the best y on that edge, and
/// the nearest y with the best x.
#[inline(always)]
fn block_mask<T: Lanes>(q: &Splat, tile_x: f32, tile_y: f32) -> u32 {
    const fn offsets(rows: usize, vertical: bool) -> [f32; 32] {
        let mut out = [0f32; 32];
        let mut i = 0;
        while i < 32 {
            out[i] = if vertical { ((i >> 2) * rows) as f32 + 0.5 } else { ((i & 3) * 4) as f32 + 0.5 };
            i += 1;
        }
        out
    }
    static LEFT: [f32; 32] = offsets(4, false);
    static TOP_OF_4: [f32; 32] = offsets(4, true);
    static TOP_OF_2: [f32; 32] = offsets(2, true);
    let top = if T::N == 16 { &TOP_OF_4 } else { &TOP_OF_2 };
    let rows = T::N / 4;

    let (a, b, c) = (T::splat(q.a), T::splat(q.b), T::splat(q.c));
    let (best_x, best_y) = (T::splat(q.best_x), T::splat(q.best_y));
    // A little generous: a missed block would be an error, an extra one costs a vector.
    let threshold = T::splat(MIN_LOG2_ALPHA - 1e-3 - q.l2o);
    let zero = T::splat(0.0);
    let mut mask = 0;
    let mut block = 0;
    while block < 256 / T::N {
        let x_lo = T::load(&LEFT[block..]) + T::splat(tile_x - q.mx);
        let y_lo = T::load(&top[block..]) + T::splat(tile_y - q.my);
        let (x_hi, y_hi) = (x_lo + T::splat(3.0), y_lo + T::splat((rows - 1) as f32));
        let x = zero.max(x_lo).min(x_hi);
        let y = zero.max(y_lo).min(y_hi);
        let y1 = (x * best_y).max(y_lo).min(y_hi);
        let x2 = (y * best_x).max(x_lo).min(x_hi);
        let e1 = (a * x).fma(x, (b * x).fma(y1, c * y1 * y1));
        let e2 = (a * x2).fma(x2, (b * x2).fma(y, c * y * y));
        mask |= T::bits(e1.max(e2).ge(threshold)) << block;
        block += T::N;
    }
    mask
}
