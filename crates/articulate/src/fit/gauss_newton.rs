//! The last digits: all joints and their values by Gauss-Newton in f64, point to plane, between all
//! states.
//!
//! A sample of part k seen in state a is carried to state t by M = P_k(t) P_k(a)^-1 and compared
//! with the plane measured there: r = n . (M x - y). Every joint on the way from k to the root
//! moves it: a change of a parameter turns P_k(t) into exp(xi_t) P_k(t), with the twist xi in the
//! world frame, so dr = n . (xi_t(M x) - R_M xi_a(x)).

use super::unknowns::{Slot, slots, update};
use crate::model::estimate::FitReport;
use crate::model::owners::Member;
use crate::model::twist::{Twist, twists};
use crate::observe::evidence::Evidence;
use crate::observe::sample::{Motion, Sample};
use glam::DVec3;
use hingecast_geom::{KinematicTree, Pose};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::*;

/// How a fit goes.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Largest accepted distance in the first and the last round, scene units.
    pub gates: [f64; 2],
    /// Rounds in all.
    pub rounds: usize,
    /// Other states that each sample is compared with per round.
    pub partners: usize,
}

impl Settings {
    /// Six rounds, each sample against six other states, whose gate narrows from `first` to `last`
    /// voxels. `voxel`: scene units.
    pub fn narrowing(first: f64, last: f64, voxel: f32) -> Self {
        Self { gates: [first * voxel as f64, last * voxel as f64], rounds: 6, partners: 6 }
    }
}

/// Normal equations and tallies of some members.
struct Sums {
    a: DMatrix<f64>,
    b: DVector<f64>,
    /// Weighted mean of r^2.
    squares: f64,
    rows: usize,
    /// r^2 / gate^2, 1 where no surface was found: the sum, later the mean.
    cost: f64,
    asked: usize,
}

impl Sums {
    fn new(size: usize) -> Self {
        Self { a: DMatrix::zeros(size, size), b: DVector::zeros(size), squares: 0.0, rows: 0, cost: 0.0, asked: 0 }
    }
}

/// Improves the joints for which `free` says so, in place.
pub fn gauss_newton(
    evidence: &Evidence,
    tree: &mut KinematicTree,
    members: &[Member],
    free: &[bool],
    settings: &Settings,
    seed: u64,
) -> FitReport {
    let n_states = evidence.n_states();
    let (slots, size) = slots(tree, free, n_states);
    let mut report = FitReport { sigmas: vec![[0.0; 3]; tree.joints.len()], ..FitReport::default() };
    if size == 0 {
        return report;
    }
    centre_pivots(tree, members);
    for round in 0..settings.rounds {
        let share = round as f64 / (settings.rounds - 1).max(1) as f64;
        let gate = settings.gates[0] * (settings.gates[1] / settings.gates[0]).powf(share);
        let ask = Round { evidence, members, slots: &slots, size, gate, partners: settings.partners, seed, round };
        let sums = ask.all(tree);
        report.cost = sums.cost;
        report.rms = sums.squares.sqrt();
        report.rows = sums.rows;
        let Some(solved) = step(&ask, tree, &sums) else { break };
        if round + 1 == settings.rounds {
            let inverse = solved.inverse();
            let variance = report.rms * report.rms;
            for (j, slot) in slots.iter().enumerate() {
                let Some(slot) = slot else { continue };
                let sigma = |i: usize, n: usize| ((i..i + n).map(|k| inverse[(k, k)]).sum::<f64>() * variance).sqrt();
                let pivot = if slot.n_shape == 4 { sigma(slot.shape + 2, 2) } else { 0.0 };
                let values = sigma(slot.values, n_states - 1) / ((n_states - 1) as f64).sqrt();
                report.sigmas[j] = [sigma(slot.shape, 2), pivot, values];
            }
        }
    }
    report
}

/// Mean over all comparisons of r^2 / gate^2, 1 where no surface was found, as a first round of
/// [`gauss_newton`] with this gate would report it.
pub fn cost(
    evidence: &Evidence,
    tree: &KinematicTree,
    members: &[Member],
    gate: f64,
    partners: usize,
    seed: u64,
) -> f64 {
    let slots = vec![None; tree.joints.len()];
    Round { evidence, members, slots: &slots, size: 0, gate, partners, seed, round: 0 }.all(tree).cost
}

/// Normal matrix of joint `j` alone (2 of the axis first), weighted root mean square of the residuals (scene
/// units) and rows, with the last gate of `settings`; nothing is moved.
pub fn normal_equations(
    evidence: &Evidence,
    tree: &KinematicTree,
    members: &[Member],
    j: usize,
    settings: &Settings,
    seed: u64,
) -> (DMatrix<f64>, f64, usize) {
    let free: Vec<bool> = (0..tree.joints.len()).map(|k| k == j).collect();
    let (slots, size) = slots(tree, &free, evidence.n_states());
    let (gate, partners) = (settings.gates[1], settings.partners);
    let sums = Round { evidence, members, slots: &slots, size, gate, partners, seed, round: 0 }.all(tree);
    (sums.a, sums.squares.sqrt(), sums.rows)
}

/// One round's question: the same members meet the same states, however often it is asked.
struct Round<'a> {
    evidence: &'a Evidence,
    members: &'a [Member],
    slots: &'a [Option<Slot>],
    /// Unknowns.
    size: usize,
    gate: f64,
    partners: usize,
    seed: u64,
    round: usize,
}

/// However narrow the gate, the nearest sample of a surface may be this many voxels away.
const LEAST_REACH: f32 = 1.2;
/// A step that moves no member by more than this share of the gate is taken unasked.
const SMALL: f64 = 0.25;
/// A slide goes at most so far in one step, shares of the object's extent.
const LONGEST_SLIDE: f64 = 0.2;
/// Members that tell how far a step moves them: every so many.
const TELLING: usize = 29;
/// Damping of the first try, shares of the diagonal; each further try takes the next one. The last
/// resort is to stay.
const DAMPING: [f64; 4] = [1e-6, 0.03, 1.0, 30.0];

/// Takes the step that the sums ask for, shortened until it keeps what it promises, or none.
/// Answers the normal matrix, decomposed.
///
/// Few members of a drawer tell whether it rises on its way; a step away from them loses them all,
/// and then nothing pulls it back.
fn step(ask: &Round, tree: &mut KinematicTree, sums: &Sums) -> Option<Cholesky<f64, Dyn>> {
    // Unseen states keep their value; a joint that nothing constrains keeps its place.
    let scale = sums.a.diagonal().max().max(1e-12);
    let damped = |damping: f64| {
        let mut a = sums.a.clone();
        for i in 0..ask.size {
            a[(i, i)] += damping * a[(i, i)] + 1e-9 * scale;
        }
        a.cholesky()
    };
    let first = damped(DAMPING[0])?;
    for (k, damping) in DAMPING.into_iter().enumerate() {
        let by = if k == 0 { first.solve(&sums.b) } else { damped(damping)?.solve(&sums.b) };
        if by.iter().any(|x| !x.is_finite()) {
            return None;
        }
        let mut trial = tree.clone();
        update(&mut trial, ask.slots, &by, LONGEST_SLIDE * f64::from(ask.evidence.extent()));
        if ask.farthest(tree, &trial) < SMALL * ask.gate || ask.all(&trial).cost <= sums.cost {
            *tree = trial;
            break;
        }
    }
    Some(first)
}

impl Round<'_> {
    /// How far some members are apart under the two trees, where states are compared with the
    /// first; scene units.
    fn farthest(&self, old: &KinematicTree, new: &KinematicTree) -> f64 {
        let n_states = self.evidence.n_states();
        let poses = |tree: &KinematicTree| -> Vec<Vec<Pose>> { (0..n_states).map(|s| tree.poses_at(s)).collect() };
        let (old, new) = (poses(old), poses(new));
        let gap = |Member { sample: s, part, .. }: &Member| {
            let x = s.point.as_dvec3();
            let in_state =
                |poses: &[Vec<Pose>], t: usize| poses[t][*part].apply(poses[s.state][*part].inverse().apply(x));
            (0..n_states).map(|t| in_state(&old, t).distance(in_state(&new, t))).fold(0.0, f64::max)
        };
        self.members.iter().step_by(TELLING).map(gap).fold(0.0, f64::max)
    }

    /// Normal equations and cost of a tree.
    fn all(&self, tree: &KinematicTree) -> Sums {
        let n_states = self.evidence.n_states();
        let chains: Vec<Vec<usize>> = (0..tree.parts.len()).map(|p| tree.ancestry(p)).collect();
        let poses: Vec<Vec<Pose>> = (0..n_states).map(|s| tree.poses_at(s)).collect();
        let twists: Vec<Vec<Vec<Twist>>> =
            (0..n_states).map(|s| (0..tree.joints.len()).map(|j| twists(tree, j, s, &poses[s])).collect()).collect();
        let chunks: Vec<Sums> = self
            .members
            .par_chunks(4096)
            .enumerate()
            .map(|(c, chunk)| self.some(chunk, c as u64, &chains, &poses, &twists))
            .collect();
        // Summed in a fixed order.
        let mut all = Sums::new(self.size);
        for chunk in chunks {
            all.a += chunk.a;
            all.b += chunk.b;
            all.squares += chunk.squares * chunk.rows as f64;
            all.rows += chunk.rows;
            all.cost += chunk.cost;
            all.asked += chunk.asked;
        }
        all.squares /= all.rows.max(1) as f64;
        all.cost /= all.asked.max(1) as f64;
        all
    }

    /// Those of one chunk; the cost is not divided yet.
    fn some(
        &self,
        chunk: &[Member],
        c: u64,
        chains: &[Vec<usize>],
        poses: &[Vec<Pose>],
        twists: &[Vec<Vec<Twist>>],
    ) -> Sums {
        let (n_states, gate) = (self.evidence.n_states(), self.gate);
        let mut rng = fastrand::Rng::with_seed(self.seed ^ ((self.round as u64) << 32) ^ c);
        let mut out = Sums::new(self.size);
        let mut weight = 0.0;
        let mut row: Vec<(usize, f64)> = Vec::new();
        for Member { sample, part, shown } in chunk {
            let back = poses[sample.state][*part].inverse();
            for _ in 0..self.partners.min(n_states - 1) {
                let t = (sample.state + 1 + rng.usize(..n_states - 1)) % n_states;
                if shown >> t & 1 == 0 {
                    continue;
                }
                let m = poses[t][*part] * back;
                out.asked += 1;
                let Some((r, n, x)) = residual(self.evidence, sample, t, &m, gate) else {
                    out.cost += 1.0;
                    continue;
                };
                out.cost += (r / gate).powi(2);
                row.clear();
                let rotated = m.rot.conjugate() * n;
                for &j in &chains[*part] {
                    let Some(slot) = self.slots[j] else { continue };
                    let here = &twists[t][j];
                    let there = &twists[sample.state][j];
                    let d = |k: usize| n.dot(here[k].at(x)) - rotated.dot(there[k].at(sample.point.as_dvec3()));
                    for k in 0..slot.n_shape {
                        row.push((slot.shape + k, d(k)));
                    }
                    if t > 0 {
                        row.push((slot.values + t - 1, n.dot(here[4].at(x))));
                    }
                    if sample.state > 0 {
                        let g = rotated.dot(there[4].at(sample.point.as_dvec3()));
                        row.push((slot.values + sample.state - 1, -g));
                    }
                }
                // Geman and McClure: what lies far off hardly pulls.
                let w = (1.0 + (2.0 * r / gate).powi(2)).powi(-2);
                for &(i, gi) in &row {
                    out.b[i] -= w * gi * r;
                    for &(k, gk) in &row {
                        out.a[(i, k)] += w * gi * gk;
                    }
                }
                out.squares += w * r * r;
                weight += w;
                out.rows += 1;
            }
        }
        out.squares /= f64::max(weight, 1e-300);
        out
    }
}

/// Distance to the plane found at state t, its normal, and the carried point.
fn residual(evidence: &Evidence, s: &Sample, t: usize, m: &Pose, gate: f64) -> Option<(f64, DVec3, DVec3)> {
    let x = m.apply(s.point.as_dvec3());
    let normal = Motion::from(*m).rot * s.normal;
    let reach = (gate as f32).max(LEAST_REACH * evidence.lattice.voxel);
    let i = evidence.surface_at(t, x.as_vec3(), normal, reach)?;
    let cloud = &evidence.clouds[t];
    // The bisecting normal is right to second order on curved surfaces.
    let n = (cloud.normals[i] + normal).normalize().as_dvec3();
    let r = n.dot(x - cloud.points[i].as_dvec3());
    (r.abs() < gate).then_some((r, n, x))
}

/// Pivots slide along their axes to beside their part: far from it, tilt and shift would be hard to
/// tell apart.
fn centre_pivots(tree: &mut KinematicTree, members: &[Member]) {
    let poses: Vec<Vec<Pose>> =
        (0..tree.joints.first().map_or(0, |j| j.values.len())).map(|s| tree.poses_at(s)).collect();
    for j in 0..tree.joints.len() {
        let (child, parent) = (tree.joints[j].child, tree.joints[j].parent);
        let own = members.iter().filter(|m| m.part == child).map(|m| &m.sample);
        let (sum, n) = own.fold((DVec3::ZERO, 0.0), |(sum, n), s| {
            (sum + poses[s.state][parent].inverse().apply(s.point.as_dvec3()), n + 1.0)
        });
        if n > 0.0 {
            let centre = sum / n;
            let screw = &mut tree.joints[j].screw;
            screw.pivot = if screw.kind.turns() { screw.foot(centre) } else { centre };
        }
    }
}
