//! The slow, obvious twin of the engine: one gaussian, one pixel at a time, f64, textbook formulas.
//!
//! The tests hold every fast kernel against it and hold its gradients against central differences;
//! the speed bench measures against it. It is the per-pixel loop of the CUDA rasteriser of 3D
//! Gaussian Splatting (Kerbl et al. 2023): depth-sorted lists per 16 x 16 tile, front to back
//! forward, back to front backward.

mod loss;
mod project;

pub use loss::loss;

use crate::target::Target;
use glam::DVec3;
use hingecast_geom::{Camera, Gaussians, Pose};
use project::{Screen, SplatGradient};

/// f64, so that central differences can take small steps.
pub type Real = f64;

const TILE: usize = 16;

/// Gaussians, how they are moved, and what is drawn besides colour.
#[derive(Clone, Copy)]
pub struct Scene<'a> {
    /// What is drawn, in the canonical frame.
    pub gaussians: &'a Gaussians,
    /// Empty: everything at rest.
    pub groups: &'a [u16],
    /// Pose of every group.
    pub world_from_group: &'a [Pose],
    /// (gaussians, channels)
    pub extra: &'a [f32],
    /// Extra values of a gaussian; 0 when `extra` is empty.
    pub channels: usize,
}

/// A picture with what the backward pass needs. Planes are (h, w).
pub struct Image {
    /// What it was drawn with; (h, w) is its size.
    pub camera: Camera,
    /// Colour behind the gaussians, rgb, 0..1.
    pub background: [Real; 3],
    /// Red, green and blue, over the background.
    pub rgb: [Vec<Real>; 3],
    /// Premultiplied depth: sum of w_i z_i, scene units.
    pub depth: Vec<Real>,
    /// What is left of the light: 1 - alpha.
    pub transmittance: Vec<Real>,
    /// Premultiplied extra values, one plane a channel.
    pub extra: Vec<Vec<Real>>,
    screen: Vec<Screen>,
    tiles: Vec<Vec<u32>>,
}

/// dL/d pixel, planes like [`Image`].
#[derive(Clone, Default)]
pub struct PixelGradient {
    /// By red, green and blue.
    pub rgb: [Vec<Real>; 3],
    /// By the premultiplied depth.
    pub depth: Vec<Real>,
    /// By alpha.
    pub alpha: Vec<Real>,
    /// By the premultiplied extra values, one plane a channel.
    pub extra: Vec<Vec<Real>>,
}

/// Gradients in the order of [`Gaussians`]; twists as in [`crate::Gradients`].
#[derive(Clone, Default)]
pub struct SceneGradient {
    /// By the centres. (n, 3)
    pub means: Vec<[Real; 3]>,
    /// By the quaternions as they are, before they are normalised; w x y z. (n, 4)
    pub quats: Vec<[Real; 4]>,
    /// By the logarithms of the standard deviations. (n, 3)
    pub scales: Vec<[Real; 3]>,
    /// By the logits. (n)
    pub opacities: Vec<Real>,
    /// By the coefficients of degree 0. (n, 3)
    pub sh0: Vec<[Real; 3]>,
    /// By the coefficients of degree 1, basis y, z, x, each rgb; empty when the degree is 0. (n, 3,
    /// 3)
    pub sh1: Vec<[[Real; 3]; 3]>,
    /// By the extra values. (n, channels)
    pub extra: Vec<Vec<Real>>,
    /// By the groups' poses, as twists (vx vy vz wx wy wz); one without groups.
    pub poses: Vec<[Real; 6]>,
}

/// Renders `scene` over `background`.
pub fn render(scene: &Scene, camera: &Camera, background: [f32; 3]) -> Image {
    let n = scene.gaussians.len();
    let screen: Vec<Screen> = (0..n).map(|i| Screen::project(scene, i, camera)).collect();
    let (w, h) = (camera.width, camera.height);
    let (tiles_x, tiles_y) = (w.div_ceil(TILE), h.div_ceil(TILE));

    // Depth order, then one list per tile.
    let mut order: Vec<u32> = (0..n as u32).filter(|&i| screen[i as usize].visible).collect();
    order.sort_by(|&a, &b| (screen[a as usize].z as f32).total_cmp(&(screen[b as usize].z as f32)));
    let mut tiles = vec![Vec::new(); tiles_x * tiles_y];
    for &i in &order {
        let s = &screen[i as usize];
        let range = |centre: Real, reach: Real, count: usize| {
            let lo = ((centre - reach) / TILE as Real).max(0.0) as usize;
            let hi = ((centre + reach) / TILE as Real).max(0.0) as usize;
            lo.min(count - 1)..hi.min(count - 1) + 1
        };
        for y in range(s.mean[1], s.reach[1], tiles_y) {
            for x in range(s.mean[0], s.reach[0], tiles_x) {
                tiles[y * tiles_x + x].push(i);
            }
        }
    }

    let zeros = || vec![0.0 as Real; w * h];
    let mut image = Image {
        camera: *camera,
        background: background.map(Real::from),
        rgb: [zeros(), zeros(), zeros()],
        depth: zeros(),
        transmittance: zeros(),
        extra: vec![zeros(); scene.channels],
        screen,
        tiles,
    };
    for y in 0..h {
        for x in 0..w {
            draw_pixel(scene, &mut image, x, y, tiles_x);
        }
    }
    image
}

/// Alpha of gaussian `s` at a pixel centre, before the cap; None when it does not count.
#[inline]
fn alpha_at(s: &Screen, px: Real, py: Real) -> Option<Real> {
    let (dx, dy) = (px - s.mean[0], py - s.mean[1]);
    let power = -0.5 * (s.conic[0] * dx * dx + s.conic[2] * dy * dy) - s.conic[1] * dx * dy;
    if power + s.log_opacity < s.least {
        return None;
    }
    Some((power + s.log_opacity).exp())
}

fn draw_pixel(scene: &Scene, image: &mut Image, x: usize, y: usize, tiles_x: usize) {
    let (px, py) = (x as Real + 0.5, y as Real + 0.5);
    let at = y * image.camera.width + x;
    let mut t = 1.0;
    let (mut rgb, mut depth) = ([0.0; 3], 0.0);
    for &i in &image.tiles[y / TILE * tiles_x + x / TILE] {
        if t < crate::raster::MIN_TRANSMITTANCE as Real {
            break;
        }
        let s = &image.screen[i as usize];
        let Some(alpha) = alpha_at(s, px, py) else { continue };
        let w = alpha.min(crate::raster::MAX_ALPHA as Real) * t;
        for c in 0..3 {
            rgb[c] += w * s.rgb[c];
        }
        depth += w * s.z;
        for c in 0..scene.channels {
            image.extra[c][at] += w * Real::from(scene.extra[i as usize * scene.channels + c]);
        }
        t -= w;
    }
    for c in 0..3 {
        image.rgb[c][at] = rgb[c] + t * image.background[c];
    }
    image.depth[at] = depth;
    image.transmittance[at] = t;
}

/// Gradients of everything from the gradient by the pixels.
pub fn backward(scene: &Scene, image: &Image, pixels: &PixelGradient) -> SceneGradient {
    let n = scene.gaussians.len();
    let mut splats = vec![SplatGradient::default(); n];
    let mut extra = vec![vec![0.0; scene.channels]; n];
    let (w, h) = (image.camera.width, image.camera.height);
    for y in 0..h {
        for x in 0..w {
            pixel_backward(scene, image, pixels, x, y, &mut splats, &mut extra);
        }
    }
    let mut out = SceneGradient {
        means: vec![[0.0; 3]; n],
        quats: vec![[0.0; 4]; n],
        scales: vec![[0.0; 3]; n],
        opacities: vec![0.0; n],
        sh0: vec![[0.0; 3]; n],
        sh1: vec![[[0.0; 3]; 3]; scene.gaussians.sh1.len()],
        extra,
        poses: vec![[0.0; 6]; scene.world_from_group.len().max(1)],
    };
    for i in 0..n {
        if image.screen[i].visible {
            project::backward(scene, &image.camera, i, &image.screen[i], &splats[i], &mut out);
        }
    }
    out
}

/// Back to front: `behind` is the colour (and depth, alpha ...) gathered behind the current
/// gaussian, dotted with dL/d pixel.
fn pixel_backward(
    scene: &Scene,
    image: &Image,
    pixels: &PixelGradient,
    x: usize,
    y: usize,
    splats: &mut [SplatGradient],
    extra: &mut [Vec<Real>],
) {
    let (px, py) = (x as Real + 0.5, y as Real + 0.5);
    let at = y * image.camera.width + x;
    let g_rgb = [pixels.rgb[0][at], pixels.rgb[1][at], pixels.rgb[2][at]];
    let (g_depth, g_alpha) = (pixels.depth[at], pixels.alpha[at]);
    let list = &image.tiles[y / TILE * image.camera.width.div_ceil(TILE) + x / TILE];

    // The gaussians that this pixel used, with alpha and transmittance before them.
    let mut used = Vec::with_capacity(32);
    let mut t = 1.0;
    for &i in list {
        if t < crate::raster::MIN_TRANSMITTANCE as Real {
            break;
        }
        if let Some(raw) = alpha_at(&image.screen[i as usize], px, py) {
            let alpha = raw.min(crate::raster::MAX_ALPHA as Real);
            used.push((i as usize, raw, alpha, t));
            t -= alpha * t;
        }
    }
    // Behind everything: the background, which is what alpha takes away from.
    let mut behind = (0..3).map(|c| g_rgb[c] * image.background[c]).sum::<Real>() - g_alpha;
    for &(i, raw, alpha, t) in used.iter().rev() {
        let s = &image.screen[i];
        let w = alpha * t;
        let mut own = g_depth * s.z;
        for c in 0..3 {
            own += g_rgb[c] * s.rgb[c];
            splats[i].rgb[c] += w * g_rgb[c];
        }
        splats[i].z += w * g_depth;
        for c in 0..scene.channels {
            let g = pixels.extra[c][at];
            own += g * Real::from(scene.extra[i * scene.channels + c]);
            extra[i][c] += w * g;
        }
        let d_alpha = t * (own - behind);
        if raw <= crate::raster::MAX_ALPHA as Real {
            splats[i].add_alpha(s, d_alpha * alpha, px - s.mean[0], py - s.mean[1]);
        }
        behind = alpha * own + (1.0 - alpha) * behind;
    }
}

/// Loss and gradients of one view in one call, as [`crate::Engine::loss_and_gradients`].
pub fn loss_and_gradients(
    scene: &Scene,
    target: &Target,
    config: &crate::LossConfig,
) -> (crate::LossTerms, SceneGradient) {
    let image = render(scene, target.camera(), target.background());
    let (terms, pixels) = loss(&image, target, config);
    (terms, backward(scene, &image, &pixels))
}

pub(crate) fn vec3(v: [f32; 3]) -> DVec3 {
    DVec3::new(v[0].into(), v[1].into(), v[2].into())
}
