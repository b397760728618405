//! Textures with box-filtered mip levels, in linear light.

use crate::{CaptureError, recording::images};
use glam::{Vec2, Vec3};
use std::path::Path;

/// Level 0 is the image, each next level half its size. Texels are linear-light RGB.
#[derive(Clone, Debug)]
pub struct Texture {
    levels: Vec<Level>,
}

#[derive(Clone, Debug)]
struct Level {
    width: usize,
    height: usize,
    texels: Vec<Vec3>,
}

impl Texture {
    /// Reads a PNG or JPEG; transparent texels come over white.
    ///
    /// # Errors
    /// When the file is missing or cannot be decoded.
    pub fn read(path: &Path) -> Result<Self, CaptureError> {
        Ok(Self::of(images::read(path)?))
    }

    /// Decodes a PNG or JPEG file held in memory; the reason, when it is neither.
    pub(super) fn decode(bytes: &[u8]) -> Result<Self, String> {
        let image = image::load_from_memory(bytes);
        image.map(Self::of).map_err(|e| format!("cannot be decoded (PNG and JPEG are read; {e})"))
    }

    fn of(image: image::DynamicImage) -> Self {
        let image = image.into_rgba8();
        let (width, height) = (image.width() as usize, image.height() as usize);
        let texels = image.pixels().map(|p| {
            let a = f32::from(p.0[3]) / 255.0;
            Vec3::from_array([0, 1, 2].map(|c| linear_from_srgb(f32::from(p.0[c]) / 255.0))) * a + Vec3::splat(1.0 - a)
        });
        Self::with_mips(Level { width, height, texels: texels.collect() })
    }

    /// From 8-bit sRGB pixels, rows from the top.
    ///
    /// # Panics
    /// When there are not `3 * width * height` of them, or none.
    pub fn from_rgb(width: usize, height: usize, rgb: &[u8]) -> Self {
        assert!(width * height > 0 && rgb.len() == 3 * width * height, "{width} x {height}: {} bytes", rgb.len());
        let linear = |p: &[u8; 3]| Vec3::from_array(p.map(|c| linear_from_srgb(f32::from(c) / 255.0)));
        Self::with_mips(Level { width, height, texels: rgb.as_chunks().0.iter().map(linear).collect() })
    }

    fn with_mips(base: Level) -> Self {
        let mut levels = vec![base];
        while let Some(last) = levels.last().filter(|l| l.width > 1 || l.height > 1) {
            let (width, height) = (last.width.div_ceil(2), last.height.div_ceil(2));
            let texel = |x: usize, y: usize| last.texels[y.min(last.height - 1) * last.width + x.min(last.width - 1)];
            let texels = (0..width * height)
                .map(|i| (2 * (i % width), 2 * (i / width)))
                .map(|(x, y)| (texel(x, y) + texel(x + 1, y) + texel(x, y + 1) + texel(x + 1, y + 1)) * 0.25)
                .collect();
            levels.push(Level { width, height, texels });
        }
        Self { levels }
    }

    /// Width and height of the finest level, texels.
    pub fn size(&self) -> Vec2 {
        Vec2::new(self.levels[0].width as f32, self.levels[0].height as f32)
    }

    /// Linear-light colour at `uv` (repeating, v up as in OBJ), blended between the two mip levels
    /// around `level`.
    pub fn sample(&self, uv: Vec2, level: f32) -> Vec3 {
        let level = level.clamp(0.0, (self.levels.len() - 1) as f32);
        let (fine, blend) = (level as usize, level.fract());
        let color = self.levels[fine].sample(uv);
        if blend < 1e-3 { color } else { color.lerp(self.levels[fine + 1].sample(uv), blend) }
    }

    /// sRGB colour of the finest level.
    pub fn sample_srgb(&self, uv: Vec2) -> [f32; 3] {
        self.sample(uv, 0.0).to_array().map(srgb_from_linear)
    }
}

impl Level {
    fn sample(&self, uv: Vec2) -> Vec3 {
        let wrap = |x: f32, n: usize| (x - x.floor()) * n as f32 - 0.5;
        let (x, y) = (wrap(uv.x, self.width), wrap(1.0 - uv.y, self.height));
        let (x0, y0) = (x.floor(), y.floor());
        let at = |dx: isize, dy: isize| {
            let column = (x0 as isize + dx).rem_euclid(self.width as isize) as usize;
            let row = (y0 as isize + dy).rem_euclid(self.height as isize) as usize;
            self.texels[row * self.width + column]
        };
        let (fx, fy) = (x - x0, y - y0);
        at(0, 0).lerp(at(1, 0), fx).lerp(at(0, 1).lerp(at(1, 1), fx), fy)
    }
}

/// IEC 61966-2-1.
pub(crate) fn linear_from_srgb(c: f32) -> f32 {
    if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

pub(crate) fn srgb_from_linear(c: f32) -> f32 {
    if c <= 0.003_130_8 { c * 12.92 } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 }
}
