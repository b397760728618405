//! Mask images of all kinds as object and background: one rule for `import`, `check` and `build`.

use super::images;
use super::palette;
use crate::CaptureError;
use image::DynamicImage;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// So many different values and fewer are labels, one a thing: all but 0 are the object.
const FEW: usize = 32;
/// With more values: if fewer of the object's pixels than this have one between 0 and the largest,
/// they are edges that were smoothed. Share.
const EDGES: f64 = 0.1;
/// Labels that a message lists.
const LISTED: usize = 12;

/// Reads a mask: 1 = object, 0 = background, row-major, with its width and height.
///
/// Masks come as 0 and 1, as 0 and 255, as one number a thing (8 or 16 bits), as the entries of a
/// palette, in the alpha of a white image, and through JPEG, which rings around edges. With `ids` the
/// object is what has one of these numbers.
///
/// # Errors
/// When the image is missing or cannot be decoded; with `ids`, when its pixels are colours and no
/// numbers.
pub(crate) fn read(path: &Path, ids: &[u16]) -> Result<(Vec<u8>, usize, usize), CaptureError> {
    let (values, w, h) = numbers(path)?;
    Ok((object(&values, path, ids)?, w, h))
}

/// The same, and what [`labels`] says.
///
/// # Errors
/// As [`read`].
pub(crate) fn read_with_labels(path: &Path, ids: &[u16]) -> Result<(Vec<u8>, usize, usize, Labels), CaptureError> {
    let (values, w, h) = numbers(path)?;
    Ok((object(&values, path, ids)?, w, h, counted(&values, path)))
}

fn object(values: &Numbers, path: &Path, ids: &[u16]) -> Result<Vec<u8>, CaptureError> {
    if !ids.is_empty() {
        let Numbers::Plain(values) = values else { return Err(colors(path, ids)) };
        return Ok(values.iter().map(|v| u8::from(ids.contains(v))).collect());
    }
    let (Numbers::Plain(values) | Numbers::Colors(values)) = values;
    let half = threshold(values, lossy(path));
    Ok(values.iter().map(|v| u8::from(*v > half)).collect())
}

/// Numbers of things in masks, and the pixels of each.
pub(crate) type Labels = BTreeMap<u16, usize>;

/// The labels other than 0 of a label image, with the pixels of each. Empty: its pixels are no labels, or
/// one thing.
///
/// # Errors
/// When the image is missing or cannot be decoded.
pub(crate) fn labels(path: &Path) -> Result<Labels, CaptureError> {
    Ok(counted(&numbers(path)?.0, path))
}

fn counted(values: &Numbers, path: &Path) -> Labels {
    let Numbers::Plain(values) = values else { return Labels::new() };
    let mut count = Labels::new();
    values.iter().filter(|v| **v > 0).for_each(|v| *count.entry(*v).or_insert(0) += 1);
    let are_labels = !lossy(path) && count.len() > 1 && count.len() < FEW;
    if are_labels { count } else { Labels::new() }
}

/// The labels of many masks together.
pub(crate) fn sum<'a>(all: impl Iterator<Item = &'a Labels>) -> Labels {
    let mut out = Labels::new();
    all.flatten().for_each(|(id, n)| *out.entry(*id).or_insert(0) += n);
    out
}

/// `1 or 3`
pub(crate) fn words(ids: &[u16]) -> String {
    ids.iter().map(u16::to_string).collect::<Vec<_>>().join(" or ")
}

/// `1 (2041 pixels), 3 (88 pixels)`, of most pixels first.
pub(crate) fn listed(labels: &Labels) -> String {
    let mut all: Vec<(&u16, &usize)> = labels.iter().collect();
    all.sort_by_key(|(id, n)| (std::cmp::Reverse(**n), **id));
    let more = if all.len() > LISTED { ", ..." } else { "" };
    let some: Vec<String> = all.iter().take(LISTED).map(|(id, n)| format!("{id} ({n} pixels)")).collect();
    some.join(", ") + more
}

/// JPEG rings around edges.
fn lossy(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("jpg") || e.eq_ignore_ascii_case("jpeg"))
}

fn colors(path: &Path, ids: &[u16]) -> CaptureError {
    CaptureError::new(
        format!("a mask has colours, no numbers: none of its pixels is {}", words(ids)),
        path.display().to_string(),
        "export masks as grey or palette PNG with one number a thing, or leave --mask-id (mask_id) away",
    )
}

/// One number a pixel.
enum Numbers {
    /// As they stand in the file: labels, or lightness.
    Plain(Vec<u16>),
    /// The lightest channel of colours.
    Colors(Vec<u16>),
}

fn numbers(path: &Path) -> Result<(Numbers, usize, usize), CaptureError> {
    if let Some((index, w, h)) = palette::read(path)? {
        return Ok((Numbers::Plain(index.into_iter().map(u16::from).collect()), w, h));
    }
    let image = images::read(path)?;
    let (w, h) = (image.width() as usize, image.height() as usize);
    let values = match image {
        DynamicImage::ImageLuma8(i) => Numbers::Plain(i.into_raw().into_iter().map(u16::from).collect()),
        DynamicImage::ImageLuma16(i) => Numbers::Plain(i.into_raw()),
        other => {
            let raw = other.into_rgba8().into_raw();
            let pixels = raw.as_chunks::<4>().0;
            let white = pixels.iter().all(|p| p[..3] == [255; 3]) && pixels.iter().any(|p| p[3] < 128);
            let grey = pixels.iter().all(|p| p[0] == p[1] && p[1] == p[2]);
            // Black is background, any colour is a thing.
            let color = |p: &[u8; 4]| p[0].max(p[1]).max(p[2]);
            let values = pixels.iter().map(|p| u16::from(if white { p[3] } else { color(p) })).collect();
            if grey || white { Numbers::Plain(values) } else { Numbers::Colors(values) }
        }
    };
    Ok((values, w, h))
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
        let (mask, w, h) = read(&file, &[]).unwrap();
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

    /// A palette whose first entry is not black: its colours say nothing, its numbers all.
    #[test]
    fn palettes_are_read_by_number() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("mask.png");
        let number = |i: u32| match (i % 40, i / 40) {
            (x, y) if !inside(x, y) => 0u8,
            (x, _) => {
                if x > 24 {
                    3
                } else {
                    1
                }
            }
        };
        let pixels: Vec<u8> = (0..1600).map(number).collect();
        palette::write(&file, &pixels, 40, &[200, 200, 200, 0, 0, 0, 9, 9, 9, 128, 0, 0]).unwrap();
        let count = |ids: &[u16]| read(&file, ids).unwrap().0.iter().map(|m| usize::from(*m)).sum::<usize>();
        assert_eq!((count(&[]), count(&[1]), count(&[3]), count(&[1, 3]), count(&[2])), (400, 300, 100, 400, 0));
        let labels = labels(&file).unwrap();
        assert_eq!(listed(&labels), "1 (300 pixels), 3 (100 pixels)");
    }

    #[test]
    fn colours_have_no_numbers() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("mask.png");
        image::RgbImage::from_pixel(8, 8, image::Rgb([128, 0, 0])).save(&file).unwrap();
        let text = read(&file, &[1]).unwrap_err().to_string();
        assert!(text.contains("colours, no numbers"), "{text}");
        assert_eq!(read(&file, &[]).unwrap().0, vec![1; 64]);
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
