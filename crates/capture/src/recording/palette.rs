//! PNGs with a palette: the number of each pixel's colour, which is a thing's number where the file is a
//! mask.

use super::images;
use crate::CaptureError;
use std::path::Path;

/// Byte of a PNG that holds its colour type, and the type of palettes.
const COLOR_TYPE: usize = 25;
const PALETTE: u8 = 3;

/// Entry of the palette of every pixel, row-major, with width and height; `None` for other images.
///
/// # Errors
/// When the image is missing or cannot be decoded.
pub(super) fn read(path: &Path) -> Result<Option<(Vec<u8>, usize, usize)>, CaptureError> {
    let bytes = images::bytes(path)?;
    if !bytes.starts_with(b"\x89PNG\r\n\x1a\n") || bytes.get(COLOR_TYPE) != Some(&PALETTE) {
        return Ok(None);
    }
    decode(&bytes).map(Some).map_err(|e| images::broken(path, bytes.len(), &e))
}

fn decode(bytes: &[u8]) -> Result<(Vec<u8>, usize, usize), png::DecodingError> {
    let mut decoder = png::Decoder::new(std::io::Cursor::new(bytes));
    decoder.set_transformations(png::Transformations::IDENTITY);
    let mut reader = decoder.read_info()?;
    let size = reader.output_buffer_size().ok_or(png::DecodingError::LimitsExceeded)?;
    let mut rows = vec![0; size];
    let info = reader.next_frame(&mut rows)?;
    let (w, h, bits) = (info.width as usize, info.height as usize, info.bit_depth as usize);
    // Several to a byte, the first in its highest bits; rows begin with a byte.
    let per_byte = 8 / bits;
    let at = |x: usize, y: usize| {
        let byte = u16::from(rows[y * info.line_size + x / per_byte]);
        (byte >> (8 - bits * (x % per_byte + 1)) & ((1 << bits) - 1)) as u8
    };
    Ok(((0..w * h).map(|i| at(i % w, i / w)).collect(), w, h))
}

/// A palette PNG of two bits a pixel, as small as such files come.
#[cfg(test)]
pub(super) fn write(path: &Path, pixels: &[u8], w: usize, palette: &[u8]) -> Result<(), png::EncodingError> {
    let mut encoder =
        png::Encoder::new(std::fs::File::create(path).expect("a file"), w as u32, (pixels.len() / w) as u32);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_depth(png::BitDepth::Two);
    encoder.set_palette(palette.to_vec());
    let pack = |row: &[u8]| {
        row.chunks(4).map(|p| p.iter().enumerate().fold(0, |b, (k, v)| b | v << (6 - 2 * k))).collect::<Vec<u8>>()
    };
    encoder.write_header()?.write_image_data(&pixels.chunks(w).flat_map(pack).collect::<Vec<u8>>())
}
