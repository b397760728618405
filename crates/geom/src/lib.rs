//! The plain types every other crate shares: poses, cameras, screws, kinematic trees, gaussians,
//! meshes.
//!
//! Conventions, everywhere in hingecast:
//! - a transform is named `a_from_b` and maps points of frame `b` into frame `a`;
//! - cameras are OpenCV: x right, y down, z forward; pixel centres at +0.5; depth is z in scene units, 0 = unknown;
//! - metres (or scene units where a recording has no metric scale), radians, seconds, kilograms;
//! - poses and joints are f64, gaussians and pixels f32; quaternions are written w x y z in files.
//!
//! ```
//! use glam::{DVec2, DVec3};
//! use hingecast_geom::{Camera, JointKind, Screw};
//!
//! // The middle of the picture is what the camera looks at.
//! let eye = DVec3::new(0.0, -2.0, 1.0);
//! let camera = Camera::look_at(eye, DVec3::ZERO, DVec3::Z, 640, 480, 0.7);
//! let (uv, depth) = camera.project(DVec3::ZERO);
//! assert!((uv - DVec2::new(320.0, 240.0)).length() < 1e-9);
//! assert!(camera.unproject(uv, depth).length() < 1e-9);
//!
//! // A quarter turn about a vertical hinge at x = 1.
//! let hinge = Screw { kind: JointKind::Revolute, axis: DVec3::Z, pivot: DVec3::X };
//! let world_from_canonical = hinge.motion(std::f64::consts::FRAC_PI_2);
//! let moved = world_from_canonical.apply(DVec3::ZERO);
//! assert!((moved - DVec3::new(1.0, -1.0, 0.0)).length() < 1e-9);
//! ```

#![warn(missing_docs)]

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
pub use tree::{Certainty, Coupling, Joint, JointKind, KinematicTree, Screw};
