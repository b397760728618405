//! How good a picture is.

use crate::ssim::{C1, C2, Padded, WINDOW, moments};

/// Peak signal to noise ratio in dB of values in 0..=1; capped at 120 for equal pictures, NaN for
/// none.
///
/// # Panics
/// When the pictures have different sizes.
pub fn psnr(a: &[f32], b: &[f32]) -> f64 {
    assert_eq!(a.len(), b.len(), "pictures of one size");
    let sum: f64 = a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum();
    -10.0 * (sum / a.len() as f64).max(1e-12).log10()
}

/// Mean structural similarity of two (h, w, 3) pictures: 11 x 11 window, sigma 1.5, zero outside,
/// as in training.
///
/// # Panics
/// When a picture is not (height, width, 3).
pub fn ssim(a: &[f32], b: &[f32], width: usize, height: usize) -> f64 {
    assert_eq!(a.len(), 3 * width * height, "a is (h, w, 3)");
    assert_eq!(b.len(), a.len(), "pictures of one size");
    let layout = Padded { width: width.next_multiple_of(16), height };
    let mut total = 0.0;
    for channel in 0..3 {
        let plane = |values: &dyn Fn(usize) -> f32| {
            let mut out = vec![0f32; layout.len()];
            for y in 0..height {
                for x in 0..width {
                    out[layout.row(y) + x] = values(3 * (y * width + x) + channel);
                }
            }
            moments(&out, layout, width, height)
        };
        let (ma, va) = plane(&|i| a[i]);
        let (mb, vb) = plane(&|i| b[i]);
        // var(a + b) = var(a) + var(b) + 2 cov
        let (_, vs) = plane(&|i| a[i] + b[i]);
        for y in 0..height {
            for i in layout.row(y)..layout.row(y) + width {
                let covariance = 0.5 * (vs[i] - va[i] - vb[i]);
                let n = (2.0 * ma[i] * mb[i] + C1) * (2.0 * covariance + C2);
                let d = (ma[i] * ma[i] + mb[i] * mb[i] + C1) * (va[i] + vb[i] + C2);
                total += f64::from(n / d);
            }
        }
    }
    debug_assert!((WINDOW.iter().sum::<f32>() - 1.0).abs() < 1e-5);
    total / (3 * width * height) as f64
}

/// Mean absolute difference over pixels where both depths are known (above 0); None when there are
/// none.
pub fn depth_mae(a: &[f32], b: &[f32]) -> Option<f64> {
    assert_eq!(a.len(), b.len(), "pictures of one size");
    let (mut sum, mut count) = (0.0, 0);
    for (a, b) in a.iter().zip(b) {
        if *a > 0.0 && *b > 0.0 {
            sum += f64::from((a - b).abs());
            count += 1;
        }
    }
    (count > 0).then(|| sum / f64::from(count))
}

/// Intersection over union of the pixels above 0.5; 1 when both are empty.
pub fn mask_iou(a: &[f32], b: &[f32]) -> f64 {
    assert_eq!(a.len(), b.len(), "pictures of one size");
    let (mut both, mut either) = (0u32, 0u32);
    for (a, b) in a.iter().zip(b) {
        both += u32::from(*a > 0.5 && *b > 0.5);
        either += u32::from(*a > 0.5 || *b > 0.5);
    }
    if either == 0 { 1.0 } else { f64::from(both) / f64::from(either) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_values() {
        assert!((psnr(&[0.0, 0.5], &[0.1, 0.4]) - 20.0).abs() < 1e-5);
        let picture: Vec<f32> = (0..3 * 20 * 17).map(|i| (i as f32 * 0.37).sin() * 0.5 + 0.5).collect();
        assert!((ssim(&picture, &picture, 20, 17) - 1.0).abs() < 1e-4);
        let inverse: Vec<f32> = picture.iter().map(|v| 1.0 - v).collect();
        assert!(ssim(&picture, &inverse, 20, 17) < 0.0);
        assert_eq!(depth_mae(&[1.0, 0.0, 2.0], &[1.5, 1.0, 0.0]), Some(0.5));
        assert_eq!(depth_mae(&[0.0], &[1.0]), None);
        assert_eq!(mask_iou(&[1.0, 1.0, 0.0], &[1.0, 0.0, 0.0]), 0.5);
        assert_eq!(mask_iou(&[0.0], &[0.0]), 1.0);
    }
}
