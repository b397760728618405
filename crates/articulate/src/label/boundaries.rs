//! Where parts meet, pixel by pixel.
//!
//! Samples are a voxel apart, and so near to a border of two parts the grid confirms both: the rim
//! of a blade half a voxel above another's. So the surface there is gathered anew, three times as
//! fine, and the pictures themselves are asked: carried along with each part into other states,
//! does a point meet what a camera measured there, or does the camera look through it?

use super::labelled::{Labelled, far_off_plane};
use crate::model::motions::poses_of;
use crate::observe::depth_view::{BACKGROUND, DepthView, OBJECT, OTHER};
use crate::observe::evidence::Evidence;
use crate::observe::sample::Motion;
use glam::{DVec2, Vec3};
use hingecast_geom::icp::Surface;
use hingecast_geom::{KinematicTree, PointTree, Pose, Projection};
use rayon::prelude::*;
use std::collections::BTreeSet;

/// States that are asked, and views of each; more say little that is new.
const MOST_STATES_ASKED: usize = 12;
const MOST_VIEWS_ASKED: usize = 20;
/// Cells per voxel.
const CELLS_PER_VOXEL: f32 = 3.0;
/// Samples around one that must be of its part for it to lie off the border.
const AROUND: usize = 12;
/// Depth within this many voxels is the same surface.
const SAME_VOXELS: f32 = 0.3;
/// States that must look through a point under its part, more than under the one that takes it.
const CLEARLY_STATES: f32 = 1.0;
/// Points that have a say in the label of one.
const BESIDE: usize = 8;

/// A picture that is asked.
struct Witness {
    view: DepthView,
    camera: Projection,
}

impl Witness {
    fn new(view: DepthView) -> Self {
        let camera = Projection::new(&view.camera, &Pose::IDENTITY);
        Self { view, camera }
    }

    /// How the four pixels around a world point answer: 1 if one of them measured it, -1 if all
    /// look through it, 0 else.
    fn ask(&self, x: Vec3, same: f32) -> i32 {
        let (c, x) = (&self.view.camera, self.camera.to_camera(x));
        let (u, v) = self.camera.uv(x);
        let (u, v) = (u - 0.5, v - 0.5);
        if !(x.z > 0.0 && u >= 0.0 && v >= 0.0 && u + 1.0 < c.width as f32 && v + 1.0 < c.height as f32) {
            return 0;
        }
        let first = v as usize * c.width + u as usize;
        let mut through = true;
        for i in [first, first + 1, first + c.width, first + c.width + 1] {
            match self.view.class[i] {
                OBJECT if (self.view.depth[i] - x.z).abs() < same => return 1,
                OBJECT | OTHER => through &= self.view.depth[i] > x.z,
                class => through &= class == BACKGROUND,
            }
        }
        -i32::from(through)
    }
}

/// The labelled surface of every state: samples as they are, but along borders finer ones, labelled
/// by the pictures. `labels`: the part of every point of every state's cloud; `states(s)`: the
/// views of state s, with corrected cameras.
pub fn sharpen<E>(
    evidence: &Evidence,
    tree: &KinematicTree,
    labels: &[Vec<u8>],
    states: &mut dyn FnMut(usize) -> Result<Vec<DepthView>, E>,
) -> Result<Vec<Labelled>, E> {
    let n_states = evidence.n_states();
    let poses: Vec<Vec<Pose>> = (0..tree.parts.len()).map(|p| poses_of(tree, p, n_states)).collect();
    let border: Vec<Vec<bool>> = (0..n_states).into_par_iter().map(|s| on_border(evidence, s, &labels[s])).collect();
    let mut asked: Vec<(usize, Vec<Witness>)> = Vec::new();
    if border.iter().flatten().any(|b| *b) {
        for state in (0..n_states).step_by(n_states.div_ceil(MOST_STATES_ASKED)) {
            let views = states(state)?;
            let step = views.len().div_ceil(MOST_VIEWS_ASKED).max(1);
            asked.push((state, views.into_iter().step_by(step).map(Witness::new).collect()));
        }
    }
    let mut out = Vec::new();
    for state in 0..n_states {
        let (cloud, border) = (&evidence.clouds[state], &border[state]);
        let sure = (0..border.len()).filter(|&i| !border[i]);
        out.extend(sure.map(|i| Labelled { state, point: cloud.points[i], part: labels[state][i] }));
        if !border.contains(&true) {
            continue;
        }
        let points = fine_points(evidence, state, border, &states(state)?);
        let there = |p: &Vec<Pose>| asked.iter().map(|(t, _)| Motion::from(p[*t] * p[state].inverse())).collect();
        let here = Here {
            state,
            cloud,
            labels: &labels[state],
            asked: &asked,
            there: poses.iter().map(there).collect(),
            same: SAME_VOXELS * evidence.lattice.voxel,
        };
        let near = PointTree::new(&points);
        let label = |x: &Vec3| {
            let beside = || near.k_nearest(*x, BESIDE).into_iter().map(|j| points[j as usize]).collect();
            Labelled { state, point: *x, part: here.part_at(*x, beside) }
        };
        out.par_extend(points.par_iter().map(label));
    }
    Ok(out)
}

/// One state, and how its points go to those that are asked.
struct Here<'a> {
    state: usize,
    cloud: &'a Surface,
    labels: &'a [u8],
    /// State and its pictures.
    asked: &'a [(usize, Vec<Witness>)],
    /// World at an asked state from world here. `[part][asked]`
    there: Vec<Vec<Motion>>,
    same: f32,
}

impl Here<'_> {
    /// The part of a point; `beside`: its neighbours, asked for if need be.
    fn part_at(&self, x: Vec3, beside: impl Fn() -> Vec<Vec3>) -> u8 {
        let near = self.cloud.k_nearest(x, AROUND);
        // That of the sample in whose plane it lies.
        let far = |j: &u32| far_off_plane(x - self.cloud.points[*j as usize], self.cloud.normals[*j as usize]);
        let held = near.iter().min_by(|a, b| far(a).total_cmp(&far(b))).map_or(0, |j| self.labels[*j as usize]);
        // Only what is contradicted changes hands: a wall that is hidden elsewhere is met nowhere
        // else either.
        let first = self.ask(x, held);
        if first.through == 0.0 {
            return held;
        }
        let beside = beside();
        let mean = |p: u8, own: Answers| {
            let sum = beside.iter().fold(Answers::default(), |sum, x| sum + self.ask(*x, p));
            let n = beside.len().max(1) as f32;
            Answers { met: 0.5 * (own.met + sum.met / n), through: 0.5 * (own.through + sum.through / n) }
        };
        let own = mean(held, first);
        let mut best = (own.met - 2.0 * own.through, held);
        let rivals: BTreeSet<u8> = near.iter().map(|j| self.labels[*j as usize]).filter(|p| *p != held).collect();
        for p in rivals {
            let other = mean(p, self.ask(x, p));
            let gain = other.met - 2.0 * other.through;
            let taken = own.through - other.through >= CLEARLY_STATES && other.met > own.met - CLEARLY_STATES;
            if taken && gain > best.0 {
                best = (gain, p);
            }
        }
        best.1
    }

    /// What the other states say about a point if it is the part's.
    fn ask(&self, x: Vec3, part: u8) -> Answers {
        let others = self.asked.iter().zip(&self.there[part as usize]).filter(|((t, _), _)| *t != self.state);
        others.fold(Answers::default(), |sum, ((_, views), m)| sum + said(views, m.apply(x), self.same))
    }
}

/// How many states met a point, and how many looked through it.
#[derive(Clone, Copy, Default)]
struct Answers {
    met: f32,
    through: f32,
}

impl std::ops::Add for Answers {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { met: self.met + other.met, through: self.through + other.through }
    }
}

/// What one state says about a point.
fn said(views: &[Witness], x: Vec3, same: f32) -> Answers {
    let mut sum = Answers::default();
    for view in views {
        match view.ask(x, same) {
            1 => sum.met += 1.0,
            -1 => sum.through += 1.0,
            _ => {}
        }
    }
    // One view through is a pixel at an edge; two are a fact.
    let through = sum.through >= 2.0 && sum.through > sum.met;
    Answers { met: f32::from(!through && sum.met > 0.0), through: f32::from(through) }
}

/// Of every point of a state's cloud, whether one of another part is near.
fn on_border(evidence: &Evidence, state: usize, labels: &[u8]) -> Vec<bool> {
    let cloud = &evidence.clouds[state];
    let other = |i: usize| cloud.k_nearest(cloud.points[i], AROUND).iter().any(|j| labels[*j as usize] != labels[i]);
    (0..labels.len()).into_par_iter().map(other).collect()
}

/// The measured points around a state's border, one a fine cell.
fn fine_points(evidence: &Evidence, state: usize, border: &[bool], views: &[DepthView]) -> Vec<Vec3> {
    let lattice = &evidence.lattice;
    let mut near = vec![false; lattice.len()];
    for (x, _) in evidence.clouds[state].points.iter().zip(border).filter(|(_, border)| **border) {
        lattice.around(*x, &mut |i| near[i] = true);
    }
    let of_view = |view: &DepthView| {
        let (w, mut points) = (view.camera.width, Vec::new());
        for i in (0..view.class.len()).filter(|&i| view.class[i] == OBJECT) {
            let uv = DVec2::new((i % w) as f64 + 0.5, (i / w) as f64 + 0.5);
            let x = view.camera.unproject(uv, view.depth[i] as f64).as_vec3();
            if lattice.index(x).is_some_and(|i| near[i]) {
                let cell = ((x - lattice.lo) * (CELLS_PER_VOXEL / lattice.voxel)).as_ivec3();
                points.push((cell.to_array(), x));
            }
        }
        points
    };
    let mut points: Vec<([i32; 3], Vec3)> = views.par_iter().flat_map_iter(of_view).collect();
    points.par_sort_by_key(|p| p.0);
    let mean = |same: &[([i32; 3], Vec3)]| same.iter().map(|p| p.1).sum::<Vec3>() / same.len() as f32;
    points.chunk_by(|a, b| a.0 == b.0).map(mean).collect()
}
