//! Recordings of an articulated object in several joint states: read, check, import, and render
//! synthetic ones.
//!
//! - [`Recording`] reads the native layout (nerfstudio's `transforms.json` plus a per-frame `state`);
//!   [`ViewCache`] keeps decoded views within a byte budget.
//! - [`check`] names what is wrong with a recording and repairs what is safe to repair.
//! - [`import`] converts other layouts of the field to it.
//! - [`object`] loads articulated objects from URDF or MJCF, [`synth`] renders recordings of them.
//! - [`truth`] is what `synth` knows and `build` must not read: only evaluation and tests open it.
//!
//! Cameras are OpenCV (x right, y down, z forward), pixel centres at +0.5, depth is z, 0 = unknown.
//!
//! ```no_run
//! use hingecast_capture::{CaptureError, Recording, Split};
//! use std::path::Path;
//!
//! let recording = Recording::open(Path::new("recordings/cabinet"))?;
//! for state in 0..recording.n_states {
//!     for frame in recording.frames_of(state, Split::Train) {
//!         let view = recording.load(frame)?;
//!         let known = view.depth.iter().filter(|z| **z > 0.0).count();
//!         println!("state {state}, frame {frame}: {known} pixels with depth");
//!     }
//! }
//! # Ok::<(), CaptureError>(())
//! ```

#![warn(missing_docs)]

pub mod check;
pub mod import;
pub mod object;
pub mod recording;
pub mod synth;
pub mod truth;

/// What is wrong with a recording, an object or a plan of one.
pub use hingecast_geom::InputError as CaptureError;
pub use recording::{Frame, PackedDepth, Recording, Split, View, ViewCache};
pub use truth::Truth;
