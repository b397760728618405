//! What the engine refuses, and why.

use std::path::PathBuf;

/// What the engine refuses. `Display` says what to do about it.
#[derive(Debug, thiserror::Error)]
pub enum SplatError {
    /// A set without elements.
    #[error("{what} is empty; give at least one {item}")]
    Empty {
        /// The set.
        what: &'static str,
        /// What there should be at least one of.
        item: &'static str,
    },
    /// NaN or infinity in the input.
    #[error("{what}[{index}] is {value}; expected a finite number (remove or repair this element first)")]
    NotFinite {
        /// The array.
        what: &'static str,
        /// Position of the first such element, counted in single numbers.
        index: usize,
        /// The element.
        value: f32,
    },
    /// An array of the wrong length.
    #[error("{what} has {got} elements, expected {expected} ({why})")]
    Length {
        /// The array.
        what: &'static str,
        /// Its length.
        got: usize,
        /// The length that it should have.
        expected: usize,
        /// What the expected length follows from.
        why: &'static str,
    },
    /// A number outside of what it may be.
    #[error("{what} is {value}, outside {range}")]
    Range {
        /// The number.
        what: &'static str,
        /// Its value.
        value: f64,
        /// What it may be.
        range: &'static str,
    },
    /// There is no render to differentiate or to look at: something changed since the last one.
    #[error("there is no render to differentiate: the parameters, poses or picture changed; call render first")]
    NotRendered,
    /// A checkpoint could not be read or written.
    #[error("cannot read or write checkpoint {path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file that is no checkpoint, or one of another fit.
    #[error("{path} is not a usable checkpoint: {what}; delete it to start afresh")]
    Checkpoint {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        what: String,
    },
    /// The person asked to stop.
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
