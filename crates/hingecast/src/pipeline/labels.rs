//! Part labels per pixel: the gaussians rendered with their part as an extra channel.

use crate::failure::Result;
use hingecast_capture::View;
use hingecast_geom::{Camera, Gaussians, KinematicTree};
use hingecast_splat::{Engine, RenderOptions};
use hingecast_twin::{BACKGROUND, UNKNOWN};

/// Gaussians with parts, posed by a tree, ready to be rendered.
pub struct Labeller {
    engine: Engine,
    one_hot: Vec<f32>,
    n_parts: usize,
    groups: Vec<u16>,
}

/// Colour, depth (0 = nothing) and the most likely part (`BACKGROUND` = nothing) of every pixel.
pub struct Picture {
    pub rgb: Vec<f32>,
    pub depth: Vec<f32>,
    pub alpha: Vec<f32>,
    pub parts: Vec<u8>,
}

impl Labeller {
    pub fn new(gaussians: &Gaussians, labels: &[u8], n_parts: usize, threads: usize) -> Result<Self> {
        let mut one_hot = vec![0.0; gaussians.len() * n_parts];
        for (i, l) in labels.iter().enumerate() {
            one_hot[i * n_parts + *l as usize] = 1.0;
        }
        let groups = labels.iter().map(|l| *l as u16).collect();
        Ok(Self { engine: Engine::from_gaussians(gaussians, threads)?, one_hot, n_parts, groups })
    }

    /// Moves the parts to where the tree has them with joint values `q`.
    pub fn pose(&mut self, tree: &KinematicTree, q: &[f64]) -> Result<()> {
        Ok(self.engine.set_groups(&self.groups, &tree.poses(q))?)
    }

    pub fn render(&mut self, camera: &Camera, background: [f32; 3]) -> Result<Picture> {
        let options = RenderOptions { background, extra: &self.one_hot, channels: self.n_parts };
        let render = self.engine.render(camera, &options)?;
        let n = camera.width * camera.height;
        let parts = (0..n)
            .map(|i| {
                if render.alpha[i] < 0.5 {
                    return BACKGROUND;
                }
                let share = |p: &usize| render.extra[p * n + i];
                (0..self.n_parts).max_by(|a, b| share(a).total_cmp(&share(b))).unwrap_or(0) as u8
            })
            .collect();
        let depth = render.depth_normalised();
        Ok(Picture { rgb: render.rgb, depth, alpha: render.alpha, parts })
    }

    /// Labels of a recorded view for fusing: background where the mask says so, the rendered part where measured and
    /// rendered depth agree within `tolerance`, unknown elsewhere.
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
