//! The last digits: all joints and their values by Gauss-Newton in f64, point to plane, between all states.
//!
//! A sample of part k seen in state a is carried to state t by M = P_k(t) P_k(a)^-1 and compared with the plane measured
//! there: r = n . (M x - y). Every joint on the way from k to the root moves it: a change of a parameter turns
//! P_k(t) into exp(xi_t) P_k(t), with the twist xi in the world frame, so dr = n . (xi_t(M x) - R_M xi_a(x)).

use super::evidence::{Evidence, Motion, Sample};
use super::twist::{Twist, square, twists};
use glam::{DMat3, DVec3};
use hingecast_geom::pose::quat_from_rotation_vector;
use hingecast_geom::{JointKind, KinematicTree, Pose};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::*;

/// A sample and the part that it belongs to.
#[derive(Clone, Copy, Debug)]
pub struct Member {
    pub sample: Sample,
    pub part: usize,
    /// States that it is compared with, one bit each.
    pub shown: u64,
}

#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Largest accepted distance in the first and the last round, scene units.
    pub gates: [f64; 2],
    pub rounds: usize,
    /// Other states that each sample is compared with per round.
    pub partners: usize,
}

/// What the last round knew.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct Report {
    /// Root mean square of the accepted residuals, scene units.
    pub rms: f64,
    /// Accepted residuals.
    pub rows: usize,
    /// Mean over all comparisons of r^2 / gate^2, 1 where no surface was found.
    pub cost: f64,
    /// Standard deviations per joint: axis [rad], pivot [scene units], value (mean over states).
    pub sigmas: Vec<[f64; 3]>,
}

/// Where a joint's parameters stand in the unknowns: axis 2, pivot 2 (hinges), values from state 1 on.
#[derive(Clone, Copy)]
pub struct Slot {
    pub shape: usize,
    pub n_shape: usize,
    pub values: usize,
}

/// Slots of the joints that are free, and the number of unknowns.
pub fn slots(tree: &KinematicTree, free: &[bool], n_states: usize) -> (Vec<Option<Slot>>, usize) {
    let mut size = 0;
    let mut slot = |n_shape: usize| {
        let slot = Slot { shape: size, n_shape, values: size + n_shape };
        size += n_shape + n_states - 1;
        slot
    };
    let joints = tree.joints.iter().zip(free);
    let slots = joints.map(|(joint, free)| {
        (*free && joint.screw.kind != JointKind::Fixed).then(|| slot(if joint.screw.kind.turns() { 4 } else { 2 }))
    });
    (slots.collect(), size)
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
pub fn refine(
    evidence: &Evidence,
    tree: &mut KinematicTree,
    members: &[Member],
    free: &[bool],
    settings: &Settings,
    seed: u64,
) -> Report {
    let n_states = evidence.n_states();
    let (slots, size) = slots(tree, free, n_states);
    let mut report = Report { sigmas: vec![[0.0; 3]; tree.joints.len()], ..Report::default() };
    if size == 0 {
        return report;
    }
    centre_pivots(tree, members);
    for round in 0..settings.rounds {
        let share = round as f64 / (settings.rounds - 1).max(1) as f64;
        let gate = settings.gates[0] * (settings.gates[1] / settings.gates[0]).powf(share);
        let ask = Ask { evidence, members, slots: &slots, size, gate, partners: settings.partners, seed, round };
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

/// Mean over all comparisons of r^2 / gate^2, 1 where no surface was found, as a first round of [`refine`] with this gate would report
/// it.
pub fn cost(
    evidence: &Evidence,
    tree: &KinematicTree,
    members: &[Member],
    gate: f64,
    partners: usize,
    seed: u64,
) -> f64 {
    let slots = vec![None; tree.joints.len()];
    Ask { evidence, members, slots: &slots, size: 0, gate, partners, seed, round: 0 }.all(tree).cost
}

/// One round's question: the same members meet the same states, however often it is asked.
struct Ask<'a> {
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

/// A step that moves no member by more than this share of the gate is taken unasked.
const SMALL: f64 = 0.25;
/// Members that tell how far a step moves them: every so many.
const TELLING: usize = 29;
/// Damping of the first try, shares of the diagonal; each further try takes the next one. The last resort is to stay.
const DAMPING: [f64; 4] = [1e-6, 0.03, 1.0, 30.0];

/// Takes the step that the sums ask for, shortened until it keeps what it promises, or none. Answers the normal matrix, decomposed.
///
/// Few members of a drawer tell whether it rises on its way; a step away from them loses them all, and then nothing pulls it back.
fn step(ask: &Ask, tree: &mut KinematicTree, sums: &Sums) -> Option<Cholesky<f64, Dyn>> {
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
        let mut trial = tree.clone();
        update(&mut trial, ask.slots, &by);
        if ask.farthest(tree, &trial) < SMALL * ask.gate || ask.all(&trial).cost <= sums.cost {
            *tree = trial;
            break;
        }
    }
    Some(first)
}

impl Ask<'_> {
    /// How far some members are apart under the two trees, where states are compared with the first; scene units.
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
    let cloud = &evidence.clouds[t];
    let (i, squared) = cloud.nearest(x.as_vec3())?;
    let n = cloud.normals[i];
    let reach = (gate as f32).max(1.2 * evidence.lattice.voxel);
    if squared > reach * reach || n.dot(normal) < 0.85 {
        return None;
    }
    // The bisecting normal is right to second order on curved surfaces.
    let n = (n + normal).normalize().as_dvec3();
    let r = n.dot(x - cloud.points[i].as_dvec3());
    (r.abs() < gate).then_some((r, n, x))
}

/// Adds a step to the unknowns.
pub fn update(tree: &mut KinematicTree, slots: &[Option<Slot>], step: &DVector<f64>) {
    for (joint, slot) in tree.joints.iter_mut().zip(slots) {
        let Some(slot) = slot else { continue };
        let [b1, b2] = square(joint.screw.axis);
        let at = |k: usize| step[slot.shape + k];
        // A step longer than this is not one that the linearisation knows anything about.
        let tilt = (b1 * at(0) + b2 * at(1)).clamp_length_max(0.2);
        if slot.n_shape == 4 {
            joint.screw.pivot += b1 * at(2) + b2 * at(3);
        }
        joint.screw.axis = (DMat3::from_quat(quat_from_rotation_vector(tilt)) * joint.screw.axis).normalize();
        for (s, q) in joint.values.iter_mut().enumerate().skip(1) {
            *q += step[slot.values + s - 1];
        }
    }
}

/// Pivots slide along their axes to beside their part: far from it, tilt and shift would be hard to tell apart.
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

#[cfg(test)]
mod tests {
    use super::*;
    use hingecast_geom::{Joint, Screw};

    /// A slide on a hinge.
    fn chain_tree() -> KinematicTree {
        let joint = |parent, kind, axis: DVec3, pivot, values: [f64; 2]| Joint {
            name: "j".into(),
            parent,
            child: parent + 1,
            screw: Screw { kind, axis: axis.normalize(), pivot },
            values: values.to_vec(),
            limits: [0.0, 1.0],
        };
        KinematicTree {
            parts: vec!["a".into(), "b".into(), "c".into()],
            joints: vec![
                joint(0, JointKind::Revolute, DVec3::new(0.2, 0.1, 1.0), DVec3::new(0.3, -0.1, 0.2), [0.2, 0.9]),
                joint(1, JointKind::Prismatic, DVec3::new(1.0, 0.3, -0.2), DVec3::new(0.1, 0.5, 0.0), [0.1, 0.4]),
            ],
        }
    }

    /// The twists against central differences of where a carried point ends, for every parameter of both joints.
    #[test]
    fn twists_are_the_derivatives_of_the_motion() {
        let tree = chain_tree();
        let x = DVec3::new(0.7, -0.4, 0.9);
        let carried = |tree: &KinematicTree| (tree.poses_at(1)[2] * tree.poses_at(0)[2].inverse()).apply(x);
        let poses = [tree.poses_at(0), tree.poses_at(1)];
        let m = poses[1][2] * poses[0][2].inverse();
        let h = 1e-6;
        for j in 0..2 {
            let (there, here) = (twists(&tree, j, 0, &poses[0]), twists(&tree, j, 1, &poses[1]));
            let n_shape = if j == 0 { 4 } else { 2 };
            for k in 0..n_shape + 2 {
                let moved = |step: f64| {
                    let mut tree = tree.clone();
                    let size = n_shape + 1;
                    let slot = Slot { shape: 0, n_shape, values: n_shape };
                    let mut by = DVector::zeros(size + 1);
                    // The last two parameters: the value at state 1, and (by hand) that at state 0.
                    if k < size {
                        by[k] = step;
                    } else {
                        tree.joints[j].values[0] += step;
                    }
                    let slots: Vec<Option<Slot>> = (0..2).map(|i| (i == j).then_some(slot)).collect();
                    update(&mut tree, &slots, &by);
                    carried(&tree)
                };
                let numeric = (moved(h) - moved(-h)) / (2.0 * h);
                let index = if k < n_shape { k } else { 4 };
                let analytic = if k < n_shape {
                    here[index].at(m.apply(x)) - m.rotate(there[index].at(x))
                } else if k == n_shape {
                    here[4].at(m.apply(x))
                } else {
                    -m.rotate(there[4].at(x))
                };
                assert!((numeric - analytic).length() < 1e-7, "joint {j} parameter {k}: {numeric} {analytic}");
            }
        }
    }
}
