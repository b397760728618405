//! Boxes that move with a tree, and the depth that cameras around them measure.

use glam::{DVec2, DVec3, Vec3};
use hingecast_articulate::observe::evidence::Evidence;
use hingecast_articulate::observe::lattice::Lattice;
use hingecast_articulate::{
    ArticulateError, Articulation, BACKGROUND, Config, DepthError, DepthView, Depths, OBJECT, find,
};
use hingecast_geom::{Camera, KinematicTree, Pose, Progress};

/// Boxes of one part, canonical frame: lowest and highest corner.
pub type Boxes = Vec<(DVec3, DVec3)>;

/// Extent of every scene, scene units.
pub const LO: Vec3 = Vec3::new(-1.0, -1.0, -0.4);
pub const HI: Vec3 = Vec3::new(1.0, 1.0, 1.0);

/// An object and how it is recorded. Recorded anew whenever it is asked for.
#[derive(Clone)]
pub struct Scene {
    /// Of every part.
    pub boxes: Vec<Boxes>,
    /// The truth.
    pub tree: KinematicTree,
    pub n_states: usize,
    /// Pixels along the side of a picture, pictures of a state, cells of the grid.
    pub size: usize,
    pub views: usize,
    pub cells: usize,
    /// Standard deviation of a depth over that depth.
    pub noise: f64,
    /// The same of what about ten pixels around share: stereo cameras match windows.
    pub blotches: f64,
    /// Of the noise.
    pub seed: u64,
    /// Where the cameras of a state believe that the world is, per state; empty: where it is.
    pub believed_from_world: Vec<Pose>,
}

/// A box between two corners.
pub fn cuboid(lo: [f64; 3], hi: [f64; 3]) -> (DVec3, DVec3) {
    (lo.into(), hi.into())
}

impl Scene {
    /// 24 exact pictures of 128 x 128 in every state, a grid of 80 cells.
    pub fn new(boxes: Vec<Boxes>, tree: KinematicTree) -> Self {
        let n_states = tree.joints.first().map_or(3, |j| j.values.len());
        let believed_from_world = Vec::new();
        Self {
            boxes,
            tree,
            n_states,
            size: 128,
            views: 24,
            cells: 80,
            noise: 0.0,
            blotches: 0.0,
            seed: 0,
            believed_from_world,
        }
    }

    /// Coarser and quicker: 16 pictures of 96 x 96, 56 cells.
    pub fn coarse(self) -> Self {
        Self { size: 96, views: 16, cells: 56, ..self }
    }

    /// Edge of a cell, scene units.
    pub fn voxel(&self) -> f64 {
        (HI - LO).max_element() as f64 / self.cells as f64
    }

    /// Looks for its parts, without the passes named in `skip`.
    pub fn find_without(&self, skip: &[&str]) -> Articulation {
        let skip = skip.iter().map(|name| name.to_string()).collect();
        let config = Config { cells: self.cells, skip, resample: false, ..Config::default() };
        find(&mut self.clone(), &config, &Progress::default()).unwrap()
    }

    /// Looks for its parts with all passes.
    pub fn find(&self) -> Articulation {
        self.find_without(&[])
    }

    /// The same, and fitted anew without some of the views, to know how sure it is.
    pub fn find_and_resample(&self) -> Articulation {
        let config = Config { cells: self.cells, ..Config::default() };
        find(&mut self.clone(), &config, &Progress::default()).unwrap()
    }

    /// What `find` gathers before it searches.
    pub fn evidence(&self) -> Evidence {
        let lattice = Lattice::new(LO, HI, self.cells);
        let mut states = |s: usize| Ok::<_, ArticulateError>(self.recorded(s));
        Evidence::gather(self.n_states, lattice, &mut states, 0).unwrap()
    }

    /// The views of one state.
    pub fn recorded(&self, state: usize) -> Vec<DepthView> {
        let parts: Vec<_> = self.boxes.iter().zip(self.tree.poses_at(state)).collect();
        let mut rng = fastrand::Rng::with_seed(state as u64 + 1000 * self.seed);
        (0..self.views).map(|k| self.view(state, k, &parts, &mut rng)).collect()
    }

    /// Cameras spiral around the object, from low to nearly above it.
    fn view(&self, state: usize, k: usize, parts: &[(&Boxes, Pose)], rng: &mut fastrand::Rng) -> DepthView {
        let (turn, height) = (k as f64 * 2.399, 0.15 + 0.8 * (k as f64 + 0.5) / self.views as f64);
        let flat = (1.0 - height * height).sqrt();
        let eye = DVec3::new(flat * turn.cos(), flat * turn.sin(), height) * 3.2;
        let size = self.size;
        let mut camera = Camera::look_at(eye, DVec3::new(0.0, 0.0, 0.2), DVec3::Z, size, size, 0.75);
        let (mut depth, mut class) = (vec![0.0; size * size], vec![BACKGROUND; size * size]);
        let field = if self.blotches > 0.0 { smooth(size, rng) } else { vec![0.0; size * size] };
        for i in 0..size * size {
            let uv = DVec2::new((i % size) as f64 + 0.5, (i / size) as f64 + 0.5);
            if let Some(z) = hit(eye, camera.ray(uv), parts) {
                (depth[i], class[i]) =
                    ((z * (1.0 + self.noise * normal(rng) + self.blotches * field[i])) as f32, OBJECT);
            }
        }
        if let Some(believed) = self.believed_from_world.get(state) {
            camera.camera_from_world = camera.camera_from_world * believed.inverse();
        }
        DepthView { camera, depth, class }
    }
}

impl Depths for Scene {
    fn n_states(&self) -> usize {
        self.n_states
    }

    fn extent(&mut self) -> Result<(Vec3, Vec3), DepthError> {
        Ok((LO, HI))
    }

    fn views(&mut self, state: usize) -> Result<Vec<DepthView>, DepthError> {
        Ok(self.recorded(state))
    }
}

/// A random field of variance 1 or a little less, alike over about ten pixels.
fn smooth(size: usize, rng: &mut fastrand::Rng) -> Vec<f64> {
    const STEP: usize = 9;
    let across = size / STEP + 2;
    let knots: Vec<f64> = (0..across * across).map(|_| normal(rng)).collect();
    let at = |i: usize| {
        let (x, y) = ((i % size) as f64 / STEP as f64, (i / size) as f64 / STEP as f64);
        let (u, v) = (x.fract(), y.fract());
        let k = y as usize * across + x as usize;
        (1.0 - v) * ((1.0 - u) * knots[k] + u * knots[k + 1])
            + v * ((1.0 - u) * knots[k + across] + u * knots[k + across + 1])
    };
    (0..size * size).map(at).collect()
}

/// Depth along a ray of the nearest box; None = background.
fn hit(origin: DVec3, ray: DVec3, parts: &[(&Boxes, Pose)]) -> Option<f64> {
    let mut nearest: Option<f64> = None;
    for (boxes, pose) in parts {
        let back = pose.inverse();
        let (o, d) = (back.apply(origin), back.rotate(ray));
        for (lo, hi) in *boxes {
            let (a, b) = ((*lo - o) / d, (*hi - o) / d);
            let (near, far) = (a.min(b).max_element(), a.max(b).min_element());
            if near < far && near > 0.0 && nearest.is_none_or(|n| near < n) {
                nearest = Some(near);
            }
        }
    }
    nearest
}

/// Nearly normally distributed, variance 1.
fn normal(rng: &mut fastrand::Rng) -> f64 {
    (0..12).map(|_| rng.f64()).sum::<f64>() - 6.0
}
