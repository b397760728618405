//! A film of play, cut into states: a scan first, then one camera that looks on while hands move the
//! parts.
//!
//! ```text
//! onto     every picture of the film onto the scan's surface: tracking drifts, and hands move
//! change   how much of what two pictures show has changed between them, the camera's motion apart
//! cut      rests - runs of pictures in which nothing moves - and single pictures between them
//! ```

mod change;
mod cut;
mod onto;

pub use cut::{Cut, cut};
pub use onto::{Placing, onto};
