//! `splat/`: the gaussians, the object's size, and what the pictures said about the joints.

use super::check::{self, read_checked};
use super::write_and_settle;
use crate::failure::Result;
use hingecast_capture::Recording;
use hingecast_geom::{Gaussians, KinematicTree, Pose};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// `splat/gaussians.ply`, `splat/extent.json`, and by `--method screw` `splat/placed.json`.
#[derive(Clone, Debug)]
pub struct Splats {
    /// Where the first state has them.
    pub gaussians: Gaussians,
    /// Of the object in its first state.
    pub extent: Extent,
    /// Gaussians with parts, fitted to all states; `None` by `--method track`.
    pub placed: Option<Placed>,
}

/// `splat/extent.json`
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Extent {
    /// Lowest corner, world frame, scene units.
    pub lo: [f64; 3],
    /// Highest corner.
    pub hi: [f64; 3],
    /// Scene units.
    pub diagonal: f64,
}

/// `splat/placed.json`
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Placed {
    /// Of every gaussian.
    pub parts: Vec<u8>,
    /// By depth and pictures.
    pub tree: KinematicTree,
    /// Per state: what its cameras, as the stage before left them, take for the world, from the
    /// world. Empty where depth had the last word.
    pub state_from_world: Vec<Pose>,
    /// What the tree cost before the pictures were asked, and after.
    pub nats: [f64; 2],
}

impl Placed {
    /// Corrects cameras (camera_from_world by frame) by what their states' worlds were off.
    pub fn correct(&self, recording: &Recording, cameras: &mut BTreeMap<usize, Pose>) {
        for (frame, camera) in cameras {
            let state = recording.frames.get(*frame).map(|f| f.state);
            if let Some(state_from_world) = state.and_then(|s| self.state_from_world.get(s)) {
                *camera = *camera * *state_from_world;
            }
        }
    }
}

impl Splats {
    /// Writes the files; answers the splats as a reader would have them.
    pub fn write(self, folder: &Path) -> Result<Self> {
        self.gaussians.write_ply(&folder.join("gaussians.ply"))?;
        let placed = self.placed.map(|p| write_and_settle(&folder.join("placed.json"), &p)).transpose()?;
        let extent = write_and_settle(&folder.join("extent.json"), &self.extent)?;
        Ok(Self { extent, placed, ..self })
    }

    /// Of a finished stage.
    ///
    /// # Errors
    /// When a file is missing or not ours.
    pub fn read(run: &Path) -> Result<Self> {
        let at = run.join("splat");
        let placed = at.join("placed.json");
        let gaussians = Gaussians::read_ply(&at.join("gaussians.ply"))?;
        let extent = read_checked(&at.join("extent.json"), |e: &Extent| {
            check::finite("the object's box", &[e.lo, e.hi].concat())?;
            if e.diagonal.is_finite() && e.diagonal > 0.0 { Ok(()) } else { Err("diagonal is not a length".into()) }
        })?;
        let check_placed = |p: &Placed| {
            check::tree(&p.tree)?;
            check::labels(&p.parts, p.tree.parts.len())?;
            check::as_many("labels", p.parts.len(), "gaussians", gaussians.len())
        };
        let placed = placed.is_file().then(|| read_checked(&placed, check_placed)).transpose()?;
        Ok(Self { gaussians, extent, placed })
    }
}
