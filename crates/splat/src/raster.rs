//! The two pixel kernels: alpha compositing front to back, and its gradient front to back.
//!
//! A tile is sixteen 4 x 4 blocks (thirty-two 4 x 2 with eight lanes), one vector each; the loop
//! runs over gaussians and, inside, over the set bits of the gaussian's block mask. Per-pixel state
//! lives block by block in L1.
//!
//! Forward: w_i = alpha_i T_i, T_{i+1} = T_i (1 - alpha_i); image = sum w_i c_i + T_end background.
//! Backward needs only two scalars per pixel. With q_i = g_rgb . c_i + g_depth z_i + g_extra . e_i
//! and b = g_rgb . background - g_alpha, let R_i = sum_{j >= i} w_j q_j + T_end b; then dL/d
//! ln(alpha_i) = w_i q_i - alpha_i / (1 - alpha_i) R_{i+1}, and R_0 is the dot product of the
//! gradient image with the rendered one. No sorting back to front, no stored per-pixel last index.

use crate::bins::Entry;
use crate::pool::Shards;
use crate::prefetch::prefetch;
use crate::project::{MIN_LOG2_ALPHA, Splat};
use crate::simd::Lanes;
use crate::view::{TILE, View};
use std::mem::MaybeUninit;

/// Below this transmittance a pixel is finished.
pub(crate) const MIN_TRANSMITTANCE: f32 = 1e-4;
/// No gaussian covers a pixel completely: 1 / (1 - alpha) must stay bounded.
pub(crate) const MAX_ALPHA: f32 = 0.99;
/// Image planes: r g b depth transmittance, then extra channels. In the gradient image plane 4 is
/// dL/d alpha.
pub(crate) const PLANES: usize = 5;
/// Most extra channels at a time.
pub const MAX_EXTRA: usize = 32;
/// Gaussians between two looks at which blocks are finished.
const REST: usize = 16;
const PIXELS: usize = TILE * TILE;

pub(crate) struct ForwardArgs<'a> {
    pub view: &'a View,
    pub splats: &'a [Splat],
    pub tiles: &'a [Vec<Entry>],
    pub background: [f32; 3],
    /// Extra values (gaussians, channels).
    pub extra: &'a [f32],
    pub channels: usize,
    /// PLANES + channels planes.
    pub image: Shards<'a, f32>,
    /// How far into its list each tile came before it was opaque.
    pub used: Shards<'a, u32>,
}

pub(crate) struct BackwardArgs<'a> {
    pub view: &'a View,
    pub splats: &'a [Splat],
    pub tiles: &'a [Vec<Entry>],
    pub used: &'a [u32],
    pub extra: &'a [f32],
    pub channels: usize,
    pub image: &'a [f32],
    /// dL/d rgb, depth, alpha, extra, planes like the image.
    pub gradient: &'a [f32],
    /// One 16-float row per pair: the ten sums at `SUM_AT`.
    pub rows: Shards<'a, [f32; 16]>,
    /// One row of `channels` floats per pair.
    pub extra_rows: Shards<'a, f32>,
    /// 1 where the pair's row was written.
    pub written: Shards<'a, u8>,
}

#[repr(align(64))]
struct State<const P: usize>([[f32; PIXELS]; P]);

/// Pixel offsets inside a block, relative to its first pixel.
#[inline(always)]
fn block_offsets<T: Lanes>() -> (T, T) {
    const X: [f32; 16] = [0., 1., 2., 3., 0., 1., 2., 3., 0., 1., 2., 3., 0., 1., 2., 3.];
    const Y: [f32; 16] = [0., 0., 0., 0., 1., 1., 1., 1., 2., 2., 2., 2., 3., 3., 3., 3.];
    (T::load(&X), T::load(&Y))
}

#[inline(always)]
fn all_blocks<T: Lanes>() -> u32 {
    if T::N == 16 { 0xffff } else { u32::MAX }
}

/// Blocks in which some pixel is not finished.
#[inline(always)]
unsafe fn unfinished<T: Lanes>(transmittance: *const f32, mut alive: u32) -> u32 {
    let mut left = alive;
    while left != 0 {
        let b = left.trailing_zeros();
        left &= left - 1;
        let t = unsafe { T::load_ptr(transmittance.add(b as usize * T::N)) };
        if T::bits(t.ge(T::splat(MIN_TRANSMITTANCE))) == 0 {
            alive &= !(1 << b);
        }
    }
    alive
}

/// log2 of alpha before cap and threshold.
#[inline(always)]
fn exponent<T: Lanes>(q: &Splat, dx: T, dy: T) -> T {
    let t1 = T::splat(q.a).fma(dx, T::splat(q.b) * dy);
    let t2 = (T::splat(q.c) * dy).fma(dy, T::splat(q.l2o));
    t1.fma(dx, t2)
}

/// Where row `row` of a block starts in a row-major plane.
#[inline(always)]
fn block_row<T: Lanes>(view: &View, tile_x: usize, tile_y: usize, block: usize, row: usize) -> usize {
    (tile_y * TILE + (block >> 2) * (T::N / 4) + row) * view.stride() + tile_x * TILE + (block & 3) * 4
}

/// # Safety
/// The CPU has the features of `T`; each tile runs once.
#[inline(always)]
pub(crate) unsafe fn forward<T: Lanes, const EXTRA: bool>(args: &ForwardArgs, tile: usize) {
    let view = args.view;
    let (tile_x, tile_y) = (tile % view.tiles_x, tile / view.tiles_x);
    let blocks = PIXELS / T::N;
    let list = &args.tiles[tile];
    let mut state = State([[0f32; PIXELS]; PLANES]);
    state.0[4] = [1.0; PIXELS];
    let s = state.0.as_mut_ptr().cast::<f32>();
    let channels = if EXTRA { args.channels } else { 0 };
    let mut extra_state = MaybeUninit::<State<MAX_EXTRA>>::uninit();
    let e_state = extra_state.as_mut_ptr().cast::<f32>();
    unsafe { e_state.write_bytes(0, channels * PIXELS) };

    let (x0, y0) = ((tile_x * TILE) as f32 + 0.5, (tile_y * TILE) as f32 + 0.5);
    let (off_x, off_y) = block_offsets::<T>();
    let (threshold, cap) = (T::splat(MIN_LOG2_ALPHA), T::splat(MAX_ALPHA));
    let finished = T::splat(MIN_TRANSMITTANCE);
    let mut alive = all_blocks::<T>();
    let mut used = list.len();
    for (k, entry) in list.iter().enumerate() {
        if let Some(ahead) = list.get(k + 6) {
            prefetch(&args.splats[ahead.id as usize]);
        }
        let q = &args.splats[entry.id as usize];
        let (r, g, b, z) = (T::splat(q.rgb[0]), T::splat(q.rgb[1]), T::splat(q.rgb[2]), T::splat(q.z));
        let (ox, oy) = (x0 - q.mx, y0 - q.my);
        let mut mask = entry.mask & alive;
        while mask != 0 {
            let block = mask.trailing_zeros() as usize;
            mask &= mask - 1;
            let dx = off_x + T::splat(ox + ((block & 3) * 4) as f32);
            let dy = off_y + T::splat(oy + ((block >> 2) * (T::N / 4)) as f32);
            let e = exponent(q, dx, dy);
            unsafe {
                let p = s.add(block * T::N);
                let t = T::load_ptr(p.add(4 * PIXELS));
                let alpha = e.exp2().min(cap).keep(T::and(e.ge(threshold), t.ge(finished)));
                let w = alpha * t;
                (t - w).store_ptr(p.add(4 * PIXELS));
                w.fma(r, T::load_ptr(p)).store_ptr(p);
                w.fma(g, T::load_ptr(p.add(PIXELS))).store_ptr(p.add(PIXELS));
                w.fma(b, T::load_ptr(p.add(2 * PIXELS))).store_ptr(p.add(2 * PIXELS));
                w.fma(z, T::load_ptr(p.add(3 * PIXELS))).store_ptr(p.add(3 * PIXELS));
                if EXTRA {
                    for c in 0..channels {
                        let v = T::splat(args.extra[entry.id as usize * channels + c]);
                        let p = e_state.add(c * PIXELS + block * T::N);
                        w.fma(v, T::load_ptr(p)).store_ptr(p);
                    }
                }
            }
        }
        if k % REST == REST - 1 {
            alive = unsafe { unfinished::<T>(s.add(4 * PIXELS), alive) };
            if alive == 0 {
                used = k + 1;
                break;
            }
        }
    }
    unsafe { *args.used.ptr().add(tile) = used as u32 };

    for channel in 0..PLANES + channels {
        for block in 0..blocks {
            let mut pixels = [0f32; 16];
            unsafe {
                let from =
                    if channel < PLANES { s.add(channel * PIXELS) } else { e_state.add((channel - PLANES) * PIXELS) };
                let mut v = T::load_ptr(from.add(block * T::N));
                if channel < 3 {
                    let t = T::load_ptr(s.add(4 * PIXELS + block * T::N));
                    v = t.fma(T::splat(args.background[channel]), v);
                }
                v.store(&mut pixels);
                for row in 0..T::N / 4 {
                    let to = channel * view.plane_len() + block_row::<T>(view, tile_x, tile_y, block, row);
                    args.image.slice(to, 4).copy_from_slice(&pixels[4 * row..4 * row + 4]);
                }
            }
        }
    }
}

/// # Safety
/// The CPU has the features of `T`; each tile runs once.
#[inline(always)]
pub(crate) unsafe fn backward<T: Lanes, const EXTRA: bool>(args: &BackwardArgs, tile: usize) {
    let view = args.view;
    let (tile_x, tile_y) = (tile % view.tiles_x, tile / view.tiles_x);
    let list = &args.tiles[tile][..args.used[tile] as usize];
    if list.is_empty() {
        return;
    }
    let channels = if EXTRA { args.channels } else { 0 };
    let zero = T::splat(0.0);
    let one = T::splat(1.0);

    // State: dL/d r g b depth, T, R.
    let mut state = State([[0f32; PIXELS]; 6]);
    let s = state.0.as_mut_ptr().cast::<f32>();
    let mut extra_state = MaybeUninit::<State<MAX_EXTRA>>::uninit();
    let e_state = extra_state.as_mut_ptr().cast::<f32>();
    for block in 0..PIXELS / T::N {
        macro_rules! load_block {
            ($plane:expr, $channel:expr) => {{
                let mut pixels = [0f32; 16];
                for row in 0..T::N / 4 {
                    let at = $channel * view.plane_len() + block_row::<T>(view, tile_x, tile_y, block, row);
                    pixels[4 * row..4 * row + 4].copy_from_slice(&$plane[at..at + 4]);
                }
                T::load(&pixels)
            }};
        }
        let at = block * T::N;
        let mut rest = zero;
        for c in 0..4 {
            let g: T = load_block!(args.gradient, c);
            unsafe { g.store_ptr(s.add(c * PIXELS + at)) };
            rest = g.fma(load_block!(args.image, c), rest);
        }
        for c in 0..channels {
            let g: T = load_block!(args.gradient, PLANES + c);
            unsafe { g.store_ptr(e_state.add(c * PIXELS + at)) };
            rest = g.fma(load_block!(args.image, PLANES + c), rest);
        }
        let g_alpha: T = load_block!(args.gradient, 4);
        rest = g_alpha.fnma(load_block!(args.image, 4), rest);
        unsafe {
            one.store_ptr(s.add(4 * PIXELS + at));
            rest.store_ptr(s.add(5 * PIXELS + at));
        }
    }

    let (x0, y0) = ((tile_x * TILE) as f32 + 0.5, (tile_y * TILE) as f32 + 0.5);
    let (off_x, off_y) = block_offsets::<T>();
    let (threshold, cap) = (T::splat(MIN_LOG2_ALPHA), T::splat(MAX_ALPHA));
    let finished = T::splat(MIN_TRANSMITTANCE);
    let mut alive = all_blocks::<T>();
    for (k, entry) in list.iter().enumerate() {
        if let Some(ahead) = list.get(k + 6) {
            prefetch(&args.splats[ahead.id as usize]);
            prefetch(unsafe { &*args.rows.ptr().add(ahead.slot as usize) });
        }
        let mut mask = entry.mask & alive;
        if mask != 0 {
            let q = &args.splats[entry.id as usize];
            let (r, g, b, z) = (T::splat(q.rgb[0]), T::splat(q.rgb[1]), T::splat(q.rgb[2]), T::splat(q.z));
            let (ox, oy) = (x0 - q.mx, y0 - q.my);
            let (mut sum_r, mut sum_g, mut sum_b, mut sum_z) = (zero, zero, zero, zero);
            let (mut s0, mut sx, mut sy, mut sxx, mut sxy, mut syy) = (zero, zero, zero, zero, zero, zero);
            let mut sum_e = [zero; MAX_EXTRA];
            while mask != 0 {
                let block = mask.trailing_zeros() as usize;
                mask &= mask - 1;
                let dx = off_x + T::splat(ox + ((block & 3) * 4) as f32);
                let dy = off_y + T::splat(oy + ((block >> 2) * (T::N / 4)) as f32);
                let e = exponent(q, dx, dy);
                unsafe {
                    let p = s.add(block * T::N);
                    let t = T::load_ptr(p.add(4 * PIXELS));
                    let raw = e.exp2();
                    let alpha = raw.min(cap).keep(T::and(e.ge(threshold), t.ge(finished)));
                    let w = alpha * t;
                    (t - w).store_ptr(p.add(4 * PIXELS));

                    let g_r = T::load_ptr(p);
                    let g_g = T::load_ptr(p.add(PIXELS));
                    let g_b = T::load_ptr(p.add(2 * PIXELS));
                    let g_z = T::load_ptr(p.add(3 * PIXELS));
                    let mut dot = g_r.fma(r, g_g.fma(g, g_b.fma(b, g_z * z)));
                    if EXTRA {
                        for c in 0..channels {
                            let g_e = T::load_ptr(e_state.add(c * PIXELS + block * T::N));
                            dot = g_e.fma(T::splat(args.extra[entry.id as usize * channels + c]), dot);
                            sum_e[c] = w.fma(g_e, sum_e[c]);
                        }
                    }
                    let own = w * dot;
                    let rest = T::load_ptr(p.add(5 * PIXELS)) - own;
                    rest.store_ptr(p.add(5 * PIXELS));
                    // A capped alpha does not move with its parameters.
                    let d = (alpha * (one - alpha).rough_recip()).fnma(rest, own).keep(cap.ge(raw));

                    sum_r = w.fma(g_r, sum_r);
                    sum_g = w.fma(g_g, sum_g);
                    sum_b = w.fma(g_b, sum_b);
                    sum_z = w.fma(g_z, sum_z);
                    let (px, py) = (d * dx, d * dy);
                    s0 = s0 + d;
                    sx = sx + px;
                    sy = sy + py;
                    sxx = px.fma(dx, sxx);
                    sxy = px.fma(dy, sxy);
                    syy = py.fma(dy, syy);
                }
            }
            unsafe {
                let row = args.rows.ptr().add(entry.slot as usize).cast::<f32>();
                T::store_sums(&[sum_r, sum_g, sum_b, sum_z, s0, sx, sy, sxx, sxy, syy], row);
                *args.written.ptr().add(entry.slot as usize) = 1;
                if EXTRA {
                    let row = args.extra_rows.ptr().add(entry.slot as usize * channels);
                    for c in 0..channels {
                        *row.add(c) = sum_e[c].sum();
                    }
                }
            }
        }
        if k % REST == REST - 1 {
            alive = unsafe { unfinished::<T>(s.add(4 * PIXELS), alive) };
        }
    }
}
