//! What the engine refuses, and why.

use std::path::PathBuf;

#[derive(Debug, thiserror::Error)]
pub enum SplatError {
    #[error("{what} is empty; give at least one {item}")]
    Empty { what: &'static str, item: &'static str },
    #[error("{what}[{index}] is {value}; expected a finite number (remove or repair this element first)")]
    NotFinite { what: &'static str, index: usize, value: f32 },
    #[error("{what} has {got} elements, expected {expected} ({why})")]
    Length { what: &'static str, got: usize, expected: usize, why: &'static str },
    #[error("{what} is {value}, outside {range}")]
    Range { what: &'static str, value: f64, range: &'static str },
    #[error("there is no render to differentiate: the parameters, poses or picture changed; call render first")]
    NotRendered,
    #[error("cannot read or write checkpoint {path}: {source}")]
    Io { path: PathBuf, source: std::io::Error },
    #[error("{path} is not a usable checkpoint: {what}; delete it to start afresh")]
    Checkpoint { path: PathBuf, what: String },
    #[error(transparent)]
    Cancelled(#[from] hingecast_geom::Cancelled),
}

pub(crate) fn check_len(what: &'static str, got: usize, expected: usize, why: &'static str) -> Result<(), SplatError> {
    if got == expected { Ok(()) } else { Err(SplatError::Length { what, got, expected, why }) }
}

pub(crate) fn check_finite(what: &'static str, values: &[f32]) -> Result<(), SplatError> {
    match values.iter().position(|v| !v.is_finite()) {
        Some(index) => Err(SplatError::NotFinite { what, index, value: values[index] }),
        None => Ok(()),
    }
}
