//! The plain types every other crate shares: poses, cameras, screws, kinematic trees, gaussians, meshes.
//!
//! Conventions, everywhere in hingecast:
//! - a transform is named `a_from_b` and maps points of frame `b` into frame `a`;
//! - cameras are OpenCV: x right, y down, z forward; pixel centres at +0.5; depth is z in scene units, 0 = unknown;
//! - metres (or scene units where a recording has no metric scale), radians, seconds, kilograms;
//! - poses and joints are f64, gaussians and pixels f32; quaternions are written w x y z in files.

pub mod camera;
pub mod folder;
pub mod gaussians;
pub mod icp;
pub mod input_error;
pub mod mesh;
pub mod mesh_io;
pub mod nearest;
pub mod ply;
pub mod pose;
pub mod progress;
pub mod random;
pub mod staging;
pub mod tree;

pub use camera::{Camera, Projection};
pub use gaussians::Gaussians;
pub use input_error::InputError;
pub use mesh::TriMesh;
pub use nearest::PointTree;
pub use pose::Pose;
pub use progress::{Cancelled, Progress};
pub use tree::{Certainty, Joint, JointKind, KinematicTree, Screw};
