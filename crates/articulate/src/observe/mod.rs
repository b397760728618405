//! What was seen: surfaces and spaces of all states, from depth pictures and their cameras.

pub mod align_to_base;
pub mod cameras;
mod carver;
pub mod cloud;
pub mod depth_view;
pub mod evidence;
pub mod lattice;
pub mod mask_votes;
pub mod occupancy;
pub mod robust;
pub mod sample;
pub mod witness;
