//! Pictures of every state with what is not the object darkened.

use crate::failure::{Failure, Result};
use hingecast_capture::{Recording, Split};
use hingecast_geom::staging::write_whole;
use image::{ImageFormat, Rgb, RgbImage};
use std::path::Path;

/// Pictures of a state.
const ACROSS: usize = 6;
/// Width of a picture.
const WIDTH: u32 = 240;
/// States that are shown.
const STATES: usize = 12;

/// What a sheet says below itself.
pub const SHEET_CAPTION: &str =
    "a row a state, of a film its pictures in the order of time; what is not the object is dark";

/// Writes pictures of every state, their masks shown, as a PNG file: whole or not at all.
///
/// # Errors
/// When a picture cannot be read, or the file not be written.
pub fn write_contact_sheet(recording: &Recording, path: &Path) -> Result<()> {
    let mut png = std::io::Cursor::new(Vec::new());
    contact_sheet(recording)?.write_to(&mut png, ImageFormat::Png).expect("written to memory");
    write_whole(path, png.get_ref()).map_err(Failure::io(path))
}

/// One row a state: pictures spread over its views, the background at a quarter of its brightness,
/// the object's border red. Of a film a row of the scan, and then its states one after the other.
///
/// # Errors
/// When a picture cannot be read.
fn contact_sheet(recording: &Recording) -> Result<RgbImage> {
    let mut rows = Vec::new();
    for frames in frames(recording) {
        let mut row = Vec::new();
        for frame in frames {
            let view = recording.load(frame)?;
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

/// The frames of every row.
fn frames(recording: &Recording) -> Vec<Vec<usize>> {
    let of_state = |state: usize, most: usize| -> Vec<usize> {
        let frames = recording.frames_of(state, Split::Train);
        let n = frames.len().min(most);
        (0..n).map(|k| frames[k * frames.len() / n]).collect()
    };
    let some = |first: usize, most: usize| {
        let n = recording.n_states.saturating_sub(first);
        (first..recording.n_states).step_by(n.div_ceil(most).max(1))
    };
    if !recording.film {
        return some(0, STATES).map(|state| of_state(state, ACROSS)).collect();
    }
    let film: Vec<usize> = some(1, ACROSS * (STATES - 1)).flat_map(|state| of_state(state, 1)).collect();
    std::iter::once(of_state(0, ACROSS)).chain(film.chunks(ACROSS).map(<[usize]>::to_vec)).collect()
}
