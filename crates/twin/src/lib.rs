//! From a kinematic tree and labelled depth images to a twin that a simulator can run.
//!
//! ```text
//! observations --fuse--> signed distance per part --surface--> mesh --simplify, colour--> visual mesh
//!                                                               |--hulls--> collision   |--mass--> inertia
//! everything --urdf, mjcf, twin.json--> a folder
//! ```
//! Every part is fused in its own frame from all states: the inside of a drawer and the back of a door are there.

pub mod build;
pub mod clearance;
mod color;
pub mod export;
mod field;
pub mod fuse;
pub mod hulls;
pub mod link;
pub mod mass;
pub mod mjcf;
pub mod relabel;
pub mod separate;
pub mod simplify;
mod slabs;
mod snap;
mod solid;
pub mod surface;
mod thin;
pub mod urdf;
mod vertices;
mod xml;

pub use build::{Config, build};
pub use export::{ExportError, is_ours, write};

use glam::{DMat3, DVec3};
use hingecast_geom::{Camera, Certainty, KinematicTree, TriMesh};

/// Label of a pixel whose ray meets no object: everything along it is empty.
pub const BACKGROUND: u8 = 255;
/// Label of a pixel that says nothing: hidden by a hand, or an object pixel that no part claims.
pub const UNKNOWN: u8 = 254;

/// One depth image with a part id per pixel.
#[derive(Clone)]
pub struct Observation {
    pub state: usize,
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
    pub name: String,
    pub mesh: TriMesh,
    pub hulls: Vec<TriMesh>,
    pub inertial: Inertial,
}

/// Everything that `write` needs.
#[derive(Clone, Debug)]
pub struct Twin {
    pub name: String,
    pub tree: KinematicTree,
    pub parts: Vec<PartModel>,
    /// What a person should know before trusting this twin; the first is the gravest.
    pub doubts: Vec<String>,
    /// Of each joint, in the tree's order, where that is known.
    pub certainty: Vec<Option<Certainty>>,
    /// Diagonal of the object's box in the first state, scene units.
    pub diagonal: f64,
    pub metric: bool,
    pub up: DVec3,
}
