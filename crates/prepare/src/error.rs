//! What keeps scans from coming together.

use hingecast_articulate::DepthError;
use hingecast_geom::Cancelled;

/// Why scans could not be prepared.
#[derive(Debug, thiserror::Error)]
pub enum PrepareError {
    /// A view could not be read.
    #[error(transparent)]
    Depths(#[from] DepthError),
    /// A state has too little surface to be placed.
    #[error("state {state} shows too little surface to be registered: {samples} samples")]
    Empty {
        /// The state.
        state: usize,
        /// Oriented samples that it has.
        samples: usize,
    },
    /// Nothing that two scans share was found.
    #[error("state {state} cannot be brought into the frame of state {other}: only {percent:.0} % of it agrees")]
    Apart {
        /// The state.
        state: usize,
        /// The state that it agrees with best.
        other: usize,
        /// Share of the samples that can be judged which agree, percent; of all samples, where few can be.
        percent: f64,
    },
    /// Two places fit a scan about equally well.
    #[error(
        "state {state} fits into the frame of state {other} in two ways, {degrees:.0} degrees and {distance:.2} apart, almost equally well"
    )]
    Ambiguous {
        /// The state.
        state: usize,
        /// The state that it was compared with.
        other: usize,
        /// Angle between the two poses, degrees.
        degrees: f64,
        /// Farthest that a point of the scan moves from one to the other, scene units.
        distance: f64,
    },
    /// No surface of a state lies where another saw empty space.
    #[error("nothing moves between the states: {samples} samples of surface were looked through by another state")]
    NothingMoved {
        /// Samples that moved.
        samples: usize,
    },
    /// What moved lies on nothing that can be told from the room.
    #[error("no object was found: what it would be holds only {percent:.0} % of what moved")]
    NoObject {
        /// Share of moved surface on the largest piece, percent.
        percent: f64,
    },
    /// Nothing but floor and wall is where a person says that the object is.
    #[error("nothing but floor and wall is where the object is said to be")]
    NothingThere,
    /// The cameras look at nothing in common.
    #[error("the cameras look at nothing in common that has depth")]
    NoFocus,
    /// The person asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}
