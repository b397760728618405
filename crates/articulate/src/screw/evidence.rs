//! All states' surfaces and spaces, and what they say about a motion.

use super::cloud::{DepthView, deviation, gather};
use super::space::{Answer, Lattice, Space};
use crate::icp::Surface;
use glam::{Mat3, Vec3};
use hingecast_geom::{PointTree, Pose};
use rayon::prelude::*;

/// A rigid motion in f32, quick to apply.
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    pub rot: Mat3,
    pub trans: Vec3,
}

impl Motion {
    #[inline]
    pub fn apply(&self, x: Vec3) -> Vec3 {
        self.rot * x + self.trans
    }
}

impl From<Pose> for Motion {
    fn from(p: Pose) -> Self {
        Self { rot: p.mat3().as_mat3(), trans: p.trans.as_vec3() }
    }
}

/// One oriented point of one state's surface, world frame.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    pub state: usize,
    pub point: Vec3,
    pub normal: Vec3,
}

impl Sample {
    /// Point `i` of what `state` measured.
    pub fn of(cloud: &Surface, state: usize, i: usize) -> Self {
        Self { state, point: cloud.points[i], normal: cloud.normals[i] }
    }

    pub fn moved(&self, m: &Motion) -> Self {
        Self { state: self.state, point: m.apply(self.point), normal: m.rot * self.normal }
    }
}

/// Per sample, one bit a state: where its predicted place was seen empty, and where a surface was found there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Verdict {
    pub against: u64,
    pub support: u64,
    /// Support by surface that no known part explained when the question was asked.
    pub fresh: u64,
    /// Support by surface that a known part could explain as well.
    pub possible: u64,
}

impl Verdict {
    /// Nothing speaks against the motion, something for it.
    pub fn explains(&self) -> bool {
        self.against == 0 && self.support != 0
    }
}

/// What is left of the base's contradictions when a part moves a sample to where nobody looked: that explains most of it,
/// but another part that can show the sample explains it better.
const UNSEEN_LEFT: f64 = 0.3;

/// Fewest contradictions of sample `i` under any of the parts in `verdicts`, of which the first is the base.
pub fn contradictions(verdicts: &[Vec<Verdict>], i: usize) -> f64 {
    let still = verdicts[0][i].against.count_ones() as f64;
    let moved = verdicts[1..].iter().map(|part| {
        let (v, left) = (part[i], if part[i].support == 0 { UNSEEN_LEFT * still } else { 0.0 });
        left.max(v.against.count_ones() as f64)
    });
    moved.fold(still, f64::min)
}

/// Most states that witness at once (bits of a [`Verdict`]).
pub const MOST_STATES: usize = 64;
/// Samples that labels are decided on: in all, and at most per state.
const SAMPLES: usize = 62_500;
const PER_STATE: usize = 8000;
/// Neighbours that must mostly agree before a contradiction counts.
const NEIGHBOURS: usize = 8;

/// Noise below this share of a voxel: the states' frames agree already.
const SHARP: f32 = 0.05;

pub struct Evidence {
    pub lattice: Lattice,
    /// Every sample of each state's surface.
    pub clouds: Vec<Surface>,
    pub spaces: Vec<Space>,
    /// A subset of all clouds, state after state.
    pub samples: Vec<Sample>,
    /// Nearest samples of the same state. [sample][NEIGHBOURS]
    pub neighbours: Vec<Vec<u32>>,
    /// Distance to the plane within which two measurements are the same surface, scene units.
    pub tolerance: f32,
}

impl Evidence {
    /// `states(s)` answers the views of state s; they are dropped before the next state is asked for.
    pub fn gather<E>(
        n_states: usize,
        lattice: Lattice,
        states: &mut dyn FnMut(usize) -> Result<Vec<DepthView>, E>,
        seed: u64,
    ) -> Result<Self, E> {
        let (mut clouds, mut spaces, mut samples) = (Vec::new(), Vec::new(), Vec::new());
        let mut neighbours = Vec::new();
        let mut rng = fastrand::Rng::with_seed(seed ^ 0x5a3b);
        for state in 0..n_states {
            let views = states(state)?;
            let least = if views.len() >= 8 { 2 } else { 1 };
            let cloud = gather(&views, lattice.voxel, 1, least);
            spaces.push(Space::new(lattice, &cloud, &views, 1.5));
            let mut order: Vec<usize> = (0..cloud.points.len()).collect();
            rng.shuffle(&mut order);
            order.truncate((SAMPLES / n_states).min(PER_STATE));
            order.sort_unstable();
            let first = samples.len() as u32;
            let points: Vec<Vec3> = order.iter().map(|&i| cloud.points[i]).collect();
            let tree = PointTree::new(&points);
            neighbours.par_extend(points.par_iter().map(|x| {
                let near = tree.k_nearest(*x, NEIGHBOURS + 1);
                near.into_iter().skip(1).map(|j| first + j).collect::<Vec<u32>>()
            }));
            let cloud = Surface::new(cloud.points, cloud.normals);
            samples.extend(order.iter().map(|&i| Sample::of(&cloud, state, i)));
            clouds.push(cloud);
        }
        let mut evidence = Self { lattice, clouds, spaces, samples, neighbours, tolerance: 0.2 * lattice.voxel };
        evidence.tolerance = evidence.tolerance.max(4.0 * evidence.noise());
        Ok(evidence)
    }

    /// Longest side of the space that the object takes in all states, scene units.
    pub fn extent(&self) -> f32 {
        (self.lattice.size.as_vec3() * self.lattice.voxel).max_element()
    }

    pub fn n_states(&self) -> usize {
        self.spaces.len()
    }

    /// Whether depth or poses are so noisy that the states' frames have to be brought together.
    pub fn is_noisy(&self) -> bool {
        self.tolerance > 4.0 * SHARP * self.lattice.voxel
    }

    /// Median distance between a sample and the plane that another state measured where the sample stands still.
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

    /// Height of `x` above the plane of state t's sample nearest to it, if that lies within a voxel and faces the same way.
    fn height(&self, t: usize, x: Vec3, n: Vec3) -> Option<f32> {
        let cloud = &self.clouds[t];
        let (i, squared) = cloud.nearest(x)?;
        let reach = 1.1 * self.lattice.voxel;
        let m = cloud.normals[i];
        (squared < reach * reach && m.dot(n) > 0.85).then(|| m.dot(x - cloud.points[i]))
    }

    /// Whether state t measured a surface at `x` that faces along `n`, within the noise.
    pub fn meets(&self, t: usize, x: Vec3, n: Vec3) -> bool {
        self.height(t, x, n).is_some_and(|d| d.abs() < self.tolerance)
    }

    /// How near `x` is to surface of state t that faces along `n`: 1 on it, half at the tolerance, 0 where there is none.
    pub fn nearness(&self, t: usize, x: Vec3, n: Vec3) -> f32 {
        self.height(t, x, n).map_or(0.0, |d| 1.0 / (1.0 + (d / self.tolerance).powi(2)))
    }

    /// `raw` with an eye for less than the grid resolves: above the surface that counts as support a sample would have been seen, and below
    /// it nobody saw it.
    pub fn sharpened(&self, raw: Verdict, s: &Sample, from: &[Motion]) -> Verdict {
        let mut v = raw;
        for (t, m) in from.iter().enumerate().filter(|(t, _)| raw.support >> t & 1 == 1) {
            let Some(height) = self.height(t, m.apply(s.point), m.rot * s.normal) else { continue };
            if height.abs() > self.tolerance {
                v.support &= !(1 << t);
                v.against |= u64::from(height > 0.0) << t;
            }
        }
        v
    }

    /// World at state `t` from world at state `a`, for something that moves with `poses` (world from canonical). [a][t]
    pub fn between(&self, poses: &[Pose]) -> Vec<Vec<Motion>> {
        let inverse: Vec<Pose> = poses.iter().map(Pose::inverse).collect();
        inverse.iter().map(|i| poses.iter().map(|p| Motion::from(*p * *i)).collect()).collect()
    }

    /// The raw verdict on one sample; `from[t]`: world at t from world at its state.
    pub fn ask_all(&self, s: &Sample, from: &[Motion]) -> Verdict {
        let mut v = Verdict::default();
        for (t, m) in from.iter().enumerate().filter(|(t, _)| *t != s.state) {
            match self.spaces[t].ask(m.apply(s.point), m.rot * s.normal) {
                Answer::Free => v.against |= 1 << t,
                Answer::Surface => {
                    v.support |= 1 << t;
                    v.fresh |= 1 << t;
                }
                Answer::Possible => {
                    v.support |= 1 << t;
                    v.possible |= 1 << t;
                }
                Answer::Taken => v.support |= 1 << t,
                Answer::Silent => {}
            }
        }
        v
    }

    /// What all states say about every sample if it moved with `poses` (world from canonical, per state).
    pub fn judge(&self, poses: &[Pose]) -> Vec<Verdict> {
        let between = self.between(poses);
        let raw: Vec<Verdict> = self.samples.par_iter().map(|s| self.ask_all(s, &between[s.state])).collect();
        (0..raw.len()).into_par_iter().map(|i| self.without_lone(&raw, i)).collect()
    }

    /// The same for some samples alone.
    pub fn judge_some(&self, poses: &[Pose], which: &[usize]) -> Vec<Verdict> {
        let between = self.between(poses);
        let mut needed = vec![false; self.samples.len()];
        for &i in which {
            needed[i] = true;
            self.neighbours[i].iter().for_each(|&j| needed[j as usize] = true);
        }
        let ask = |(s, needed): (&Sample, &bool)| {
            if *needed { self.ask_all(s, &between[s.state]) } else { Verdict::default() }
        };
        let raw: Vec<Verdict> = self.samples.par_iter().zip(&needed).map(ask).collect();
        which.par_iter().map(|&i| self.without_lone(&raw, i)).collect()
    }

    /// The verdict on sample `i` without contradictions that most of its neighbours do not share: these are noise.
    fn without_lone(&self, raw: &[Verdict], i: usize) -> Verdict {
        let mut v = raw[i];
        let mut bits = v.against;
        while bits != 0 {
            let t = bits.trailing_zeros();
            bits &= bits - 1;
            let near = &self.neighbours[i];
            let agree = near.iter().filter(|&&j| raw[j as usize].against >> t & 1 == 1).count();
            if 2 * agree < near.len() {
                v.against &= !(1 << t);
            }
        }
        v
    }

    /// Moves what each state measured (its samples; the grid is too coarse to care).
    pub fn transform(&mut self, corrections: &[Pose]) {
        let motions: Vec<Motion> = corrections.iter().map(|c| Motion::from(*c)).collect();
        for s in &mut self.samples {
            let m = &motions[s.state];
            (s.point, s.normal) = (m.apply(s.point), m.rot * s.normal);
        }
        for (cloud, m) in self.clouds.iter_mut().zip(&motions) {
            let points = cloud.points.iter().map(|x| m.apply(*x)).collect();
            let normals = cloud.normals.iter().map(|n| m.rot * *n).collect();
            *cloud = Surface::new(points, normals);
        }
    }

    /// Marks the surface cells that one of `parts` explains (never contradicted, and confirmed by half of the states), and
    /// those that it could explain (never contradicted).
    pub fn mark_taken(&mut self, parts: &[Vec<Pose>]) {
        let n = self.n_states();
        let between: Vec<_> = parts.iter().map(|p| self.between(p)).collect();
        let marks: Vec<[Vec<Vec3>; 2]> = (0..n)
            .into_par_iter()
            .map(|state| {
                let cloud = &self.clouds[state];
                let mut out = [Vec::new(), Vec::new()];
                for i in 0..cloud.points.len() {
                    let s = Sample::of(cloud, state, i);
                    let verdicts = between.iter().map(|b| self.ask_all(&s, &b[state]));
                    let most = verdicts.filter(|v| v.against == 0).map(|v| v.support.count_ones() as usize).max();
                    match most {
                        Some(most) if 2 * most >= n - 1 => out[0].push(s.point),
                        Some(_) => out[1].push(s.point),
                        None => {}
                    }
                }
                out
            })
            .collect();
        for (space, [taken, possible]) in self.spaces.iter_mut().zip(&marks) {
            space.mark(taken, possible);
        }
    }
}
