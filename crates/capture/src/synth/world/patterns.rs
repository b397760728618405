//! Painted textures: what a floor, a wallpaper, a cardboard box look like to a camera. None repeats
//! itself within a surface, as real ones hardly do, so that no view can be taken for another.

use crate::object::texture::Texture;
use glam::Vec3;

/// Texels along a side of a floor or wall (4 mm on a wall of 4 m) and of a piece of clutter.
const LARGE: usize = 1024;
const SMALL: usize = 256;

/// Smooth random values: bilinear between the nodes of a grid, over the unit square, -1..1.
struct Waves {
    nodes: Vec<f32>,
    cells: usize,
}

impl Waves {
    fn new(cells: usize, rng: &mut fastrand::Rng) -> Self {
        Self { nodes: (0..(cells + 2) * (cells + 2)).map(|_| 2.0 * rng.f32() - 1.0).collect(), cells }
    }

    fn at(&self, u: f32, v: f32) -> f32 {
        let (x, y) = (u.clamp(0.0, 1.0) * self.cells as f32, v.clamp(0.0, 1.0) * self.cells as f32);
        let soft = |t: f32| t * t * (3.0 - 2.0 * t);
        let (fx, fy) = (soft(x.fract()), soft(y.fract()));
        let node = |dx: usize, dy: usize| self.nodes[(y as usize + dy) * (self.cells + 2) + x as usize + dx];
        let row = |dy: usize| node(0, dy) * (1.0 - fx) + node(1, dy) * fx;
        row(0) * (1.0 - fy) + row(1) * fy
    }
}

/// Octaves of [`Waves`], each twice as fine as the one before and weaker: -1..1.
struct Mottle(Vec<Waves>);

impl Mottle {
    fn new(coarsest: usize, octaves: u32, rng: &mut fastrand::Rng) -> Self {
        Self((0..octaves).map(|k| Waves::new(coarsest << k, rng)).collect())
    }

    fn at(&self, u: f32, v: f32) -> f32 {
        let (sum, weight) = self
            .0
            .iter()
            .fold((0.0, (0.0, 1.0)), |(sum, (all, w)), waves| (sum + w * waves.at(u, v), (all + w, 0.7 * w)));
        sum / weight.0
    }
}

/// sRGB, 0..1, of each texel; `u`, `v` in 0..1, v up.
fn paint(side: usize, color: impl Fn(f32, f32) -> Vec3) -> Texture {
    let mut rgb = Vec::with_capacity(3 * side * side);
    for i in 0..side * side {
        let u = ((i % side) as f32 + 0.5) / side as f32;
        let v = 1.0 - ((i / side) as f32 + 0.5) / side as f32;
        rgb.extend((color(u, v).clamp(Vec3::ZERO, Vec3::ONE) * 255.0).to_array().map(|c| c.round() as u8));
    }
    Texture::from_rgb(side, side, &rgb)
}

/// Planks along v, `planks` of them side by side, each with a shade, joints and grain of its own.
pub(super) fn planks(planks: usize, rng: &mut fastrand::Rng) -> Texture {
    let (grain, stains) = (Mottle::new(96, 3, rng), Mottle::new(5, 4, rng));
    let shades: Vec<[f32; 3]> = (0..planks).map(|_| [rng.f32(), rng.f32(), 0.22 + 0.25 * rng.f32()]).collect();
    let (dark, light) = (Vec3::new(0.36, 0.24, 0.15), Vec3::new(0.66, 0.50, 0.34));
    paint(LARGE, move |u, v| {
        let x = u * planks as f32;
        let plank = (x as usize).min(planks - 1);
        let [shade, start, length] = shades[plank];
        let y = v / length + start;
        // Each board of a plank has its own shade, too.
        let own = (shade + 0.37 * y.floor()).fract();
        let seam = x.fract() < 0.03 || y.fract() < 0.008;
        let t = 0.2 + 0.5 * own + 0.25 * grain.at(u, 0.08 * v + 0.5 * shade) + 0.25 * stains.at(u, v);
        dark.lerp(light, t) * if seam { 0.45 } else { 1.0 }
    })
}

/// A light wall with stripes of uneven width, stains, and some posters.
pub(super) fn wallpaper(rng: &mut fastrand::Rng) -> Texture {
    let (stripes, stains) = (Waves::new(40, rng), Mottle::new(6, 6, rng));
    let ink = Mottle::new(24, 4, rng);
    let posters: Vec<([f32; 4], Vec3)> = (0..6)
        .map(|_| {
            let size = [0.05 + 0.06 * rng.f32(), 0.06 + 0.08 * rng.f32()];
            let at = [rng.f32() * 0.9, 0.15 + 0.6 * rng.f32()];
            ([at[0], at[1], at[0] + size[0], at[1] + size[1]], Vec3::new(rng.f32(), rng.f32(), rng.f32()))
        })
        .collect();
    paint(LARGE, move |u, v| {
        let inside = |p: &&([f32; 4], Vec3)| u > p.0[0] && u < p.0[2] && v > p.0[1] && v < p.0[3];
        if let Some((_, tint)) = posters.iter().rfind(inside) {
            return tint.lerp(Vec3::ONE - *tint, 0.5 + 0.8 * ink.at(u, v));
        }
        let base = if stripes.at(u, 0.37) > 0.1 { Vec3::new(0.78, 0.76, 0.68) } else { Vec3::new(0.70, 0.72, 0.70) };
        base + 0.13 * stains.at(u, v)
    })
}

/// Blotches of two colours.
pub(super) fn blotches(a: Vec3, b: Vec3, rng: &mut fastrand::Rng) -> Texture {
    let (shape, fine) = (Mottle::new(5, 3, rng), Mottle::new(24, 3, rng));
    paint(SMALL, move |u, v| {
        let t = ((shape.at(u, v) * 6.0) + 0.5).clamp(0.0, 1.0);
        a.lerp(b, t) + 0.15 * fine.at(u, v)
    })
}

/// Rings of uneven width around v.
pub(super) fn rings(a: Vec3, b: Vec3, rng: &mut fastrand::Rng) -> Texture {
    let (rings, fine) = (Waves::new(14, rng), Mottle::new(20, 3, rng));
    paint(SMALL, move |u, v| {
        let color = if rings.at(0.5, v) + 0.3 * fine.at(u, v) > 0.0 { a } else { b };
        color + 0.1 * fine.at(u, v)
    })
}

/// Cardboard with a tape along v and printed squares.
pub(super) fn cardboard(rng: &mut fastrand::Rng) -> Texture {
    let fine = Mottle::new(16, 4, rng);
    let prints: Vec<[f32; 3]> = (0..7).map(|_| [rng.f32(), rng.f32(), 0.03 + 0.09 * rng.f32()]).collect();
    paint(SMALL, move |u, v| {
        let printed = prints.iter().any(|[x, y, r]| (u - x).abs() < *r && (v - y).abs() < 0.7 * r);
        let base = match () {
            () if printed => Vec3::new(0.28, 0.20, 0.16),
            () if (u - 0.5).abs() < 0.06 => Vec3::new(0.80, 0.72, 0.56),
            () => Vec3::new(0.66, 0.50, 0.34),
        };
        base + 0.12 * fine.at(u, v)
    })
}

/// Wood whose grain runs along u.
pub(super) fn grain(rng: &mut fastrand::Rng) -> Texture {
    let (lines, stains) = (Mottle::new(48, 2, rng), Mottle::new(4, 4, rng));
    paint(SMALL, move |u, v| Vec3::new(0.74, 0.62, 0.46) + 0.22 * lines.at(0.06 * u, v) + 0.18 * stains.at(u, v))
}
