//! Structural similarity (Wang et al. 2004), 11 x 11 gaussian window with sigma 1.5, fused with its
//! gradient.
//!
//! With window means m_x, m_y, variances and covariance s_x, s_y, s_xy: ssim = (2 m_x m_y + c1)(2
//! s_xy + c2) / ((m_x^2 + m_y^2 + c1)(s_x + s_y + c2)), c1 = 0.01^2, c2 = 0.03^2. Everything of y
//! is cached in the target, so a step filters three quantities: x, x^2, x y. Going back, three
//! derivative planes p1 p2 p3 (by the filtered x, x^2, x y) are filtered with the same window: d
//! ssim / dx = G*p1 + 2 x G*p2 + y G*p3. Outside the crop both images count as 0.

use crate::pool::Shards;
use crate::simd::Lanes;

/// Gaussian window, sigma 1.5 px, sum 1.
pub(crate) const WINDOW: [f32; 11] = [
    0.001_028_380_1,
    0.007_598_758,
    0.036_000_773,
    0.109_360_69,
    0.213_005_53,
    0.266_011_72,
    0.213_005_53,
    0.109_360_69,
    0.036_000_773,
    0.007_598_758,
    0.001_028_380_1,
];
pub(crate) const RADIUS: usize = 5;
pub(crate) const C1: f32 = 0.01 * 0.01;
pub(crate) const C2: f32 = 0.03 * 0.03;
/// Zero columns on each side of a padded plane: a whole vector, so that loads stay simple.
const MARGIN: usize = 16;
/// Rows per work item. Fixed: partial sums must not depend on the thread count.
pub(crate) const BAND: usize = 16;

/// Size of a plane with zero margins of 16 columns and 5 rows around `width` (a multiple of 16) x
/// `height`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Padded {
    pub width: usize,
    pub height: usize,
}

impl Padded {
    pub fn stride(self) -> usize {
        self.width + 2 * MARGIN
    }
    pub fn len(self) -> usize {
        self.stride() * (self.height + 2 * RADIUS)
    }
    /// Index of pixel (0, y).
    pub fn row(self, y: usize) -> usize {
        (y + RADIUS) * self.stride() + MARGIN
    }
}

/// The target's half of the computation, for one crop and channel. Planes in [`Padded`] layout of
/// the crop.
pub(crate) struct Fixed<'a> {
    pub y: &'a [f32],
    pub mean: &'a [f32],
    pub variance: &'a [f32],
    pub layout: Padded,
}

/// The render's planes of one channel: x and the three derivative planes, in a layout that fits the
/// largest crop.
pub(crate) struct Scratch<'a> {
    pub x: &'a [f32],
    pub layout: Padded,
}

/// Rows `band * BAND ..` of one channel: fills the derivative planes, returns the sum of ssim over
/// `width x height` pixels.
///
/// # Safety
/// The CPU has the features of `T`; planes have the lengths of their layouts; each band and channel
/// runs once.
#[inline(always)]
pub(crate) unsafe fn forward<T: Lanes>(
    fixed: &Fixed,
    scratch: &Scratch,
    derivatives: [&Shards<f32>; 3],
    width: usize,
    height: usize,
    band: usize,
) -> f64 {
    let padded_width = width.next_multiple_of(16);
    let (fl, sl) = (fixed.layout, scratch.layout);
    let mut filtered = [vec![0f32; padded_width + 32], vec![0f32; padded_width + 32], vec![0f32; padded_width + 32]];
    let (two, c1, c2) = (T::splat(2.0), T::splat(C1), T::splat(C2));
    let mut total = 0.0;
    for row in band * BAND..((band + 1) * BAND).min(height) {
        // Vertical pass: the window's eleven rows start five rows above, which is where the margin
        // puts row - 5.
        for x in (0..padded_width).step_by(T::N) {
            let (mut a, mut b, mut c) = (T::splat(0.0), T::splat(0.0), T::splat(0.0));
            for k in 0..11 {
                unsafe {
                    let xv =
                        T::load_ptr(scratch.x.as_ptr().add(sl.row(row) + x + k * sl.stride() - RADIUS * sl.stride()));
                    let yv =
                        T::load_ptr(fixed.y.as_ptr().add(fl.row(row) + x + k * fl.stride() - RADIUS * fl.stride()));
                    let gx = T::splat(WINDOW[k]) * xv;
                    a = a + gx;
                    b = gx.fma(xv, b);
                    c = gx.fma(yv, c);
                }
            }
            a.store(&mut filtered[0][MARGIN + x..]);
            b.store(&mut filtered[1][MARGIN + x..]);
            c.store(&mut filtered[2][MARGIN + x..]);
        }
        // Horizontal pass, then ssim and its derivatives.
        let mut sum = T::splat(0.0);
        for x in (0..padded_width).step_by(T::N) {
            let (mx, xx, xy) = unsafe { filter_row::<T>(&filtered, x) };
            let my = T::load(&fixed.mean[fl.row(row) + x..]);
            let sy = T::load(&fixed.variance[fl.row(row) + x..]);
            let (sx, sxy) = (mx.fnma(mx, xx), mx.fnma(my, xy));
            let n1 = two * mx.fma(my, T::splat(0.0)) + c1;
            let n2 = two.fma(sxy, c2);
            let d1 = mx.fma(mx, my.fma(my, c1));
            let d2 = sx + sy + c2;
            let recip = T::splat(1.0) / (d1 * d2);
            let ssim = n1 * n2 * recip;
            let by_sx = T::splat(0.0) - ssim * d1 * recip;
            let by_sxy = two * n1 * recip;
            let by_mx = two * my * n2 * recip - two * mx * ssim * d2 * recip - two * mx * by_sx - my * by_sxy;
            let inside = T::splat(width as f32 - 0.5).ge(T::iota() + T::splat(x as f32));
            sum = sum + ssim.keep(inside);
            for (plane, value) in derivatives.iter().zip([by_mx, by_sx, by_sxy]) {
                unsafe { value.keep(inside).store(plane.slice(sl.row(row) + x, T::N)) };
            }
        }
        total += f64::from(sum.sum());
    }
    total
}

/// Adds `-scale * d ssim / dx` of crop row `row` to `out` (padded width floats), times `weight` if
/// given.
///
/// # Safety
/// As [`forward`]; all bands of the forward pass are done.
#[inline(always)]
pub(crate) unsafe fn backward_row<T: Lanes>(
    fixed: &Fixed,
    scratch: &Scratch,
    derivatives: [&[f32]; 3],
    filtered: &mut [Vec<f32>; 3],
    width: usize,
    row: usize,
    scale: f32,
    weight: Option<&[f32]>,
    out: &mut [f32],
) {
    let padded_width = width.next_multiple_of(16);
    let (fl, sl) = (fixed.layout, scratch.layout);
    for x in (0..padded_width).step_by(T::N) {
        for (plane, to) in derivatives.iter().zip(filtered.iter_mut()) {
            let mut a = T::splat(0.0);
            for k in 0..11 {
                let at = sl.row(row) + x + k * sl.stride() - RADIUS * sl.stride();
                a = T::splat(WINDOW[k]).fma(unsafe { T::load_ptr(plane.as_ptr().add(at)) }, a);
            }
            a.store(&mut to[MARGIN + x..]);
        }
    }
    for x in (0..padded_width).step_by(T::N) {
        let (a, b, c) = unsafe { filter_row::<T>(filtered, x) };
        let xv = T::load(&scratch.x[sl.row(row) + x..]);
        let yv = T::load(&fixed.y[fl.row(row) + x..]);
        let mut g = (T::splat(2.0) * xv).fma(b, yv.fma(c, a)) * T::splat(-scale);
        if let Some(weight) = weight {
            g = g * T::load(&weight[x..]);
        }
        // Columns past the picture's right edge exist only to fill the last tile.
        g = g.keep(T::splat(width as f32 - 0.5).ge(T::iota() + T::splat(x as f32)));
        (T::load(&out[x..]) + g).store(&mut out[x..]);
    }
}

/// Horizontal window over three rows at once.
#[inline(always)]
unsafe fn filter_row<T: Lanes>(rows: &[Vec<f32>; 3], x: usize) -> (T, T, T) {
    let (mut a, mut b, mut c) = (T::splat(0.0), T::splat(0.0), T::splat(0.0));
    for k in 0..11 {
        let at = MARGIN + x + k - RADIUS;
        let g = T::splat(WINDOW[k]);
        unsafe {
            a = g.fma(T::load_ptr(rows[0].as_ptr().add(at)), a);
            b = g.fma(T::load_ptr(rows[1].as_ptr().add(at)), b);
            c = g.fma(T::load_ptr(rows[2].as_ptr().add(at)), c);
        }
    }
    (a, b, c)
}

/// Window means and variances of a padded plane, for the target. Plain loops: once per view.
pub(crate) fn moments(y: &[f32], layout: Padded, width: usize, height: usize) -> (Vec<f32>, Vec<f32>) {
    let mut mean = vec![0f32; layout.len()];
    let mut variance = vec![0f32; layout.len()];
    let mut row_mean = vec![0f32; layout.stride()];
    let mut row_square = vec![0f32; layout.stride()];
    for row in 0..height {
        row_mean.fill(0.0);
        row_square.fill(0.0);
        for k in 0..11 {
            let start = (row + k) * layout.stride();
            for (x, &v) in y[start..start + layout.stride()].iter().enumerate() {
                row_mean[x] += WINDOW[k] * v;
                row_square[x] += WINDOW[k] * v * v;
            }
        }
        for x in 0..width {
            let window = MARGIN + x - RADIUS..MARGIN + x + RADIUS + 1;
            let m: f32 = row_mean[window.clone()].iter().zip(&WINDOW).map(|(v, g)| v * g).sum();
            let s: f32 = row_square[window].iter().zip(&WINDOW).map(|(v, g)| v * g).sum();
            mean[layout.row(row) + x] = m;
            variance[layout.row(row) + x] = s - m * m;
        }
    }
    (mean, variance)
}
