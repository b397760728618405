//! Part labels per pixel: the gaussians rendered, each pixel given the part of the gaussian that it
//! shows.

use crate::failure::Result;
use hingecast_capture::View;
use hingecast_geom::{Camera, Gaussians, KinematicTree};
use hingecast_splat::{Engine, RenderOptions};
use hingecast_twin::{BACKGROUND, UNKNOWN};

/// Gaussians with parts, posed by a tree, ready to be rendered.
pub struct Labeller {
    engine: Engine,
    groups: Vec<u16>,
}

/// What the twin looks like from a camera. (h, w)
pub struct Picture {
    /// (h, w, 3), 0..1
    pub rgb: Vec<f32>,
    /// Median depth, scene units, 0 = nothing.
    pub depth: Vec<f32>,
    /// 0..1
    pub alpha: Vec<f32>,
    /// Part, [`BACKGROUND`] = nothing.
    pub parts: Vec<u8>,
}

impl Labeller {
    /// `labels`: the part of every gaussian.
    ///
    /// # Errors
    /// Those of the engine.
    pub fn new(gaussians: &Gaussians, labels: &[u8], threads: usize) -> Result<Self> {
        let groups = labels.iter().map(|l| *l as u16).collect();
        Ok(Self { engine: Engine::from_gaussians(gaussians, threads)?, groups })
    }

    /// Moves the parts to where the tree has them with joint values `q`.
    pub fn pose(&mut self, tree: &KinematicTree, q: &[f64]) -> Result<()> {
        Ok(self.engine.set_groups(&self.groups, &tree.poses(q))?)
    }

    /// The picture as posed last; `background`: sRGB, 0..1.
    ///
    /// # Errors
    /// Those of the engine.
    pub fn render(&mut self, camera: &Camera, background: [f32; 3]) -> Result<Picture> {
        let render = self.engine.render(camera, &RenderOptions { background, ..Default::default() })?;
        let hits = self.engine.median()?;
        let part = |h: hingecast_splat::Hit| self.groups[h.gaussian as usize] as u8;
        Ok(Picture {
            rgb: render.rgb,
            alpha: render.alpha,
            depth: hits.iter().map(|h| h.map_or(0.0, |h| h.depth)).collect(),
            parts: hits.iter().map(|h| h.map_or(BACKGROUND, part)).collect(),
        })
    }

    /// Labels of a recorded view for fusing: background where the mask says so, the rendered part
    /// where measured and rendered depth agree within `tolerance`, unknown elsewhere.
    pub fn label(&mut self, view: &View, tolerance: f32) -> Result<Vec<u8>> {
        let picture = self.render(&view.camera, [0.0; 3])?;
        let labels = (0..view.mask.len()).map(|i| {
            if view.usable[i] == 0 {
                UNKNOWN
            } else if view.mask[i] == 0 {
                BACKGROUND
            } else if picture.parts[i] != BACKGROUND && (picture.depth[i] - view.depth[i]).abs() < tolerance {
                picture.parts[i]
            } else {
                UNKNOWN
            }
        });
        Ok(labels.collect())
    }
}
