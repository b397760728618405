//! Views as the gaussian engine wants them.

use crate::failure::Result;
use hingecast_capture::{Recording, Split, View, ViewCache};
use hingecast_splat::{Pixels, Target, TargetImages};

/// The training picture of a view, as the engine wants it.
pub fn target(view: &View, background: ([f32; 3], bool)) -> Result<Target> {
    let to_255 = |x: &[u8]| x.iter().map(|v| v * 255).collect::<Vec<u8>>();
    let (mask, usable) = (to_255(&view.mask), to_255(&view.usable));
    let hidden = view.usable.contains(&0);
    Ok(Target::new(
        &view.camera,
        &TargetImages {
            rgb: Pixels::U8(&view.rgb),
            depth: (!view.depth.is_empty()).then_some(&view.depth),
            mask: Some(Pixels::U8(&mask)),
            weight: hidden.then_some(Pixels::U8(&usable)),
            background: background.0,
            shows_background: background.1,
        },
    )?)
}

/// One colour around the object in all pictures (a studio, a renderer), or black and "paint it
/// over".
pub fn background(recording: &Recording, cache: &ViewCache) -> Result<([f32; 3], bool)> {
    /// Largest deviation, 8-bit, that still counts as one colour: JPEG and light fall-off exceed
    /// it.
    const FLAT: i32 = 3;
    let frames = recording.frames_of(0, Split::Train);
    let mut colour: Option<[u8; 3]> = None;
    for &f in frames.iter().step_by(frames.len().div_ceil(8).max(1)) {
        let view = cache.get(f)?;
        let (w, h) = (view.camera.width, view.camera.height);
        // The picture's border is the surest background.
        let border = (0..w).map(|x| (x, 0)).chain((0..w).map(|x| (x, h - 1)));
        for (x, y) in border {
            let i = y * w + x;
            if view.mask[i] == 1 || view.usable[i] == 0 {
                continue;
            }
            let c: [u8; 3] = [view.rgb[3 * i], view.rgb[3 * i + 1], view.rgb[3 * i + 2]];
            let reference = *colour.get_or_insert(c);
            if (0..3).any(|k| (c[k] as i32 - reference[k] as i32).abs() > FLAT) {
                return Ok(([0.0; 3], false));
            }
        }
    }
    Ok(colour.map_or(([0.0; 3], false), |c| (c.map(|x| x as f32 / 255.0), true)))
}

/// What a perfect twin would render for a held-out view, (h, w, 3), 0..1: the photo, and where
/// `background` is not what it shows around the object, painted over with it.
pub fn photo(view: &View, background: ([f32; 3], bool)) -> Vec<f32> {
    let paint = |(i, c): (usize, &u8)| {
        if background.1 || view.mask[i / 3] == 1 { *c as f32 / 255.0 } else { background.0[i % 3] }
    };
    view.rgb.iter().enumerate().map(paint).collect()
}
