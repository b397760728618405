//! Mask images of all kinds as object and background: one rule for `import`, `check` and `build`.

use super::images;
use crate::CaptureError;
use image::DynamicImage;
use std::collections::BTreeSet;
use std::path::Path;

/// So many different values and fewer are labels, one a thing: all but 0 are the object.
const FEW: usize = 32;
/// With more values: if fewer of the object's pixels than this have one between 0 and the largest,
/// they are edges that were smoothed. Share.
const EDGES: f64 = 0.1;

/// Reads a mask: 1 = object, 0 = background, row-major, with its width and height.
///
/// Masks come as 0 and 1, as 0 and 255, as one number a thing (8 or 16 bits), in the colours of a
/// palette, in the alpha of a white image, and through JPEG, which rings around edges.
///
/// # Errors
/// When the image is missing or cannot be decoded.
pub(crate) fn read(path: &Path) -> Result<(Vec<u8>, usize, usize), CaptureError> {
    let image = images::read(path)?;
    let (w, h) = (image.width() as usize, image.height() as usize);
    let lossy = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("jpg") || e.eq_ignore_ascii_case("jpeg"));
    let values = values(image);
    let half = threshold(&values, lossy);
    Ok((values.into_iter().map(|v| u8::from(v > half)).collect(), w, h))
}

/// One number a pixel.
fn values(image: DynamicImage) -> Vec<u16> {
    match image {
        DynamicImage::ImageLuma8(i) => i.into_raw().into_iter().map(u16::from).collect(),
        DynamicImage::ImageLuma16(i) => i.into_raw(),
        other => {
            let raw = other.into_rgba8().into_raw();
            let pixels = raw.as_chunks::<4>().0;
            let white = pixels.iter().all(|p| p[..3] == [255; 3]) && pixels.iter().any(|p| p[3] < 128);
            // Black is background, any colour is a thing.
            let color = |p: &[u8; 4]| p[0].max(p[1]).max(p[2]);
            pixels.iter().map(|p| u16::from(if white { p[3] } else { color(p) })).collect()
        }
    }
}

/// Values above this are the object.
fn threshold(values: &[u16], lossy: bool) -> u16 {
    let most = values.iter().copied().max().unwrap_or(0);
    let distinct: BTreeSet<u16> = values.iter().copied().collect();
    let object = values.iter().filter(|v| **v > 0).count();
    let between = values.iter().filter(|v| **v > 0 && **v < most).count();
    let smoothed = distinct.len() > FEW && (between as f64) < EDGES * object as f64;
    if lossy || smoothed { most / 2 } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 40 x 40: a square of 20 x 20 of the object in the middle.
    fn masked(paint: impl Fn(usize, usize) -> DynamicImage) -> usize {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("mask.png");
        paint(40, 40).save(&file).unwrap();
        let (mask, w, h) = read(&file).unwrap();
        assert_eq!((w, h), (40, 40));
        mask.iter().map(|m| usize::from(*m)).sum()
    }

    fn inside(x: u32, y: u32) -> bool {
        (10..30).contains(&x) && (10..30).contains(&y)
    }

    #[test]
    fn labels_palettes_and_alphas_are_all_masks() {
        let w = 40;
        // Parts 1 and 2; the first once vanished below half of the largest.
        let labels = |x, y| if inside(x, y) { 1 + u8::from(x > 19) } else { 0 };
        let grey = image::GrayImage::from_fn(w, w, |x, y| image::Luma([labels(x, y)]));
        assert_eq!(masked(|_, _| grey.clone().into()), 400);
        let deep = image::ImageBuffer::from_fn(w, w, |x, y| image::Luma([u16::from(labels(x, y))]));
        assert_eq!(masked(|_, _| DynamicImage::ImageLuma16(deep.clone())), 400);
        let palette =
            image::RgbImage::from_fn(w, w, |x, y| image::Rgb([[0; 3], [128, 0, 0], [0, 0, 64]][labels(x, y) as usize]));
        assert_eq!(masked(|_, _| palette.clone().into()), 400);
        let alpha = image::RgbaImage::from_fn(w, w, |x, y| image::Rgba([255, 255, 255, 255 * u8::from(inside(x, y))]));
        assert_eq!(masked(|_, _| alpha.clone().into()), 400);
        let plain = image::GrayImage::from_fn(w, w, |x, y| image::Luma([255 * u8::from(inside(x, y))]));
        assert_eq!(masked(|_, _| plain.clone().into()), 400);
    }

    #[test]
    fn smoothed_edges_and_jpeg_end_at_half() {
        let ramp = |x: u32, y: u32| {
            if inside(x, y) {
                255
            } else if x == 9 && inside(10, y) {
                (10 + 3 * y) as u8
            } else {
                0
            }
        };
        assert_eq!(threshold(&[0, 255, 3, 250], true), 127);
        let smooth = image::GrayImage::from_fn(160, 160, |x, y| image::Luma([ramp(x / 4, y)]));
        let values: Vec<u16> = smooth.into_raw().into_iter().map(u16::from).collect();
        assert_eq!(threshold(&values, false), 0, "few values are labels");
        let many: Vec<u16> = (0..4000)
            .map(|i| {
                if i < 2000 {
                    0
                } else if i < 3900 {
                    255
                } else {
                    (i - 3900) as u16 * 2
                }
            })
            .collect();
        assert_eq!(threshold(&many, false), 127);
    }
}
