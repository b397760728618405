//! One training view, prepared once: cropped to the object, with the target's half of SSIM cached.

use crate::error::{SplatError, check_finite, check_len};
use crate::ssim::{Padded, moments};
use crate::view::{TILE, View};
use hingecast_geom::Camera;

/// Pixels around the mask's box that belong to the crop: SSIM looks 5 px far, edges are blurred by
/// 1-2 px.
const CROP_MARGIN: usize = 8;

/// Pixel values as they come from a file or a renderer.
#[derive(Clone, Copy, Debug)]
pub enum Pixels<'a> {
    /// 0..=1
    F32(&'a [f32]),
    /// 0..=255, meaning 0..=1
    U8(&'a [u8]),
}

impl Pixels<'_> {
    /// How many values there are.
    pub fn len(&self) -> usize {
        match self {
            Self::F32(v) => v.len(),
            Self::U8(v) => v.len(),
        }
    }

    /// True without values.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Value `i`, scaled to 0..=1.
    ///
    /// # Panics
    /// When `i` is not below [`Pixels::len`].
    pub fn at(&self, i: usize) -> f32 {
        match self {
            Self::F32(v) => v[i],
            Self::U8(v) => f32::from(v[i]) / 255.0,
        }
    }

    fn check(&self, what: &'static str) -> Result<(), SplatError> {
        match self {
            Self::F32(v) => check_finite(what, v),
            Self::U8(_) => Ok(()),
        }
    }
}

/// The pictures of one view, row by row. h, w are those of the camera.
#[derive(Clone, Copy, Debug)]
pub struct TargetImages<'a> {
    /// (h, w, 3)
    pub rgb: Pixels<'a>,
    /// (h, w) z in scene units at pixel centres, 0 = unknown.
    pub depth: Option<&'a [f32]>,
    /// (h, w) 1 = object. None: no alpha loss, the object may fill the picture.
    pub mask: Option<Pixels<'a>>,
    /// (h, w) 0 = this pixel says nothing (an occluder), 1 = counts.
    pub weight: Option<Pixels<'a>>,
    /// Colour behind the object, in the render and in the target outside the mask.
    pub background: [f32; 3],
    /// True when the picture already shows `background` around the object: then the blended pixels
    /// just outside a binary mask are kept. False: everything outside the mask is painted over with
    /// `background`.
    pub shows_background: bool,
}

/// Rows and columns of the picture that hold the object. `x0` is a multiple of 16.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Crop {
    pub x0: usize,
    pub y0: usize,
    /// Inside the picture.
    pub width: usize,
    pub height: usize,
}

impl Crop {
    /// Up to the next multiple of 16; still inside the padded picture.
    pub fn padded_width(&self) -> usize {
        self.width.next_multiple_of(TILE)
    }
}

/// A training view for [`crate::Engine`]. Memory: about 13 floats per pixel of the object's box.
#[derive(Clone, Debug)]
pub struct Target {
    pub(crate) camera: Camera,
    pub(crate) background: [f32; 3],
    pub(crate) crop: Crop,
    pub(crate) has_mask: bool,
    /// Crop planes in [`Padded`] layout: colour, its window mean and variance.
    pub(crate) layout: Padded,
    pub(crate) rgb: [Vec<f32>; 3],
    pub(crate) mean: [Vec<f32>; 3],
    pub(crate) variance: [Vec<f32>; 3],
    /// (crop height, padded crop width): depth (0 = says nothing), alpha, and how far from it alpha
    /// may be for nothing.
    pub(crate) depth: Vec<f32>,
    pub(crate) alpha: Vec<f32>,
    pub(crate) alpha_slack: Vec<f32>,
    /// Whole picture, tile-padded rows, 0 in the padding; None when every pixel counts.
    pub(crate) weight: Option<Vec<f32>>,
}

impl Target {
    /// Crops the pictures of one view to the object and prepares them.
    ///
    /// # Errors
    /// Wrong lengths, NaN or inf, negative depth.
    pub fn new(camera: &Camera, images: &TargetImages) -> Result<Self, SplatError> {
        let view = View::new(camera, &[])?;
        let (w, h) = (camera.width, camera.height);
        check_images(images, w * h)?;

        let mask = |i: usize| images.mask.map_or(1.0, |m| m.at(i));
        let crop = match images.mask {
            Some(mask) => crop_of(&mask, w, h),
            None => Crop { x0: 0, y0: 0, width: w, height: h },
        };
        let padded = crop.padded_width();
        let layout = Padded { width: padded, height: crop.height };
        let mut rgb = [vec![0f32; layout.len()], vec![0f32; layout.len()], vec![0f32; layout.len()]];
        let mut depth = vec![0f32; padded * crop.height];
        let mut alpha = depth.clone();
        let mut alpha_slack = depth.clone();
        for y in 0..crop.height {
            for x in 0..crop.width {
                let i = (crop.y0 + y) * w + crop.x0 + x;
                let m = mask(i);
                for c in 0..3 {
                    let seen = images.rgb.at(3 * i + c);
                    rgb[c][layout.row(y) + x] =
                        if images.shows_background { seen } else { m * seen + (1.0 - m) * images.background[c] };
                }
                alpha[y * padded + x] = m;
                alpha_slack[y * padded + x] = if on_edge(&mask, i, w, h) { EDGE_SLACK } else { 0.0 };
                if let Some(z) = images.depth
                    && m > 0.5
                {
                    depth[y * padded + x] = z[i];
                }
            }
        }
        let filtered: [_; 3] = std::array::from_fn(|c| moments(&rgb[c], layout, crop.width, crop.height));
        let [(m0, v0), (m1, v1), (m2, v2)] = filtered;
        let weight = images.weight.map(|weight| {
            let mut out = vec![0f32; view.plane_len()];
            for y in 0..h {
                for x in 0..w {
                    out[y * view.stride() + x] = weight.at(y * w + x);
                }
            }
            out
        });
        Ok(Self {
            camera: *camera,
            background: images.background,
            crop,
            has_mask: images.mask.is_some(),
            layout,
            rgb,
            mean: [m0, m1, m2],
            variance: [v0, v1, v2],
            depth,
            alpha,
            alpha_slack,
            weight,
        })
    }

    /// Where the view was taken from; its size is that of the picture.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Colour behind the object, rgb, 0..1.
    pub fn background(&self) -> [f32; 3] {
        self.background
    }

    /// Colour that the render is compared with. (h, w, 3)
    pub fn rgb(&self) -> Vec<f32> {
        let (w, h) = (self.camera.width, self.camera.height);
        let mut out = self.background.repeat(w * h);
        for y in 0..self.crop.height {
            for x in 0..self.crop.width {
                let i = (self.crop.y0 + y) * w + self.crop.x0 + x;
                for c in 0..3 {
                    out[3 * i + c] = self.rgb[c][self.layout.row(y) + x];
                }
            }
        }
        out
    }

    /// Depth (0 = unknown) and mask. (h, w) each
    pub fn depth_and_mask(&self) -> (Vec<f32>, Vec<f32>) {
        let (w, h) = (self.camera.width, self.camera.height);
        let (mut depth, mut mask) = (vec![0f32; w * h], vec![0f32; w * h]);
        for y in 0..self.crop.height {
            let to = (self.crop.y0 + y) * w + self.crop.x0;
            let from = y * self.crop.padded_width();
            depth[to..to + self.crop.width].copy_from_slice(&self.depth[from..from + self.crop.width]);
            mask[to..to + self.crop.width].copy_from_slice(&self.alpha[from..from + self.crop.width]);
        }
        (depth, mask)
    }

    /// Weight of pixel (x, y).
    pub fn weight_at(&self, x: usize, y: usize) -> f32 {
        let stride = self.camera.width.next_multiple_of(TILE);
        self.weight.as_ref().map_or(1.0, |w| w[y * stride + x])
    }
}

fn check_images(images: &TargetImages, pixels: usize) -> Result<(), SplatError> {
    check_len("target.rgb", images.rgb.len(), 3 * pixels, "camera width x height x 3")?;
    images.rgb.check("target.rgb")?;
    check_finite("target.background", &images.background)?;
    if let Some(depth) = images.depth {
        check_len("target.depth", depth.len(), pixels, "camera width x height")?;
        check_finite("target.depth", depth)?;
        if let Some(z) = depth.iter().find(|z| **z < 0.0) {
            return Err(SplatError::Range {
                what: "target.depth",
                value: f64::from(*z),
                range: "0 (unknown) and above",
            });
        }
    }
    for (what, plane) in [("target.mask", images.mask), ("target.weight", images.weight)] {
        if let Some(plane) = plane {
            check_len(what, plane.len(), pixels, "camera width x height")?;
            plane.check(what)?;
        }
    }
    Ok(())
}

/// Box of the mask, widened, to whole tiles in x. Empty when there is no object.
fn crop_of(mask: &Pixels, w: usize, h: usize) -> Crop {
    let (mut x0, mut x1, mut y0, mut y1) = (w, 0, h, 0);
    for y in 0..h {
        for x in 0..w {
            if mask.at(y * w + x) > 0.0 {
                (x0, x1) = (x0.min(x), x1.max(x + 1));
                (y0, y1) = (y0.min(y), y1.max(y + 1));
            }
        }
    }
    if x0 >= x1 {
        return Crop::default();
    }
    let x0 = x0.saturating_sub(CROP_MARGIN) / TILE * TILE;
    let x1 = (x1 + CROP_MARGIN).next_multiple_of(TILE).min(w);
    let (y0, y1) = (y0.saturating_sub(CROP_MARGIN), (y1 + CROP_MARGIN).min(h));
    Crop { x0, y0, width: x1 - x0, height: y1 - y0 }
}

/// A binary mask knows of an edge pixel only whether half of it is covered; how much more or less,
/// its blended colour tells. But the colour alone is not enough: a rim of gaussians with the
/// background's colour costs nothing and makes silhouettes fat.
const EDGE_SLACK: f32 = 0.5;

/// Whether one of the eight pixels around is on the other side of the mask.
fn on_edge(mask: &impl Fn(usize) -> f32, i: usize, w: usize, h: usize) -> bool {
    let (x, y) = (i % w, i / w);
    let own = mask(i) > 0.5;
    let rows = y.saturating_sub(1)..(y + 2).min(h);
    rows.into_iter().any(|v| (x.saturating_sub(1)..(x + 2).min(w)).any(|u| (mask(v * w + u) > 0.5) != own))
}
