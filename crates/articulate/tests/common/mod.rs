//! Scenes of boxes whose depth is computed exactly, and what is asserted of the joints found in
//! them.

#![allow(dead_code)] // Each test file uses its own share.

pub mod objects;
pub mod scene;
pub mod settled;
pub mod truth;
