//! What can go wrong.

/// What a [`Depths`](crate::Depths) fails with.
pub type DepthError = Box<dyn std::error::Error + Send + Sync>;

/// Why no parts and joints were looked for, or the search ended early.
#[derive(Debug, thiserror::Error)]
pub enum ArticulateError {
    /// Input that nothing can be found in: what is wrong, where, what to try.
    #[error("{what}\n  where: {place}\n  try: {hint}")]
    Input {
        /// What is wrong.
        what: String,
        /// File, field or value.
        place: String,
        /// What to try.
        hint: String,
    },
    /// Views could not be had.
    #[error(transparent)]
    Depths(DepthError),
    /// Somebody wished it to stop.
    #[error(transparent)]
    Cancelled(#[from] hingecast_geom::Cancelled),
}

impl ArticulateError {
    /// The three lines of an [`ArticulateError::Input`].
    pub fn input(what: impl Into<String>, place: impl Into<String>, hint: impl Into<String>) -> Self {
        Self::Input { what: what.into(), place: place.into(), hint: hint.into() }
    }

    /// What a [`Depths`](crate::Depths) failed with: one of these, or something of its own.
    pub(crate) fn of_depths(error: DepthError) -> Self {
        error.downcast::<Self>().map_or_else(Self::Depths, |own| *own)
    }
}
