//! Saving and resuming a fit: parameters, Adam state and iteration in one safetensors file.
//!
//! Tensors `params`, `first`, `second`: f32 (planes, gaussians), see [`crate::plane`]. Metadata:
//! `steps` (Adam's counter), `iteration` and `extent` of the fit. Written to a temporary name and
//! renamed, so a file is whole or absent. Groups and poses are not part of it.

use crate::engine::Engine;
use crate::error::SplatError;
use crate::params::Planes;
use hingecast_geom::staging::write_whole;
use serde_json::{Value, json};
use std::path::Path;

const TENSORS: [&str; 3] = ["params", "first", "second"];

/// Where a fit stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Checkpoint {
    /// Iterations done.
    pub iteration: usize,
    /// Radius of the object that the fit works with, scene units.
    pub extent: f32,
}

fn bad(path: &Path, what: impl Into<String>) -> SplatError {
    SplatError::Checkpoint { path: path.to_path_buf(), what: what.into() }
}

/// Writes the engine and where its fit stands to `path`.
///
/// # Errors
/// The folder cannot be written.
pub fn save(engine: &Engine, checkpoint: &Checkpoint, path: &Path) -> Result<(), SplatError> {
    let io = |source| SplatError::Io { path: path.to_path_buf(), source };
    let (first, second, steps) = engine.moments();
    let (count, len) = (engine.params().count(), engine.len());
    let bytes = 4 * count * len;
    let mut header = json!({
        "__metadata__": {
            "format": "hingecast-splat-1",
            "steps": steps.to_string(),
            "iteration": checkpoint.iteration.to_string(),
            // As bits, so that a resumed fit is the same fit.
            "extent": checkpoint.extent.to_bits().to_string(),
        }
    });
    for (k, name) in TENSORS.iter().enumerate() {
        header[*name] = json!({ "dtype": "F32", "shape": [count, len], "data_offsets": [k * bytes, (k + 1) * bytes] });
    }
    let mut text = header.to_string();
    while !text.len().is_multiple_of(8) {
        text.push(' ');
    }
    let mut out = Vec::with_capacity(8 + text.len() + 3 * bytes);
    out.extend((text.len() as u64).to_le_bytes());
    out.extend(text.as_bytes());
    for planes in [engine.params(), first, second] {
        for k in 0..count {
            out.extend(planes.plane(k).iter().flat_map(|v| v.to_le_bytes()));
        }
    }
    write_whole(path, &out).map_err(io)
}

/// Restores parameters and Adam state into an engine of the same size.
///
/// # Errors
/// No such file, not a checkpoint, or one of another number of gaussians or harmonics; the engine
/// is then unchanged.
pub fn load(engine: &mut Engine, path: &Path) -> Result<Checkpoint, SplatError> {
    let data = std::fs::read(path).map_err(|source| SplatError::Io { path: path.to_path_buf(), source })?;
    let length = data.get(..8).map(|b| u64::from_le_bytes(b.try_into().expect("eight bytes")) as usize);
    let length = length.ok_or_else(|| bad(path, "shorter than its header"))?;
    let text = data[8..].get(..length).ok_or_else(|| bad(path, "shorter than its header"))?;
    let header: Value = serde_json::from_slice(text).map_err(|e| bad(path, format!("header: {e}")))?;
    let body = &data[8 + length..];
    let number = |key: &str| -> Result<u64, SplatError> {
        header["__metadata__"][key]
            .as_str()
            .and_then(|s| s.parse().ok())
            .ok_or_else(|| bad(path, format!("no number '{key}' in its metadata")))
    };
    let (count, len) = (engine.params().count(), engine.len());
    let mut loaded = Vec::new();
    for name in TENSORS {
        let entry = &header[name];
        if entry["shape"] != json!([count, len]) {
            return Err(bad(path, format!("'{name}' has shape {}, this fit needs [{count},{len}]", entry["shape"])));
        }
        let start = entry["data_offsets"][0].as_u64().unwrap_or(u64::MAX) as usize;
        let bytes = start.checked_add(4 * count * len).and_then(|end| body.get(start..end));
        let bytes = bytes.ok_or_else(|| bad(path, format!("'{name}' is cut off")))?;
        let values: Vec<f32> =
            bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().expect("four bytes"))).collect();
        if values.iter().any(|v| !v.is_finite()) {
            return Err(bad(path, format!("'{name}' holds NaN or inf")));
        }
        loaded.push(values);
    }
    let (steps, iteration, extent) = (number("steps")?, number("iteration")?, number("extent")?);
    let (params, first, second, engine_steps) = engine.state_mut();
    let fill = |planes: &mut Planes, values: &[f32]| {
        for k in 0..count {
            planes.plane_mut(k).copy_from_slice(&values[k * len..(k + 1) * len]);
        }
    };
    fill(params, &loaded[0]);
    fill(first, &loaded[1]);
    fill(second, &loaded[2]);
    *engine_steps = steps;
    Ok(Checkpoint { iteration: iteration as usize, extent: f32::from_bits(extent as u32) })
}
