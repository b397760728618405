//! Depth of an articulated object in several states -> its parts, its joints, a kinematic tree, and
//! what is doubtful.
//!
//! [`find`](find()) does it all; the folders are its steps, in this order:
//!
//! ```text
//! observe     what was seen: surfaces, empty space, corrected cameras. Immutable once built
//! model       what is believed: trees, who owns which sample, motions, small edits
//! score       how well a motion, a part, a whole tree explains what was seen. Pure functions
//! fit         joints fitted to samples
//! search      parts one after another: candidates, ranked by what they explain
//! passes      the list of named passes from a discovery to the final estimate
//! label       which part every piece of surface belongs to
//! coupling    joints that are a function of each other
//! doubt       what a person should know before believing the joints
//! pictures    noisy recordings: joints by pictures and depth together
//! classical   the other method (`--method track`), for comparison
//! ```
//!
//! World frame, scene units and radians throughout; `a_from_b` maps points of frame b into frame a;
//! cameras are OpenCV's. Same input, settings and seed give the same bytes with any number of
//! threads.
//!
//! # Examples
//! See [`find`](find()): depth images of your own, ten lines to their joints.
//! `examples/find_joints.rs` of the crate `hingecast` does the same from a recording.

#![warn(missing_docs)]

pub mod classical;
mod config;
pub mod coupling;
mod depths;
pub mod doubt;
mod error;
mod find;
pub mod fit;
pub mod label;
pub mod model;
pub mod observe;
pub mod passes;
pub mod pictures;
mod resample;
pub mod score;
pub mod search;
mod shadow;
pub mod shown;
pub mod value_by_views;
mod weigh_doubts;

pub use config::{Config, MANY_STATES};
pub use depths::Depths;
pub use doubt::Doubt;
pub use error::{ArticulateError, DepthError};
pub use find::{Articulation, find};
pub use label::labelled::Labelled;
pub use observe::depth_view::{BACKGROUND, DepthView, OBJECT, OTHER, UNKNOWN};
pub use observe::evidence::MOST_STATES;
pub use passes::driver::PassRecord;
pub use pictures::information::Information;
