//! What pictures say about the poses of parts: the gaussians, rendered where a guess puts them,
//! against what was seen.
//!
//! Cost: sum over pixels and channels of rho(render - picture), rho(r) = r^2 / (1 + r^2 / s^2)
//! (Geman and McClure). Its gradient by the parts' poses is the engine's; its Hessian is that of
//! Gauss and Newton with the flow of the picture: a twist (v, w) of a part moves the point X of its
//! pixel, and the pixel's colour changes by -grad(I) . dpi/dX (v + w x X). That neglects occlusion,
//! so steps are longer or shorter than they should be, but they go down.

use crate::model::twist::along;
use glam::DVec3;
use hingecast_geom::Camera;
use hingecast_splat::{Engine, Gradients, PixelGradients, Render, RenderOptions, SplatError, Target};
use nalgebra::{Matrix2, Matrix2x6, Matrix6, Vector2, Vector6};

/// Differences of colour (0..1) beyond this hardly pull: highlights, shadows, what no gaussian
/// shows.
const ROBUST: f32 = 0.1;

/// What pictures say about the pose of every part: gradient and Hessian by its twist (v, w), about
/// the world's origin.
pub struct ByPart {
    /// By each part's twist.
    pub gradient: Vec<Vector6<f64>>,
    /// By each part's twist, Gauss and Newton's.
    pub hessian: Vec<Matrix6<f64>>,
    /// Sum over pixels and channels.
    pub cost: f64,
    /// Pixels that show gaussians.
    pub filled: usize,
}

impl ByPart {
    /// Nothing seen yet.
    pub fn new(n_parts: usize) -> Self {
        Self {
            gradient: vec![Vector6::zeros(); n_parts],
            hessian: vec![Matrix6::zeros(); n_parts],
            cost: 0.0,
            filled: 0,
        }
    }

    /// Adds what one picture says about the engine's poses.
    pub fn add_view(
        &mut self,
        engine: &mut Engine,
        target: &Target,
        gradients: &mut Gradients,
    ) -> Result<(), SplatError> {
        let camera = *target.camera();
        let render =
            engine.render(&camera, &RenderOptions { background: target.background(), ..Default::default() })?;
        let shown = target.rgb();
        let mut by_rgb = vec![0f32; shown.len()];
        let mut weights = vec![0f32; shown.len()];
        for (i, (x, y)) in render.rgb.iter().zip(&shown).enumerate() {
            let r = x - y;
            let usable = target.weight_at(i / 3 % camera.width, i / 3 / camera.width);
            let damp = 1.0 / (1.0 + (r / ROBUST).powi(2));
            self.cost += f64::from(usable * r * r * damp);
            weights[i] = 2.0 * usable * damp * damp;
            by_rgb[i] = weights[i] * r;
        }
        let hits = engine.median()?;
        let groups = engine.groups();
        let parts: Vec<Option<usize>> = hits.iter().map(|h| h.map(|h| groups[h.gaussian as usize] as usize)).collect();
        self.filled += parts.iter().flatten().count();
        self.add_flow(&camera, &render, &weights, &parts);
        engine.backward(&PixelGradients { rgb: by_rgb, ..Default::default() }, gradients)?;
        for (sum, g) in self.gradient.iter_mut().zip(&gradients.poses) {
            *sum += Vector6::from_column_slice(g);
        }
        Ok(())
    }

    /// Adds the Hessian by how the picture would flow with each part.
    fn add_flow(&mut self, camera: &Camera, render: &Render, weights: &[f32], parts: &[Option<usize>]) {
        let (w, h) = (camera.width, camera.height);
        let world_from_camera = camera.camera_from_world.inverse();
        let r = camera.camera_from_world.mat3();
        let colour = |i: usize, c: usize| f64::from(render.rgb[3 * i + c]);
        for y in 1..h - 1 {
            for x in 1..w - 1 {
                let i = y * w + x;
                let Some(part) = parts[i] else { continue };
                let mut s = Matrix2::zeros();
                for c in 0..3 {
                    let g =
                        Vector2::new(colour(i + 1, c) - colour(i - 1, c), colour(i + w, c) - colour(i - w, c)) * 0.5;
                    s += g * g.transpose() * f64::from(weights[3 * i + c]);
                }
                let z = f64::from(render.depth[i] / render.alpha[i]);
                let (u, v) = ((x as f64 + 0.5 - camera.cx) / camera.fx, (y as f64 + 0.5 - camera.cy) / camera.fy);
                let point = world_from_camera.apply(DVec3::new(u * z, v * z, z));
                // d(uv)/dX, X in the world: rows.
                let rows = [(r.row(0) - r.row(2) * u) * (camera.fx / z), (r.row(1) - r.row(2) * v) * (camera.fy / z)];
                let mut flow = Matrix2x6::zeros();
                for (k, row) in rows.iter().enumerate() {
                    flow.set_row(k, &along(*row, point).transpose());
                }
                self.hessian[part] += flow.transpose() * s * flow;
            }
        }
    }
}
