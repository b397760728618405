//! The loss of `crate::loss`, plainly.

use super::{Image, PixelGradient, Real};
use crate::loss::{DepthLoss, LossConfig, LossTerms};
use crate::ssim::{C1, C2, WINDOW};
use crate::target::Target;

/// Derivative of |v|, 0 at 0.
fn sign(v: Real) -> Real {
    if v > 1e-12 {
        1.0
    } else if v < -1e-12 {
        -1.0
    } else {
        0.0
    }
}

/// Loss terms and the gradient by every pixel.
pub fn loss(image: &Image, target: &Target, config: &LossConfig) -> (LossTerms, PixelGradient) {
    let (w, h) = (image.camera.width, image.camera.height);
    let pixels = (w * h) as Real;
    let zeros = || vec![0.0 as Real; w * h];
    let mut g = PixelGradient {
        rgb: [zeros(), zeros(), zeros()],
        depth: zeros(),
        alpha: zeros(),
        extra: vec![zeros(); image.extra.len()],
    };
    let rgb = target.rgb();
    let (depth, mask) = target.depth_and_mask();
    let mut terms = LossTerms::default();
    let l = Real::from(config.ssim);
    let crop = target.crop;

    for y in 0..h {
        for x in 0..w {
            let i = y * w + x;
            let weight = Real::from(target.weight_at(x, y));
            for c in 0..3 {
                let e = weight * (image.rgb[c][i] - Real::from(rgb[3 * i + c]));
                terms.l1 += e.abs() / (3.0 * pixels);
                terms.mse += e * e / (3.0 * pixels);
                g.rgb[c][i] = (1.0 - l) * weight * sign(e) / (3.0 * pixels);
            }
            let alpha = 1.0 - image.transmittance[i];
            let z = Real::from(depth[i]);
            if z > 0.0 {
                let scale = Real::from(config.depth_scale);
                let e = image.depth[i] - z * alpha;
                let size = e.abs() / scale;
                let (value, slope) = match config.depth_loss {
                    DepthLoss::Log => (size.ln_1p(), 1.0 / (1.0 + size)),
                    DepthLoss::L1 => (size, 1.0),
                };
                terms.depth += weight * value / pixels;
                g.depth[i] = Real::from(config.depth) * weight * slope * sign(e) / (scale * pixels);
                g.alpha[i] = -z * g.depth[i];
            }
            if target.has_mask {
                let in_crop = y >= crop.y0 && y < crop.y0 + crop.height && x >= crop.x0 && x < crop.x0 + crop.width;
                let slack = if in_crop {
                    Real::from(target.alpha_slack[(y - crop.y0) * crop.padded_width() + x - crop.x0])
                } else {
                    0.0
                };
                let e = alpha - Real::from(mask[i]);
                if e.abs() > slack {
                    terms.alpha += weight * (e.abs() - slack) / pixels;
                    g.alpha[i] += Real::from(config.alpha) * weight * sign(e) / pixels;
                }
            }
        }
    }

    terms.ssim = 1.0;
    if l > 0.0 {
        for c in 0..3 {
            let lost = ssim_channel(image, target, &rgb, c, l / (3.0 * pixels), &mut g.rgb[c]);
            terms.ssim -= lost / (3.0 * pixels);
        }
    }
    terms.total = (1.0 - l) * terms.l1 + l * (1.0 - terms.ssim) + Real::from(config.depth) * terms.depth;
    if target.has_mask {
        terms.total += Real::from(config.alpha) * terms.alpha;
    }
    (terms, g)
}

/// Sum of 1 - ssim over the crop; subtracts `scale` times its gradient.
fn ssim_channel(
    image: &Image,
    target: &Target,
    rgb: &[f32],
    channel: usize,
    scale: Real,
    gradient: &mut [Real],
) -> Real {
    let (crop, w) = (target.crop, image.camera.width);
    let (cw, ch) = (crop.width, crop.height);
    let at = |x: usize, y: usize| (crop.y0 + y) * w + crop.x0 + x;
    let mut xs = vec![0.0; cw * ch];
    let mut ys = vec![0.0; cw * ch];
    for y in 0..ch {
        for x in 0..cw {
            let seen = Real::from(rgb[3 * at(x, y) + channel]);
            let weight = Real::from(target.weight_at(crop.x0 + x, crop.y0 + y));
            xs[y * cw + x] = seen + weight * (image.rgb[channel][at(x, y)] - seen);
            ys[y * cw + x] = seen;
        }
    }
    let product = |a: &[Real], b: &[Real]| -> Vec<Real> { a.iter().zip(b).map(|(a, b)| a * b).collect() };
    let mx = filter(&xs, cw, ch);
    let my = filter(&ys, cw, ch);
    let xx = filter(&product(&xs, &xs), cw, ch);
    let yy = filter(&product(&ys, &ys), cw, ch);
    let xy = filter(&product(&xs, &ys), cw, ch);

    let (c1, c2) = (Real::from(C1), Real::from(C2));
    let mut by = [vec![0.0; cw * ch], vec![0.0; cw * ch], vec![0.0; cw * ch]];
    let mut lost = 0.0;
    for i in 0..cw * ch {
        let (sx, sy, sxy) = (xx[i] - mx[i] * mx[i], yy[i] - my[i] * my[i], xy[i] - mx[i] * my[i]);
        let (n1, n2) = (2.0 * mx[i] * my[i] + c1, 2.0 * sxy + c2);
        let (d1, d2) = (mx[i] * mx[i] + my[i] * my[i] + c1, sx + sy + c2);
        let ssim = n1 * n2 / (d1 * d2);
        lost += 1.0 - ssim;
        let (by_sx, by_sxy) = (-ssim / d2, 2.0 * n1 / (d1 * d2));
        by[0][i] = 2.0 * my[i] * n2 / (d1 * d2) - 2.0 * mx[i] * ssim / d1 - 2.0 * mx[i] * by_sx - my[i] * by_sxy;
        by[1][i] = by_sx;
        by[2][i] = by_sxy;
    }
    let [p1, p2, p3] = by.map(|p| filter(&p, cw, ch));
    for y in 0..ch {
        for x in 0..cw {
            let i = y * cw + x;
            let weight = Real::from(target.weight_at(crop.x0 + x, crop.y0 + y));
            gradient[at(x, y)] -= scale * weight * (p1[i] + 2.0 * xs[i] * p2[i] + ys[i] * p3[i]);
        }
    }
    lost
}

/// The 11 x 11 window, rows then columns, zero outside.
fn filter(v: &[Real], w: usize, h: usize) -> Vec<Real> {
    let window = WINDOW.map(Real::from);
    let mut rows = vec![0.0; w * h];
    for y in 0..h {
        for x in 0..w {
            let lo = x.saturating_sub(5);
            let hi = (x + 6).min(w);
            rows[y * w + x] = (lo..hi).map(|u| window[u + 5 - x] * v[y * w + u]).sum();
        }
    }
    let mut out = vec![0.0; w * h];
    for y in 0..h {
        for v in y.saturating_sub(5)..(y + 6).min(h) {
            let k = window[v + 5 - y];
            for x in 0..w {
                out[y * w + x] += k * rows[v * w + x];
            }
        }
    }
    out
}
