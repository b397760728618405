//! Pictures to another size: colours as averages of area, masks by majority, depth untouched.
//!
//! Pixel centres lie at +0.5, so pixel `i` of `n` covers `[i, i + 1) / n` of the picture, and a
//! camera that is scaled with the picture (`Camera::resized`) is exact.

/// Rows and columns.
pub(super) type Size = (usize, usize);

/// Whether two sizes show one picture: sides in one proportion, up to rounding.
pub(super) fn same_shape(a: Size, b: Size) -> bool {
    /// Apps round the sides: 0.02 of the picture, 4 pixels of a depth map, is no other field of
    /// view.
    const TOLERANCE: f64 = 0.02;
    let (x, y) = (a.0 as f64 / b.0 as f64, a.1 as f64 / b.1 as f64);
    (x / y - 1.0).abs() < TOLERANCE
}

/// The cells of `from` that cell `i` of `to` covers: first one, and each one's share (sum 1).
fn cover(i: usize, from: usize, to: usize) -> (usize, Vec<f64>) {
    let scale = from as f64 / to as f64;
    let (start, end) = (i as f64 * scale, (i + 1) as f64 * scale);
    let first = start.floor() as usize;
    let last = (end.ceil() as usize).clamp(first + 1, from);
    let share = |k: usize| ((k + 1) as f64).min(end) - (k as f64).max(start);
    let shares: Vec<f64> = (first..last).map(|k| (share(k) / scale).max(0.0)).collect();
    (first, shares)
}

/// The average colour over each pixel's area; sizes are (width, height).
pub(super) fn area_average<const C: usize>(pixels: &[u8], from: Size, to: Size) -> Vec<u8> {
    average::<C>(pixels, from, to).into_iter().map(|v| v.round() as u8).collect()
}

/// 255 where more than half of a pixel's area is not 0, else 0.
pub(super) fn majority(mask: &[u8], from: Size, to: Size) -> Vec<u8> {
    let flags: Vec<u8> = mask.iter().map(|m| u8::from(*m > 0)).collect();
    average::<1>(&flags, from, to).into_iter().map(|share| if share > 0.5 { 255 } else { 0 }).collect()
}

/// First along rows, then along columns.
fn average<const C: usize>(pixels: &[u8], from: Size, to: Size) -> Vec<f32> {
    let mut narrow = vec![0f32; C * to.0 * from.1];
    for x in 0..to.0 {
        let (first, shares) = cover(x, from.0, to.0);
        for y in 0..from.1 {
            for (k, share) in shares.iter().enumerate() {
                for c in 0..C {
                    narrow[C * (y * to.0 + x) + c] +=
                        *share as f32 * f32::from(pixels[C * (y * from.0 + first + k) + c]);
                }
            }
        }
    }
    let mut out = vec![0f32; C * to.0 * to.1];
    let width = C * to.0;
    for y in 0..to.1 {
        let (first, shares) = cover(y, from.1, to.1);
        for (k, share) in shares.iter().enumerate() {
            let row = &narrow[(first + k) * width..(first + k + 1) * width];
            let sums = &mut out[y * width..(y + 1) * width];
            sums.iter_mut().zip(row).for_each(|(sum, v)| *sum += *share as f32 * v);
        }
    }
    out
}

/// For each pixel the known depth nearest to its middle, of those that it covers; 0 without one.
/// Averages would invent surface between what is near and what is far.
pub(super) fn nearest_known(depth: &[f64], from: Size, to: Size) -> Vec<f64> {
    let middle = |i: usize, from: usize, to: usize| (i as f64 + 0.5) * from as f64 / to as f64;
    let mut out = Vec::with_capacity(to.0 * to.1);
    for y in 0..to.1 {
        let (top, rows) = cover(y, from.1, to.1);
        for x in 0..to.0 {
            let (left, columns) = cover(x, from.0, to.0);
            let mut best = (f64::INFINITY, 0.0);
            for v in top..top + rows.len() {
                for u in left..left + columns.len() {
                    let (dx, dy) = (u as f64 + 0.5 - middle(x, from.0, to.0), v as f64 + 0.5 - middle(y, from.1, to.1));
                    let (distance, z) = (dx * dx + dy * dy, depth[v * from.0 + u]);
                    if z > 0.0 && distance < best.0 {
                        best = (distance, z);
                    }
                }
            }
            out.push(best.1);
        }
    }
    out
}

/// For each pixel of a picture of size `to` the nearest one of a picture of size `from`.
pub(super) fn nearest(from: Size, to: Size) -> impl Iterator<Item = usize> {
    (0..to.0 * to.1).map(move |i| ((i / to.0) * from.1 / to.1) * from.0 + (i % to.0) * from.0 / to.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn areas_are_averaged_exactly_where_pixels_are_cut() {
        // Three pixels to two: each takes one and a half.
        assert_eq!(area_average::<1>(&[0, 90, 240], (3, 1), (2, 1)), [30, 190]);
        let flat = vec![77u8; 3 * 15 * 10];
        assert!(area_average::<3>(&flat, (15, 10), (4, 3)).iter().all(|v| *v == 77));
        assert_eq!(majority(&[9, 0, 9, 9, 0, 0], (6, 1), (2, 1)), [255, 0]);
    }

    #[test]
    fn depth_is_picked_never_mixed() {
        let depth = [1.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 0.0];
        assert_eq!(nearest_known(&depth, (4, 2), (2, 1)), [1.0, 4.0]);
        assert_eq!(nearest_known(&depth, (4, 2), (4, 2)), depth);
        assert!(same_shape((1920, 1440), (256, 192)) && !same_shape((1920, 1080), (256, 192)));
    }
}
