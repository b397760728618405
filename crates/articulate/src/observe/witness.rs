//! Single views asked about places: did this camera look through there?
//!
//! Not on a grid: scissors on a floor are thinner than any cell. And view by view: what one camera that
//! is a little off sees empty, the others do not.

use super::depth_view::{BACKGROUND, DepthView, OBJECT, OTHER};
use glam::{Mat3, Vec3};
use rayon::prelude::*;

/// Views of a state that are asked.
pub const VIEWS: usize = 12;
/// A camera looks through what is nearer than what it measured by more than this share of z, and
/// so many standard deviations.
const NEARER: f32 = 0.008;
const SURE: f32 = 4.0;

/// A view as a question: the nearest and the farthest of what each block of pixels and those around
/// it measured.
pub struct Witness {
    nearest: Vec<f32>,
    farthest: Vec<f32>,
    size: (usize, usize),
    block: f32,
    noise: f32,
    rot: Mat3,
    trans: Vec3,
    lens: [f32; 4],
}

/// What a view says about a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Said {
    /// It looked through.
    Empty,
    /// It saw surface there.
    Surface,
    /// It cannot see it.
    Nothing,
}

impl Witness {
    /// Some views of a state, at most [`VIEWS`]. `across`: larger pictures are asked in blocks, so many to a
    /// row.
    pub fn some(views: &[DepthView], across: usize) -> Vec<Self> {
        let n = views.len().min(VIEWS);
        (0..n).into_par_iter().map(|k| Self::new(&views[k * views.len() / n], across)).collect()
    }

    /// Which of [`Self::some`] view `k` of `n` is.
    pub fn which(k: usize, n: usize) -> Option<usize> {
        let some = n.min(VIEWS);
        (0..some).find(|i| i * n / some == k)
    }

    fn new(view: &DepthView, across: usize) -> Self {
        let (w, h) = (view.camera.width, view.camera.height);
        let block = w.div_ceil(across).max(1);
        let size = (w.div_ceil(block), h.div_ceil(block));
        // What is not known may be anywhere.
        let around = |i: usize| {
            let (x, y) = (i % size.0 * block, i / size.0 * block);
            let rows = y.saturating_sub(1)..(y + block + 1).min(h);
            let columns = x.saturating_sub(1)..(x + block + 1).min(w);
            let all = rows.flat_map(|y| columns.clone().map(move |x| y * w + x));
            all.fold((f32::INFINITY, 0.0f32), |(lo, hi), i| match view.class[i] {
                OBJECT | OTHER => (lo.min(view.depth[i]), hi.max(view.depth[i])),
                BACKGROUND => (lo, hi),
                _ => (0.0, hi),
            })
        };
        let (nearest, farthest) = (0..size.0 * size.1).map(around).unzip();
        let c = &view.camera;
        Self {
            nearest,
            farthest,
            size,
            block: block as f32,
            noise: SURE * view.noise().min(0.05),
            rot: c.camera_from_world.mat3().as_mat3(),
            trans: c.camera_from_world.trans.as_vec3(),
            lens: [c.fx as f32, c.fy as f32, c.cx as f32, c.cy as f32],
        }
    }

    /// What it says about a place, world frame, which may be off by `slack`, scene units.
    pub fn ask(&self, x: Vec3, slack: f32) -> Said {
        let p = self.rot * x + self.trans;
        if p.z <= 0.0 {
            return Said::Nothing;
        }
        let [fx, fy, cx, cy] = self.lens;
        let (u, v) = ((fx * p.x / p.z + cx) / self.block, (fy * p.y / p.z + cy) / self.block);
        if !(u >= 0.0 && v >= 0.0 && (u as usize) < self.size.0 && (v as usize) < self.size.1) {
            return Said::Nothing;
        }
        let i = v as usize * self.size.0 + u as usize;
        let (lo, hi) = (self.nearest[i], self.farthest[i]);
        if p.z + slack < lo * (1.0 - NEARER - self.noise) {
            Said::Empty
        } else if hi > 0.0 && p.z - slack <= hi * (1.0 + NEARER + self.noise) {
            Said::Surface
        } else {
            Said::Nothing
        }
    }
}

/// How many of a state's witnesses look through a place, and how many see surface there.
pub fn counted(witnesses: &[Witness], x: Vec3, slack: f32) -> (usize, usize) {
    witnesses.iter().fold((0, 0), |(through, on), w| match w.ask(x, slack) {
        Said::Empty => (through + 1, on),
        Said::Surface => (through, on + 1),
        Said::Nothing => (through, on),
    })
}
