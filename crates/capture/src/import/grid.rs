//! Depth and confidence maps as apps store them: PNG, `.npy`, OpenEXR, and Record3D's LZFSE.

use crate::CaptureError;
use crate::recording::images;
use exr::prelude::{ReadChannels, ReadLayers, read};
use std::io::Cursor;
use std::path::{Path, PathBuf};

/// One number a pixel, row by row.
pub(crate) struct Map<T> {
    pub values: Vec<T>,
    pub width: usize,
    pub height: usize,
}

/// A map that is not read yet.
#[derive(Clone, Debug)]
pub(crate) enum Grid {
    /// PNG, `.npy` or `.exr`: the file knows its size.
    File(PathBuf),
    /// Apple's LZFSE over plain numbers (f32 for depth, u8 for confidence), size from elsewhere.
    Lzfse { file: PathBuf, width: usize, height: usize },
}

impl Grid {
    pub fn path(&self) -> &Path {
        match self {
            Self::File(path) | Self::Lzfse { file: path, .. } => path,
        }
    }

    /// Depth in stored units; what is not finite stays so.
    pub fn depth(&self) -> Result<Map<f32>, CaptureError> {
        match self {
            Self::File(path) if path.extension().is_some_and(|e| e == "exr") => exr_channel(path),
            Self::File(path) => {
                let (values, width, height) = images::read_depth(path)?;
                Ok(Map { values, width, height })
            }
            Self::Lzfse { file, width, height } => {
                let bytes = unpacked(file, 4 * width * height)?;
                let values = bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
                Ok(Map { values, width: *width, height: *height })
            }
        }
    }

    /// Confidence on ARKit's scale: 0 low, 1 medium, 2 high.
    pub fn confidence(&self) -> Result<Map<u8>, CaptureError> {
        let mut map = match self {
            Self::File(path) => {
                let image = images::read(path)?;
                if image.color().channel_count() != 1 || image.color().bytes_per_pixel() != 1 {
                    return Err(CaptureError::new(
                        format!("a confidence map should be grey with 8 bits, not {:?}", image.color()),
                        path.display().to_string(),
                        "export it again as the app does, or take the folder of confidence maps away",
                    ));
                }
                let (width, height) = (image.width() as usize, image.height() as usize);
                Map { values: image.into_luma8().into_raw(), width, height }
            }
            Self::Lzfse { file, width, height } => {
                Map { values: unpacked(file, width * height)?, width: *width, height: *height }
            }
        };
        map.values.iter_mut().for_each(|v| *v = level(*v));
        Ok(map)
    }
}

/// Apps store ARKit's 0, 1, 2, and Polycam 0, 127, 255: no value means two things.
fn level(stored: u8) -> u8 {
    match stored {
        0..=2 => stored,
        3..=63 => 0,
        64..=191 => 1,
        192..=255 => 2,
    }
}

fn unpacked(file: &Path, expected: usize) -> Result<Vec<u8>, CaptureError> {
    let packed = std::fs::read(file).map_err(|e| CaptureError::read(file, e))?;
    let mut bytes = Vec::new();
    let wrong = |what: String| {
        let hint = "the size stands in metadata (dw, dh); copy or export the recording again";
        CaptureError::new(what, format!("{} ({} bytes)", file.display(), packed.len()), hint)
    };
    lzfse_rust::decode_bytes(&packed, &mut bytes)
        .map_err(|e| wrong(format!("an LZFSE file cannot be unpacked: {e}")))?;
    if bytes.len() != expected {
        return Err(wrong(format!("a map unpacks to {} bytes, its size needs {expected}", bytes.len())));
    }
    Ok(bytes)
}

/// The depth channel of an OpenEXR file: the only one, or the one of a usual name.
fn exr_channel(path: &Path) -> Result<Map<f32>, CaptureError> {
    let bytes = std::fs::read(path).map_err(|e| CaptureError::read(path, e))?;
    let bad = |what: String| {
        let hint = "export depth as one channel of half or single floats, as Record3D does";
        CaptureError::new(what, format!("{} ({} bytes)", path.display(), bytes.len()), hint)
    };
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(&bytes))
        .map_err(|e| bad(format!("an OpenEXR file cannot be read: {e}")))?;
    let layer = image.layer_data;
    let list = &layer.channel_data.list;
    let named = |name: &str| list.iter().find(|c| c.name.to_string() == name);
    let channel = if list.len() == 1 { list.first() } else { ["Z", "R", "Y"].into_iter().find_map(named) };
    let Some(channel) = channel else {
        let names: Vec<String> = list.iter().map(|c| c.name.to_string()).collect();
        return Err(bad(format!("no channel is depth among {}", names.join(", "))));
    };
    let values: Vec<f32> = channel.sample_data.values_as_f32().collect();
    let (width, height) = (layer.size.width(), layer.size.height());
    if values.len() != width * height {
        return Err(bad(format!("{} numbers for {width} x {height} pixels", values.len())));
    }
    Ok(Map { values, width, height })
}
