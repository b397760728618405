//! A row of pictures of one episode, as PNG.

use hingecast::failure::Result;
use hingecast_capture::recording::images::write_rgb;
use hingecast_sim::{Env, Scene, Start, picture};
use image::{RgbImage, imageops};
use rayon::prelude::*;
use std::path::Path;

const FRAMES: usize = 6;
const WIDTH: usize = 240;
const HEIGHT: usize = 200;

/// Six moments of the episode, evenly spaced, first and last included.
///
/// # Errors
/// When the file cannot be written.
pub fn write(scene: &Scene, start: &Start, states: &[Vec<f64>], path: &Path) -> Result<()> {
    let last = states.len().saturating_sub(1);
    let tiles: Vec<Result<RgbImage>> = (0..FRAMES)
        .into_par_iter()
        .map(|k| {
            let mut env = Env::new(scene);
            env.start_from(start)?;
            env.set_state(&states[k * last / (FRAMES - 1)])?;
            let pixels = picture::take(&mut env, &picture::SIDE, WIDTH, HEIGHT);
            Ok(RgbImage::from_raw(WIDTH as u32, HEIGHT as u32, pixels).expect("three bytes a pixel"))
        })
        .collect();
    let mut sheet = RgbImage::from_pixel((FRAMES * (WIDTH + 4) - 4) as u32, HEIGHT as u32, image::Rgb([255; 3]));
    for (k, tile) in tiles.into_iter().enumerate() {
        imageops::replace(&mut sheet, &tile?, (k * (WIDTH + 4)) as i64, 0);
    }
    let (w, h) = (sheet.width() as usize, sheet.height() as usize);
    Ok(write_rgb(path, sheet.as_raw(), w, h)?)
}
