//! Scans as people make them - each with a world of its own, no masks, the room in view - to what
//! the search for parts needs: one frame for all states, and the object alone.
//!
//! ```text
//! settle      the views of each scan among themselves, where tracking drifted
//! level       the frames of states that share one but for drift
//! register    the states' frames, brought together on what stands still: pairs of scans globally, all together finely
//! film        one camera that looks on while hands move the parts, cut into states
//! mask        the object without masks: what moves, and what that hangs on
//! hands       what no part explains
//! ```
//!
//! World frame, scene units and radians; `a_from_b` maps points of frame b into frame a; cameras are
//! OpenCV's. Same input and seed give the same bytes with any number of threads.

#![warn(missing_docs)]

mod error;
pub mod film;
pub mod hands;
pub mod mask;
pub mod register;
mod scan;
mod settle;

pub use error::PrepareError;
pub use mask::{MaskReport, Masks, Wanted, object_masks};
pub use register::{Registration, apart, level, register, steady};
pub use scan::Scan;
pub use settle::{Settled, settle};
