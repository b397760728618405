//! From a kinematic tree and labelled depth images to a twin that a simulator can run.
//!
//! ```text
//! observations --fuse--> signed distance per part --surface--> mesh --simplify, colour--> visual mesh
//!                                                               |--hulls--> collision   |--mass--> inertia
//! everything --urdf, mjcf, glb, usd, twin.json--> a folder
//! ```
//! Every part is fused in its own frame from all states: the inside of a drawer and the back of a
//! door are there.
//!
//! [`fn@build`] makes a [`Twin`], [`fn@write`] puts it on the disk:
//!
//! ```
//! use glam::{DVec2, DVec3};
//! use hingecast_geom::{Camera, Cancelled, KinematicTree, Progress};
//! use hingecast_twin::{BACKGROUND, Config, Observation, build, build::Input, write};
//!
//! // A ball of radius 0.5 m, seen from 24 sides. Of a real object, pictures say all this.
//! let observe = |i: usize| {
//!     let z = 0.9 - 1.8 * i as f64 / 23.0;
//!     let (sin, cos) = (2.4 * i as f64).sin_cos();
//!     let ring = (1.0 - z * z).sqrt();
//!     let eye = 2.0 * DVec3::new(ring * cos, ring * sin, z);
//!     let camera = Camera::look_at(eye, DVec3::ZERO, DVec3::Z, 96, 96, 0.7);
//!     let (mut depth, mut labels) = (vec![0.0; 96 * 96], vec![BACKGROUND; 96 * 96]);
//!     for p in 0..96 * 96 {
//!         let ray = camera.ray(DVec2::new((p % 96) as f64 + 0.5, (p / 96) as f64 + 0.5));
//!         let (a, b, c) = (ray.dot(ray), eye.dot(ray), eye.dot(eye) - 0.25);
//!         if b * b > a * c {
//!             // A ray's camera z is 1, so how far it goes is the z depth.
//!             depth[p] = ((-b - (b * b - a * c).sqrt()) / a) as f32;
//!             labels[p] = 0;
//!         }
//!     }
//!     Observation { state: 0, camera, depth, labels, rgb: vec![200; 3 * 96 * 96] }
//! };
//!
//! let tree = KinematicTree { parts: vec!["ball".into()], ..Default::default() };
//! let input = Input {
//!     name: "ball",
//!     tree: &tree,
//!     n_states: 1,
//!     n_observations: 24,
//!     diagonal: 1.73,
//!     metric: true,
//!     up: DVec3::Z,
//! };
//! let config = Config { voxel: 1.0 / 64.0, ..Config::default() };
//! let load = |i: usize| Ok::<_, Cancelled>(observe(i));
//! let twin = build(&input, &load, &config, &Progress::default())?;
//! // 500 kg/m^3 of 0.52 m^3.
//! assert!((twin.parts[0].inertial.mass - 262.0).abs() < 40.0);
//!
//! let folder = tempfile::tempdir()?;
//! write(&twin, None, &folder.path().join("twin"))?;
//! assert!(folder.path().join("twin/robot.urdf").is_file());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![warn(missing_docs)]

pub mod build;
pub mod clearance;
mod color;
pub mod cuboid;
pub mod export;
mod exposure;
mod field;
pub mod fuse;
pub mod glb;
pub mod hulls;
pub mod link;
pub mod mass;
pub mod mjcf;
pub mod pieces;
pub mod relabel;
pub mod sdf;
pub mod separate;
pub mod simplify;
mod slabs;
mod snap;
mod solid;
pub mod surface;
mod texture;
mod thin;
pub mod urdf;
pub mod usd;
mod vertices;
mod xml;

pub use build::{Config, build};
pub use export::{ExportError, is_ours, write};
pub use texture::Texture;

use glam::{DMat3, DVec3};
use hingecast_geom::{Camera, Certainty, KinematicTree, TriMesh};

/// Label of a pixel whose ray meets no object: everything along it is empty.
pub const BACKGROUND: u8 = 255;
/// Label of a pixel that says nothing: hidden by a hand, or an object pixel that no part claims.
pub const UNKNOWN: u8 = 254;

/// One depth image with a part id per pixel.
#[derive(Clone)]
pub struct Observation {
    /// State of the recording, from 0.
    pub state: usize,
    /// Where it was taken from; its size is (h, w).
    pub camera: Camera,
    /// z depth, scene units, 0 = unknown. (h, w)
    pub depth: Vec<f32>,
    /// Part id, [`UNKNOWN`] or [`BACKGROUND`]. (h, w)
    pub labels: Vec<u8>,
    /// sRGB. (h, w, 3)
    pub rgb: Vec<u8>,
}

impl Observation {
    /// Where pixel `i` measured a surface, camera frame; meaningless where its depth is unknown.
    fn camera_point(&self, i: usize) -> DVec3 {
        let c = &self.camera;
        let (u, v) = ((i % c.width) as f64 + 0.5, (i / c.width) as f64 + 0.5);
        DVec3::new((u - c.cx) / c.fx, (v - c.cy) / c.fy, 1.0) * self.depth[i] as f64
    }
}

/// Mass properties of a part about its own centre of mass, axes of the canonical world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inertial {
    /// kg (or density unit times scene units cubed).
    pub mass: f64,
    /// Centre of mass in the canonical world frame, m.
    pub com: DVec3,
    /// kg m^2
    pub inertia: DMat3,
}

/// One link of the twin; geometry in the canonical world frame (all joints at 0).
#[derive(Clone, Debug)]
pub struct PartModel {
    /// Name of the link.
    pub name: String,
    /// The surface as it is shown, with vertex colours; empty for a part that no view shows.
    pub mesh: TriMesh,
    /// Photographs on it, where views show it.
    pub texture: Option<Texture>,
    /// Convex pieces for collision.
    pub hulls: Vec<TriMesh>,
    /// Mass, centre of mass and inertia of the solid.
    pub inertial: Inertial,
}

/// Everything that `write` needs.
#[derive(Clone, Debug)]
pub struct Twin {
    /// Name of the object.
    pub name: String,
    /// Parts and joints; the screws stand in the canonical world frame.
    pub tree: KinematicTree,
    /// One link a part; index = part id.
    pub parts: Vec<PartModel>,
    /// What a person should know before trusting this twin; the first is the gravest.
    pub doubts: Vec<String>,
    /// Of each joint, in the tree's order, where that is known.
    pub certainty: Vec<Option<Certainty>>,
    /// Diagonal of the object's box in the first state, scene units.
    pub diagonal: f64,
    /// Lengths are metres; otherwise scene units.
    pub metric: bool,
    /// Unit vector that points up in the world.
    pub up: DVec3,
}
