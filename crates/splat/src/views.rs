//! Training views as they come to the fit, and their smaller copies.

use crate::error::SplatError;
use crate::target::{Pixels, Target, TargetImages};
use hingecast_geom::{Camera, Pose};
use std::collections::BTreeMap;
use std::sync::Arc;

/// `count` views behind a function, so that the caller decides what stays in memory.
#[derive(Clone, Copy)]
pub struct Views<'a> {
    /// How many views there are.
    pub count: usize,
    /// View `i`, 0 <= i < `count`; called once a step, so it should be quick.
    pub get: &'a dyn Fn(usize) -> Arc<Target>,
    /// Poses of the engine's groups in each view (see [`crate::Engine::set_groups`]); `None`: they
    /// stay as they are.
    pub poses: Option<&'a dyn Fn(usize) -> Vec<Pose>>,
}

impl Target {
    /// The same view at half the width and height (a last odd row or column is dropped).
    ///
    /// Colour and mask are averaged over 2 x 2 pixels; depth is kept where all four pixels know it
    /// and agree within 2 %, because the mean across an edge is on neither side.
    ///
    /// # Errors
    /// A picture of less than 2 x 2 pixels.
    pub fn halved(&self) -> Result<Self, SplatError> {
        let full = self.camera;
        let (w, h) = (full.width / 2, full.height / 2);
        let camera = Camera {
            width: w,
            height: h,
            fx: 0.5 * full.fx,
            fy: 0.5 * full.fy,
            cx: 0.5 * full.cx,
            cy: 0.5 * full.cy,
            ..full
        };
        let (rgb, (depth, mask)) = (self.rgb(), self.depth_and_mask());
        let mut small_rgb = vec![0f32; 3 * w * h];
        let (mut small_depth, mut small_mask, mut small_weight) =
            (vec![0f32; w * h], vec![0f32; w * h], vec![0f32; w * h]);
        for y in 0..h {
            for x in 0..w {
                let four = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(u, v)| (2 * y + v) * full.width + 2 * x + u);
                let i = y * w + x;
                for c in 0..3 {
                    small_rgb[3 * i + c] = four.iter().map(|&j| rgb[3 * j + c]).sum::<f32>() * 0.25;
                }
                small_mask[i] = four.iter().map(|&j| mask[j]).sum::<f32>() * 0.25;
                let near = four.iter().map(|&j| depth[j]).fold(f32::INFINITY, f32::min);
                let far = four.iter().map(|&j| depth[j]).fold(0.0, f32::max);
                if near > 0.0 && far < 1.02 * near {
                    small_depth[i] = four.iter().map(|&j| depth[j]).sum::<f32>() * 0.25;
                }
                // A pixel that says nothing spoils the mean.
                let weights = four.map(|j| self.weight_at(j % full.width, j / full.width));
                small_weight[i] = weights.into_iter().fold(1.0, f32::min);
            }
        }
        Self::new(
            &camera,
            &TargetImages {
                rgb: Pixels::F32(&small_rgb),
                depth: Some(&small_depth),
                mask: self.has_mask.then_some(Pixels::F32(&small_mask)),
                weight: self.weight.is_some().then_some(Pixels::F32(&small_weight)),
                background: self.background,
                shows_background: true,
            },
        )
    }
}

/// Half-size views, made when first asked for; at most `ROOM` are kept.
#[derive(Default)]
pub(crate) struct Halved(BTreeMap<usize, Arc<Target>>);

const ROOM: usize = 256;

impl Halved {
    pub fn get(&mut self, views: &Views, i: usize) -> Result<Arc<Target>, SplatError> {
        if let Some(target) = self.0.get(&i) {
            return Ok(Arc::clone(target));
        }
        let target = Arc::new((views.get)(i).halved()?);
        if self.0.len() < ROOM {
            self.0.insert(i, Arc::clone(&target));
        }
        Ok(target)
    }
}
