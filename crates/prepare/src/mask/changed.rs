//! Surface that other states looked through.
//!
//! Asked pixel by pixel, not on a grid: scissors on a floor are thinner than any cell.

use glam::{IVec3, Mat3, Vec3};
use hingecast_articulate::observe::cloud::Cloud;
use hingecast_articulate::observe::lattice::Lattice;
use hingecast_articulate::{DepthView, OBJECT};
use rayon::prelude::*;
use std::collections::HashMap;

/// Views of a state that are asked.
const VIEWS: usize = 12;
/// Views of another state that look through a sample of moved surface.
const WITNESSES: usize = 2;
/// A camera looks through what is nearer than what it measured by more than this share of z, and
/// so many standard deviations.
const NEARER: f32 = 0.008;
const SURE: f32 = 4.0;
/// Moved samples in the cells around that make one of them believed.
const COMPANY: usize = 5;

/// A view as a question: the depth up to which each pixel's neighbourhood is empty.
pub(super) struct Witness {
    empty_to: Vec<f32>,
    size: (usize, usize),
    rot: Mat3,
    trans: Vec3,
    lens: [f32; 4],
}

impl Witness {
    /// Some views of a state.
    pub fn some(views: &[DepthView]) -> Vec<Self> {
        let n = views.len().min(VIEWS);
        (0..n).into_par_iter().map(|k| Self::new(&views[k * views.len() / n])).collect()
    }

    fn new(view: &DepthView) -> Self {
        let (w, h) = (view.camera.width, view.camera.height);
        let less = 1.0 - NEARER - SURE * view.noise().min(0.05);
        let own = |i: usize| if view.class[i] == OBJECT { view.depth[i] * less } else { 0.0 };
        let lowest = |i: usize| {
            let (x, y) = (i % w, i / w);
            let (rows, columns) = (y.saturating_sub(1)..(y + 2).min(h), x.saturating_sub(1)..(x + 2).min(w));
            rows.flat_map(|y| columns.clone().map(move |x| y * w + x)).map(own).fold(f32::INFINITY, f32::min)
        };
        let c = &view.camera;
        Self {
            empty_to: (0..w * h).map(lowest).collect(),
            size: (w, h),
            rot: c.camera_from_world.mat3().as_mat3(),
            trans: c.camera_from_world.trans.as_vec3(),
            lens: [c.fx as f32, c.fy as f32, c.cx as f32, c.cy as f32],
        }
    }

    fn looks_through(&self, x: Vec3) -> bool {
        let p = self.rot * x + self.trans;
        if p.z <= 0.0 {
            return false;
        }
        let [fx, fy, cx, cy] = self.lens;
        let (u, v) = (fx * p.x / p.z + cx, fy * p.y / p.z + cy);
        let inside = u >= 0.0 && v >= 0.0 && u < self.size.0 as f32 && v < self.size.1 as f32;
        inside && p.z < self.empty_to[v as usize * self.size.0 + u as usize]
    }
}

/// Whether each sample of each state lies where another state saw empty space, in company.
pub(super) fn moved(clouds: &[Cloud], witnesses: &[Vec<Witness>], lattice: &Lattice) -> Vec<Vec<bool>> {
    (0..clouds.len())
        .into_par_iter()
        .map(|s| {
            let cloud = &clouds[s];
            let free = |x: Vec3| {
                let through = |own: &Vec<Witness>| own.iter().filter(|w| w.looks_through(x)).take(WITNESSES).count();
                (0..witnesses.len()).any(|r| r != s && through(&witnesses[r]) >= WITNESSES)
            };
            let raw: Vec<bool> = cloud.points.par_iter().map(|x| free(*x)).collect();
            let mut cells: HashMap<IVec3, usize> = HashMap::new();
            for (x, _) in cloud.points.iter().zip(&raw).filter(|(_, m)| **m) {
                *cells.entry(super::cell(lattice, *x)).or_default() += 1;
            }
            let company = |i: usize| {
                let at = super::cell(lattice, cloud.points[i]);
                let around = (0..27).map(|k| at + IVec3::new(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1));
                around.filter_map(|c| cells.get(&c)).sum::<usize>() >= COMPANY
            };
            (0..raw.len()).map(|i| raw[i] && company(i)).collect()
        })
        .collect()
}
