//! Pictures of every state with what is not the object darkened.

use crate::failure::Result;
use hingecast_capture::{Recording, Split};
use image::{Rgb, RgbImage};

/// Pictures of a state.
const ACROSS: usize = 6;
/// Width of a picture.
const WIDTH: u32 = 240;
/// States that are shown.
const STATES: usize = 12;

/// One row a state: pictures spread over its views, the background at a quarter of its brightness,
/// the object's border red.
///
/// # Errors
/// When a picture cannot be read.
pub fn contact_sheet(recording: &Recording) -> Result<RgbImage> {
    let states: Vec<usize> = (0..recording.n_states).step_by(recording.n_states.div_ceil(STATES).max(1)).collect();
    let mut rows = Vec::new();
    for &state in &states {
        let frames = recording.frames_of(state, Split::Train);
        let n = frames.len().min(ACROSS);
        let mut row = Vec::new();
        for k in 0..n {
            let view = recording.load(frames[k * frames.len() / n])?;
            let (w, h) = (view.camera.width, view.camera.height);
            let pixel = |x: u32, y: u32| {
                let i = y as usize * w + x as usize;
                let own = view.mask[i];
                let beside = |j: Option<usize>| j.and_then(|j| view.mask.get(j)).is_some_and(|m| *m != own);
                let border = own == 1
                    && (beside(i.checked_sub(1))
                        || beside(Some(i + 1))
                        || beside(i.checked_sub(w))
                        || beside(Some(i + w)));
                let c: [u8; 3] = std::array::from_fn(|k| view.rgb[3 * i + k]);
                match (border, own) {
                    (true, _) => Rgb([255, 30, 30]),
                    (_, 1) => Rgb(c),
                    _ => Rgb(c.map(|v| v / 4)),
                }
            };
            let whole = RgbImage::from_fn(w as u32, h as u32, pixel);
            let height = (WIDTH as usize * h / w.max(1)).max(1) as u32;
            row.push(image::imageops::resize(&whole, WIDTH, height, image::imageops::FilterType::Triangle));
        }
        rows.push(row);
    }
    let height = |row: &Vec<RgbImage>| row.iter().map(|p| p.height()).max().unwrap_or(0);
    let total: u32 = rows.iter().map(height).sum();
    let mut sheet = RgbImage::new(WIDTH * ACROSS as u32, total.max(1));
    let mut y = 0;
    for row in &rows {
        for (k, picture) in row.iter().enumerate() {
            image::imageops::replace(&mut sheet, picture, i64::from(WIDTH) * k as i64, i64::from(y));
        }
        y += height(row);
    }
    Ok(sheet)
}
