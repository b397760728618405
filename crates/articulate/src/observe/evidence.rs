//! What was seen: all states' surfaces and spaces. Immutable once built.

use super::cloud::gather;
use super::depth_view::DepthView;
use super::lattice::Lattice;
use super::mask_votes::{self, MANY_VIEWS};
use super::occupancy::Occupancy;
use super::robust::deviation;
use super::sample::{Motion, Sample};
use glam::Vec3;
use hingecast_geom::icp::Surface;
use hingecast_geom::{PointTree, Pose};
use rayon::prelude::*;

/// Most states that witness at once: one bit each.
pub const MOST_STATES: usize = 64;
/// Samples that labels are decided on: in all, and at most per state.
const SAMPLES: usize = 62_500;
const PER_STATE: usize = 8000;
/// And of the scan before a film.
const OF_SCAN: usize = 16_000;
/// Neighbours that must mostly agree before a contradiction counts.
const NEIGHBOURS: usize = 8;

/// Share of a state's samples on each side that are no part of its box.
const STRAY: f32 = 0.001;
/// A grid is made anew where its voxels become so much smaller, share of what they were.
const MUCH_FINER: f32 = 0.9;

/// Surfaces face the same way where the cosine between their normals is at least this: 32 deg.
const FACES_ALIKE: f32 = 0.85;
/// The nearest sample of a surface at a place is at most this many voxels away: samples are a voxel
/// apart.
const SAME_VOXEL: f32 = 1.1;
/// Noise below this share of a voxel: the states' frames agree already.
const SHARP: f32 = 0.05;

/// What was seen, of all states.
pub struct Evidence {
    /// The grid that all states share.
    pub lattice: Lattice,
    /// Every sample of each state's surface.
    pub clouds: Vec<Surface>,
    /// Surface, empty space and the unseen of each state.
    pub spaces: Vec<Occupancy>,
    /// Pixels that look like background and are none, see [`mask_votes`]. `[state][view]`
    pub silent: Vec<Vec<Vec<u32>>>,
    /// Masks held what is not the object.
    pub too_much: bool,
    /// A subset of all clouds, state after state.
    pub samples: Vec<Sample>,
    /// Nearest samples of the same state. `[sample][NEIGHBOURS]`
    pub neighbours: Vec<Vec<u32>>,
    /// State 0 is a scan of the thing alone, the others are pictures of a film in the order of time; what
    /// they show besides may be hands.
    pub film: bool,
    /// Distance to the plane within which two measurements are the same surface, scene units.
    pub tolerance: f32,
}

impl Evidence {
    /// `states(s)` answers the views of state s; they are dropped before the next state is asked
    /// for.
    pub fn gather<E>(
        n_states: usize,
        lattice: Lattice,
        states: &mut dyn FnMut(usize) -> Result<Vec<DepthView>, E>,
        seed: u64,
    ) -> Result<Self, E> {
        let (mut clouds, mut spaces, mut silent) = (Vec::new(), Vec::new(), Vec::new());
        let mut too_much = false;
        for state in 0..n_states {
            let mut views = states(state)?;
            let least = if views.len() >= MANY_VIEWS { 2 } else { 1 };
            let mut cloud = gather(&views, lattice.voxel, 1, least);
            let votes = mask_votes::vote(&mut cloud, &mut views, lattice.voxel);
            too_much |= votes.too_much;
            silent.push(votes.silent);
            spaces.push(Occupancy::new(lattice, &cloud, &views, 1.5, votes.least));
            clouds.push(Surface::new(cloud.points, cloud.normals));
        }
        let (samples, neighbours, tolerance) = (Vec::new(), Vec::new(), 0.2 * lattice.voxel);
        let film = false;
        let mut evidence = Self { lattice, clouds, spaces, silent, too_much, samples, neighbours, film, tolerance };
        evidence.draw(seed);
        evidence.tolerance = evidence.tolerance.max(4.0 * evidence.noise());
        Ok(evidence)
    }

    /// The same as a scan and a film: with many more samples of the scan.
    pub fn of_film(mut self, seed: u64) -> Self {
        self.film = true;
        self.draw(seed);
        self
    }

    /// Draws the samples anew.
    fn draw(&mut self, seed: u64) {
        let mut rng = fastrand::Rng::with_seed(seed ^ 0x5a3b);
        self.samples.clear();
        self.neighbours.clear();
        let most = (SAMPLES / self.n_states()).min(PER_STATE);
        for (state, cloud) in self.clouds.iter().enumerate() {
            let mut order: Vec<usize> = (0..cloud.points.len()).collect();
            rng.shuffle(&mut order);
            order.truncate(if self.film && state == 0 { OF_SCAN } else { most });
            order.sort_unstable();
            let first = self.samples.len() as u32;
            let points: Vec<Vec3> = order.iter().map(|&i| cloud.points[i]).collect();
            let tree = PointTree::new(&points);
            self.neighbours.par_extend(points.par_iter().map(|x| {
                let near = tree.k_nearest(*x, NEIGHBOURS + 1);
                near.into_iter().skip(1).map(|j| first + j).collect::<Vec<u32>>()
            }));
            self.samples.extend(order.iter().map(|&i| Sample::of(cloud, state, i)));
        }
    }

    /// Longest side of the space that the object takes in all states, scene units.
    pub fn extent(&self) -> f32 {
        (self.lattice.size.as_vec3() * self.lattice.voxel).max_element()
    }

    /// The grid that the surface would have, `cells` along its longest side, if that is much finer: masks
    /// with a piece of the wall make a large box.
    pub fn finer_lattice(&self, cells: usize) -> Option<Lattice> {
        if !self.too_much {
            return None;
        }
        let (mut lo, mut hi) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for cloud in self.clouds.iter().filter(|c| !c.points.is_empty()) {
            for a in 0..3 {
                let mut axis: Vec<f32> = cloud.points.iter().map(|x| x[a]).collect();
                let stray = (STRAY * axis.len() as f32) as usize;
                let last = axis.len() - 1 - stray;
                lo[a] = lo[a].min(*axis.select_nth_unstable_by(stray, f32::total_cmp).1);
                hi[a] = hi[a].max(*axis.select_nth_unstable_by(last, f32::total_cmp).1);
            }
        }
        let side = (hi - lo).max_element();
        let finer = side > 0.0 && side < MUCH_FINER * cells as f32 * self.lattice.voxel;
        finer.then(|| Lattice::new(lo, hi, cells))
    }

    /// Number of states.
    pub fn n_states(&self) -> usize {
        self.spaces.len()
    }

    /// Whether depth or poses are so noisy that the states' frames have to be brought together.
    pub fn is_noisy(&self) -> bool {
        self.tolerance > 4.0 * SHARP * self.lattice.voxel
    }

    /// Median distance between a sample and the plane that another state measured where the sample
    /// stands still.
    fn noise(&self) -> f32 {
        let mut off: Vec<f32> = (0..self.samples.len())
            .into_par_iter()
            .step_by(7)
            .filter_map(|i| {
                let s = &self.samples[i];
                let t = (s.state + 1 + i % (self.n_states() - 1).max(1)) % self.n_states();
                if t == s.state {
                    return None;
                }
                Some(self.height(t, s.point, s.normal)?.abs())
            })
            .collect();
        deviation(&mut off)
    }

    /// State t's sample nearest to `x`, if it lies within `reach` and faces as `n` does.
    pub fn surface_at(&self, t: usize, x: Vec3, n: Vec3, reach: f32) -> Option<usize> {
        let cloud = &self.clouds[t];
        let (i, squared) = cloud.nearest(x)?;
        (squared <= reach * reach && cloud.normals[i].dot(n) >= FACES_ALIKE).then_some(i)
    }

    /// Height of `x` above the plane of state t's sample nearest to it, if that lies within a voxel
    /// and faces the same way.
    pub fn height(&self, t: usize, x: Vec3, n: Vec3) -> Option<f32> {
        let (cloud, i) = (&self.clouds[t], self.surface_at(t, x, n, SAME_VOXEL * self.lattice.voxel)?);
        Some(cloud.normals[i].dot(x - cloud.points[i]))
    }

    /// Whether state t measured a surface at `x` that faces along `n`, within the noise.
    pub fn meets(&self, t: usize, x: Vec3, n: Vec3) -> bool {
        self.height(t, x, n).is_some_and(|d| d.abs() < self.tolerance)
    }

    /// How near `x` is to surface of state t that faces along `n`: 1 on it, half at the tolerance,
    /// 0 where there is none.
    pub fn nearness(&self, t: usize, x: Vec3, n: Vec3) -> f32 {
        self.height(t, x, n).map_or(0.0, |d| 1.0 / (1.0 + (d / self.tolerance).powi(2)))
    }

    /// The same with what each state measured moved by its correction (its samples; the grid is too
    /// coarse to care).
    pub fn in_frames(mut self, corrections: &[Pose]) -> Self {
        let motions: Vec<Motion> = corrections.iter().map(|c| Motion::from(*c)).collect();
        for s in &mut self.samples {
            *s = s.moved(&motions[s.state]);
        }
        for (cloud, m) in self.clouds.iter_mut().zip(&motions) {
            let points = cloud.points.iter().map(|x| m.apply(*x)).collect();
            let normals = cloud.normals.iter().map(|n| m.rot * *n).collect();
            *cloud = Surface::new(points, normals);
        }
        self
    }
}
