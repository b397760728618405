//! Single images in and out: colour, mask, depth. Errors name the file.

use crate::CaptureError;
use hingecast_geom::staging::{write_quick, write_whole};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{DynamicImage, ExtendedColorType, ImageEncoder};
use std::path::Path;

/// Decodes an image file.
///
/// # Errors
/// When the file is missing, cut short, or of a format that is not known.
pub fn read(path: &Path) -> Result<DynamicImage, CaptureError> {
    let bytes = bytes(path)?;
    image::load_from_memory(&bytes).map_err(|e| broken(path, bytes.len(), &e))
}

/// The bytes of an image file.
pub(super) fn bytes(path: &Path) -> Result<Vec<u8>, CaptureError> {
    std::fs::read(path).map_err(|e| {
        let what =
            if e.kind() == std::io::ErrorKind::NotFound { "an image is missing" } else { "cannot read an image" };
        CaptureError::new(
            format!("{what}: {e}"),
            path.display().to_string(),
            "copy the file again, or drop its frame: hingecast check --fix",
        )
    })
}

/// What to say of an image that cannot be decoded.
pub(super) fn broken(path: &Path, len: usize, e: &dyn std::fmt::Display) -> CaptureError {
    CaptureError::new(
        format!("an image cannot be decoded: {e}"),
        format!("{} ({len} bytes)", path.display()),
        "it is cut short or no PNG or JPEG: copy or export it again, or drop its frame: hingecast check --fix",
    )
}

/// Depth in stored units (h*w, row-major) with its size: grey PNG of 8 or 16 bits, or .npy of (h,
/// w) numbers.
///
/// # Errors
/// When the file is missing or broken, is coloured, or is no array of two dimensions.
pub fn read_depth(path: &Path) -> Result<(Vec<f32>, usize, usize), CaptureError> {
    if path.extension().is_some_and(|e| e == "npy") {
        return read_depth_npy(path);
    }
    let image = read(path)?;
    let (w, h) = (image.width() as usize, image.height() as usize);
    let values = match image {
        DynamicImage::ImageLuma16(i) => i.into_raw().into_iter().map(f32::from).collect(),
        DynamicImage::ImageLuma8(i) => i.into_raw().into_iter().map(f32::from).collect(),
        other => {
            return Err(CaptureError::new(
                format!("a depth image should be grey with 16 bits, not {:?}", other.color()),
                path.display().to_string(),
                "export depth as 16-bit grey PNG or .npy, not as a coloured preview",
            ));
        }
    };
    Ok((values, w, h))
}

fn read_depth_npy(path: &Path) -> Result<(Vec<f32>, usize, usize), CaptureError> {
    let (values, shape) = read_npy(path)?;
    let (h, w) = match shape[..] {
        [h, w] | [h, w, 1] | [1, h, w] if h > 0 && w > 0 => (h, w),
        _ => {
            let hint = "save depth as an array of shape (height, width)";
            let what = format!("a depth array has the shape {shape:?}");
            return Err(CaptureError::new(what, path.display().to_string(), hint));
        }
    };
    Ok((values.into_iter().map(|x| x as f32).collect(), w, h))
}

/// Bytes that the header of a .npy file of version 2 or 3 says it has: a 32-bit number that the library
/// would make room for unasked. `None` for other files.
fn header_len(bytes: &[u8]) -> Option<u64> {
    let versions = [2, 3];
    let long = bytes.starts_with(b"\x93NUMPY") && bytes.get(6).is_some_and(|v| versions.contains(v));
    let length: [u8; 4] = bytes.get(8..12).filter(|_| long)?.try_into().ok()?;
    Some(u64::from(u32::from_le_bytes(length)))
}

/// Any real-valued .npy array as row-major f64 with its shape.
///
/// # Errors
/// When the file is missing, is no .npy array of real numbers, or is in Fortran order.
pub fn read_npy(path: &Path) -> Result<(Vec<f64>, Vec<usize>), CaptureError> {
    let bytes = std::fs::read(path).map_err(|e| CaptureError::read(path, e))?;
    let bad = |e: &dyn std::fmt::Display| {
        let hint = "save it with numpy.save as a plain array of numbers";
        CaptureError::new(format!("not a readable .npy array: {e}"), path.display().to_string(), hint)
    };
    if header_len(&bytes).is_some_and(|n| n > bytes.len() as u64) {
        return Err(bad(&"it is cut short, within its header"));
    }
    let file = || npyz::NpyFile::new(&bytes[..]).map_err(|e| bad(&e));
    let header = file()?;
    let shape: Vec<usize> = header.shape().iter().map(|&n| n as usize).collect();
    if header.order() != npyz::Order::C && shape.len() > 1 {
        return Err(bad(&"it is in Fortran order"));
    }
    macro_rules! attempt {
        ($($t:ty),*) => {$(
            if let Ok(data) = file()?.data::<$t>() {
                let values: Result<Vec<f64>, _> = data.map(|x| x.map(|x| x as f64)).collect();
                let values = values.map_err(|e| bad(&e))?;
                let wanted = shape.iter().try_fold(1usize, |n, k| n.checked_mul(*k));
                if wanted != Some(values.len()) {
                    return Err(bad(&format!("its shape is {shape:?} and it holds {} numbers", values.len())));
                }
                return Ok((values, shape));
            }
        )*};
    }
    attempt!(f32, f64, u16, u8, i16, i32, u32, i64, u64);
    let descr = header.dtype().descr();
    if let Some(order) = descr.trim_matches('\'').strip_suffix("f2") {
        let numbers = shape.iter().try_fold(1usize, |n, k| n.checked_mul(*k)).and_then(|n| n.checked_mul(2));
        let start = numbers.and_then(|n| bytes.len().checked_sub(n));
        let pairs = start.map_or(&[][..], |start| bytes[start..].as_chunks::<2>().0);
        // What stands before the numbers is at least the shortest header.
        if start.is_some_and(|start| start > 10) {
            let bits = |p: &[u8; 2]| if order == ">" { u16::from_be_bytes(*p) } else { u16::from_le_bytes(*p) };
            return Ok((pairs.iter().map(|p| from_half(bits(p))).collect(), shape));
        }
    }
    Err(bad(&format!("its type is {}", header.dtype().descr())))
}

/// IEEE 754's 16 bits: sign, 5 of exponent, 10 of fraction.
fn from_half(bits: u16) -> f64 {
    let fraction = f64::from(bits & 0x3ff) / 1024.0;
    let value = match bits >> 10 & 0x1f {
        0 => fraction * 2f64.powi(-14),
        31 if bits & 0x3ff == 0 => f64::INFINITY,
        31 => f64::NAN,
        exponent => (1.0 + fraction) * 2f64.powi(i32::from(exponent) - 15),
    };
    if bits >> 15 == 1 { -value } else { value }
}

/// Grey 8-bit PNG, fast compression.
///
/// # Errors
/// When the file cannot be written.
pub fn write_gray(path: &Path, pixels: &[u8], w: usize, h: usize) -> Result<(), CaptureError> {
    write_png(path, pixels, w, h, ExtendedColorType::L8)
}

/// What [`write_gray`] would write.
pub fn gray_png(pixels: &[u8], w: usize, h: usize) -> Result<Vec<u8>, CaptureError> {
    png(pixels, w, h, ExtendedColorType::L8).map_err(|e| CaptureError::write(Path::new("a mask"), e))
}

/// RGB 8-bit PNG, fast compression.
///
/// # Errors
/// When the file cannot be written.
pub fn write_rgb(path: &Path, pixels: &[u8], w: usize, h: usize) -> Result<(), CaptureError> {
    write_png(path, pixels, w, h, ExtendedColorType::Rgb8)
}

/// Grey 16-bit PNG of depth in stored units; 0 = unknown.
///
/// # Errors
/// When the file cannot be written.
pub fn write_depth(path: &Path, pixels: &[u16], w: usize, h: usize) -> Result<(), CaptureError> {
    // The encoder wants native byte order and swaps by itself.
    let bytes: Vec<u8> = pixels.iter().flat_map(|p| p.to_ne_bytes()).collect();
    write_png(path, &bytes, w, h, ExtendedColorType::L16)
}

fn write_png(path: &Path, bytes: &[u8], w: usize, h: usize, color: ExtendedColorType) -> Result<(), CaptureError> {
    let out = png(bytes, w, h, color).map_err(|e| CaptureError::write(path, e))?;
    write_quick(path, &out).map_err(|e| CaptureError::write(path, e))
}

/// The bytes of a PNG file.
fn png(bytes: &[u8], w: usize, h: usize, color: ExtendedColorType) -> image::ImageResult<Vec<u8>> {
    let mut out = Vec::with_capacity(bytes.len() / 2 + 1024);
    let encoder = PngEncoder::new_with_quality(&mut out, CompressionType::Fast, FilterType::Adaptive);
    encoder.write_image(bytes, w as u32, h as u32, color)?;
    Ok(out)
}

/// Writes a file that is whole or absent, also after a power cut.
///
/// # Errors
/// When the file cannot be written.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<(), CaptureError> {
    write_whole(path, bytes).map_err(|e| CaptureError::write(path, e))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A .npy file of version 1 or 2 with a shape and so many f32.
    fn npy(version: u8, shape: &str, header_len: Option<u32>, numbers: usize) -> Vec<u8> {
        let text = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({shape}), }}\n");
        let length = header_len.unwrap_or(text.len() as u32);
        let mut out = b"\x93NUMPY".to_vec();
        out.extend([version, 0]);
        if version == 1 {
            out.extend((length as u16).to_le_bytes())
        } else {
            out.extend(length.to_le_bytes())
        }
        out.extend(text.bytes());
        out.extend(std::iter::repeat_n(1f32.to_le_bytes(), numbers).flatten());
        out
    }

    #[test]
    fn half_precision_is_read() {
        for (bits, value) in
            [(0x3c00, 1.0), (0xc000, -2.0), (0x3555, 0.333_251_953_125), (0x0001, 2f64.powi(-24)), (0x7bff, 65504.0)]
        {
            assert_eq!(from_half(bits), value);
        }
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("depth.npy");
        let text = "{'descr': '<f2', 'fortran_order': False, 'shape': (2, 3), }\n";
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((text.len() as u16).to_le_bytes());
        bytes.extend(text.bytes());
        bytes.extend([0x3c00u16, 0x4000, 0x4200, 0x4400, 0, 0x3800].iter().flat_map(|b| b.to_le_bytes()));
        std::fs::write(&file, &bytes).unwrap();
        assert_eq!(read_depth(&file).unwrap(), (vec![1.0, 2.0, 3.0, 4.0, 0.0, 0.5], 3, 2));
        std::fs::write(&file, &bytes[..bytes.len() - 70]).unwrap();
        assert!(read_depth(&file).is_err());
    }

    #[test]
    fn arrays_without_pixels_and_short_headers_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("depth.npy");
        let read = |bytes: &[u8]| {
            std::fs::write(&file, bytes).unwrap();
            read_depth(&file)
        };
        for version in [1, 2] {
            assert_eq!(read(&npy(version, "2, 3", None, 6)).unwrap(), (vec![1.0; 6], 3, 2));
        }
        for shape in ["0, 0", "0, 24", "24, 0"] {
            let e = read(&npy(1, shape, None, 0)).unwrap_err();
            assert!(e.what.contains(&format!("[{shape}]")) && e.place.ends_with("depth.npy"), "{e}");
        }
        let e = read(&npy(2, "2, 3", Some(4000), 6)).unwrap_err();
        assert!(e.what.contains("within its header"), "{e}");
        assert!(read(&npy(1, "2, 3", None, 5)).is_err(), "a number is missing");
    }
}
