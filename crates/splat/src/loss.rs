//! The image loss and its gradient by every pixel.
//!
//! With W H pixels, weight w, render (x, D, A) = (colour, sum of w_i z_i, alpha) and target (y, z, a):
//! x' = y + w (x - y)
//! colour = (1 - l) mean |x' - y| + l mean (1 - ssim(x', y)), over pixels and channels
//! depth  = mean over all pixels of w rho(|D - z A|), counted where z is known; rho(e) = ln(1 + e/s) or e/s
//! alpha  = mean over all pixels of w max(|A - a| - s, 0); the slack s is 0, on the mask's edge 1/2
//!
//! D - z A = sum of w_i (z_i - z): zero exactly when the normalised depth D / A is right, whatever
//! the opacity, so depth is not biased towards the camera or away from it where the object is still
//! half transparent. SSIM is that of the crop around the object; outside of it counts as 1.

use crate::pool::Shards;
use crate::raster::PLANES;
use crate::simd::Lanes;
use crate::ssim::{self, BAND};
use crate::target::Target;
use crate::view::View;
use serde::{Deserialize, Serialize};

/// How depth errors count.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DepthLoss {
    /// ln(1 + |error| / scale): forgiving to wrong depth readings and at depth edges.
    Log,
    /// |error| / scale
    L1,
}

/// How much each term of the loss counts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct LossConfig {
    /// l: share of SSIM in the colour loss.
    pub ssim: f32,
    /// Weight of the depth loss; 0 ignores depth.
    pub depth: f32,
    /// How a pixel's depth error counts.
    pub depth_loss: DepthLoss,
    /// Depth error in scene units that counts as 1 (or ln 2); about 1 % of the object.
    pub depth_scale: f32,
    /// Weight of the alpha loss. Keep it above 0, or white noise stays around the object.
    pub alpha: f32,
}

impl Default for LossConfig {
    fn default() -> Self {
        Self { ssim: 0.2, depth: 0.1, depth_loss: DepthLoss::Log, depth_scale: 0.01, alpha: 1.0 }
    }
}

/// What the loss was made of; terms before their weights.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LossTerms {
    /// The weighted sum that was differentiated.
    pub total: f64,
    /// mean |x' - y|
    pub l1: f64,
    /// mean ssim, 1 is perfect
    pub ssim: f64,
    /// Depth term: mean of w rho(|D - z A|), no unit.
    pub depth: f64,
    /// Alpha term: mean of w max(|A - a| - s, 0), 0..1.
    pub alpha: f64,
    /// mean (x' - y)^2, for PSNR
    pub mse: f64,
}

impl LossTerms {
    /// Peak signal to noise ratio over the whole picture, dB.
    pub fn psnr(&self) -> f64 {
        -10.0 * self.mse.max(1e-12).log10()
    }
}

/// Sums of one band: |x'-y|, (x'-y)^2, depth, alpha.
pub(crate) type BandSums = [f64; 4];

pub(crate) struct Args<'a> {
    pub view: &'a View,
    pub target: &'a Target,
    pub config: &'a LossConfig,
    pub image: &'a [f32],
    pub scratch: [ssim::Scratch<'a>; 3],
    /// Derivative planes, channel-major.
    pub derivatives: [[&'a [f32]; 3]; 3],
    pub gradient: Shards<'a, f32>,
    pub sums: Shards<'a, BandSums>,
}

impl Target {
    pub(crate) fn fixed(&self, channel: usize) -> ssim::Fixed<'_> {
        ssim::Fixed {
            y: &self.rgb[channel],
            mean: &self.mean[channel],
            variance: &self.variance[channel],
            layout: self.layout,
        }
    }
}

pub(crate) struct SsimArgs<'a> {
    pub target: &'a Target,
    pub x: [&'a [f32]; 3],
    pub layout: ssim::Padded,
    pub derivatives: [[Shards<'a, f32>; 3]; 3],
    /// (3, bands)
    pub sums: Shards<'a, f64>,
    pub bands: usize,
}

/// SSIM's forward pass of one channel and band: item = channel * bands + band.
///
/// # Safety
/// The CPU has the features of `T`; each item runs once; the render is in the scratch planes.
#[inline(always)]
pub(crate) unsafe fn ssim_band<T: Lanes>(args: &SsimArgs, item: usize) {
    let (channel, band) = (item / args.bands, item % args.bands);
    let scratch = ssim::Scratch { x: args.x[channel], layout: args.layout };
    let [p1, p2, p3] = &args.derivatives[channel];
    let crop = args.target.crop;
    unsafe {
        args.sums.slice(item, 1)[0] =
            ssim::forward::<T>(&args.target.fixed(channel), &scratch, [p1, p2, p3], crop.width, crop.height, band);
    }
}

/// Crop rows `band * BAND ..`: x' of one channel into the padded scratch plane, whose margins
/// beyond the crop are cleared (an earlier view may have had a larger crop).
pub(crate) fn blend_band(
    view: &View,
    target: &Target,
    image: &[f32],
    x: &Shards<f32>,
    derivatives: [&Shards<f32>; 3],
    layout: ssim::Padded,
    channel: usize,
    band: usize,
) {
    let crop = target.crop;
    let padded = crop.padded_width();
    let rows = band * BAND..((band + 1) * BAND).min(crop.height);
    for y in rows.clone() {
        let from = channel * view.plane_len() + (crop.y0 + y) * view.stride() + crop.x0;
        let out = unsafe { x.slice(layout.row(y), padded + 16) };
        out[..crop.width].copy_from_slice(&image[from..from + crop.width]);
        out[crop.width..].fill(0.0);
        if let Some(weight) = &target.weight {
            let weight = &weight[(crop.y0 + y) * view.stride() + crop.x0..][..crop.width];
            let seen = &target.rgb[channel][target.layout.row(y)..][..crop.width];
            for ((out, w), y) in out.iter_mut().zip(weight).zip(seen) {
                *out = y + w * (*out - y);
            }
        }
        for plane in derivatives {
            unsafe { plane.slice(layout.row(y) + padded, 16) }.fill(0.0);
        }
    }
    if rows.end == crop.height {
        for y in crop.height..crop.height + ssim::RADIUS {
            for plane in [x, derivatives[0], derivatives[1], derivatives[2]] {
                unsafe { plane.slice(layout.row(y), padded + 16) }.fill(0.0);
            }
        }
    }
}

/// Rows `band * BAND ..` of the whole picture: gradient image and sums.
///
/// # Safety
/// The CPU has the features of `T`; each band runs once; SSIM's forward pass is done.
#[inline(always)]
pub(crate) unsafe fn loss_band<T: Lanes>(args: &Args, band: usize) {
    let (view, target, config) = (args.view, args.target, args.config);
    let (crop, stride, plane) = (target.crop, view.stride(), view.plane_len());
    let pixels = (view.width * view.height) as f32;
    let colour_scale = (1.0 - config.ssim) / (3.0 * pixels);
    let alpha_scale = if target.has_mask { config.alpha / pixels } else { 0.0 };
    let (zero, one) = (T::splat(0.0), T::splat(1.0));
    let tiny = T::splat(1e-12);
    let mut sums: BandSums = [0.0; 4];
    let padded = crop.padded_width();
    let empty = || vec![0f32; padded + 32];
    let mut filtered = [empty(), empty(), empty()];

    /// d |v| / dv times `scale`, 0 at 0.
    macro_rules! signed {
        ($v:expr, $scale:expr) => {
            $scale.keep($v.ge(tiny)) - $scale.keep((zero - $v).ge(tiny))
        };
    }

    for y in band * BAND..((band + 1) * BAND).min(view.height) {
        let inside_rows = y >= crop.y0 && y < crop.y0 + crop.height;
        let mut row_sums = [zero; 4];
        for x in (0..stride).step_by(T::N) {
            let at = y * stride + x;
            // Columns come in whole vectors, so a vector is inside the crop or outside.
            let crop_x = (inside_rows && x >= crop.x0 && x < crop.x0 + padded).then(|| x - crop.x0);
            let weight = match &target.weight {
                Some(weight) => T::load(&weight[at..]),
                None => one.keep(T::splat(view.width as f32 - 0.5).ge(T::iota() + T::splat(x as f32))),
            };
            let mut gradient = [zero; PLANES];
            for c in 0..3 {
                let seen = match crop_x {
                    Some(cx) => T::load(&target.rgb[c][target.layout.row(y - crop.y0) + cx..]),
                    None => T::splat(target.background[c]),
                };
                let e = (T::load(&args.image[c * plane + at..]) - seen) * weight;
                row_sums[0] = row_sums[0] + e.max(zero - e);
                row_sums[1] = e.fma(e, row_sums[1]);
                gradient[c] = signed!(e, weight) * T::splat(colour_scale);
            }
            let alpha = one - T::load(&args.image[4 * plane + at..]);
            let (mut wanted, mut slack) = (zero, zero);
            if let Some(cx) = crop_x {
                let i = (y - crop.y0) * padded + cx;
                wanted = T::load(&target.alpha[i..]);
                slack = T::load(&target.alpha_slack[i..]);
                let z = T::load(&target.depth[i..]);
                let known = z.ge(tiny);
                let e = T::load(&args.image[3 * plane + at..]) - z * alpha;
                let size = e.max(zero - e) * T::splat(1.0 / config.depth_scale);
                let (value, slope) = match config.depth_loss {
                    DepthLoss::Log => ((one + size).log2() * T::splat(std::f32::consts::LN_2), one / (one + size)),
                    DepthLoss::L1 => (size, one),
                };
                row_sums[2] = row_sums[2] + (value * weight).keep(known);
                let g = (slope * weight).keep(known) * T::splat(config.depth / (config.depth_scale * pixels));
                gradient[3] = signed!(e, g);
                gradient[4] = zero - gradient[3] * z;
            }
            if target.has_mask {
                let e = alpha - wanted;
                let over = e.max(zero - e) - slack;
                row_sums[3] = over.max(zero).fma(weight, row_sums[3]);
                gradient[4] = gradient[4] + signed!(e, weight).keep(over.ge(tiny)) * T::splat(alpha_scale);
            }
            for (k, g) in gradient.iter().enumerate() {
                unsafe { g.store(args.gradient.slice(k * plane + at, T::N)) };
            }
        }
        for (total, sum) in sums.iter_mut().zip(row_sums) {
            *total += f64::from(sum.sum());
        }
        if inside_rows && config.ssim > 0.0 {
            let weight = target.weight.as_ref().map(|w| &w[y * stride + crop.x0..]);
            for c in 0..3 {
                unsafe {
                    let out = args.gradient.slice(c * plane + y * stride + crop.x0, padded);
                    ssim::backward_row::<T>(
                        &target.fixed(c),
                        &args.scratch[c],
                        args.derivatives[c],
                        &mut filtered,
                        crop.width,
                        y - crop.y0,
                        config.ssim / (3.0 * pixels),
                        weight,
                        out,
                    );
                }
            }
        }
    }
    unsafe { args.sums.slice(band, 1)[0] = sums };
}

/// Adds the bands up, in order.
pub(crate) fn total(view: &View, target: &Target, config: &LossConfig, bands: &[BandSums], ssim: &[f64]) -> LossTerms {
    let pixels = (view.width * view.height) as f64;
    let sum = |k: usize| bands.iter().map(|b| b[k]).sum::<f64>() / pixels;
    // Outside the crop the similarity counts as 1.
    let crop_pixels = (target.crop.width * target.crop.height) as f64;
    let lost = if config.ssim > 0.0 { 3.0 * crop_pixels - ssim.iter().sum::<f64>() } else { 0.0 };
    let mut out = LossTerms {
        total: 0.0,
        l1: sum(0) / 3.0,
        mse: sum(1) / 3.0,
        ssim: 1.0 - lost / (3.0 * pixels),
        depth: sum(2),
        alpha: sum(3),
    };
    let l = f64::from(config.ssim);
    out.total = (1.0 - l) * out.l1
        + l * (1.0 - out.ssim)
        + f64::from(config.depth) * out.depth
        + if target.has_mask { f64::from(config.alpha) * out.alpha } else { 0.0 };
    out
}
