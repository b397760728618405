//! Decoding one frame: colour, depth, mask, and which pixels the person leaves visible.

use super::{Frame, Recording, images};
use crate::CaptureError;
use hingecast_geom::Camera;
use std::path::Path;

/// The pixels of one frame, row-major, w*h from its camera.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// The frame's camera: w, h and pose.
    pub camera: Camera,
    /// sRGB (h, w, 3).
    pub rgb: Vec<u8>,
    /// z in scene units (h, w); 0 = unknown; empty when the frame has no depth.
    pub depth: Vec<f32>,
    /// 1 = object, 0 = background (h, w); all 1 when the frame has neither mask nor alpha.
    pub mask: Vec<u8>,
    /// 0 where an occluder hides the object (h, w).
    pub usable: Vec<u8>,
}

impl Recording {
    /// Decodes a frame.
    ///
    /// # Errors
    /// When an image is missing, cut short, or of another size than the camera says.
    pub fn load(&self, frame: usize) -> Result<View, CaptureError> {
        let Some(f) = self.frames.get(frame) else {
            let place = format!("frame {frame} of {}", self.frames.len());
            return Err(CaptureError::new("there is no such frame", place, "frames count from 0"));
        };
        load(f)
    }
}

pub(crate) fn load(f: &Frame) -> Result<View, CaptureError> {
    let (w, h) = (f.camera.width, f.camera.height);
    let image = images::read(&f.color)?;
    same_size(&f.color, (image.width() as usize, image.height() as usize), (w, h))?;
    let (rgb, alpha) = if image.color().has_alpha() {
        let (rgb, alpha) = over_white(&image.into_rgba8().into_raw());
        (rgb, Some(alpha))
    } else {
        (image.into_rgb8().into_raw(), None)
    };
    let depth = match &f.depth {
        None => Vec::new(),
        Some(path) => {
            let (stored, dw, dh) = images::read_depth(path)?;
            same_size(path, (dw, dh), (w, h))?;
            let scale = f.depth_scale as f32;
            stored.into_iter().map(|d| d * scale).map(|z| if z > 0.0 && z.is_finite() { z } else { 0.0 }).collect()
        }
    };
    let mask = match (&f.mask, alpha) {
        (Some(path), _) => binary(path, &f.mask_ids, w, h)?,
        (None, Some(alpha)) => alpha,
        (None, None) => vec![1; w * h],
    };
    let usable = match &f.occluder_mask {
        Some(path) => binary(path, &[], w, h)?.into_iter().map(|hidden| 1 - hidden).collect(),
        None => vec![1; w * h],
    };
    Ok(View { camera: f.camera, rgb, depth, mask, usable })
}

/// Transparent pictures come over white, the background that `synth` uses; alpha above one half is
/// the object.
fn over_white(rgba: &[u8]) -> (Vec<u8>, Vec<u8>) {
    let mix = |c: u8, a: u8| ((u32::from(c) * u32::from(a) + 255 * (255 - u32::from(a)) + 127) / 255) as u8;
    let rgb = rgba.chunks_exact(4).flat_map(|p| [mix(p[0], p[3]), mix(p[1], p[3]), mix(p[2], p[3])]).collect();
    (rgb, rgba.chunks_exact(4).map(|p| u8::from(p[3] > 127)).collect())
}

/// A mask image as 0 and 1.
pub(crate) fn binary(path: &Path, ids: &[u16], w: usize, h: usize) -> Result<Vec<u8>, CaptureError> {
    let (mask, mw, mh) = super::mask::read(path, ids)?;
    same_size(path, (mw, mh), (w, h))?;
    Ok(mask)
}

fn same_size(path: &Path, found: (usize, usize), expected: (usize, usize)) -> Result<(), CaptureError> {
    if found == expected {
        return Ok(());
    }
    Err(CaptureError::new(
        format!("an image is {} x {}, but the camera says {} x {}", found.0, found.1, expected.0, expected.1),
        path.display().to_string(),
        "correct w and h (and fl_x, fl_y, cx, cy with them), or resize the image",
    ))
}
