//! The object of a recording without masks.

use super::raw_depths::RawDepths;
use super::words::failure;
use crate::failure::{Failure, Result};
use glam::DVec2;
use hingecast_capture::recording::images;
use hingecast_capture::{Frame, Recording, Split};
use hingecast_geom::Progress;
use hingecast_prepare::{MaskReport, Wanted, object_masks};
use std::path::{Path, PathBuf};

/// Finds the object and writes its masks into `folder`, one PNG a training frame, named as the
/// colour image is; frames point there.
///
/// # Errors
/// Nothing that moves, a picture that cannot be read or written, the wish to stop.
pub fn find_masks(
    recording: &mut Recording,
    wanted: &Wanted,
    folder: &Path,
    seed: u64,
    progress: &Progress,
) -> Result<MaskReport> {
    let mut depths = RawDepths::new(recording);
    let found = object_masks(&mut depths, wanted, recording.film, recording.up, seed, progress)
        .map_err(|e| failure(e, recording))?;
    write_pixels(recording, &found.masks, Pixels::Object, folder)?;
    Ok(found.report)
}

/// What the pixels say that a build finds in a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Pixels {
    /// They show the object.
    Object,
    /// They show a hand.
    Hand,
}

impl Pixels {
    /// The file of a frame's, in the folder of what was prepared.
    fn name(self, recording: &Recording, frame: usize) -> String {
        let mask = mask_name(recording, frame);
        if self == Self::Hand { format!("hand_{mask}") } else { mask }
    }

    fn point(self, frame: &mut Frame, path: PathBuf) {
        match self {
            Self::Object => {
                frame.mask = Some(path);
                frame.mask_ids.clear();
            }
            Self::Hand => frame.occluder_mask = Some(path),
        }
    }
}

/// Writes `found` (1 = such a pixel; `[state][view]`, (h, w)) into `folder`; training frames point there.
pub(super) fn write_pixels(
    recording: &mut Recording,
    found: &[Vec<Vec<u8>>],
    pixels: Pixels,
    folder: &Path,
) -> Result<()> {
    for (state, masks) in found.iter().enumerate() {
        for (frame, mask) in recording.frames_of(state, Split::Train).into_iter().zip(masks) {
            let path = folder.join(pixels.name(recording, frame));
            let camera = &recording.frames[frame].camera;
            let bytes: Vec<u8> = mask.iter().map(|m| 255 * m).collect();
            images::write_gray(&path, &bytes, camera.width, camera.height)?;
            pixels.point(&mut recording.frames[frame], path);
        }
    }
    Ok(())
}

/// Lets training frames point to what [`write_pixels`] wrote into `folder`.
pub(super) fn restore_pixels(recording: &mut Recording, pixels: Pixels, folder: &Path) {
    for frame in 0..recording.frames.len() {
        let path = folder.join(pixels.name(recording, frame));
        if recording.frames[frame].split == Split::Train && path.is_file() {
            pixels.point(&mut recording.frames[frame], path);
        }
    }
}

/// The place that a pixel of a picture shows, world frame. `picture`: the end of its path.
///
/// # Errors
/// No picture of that name, or more than one; a pixel outside it or without depth.
pub fn place_at(recording: &Recording, picture: &str, pixel: [f64; 2]) -> Result<[f32; 3]> {
    let of_name = |f: &&hingecast_capture::Frame| f.color.ends_with(picture) && f.split == Split::Train;
    let place = || format!("--at {picture}:{},{}", pixel[0], pixel[1]);
    let found: Vec<usize> = recording.frames.iter().enumerate().filter(|(_, f)| of_name(f)).map(|(i, _)| i).collect();
    let [frame] = found[..] else {
        let what = format!("{} training pictures have this name", found.len());
        return Err(Failure::new(what, place(), "its name as in transforms.json: --at rgb/s000_v003.png:U,V"));
    };
    let view = recording.load(frame)?;
    let [u, v] = pixel.map(|x| x.floor());
    let (w, h) = (view.camera.width as f64, view.camera.height as f64);
    if !(u >= 0.0 && v >= 0.0 && u < w && v < h) {
        let hint = format!("pixels from the upper left corner; the picture has {w} x {h} of them");
        return Err(Failure::new("the pixel is not in the picture", place(), hint));
    }
    let z = view.depth.get(v as usize * view.camera.width + u as usize).copied().unwrap_or(0.0);
    if z <= 0.0 {
        return Err(Failure::new("the pixel has no depth", place(), "take one beside it, in the middle of a surface"));
    }
    Ok(view.camera.unproject(DVec2::new(u + 0.5, v + 0.5), f64::from(z)).as_vec3().to_array())
}

/// `s003_v012.png`, which no two frames share.
fn mask_name(recording: &Recording, frame: usize) -> String {
    let f = &recording.frames[frame];
    let before = recording.frames[..frame].iter().filter(|o| (o.state, o.view) == (f.state, f.view)).count();
    let more = if before > 0 { format!("_{before}") } else { String::new() };
    format!("s{:03}_v{:03}{more}.png", f.state, f.view)
}
