//! Drawing on pictures: part colours blended over, axes as lines, tiles side by side.

use glam::{DVec2, DVec3};
use hingecast_geom::{Camera, Screw};
use hingecast_twin::BACKGROUND;
use image::{Rgb, RgbImage};

/// Part colours that stay apart for most colour-blind eyes (Okabe and Ito 2008, grey for the base).
pub const PALETTE: [[u8; 3]; 8] = [
    [150, 150, 150],
    [230, 159, 0],
    [86, 180, 233],
    [0, 158, 115],
    [240, 228, 66],
    [204, 121, 167],
    [213, 94, 0],
    [0, 114, 178],
];

/// A picture from 8-bit sRGB, (h, w, 3).
pub fn from_rgb8(rgb: &[u8], width: usize, height: usize) -> RgbImage {
    RgbImage::from_raw(width as u32, height as u32, rgb.to_vec()).expect("h x w x 3 bytes")
}

/// A picture from sRGB in 0..1, (h, w, 3).
pub fn from_rgb_f32(rgb: &[f32], width: usize, height: usize) -> RgbImage {
    let bytes: Vec<u8> = rgb.iter().map(|x| (x.clamp(0.0, 1.0) * 255.0).round() as u8).collect();
    from_rgb8(&bytes, width, height)
}

/// Blends each part's colour over the picture.
pub fn color_parts(image: &mut RgbImage, parts: &[u8]) {
    for (pixel, part) in image.pixels_mut().zip(parts) {
        if *part != BACKGROUND {
            let color = PALETTE[*part as usize % PALETTE.len()];
            for k in 0..3 {
                pixel.0[k] = ((pixel.0[k] as u32 * 9 + color[k] as u32 * 11) / 20) as u8;
            }
        }
    }
}

/// Draws a joint's axis as a line of length `length` about `centre`'s foot, with an arrow head at
/// its positive end.
pub fn draw_axis(image: &mut RgbImage, camera: &Camera, screw: &Screw, centre: DVec3, length: f64, color: [u8; 3]) {
    let middle = if screw.kind.turns() { screw.foot(centre) } else { centre };
    let (a, b) = (middle - screw.axis * (0.5 * length), middle + screw.axis * (0.5 * length));
    let (pa, za) = camera.project(a);
    let (pb, zb) = camera.project(b);
    if za <= 0.0 || zb <= 0.0 {
        return;
    }
    line(image, pa, pb, [0, 0, 0], 3.0);
    line(image, pa, pb, color, 1.6);
    let along = (pb - pa).normalize_or_zero();
    let side = DVec2::new(-along.y, along.x);
    for s in [-1.0, 1.0] {
        line(image, pb, pb - along * 9.0 + side * (5.0 * s), color, 1.6);
    }
    let (pm, _) = camera.project(middle);
    for k in 0..12 {
        let t = k as f64 * std::f64::consts::TAU / 12.0;
        let next = (k + 1) as f64 * std::f64::consts::TAU / 12.0;
        line(image, pm + 4.0 * DVec2::from_angle(t), pm + 4.0 * DVec2::from_angle(next), color, 1.4);
    }
}

/// An anti-aliased line of `width` pixels.
fn line(image: &mut RgbImage, a: DVec2, b: DVec2, color: [u8; 3], width: f64) {
    let (w, h) = (image.width() as f64, image.height() as f64);
    let reach = 0.5 * width + 1.0;
    let lo = (a.min(b) - reach).max(DVec2::ZERO);
    let hi = (a.max(b) + reach).min(DVec2::new(w, h));
    let d = b - a;
    for y in lo.y as i64..hi.y.max(0.0) as i64 {
        for x in lo.x as i64..hi.x.max(0.0) as i64 {
            let p = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
            let t = ((p - a).dot(d) / d.length_squared().max(1e-12)).clamp(0.0, 1.0);
            let cover = (0.5 * width + 0.5 - (p - (a + d * t)).length()).clamp(0.0, 1.0);
            if cover > 0.0 {
                let pixel = image.get_pixel_mut(x as u32, y as u32);
                for k in 0..3 {
                    pixel.0[k] = (pixel.0[k] as f64 * (1.0 - cover) + color[k] as f64 * cover).round() as u8;
                }
            }
        }
    }
}

/// Pictures side by side with a thin white gap.
pub fn row(images: &[RgbImage]) -> RgbImage {
    const GAP: u32 = 4;
    let height = images.iter().map(|i| i.height()).max().unwrap_or(1);
    let width = images.iter().map(|i| i.width() + GAP).sum::<u32>().max(GAP + 1) - GAP;
    let mut out = RgbImage::from_pixel(width, height, Rgb([255; 3]));
    let mut x = 0;
    for i in images {
        image::imageops::replace(&mut out, i, x as i64, 0);
        x += i.width() + GAP;
    }
    out
}

/// Difference of two pictures, four times stronger, white = none.
pub fn difference(a: &RgbImage, b: &RgbImage) -> RgbImage {
    let mut out = a.clone();
    for (o, b) in out.pixels_mut().zip(b.pixels()) {
        for k in 0..3 {
            let d = (o.0[k] as i32 - b.0[k] as i32).abs() * 4;
            o.0[k] = (255 - d).max(0) as u8;
        }
    }
    out
}
