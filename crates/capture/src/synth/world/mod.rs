//! What stands around the object, and what people do to a recording without meaning to: a room, a
//! frame of reference per scan, a push, the masks of a segmenter.

mod clutter;
mod config;
mod front;
mod lens;
pub(super) mod masks;
mod patterns;
mod placement;
mod room;
mod site;

pub use config::{Drift, Frames, Masks, Push, Scenery, Trajectory, World};
pub(super) use front::front;
pub use lens::Lens;
pub(super) use placement::Placement;
pub(super) use room::Room;
pub(super) use site::Site;
