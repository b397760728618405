//! What a person should know before believing the joints: rivals that explain the recording nearly as well, what the depth
//! hardly determines, pieces that always moved together.

use super::discover::poses_of;
use super::evidence::Evidence;
use super::refine::{Member, Settings, refine};
use super::settle::Settled;
use glam::{DVec3, IVec3, Vec3};
use hingecast_geom::{Certainty, Joint, JointKind, KinematicTree};
use std::collections::HashMap;

/// Samples count as independent evidence in groups of this size: neighbours share their noise.
pub const CORRELATED: f64 = 25.0;
/// Log-likelihood ratio (nats) below which a rival is not refuted.
pub const REFUTED: f64 = 10.0;
/// Standard deviations worth mentioning: axis [deg], pivot [share of the object's extent].
const LOOSE_AXIS_DEG: f64 = 1.0;
const LOOSE_PIVOT: f64 = 0.01;
/// The covariance counts rows that share noise and correspondences as if they did not.
const OPTIMISTIC: f64 = 5.0;
/// A hinge that turns less than this in all, radians, moves its part like a slide.
const SAME_TURN: f64 = 0.02;
/// A second piece of at least this share of its part is mentioned.
const PIECE: f64 = 0.2;
/// Pieces farther apart than one to two cells of this many voxels are separate.
const GAP: f32 = 1.5;
/// Share of samples that may stay unexplained silently.
const UNEXPLAINED: f64 = 0.005;
/// Share of the part's samples that a state must confirm.
const SEEN: f64 = 0.05;

/// Doubts, gravest first, and how sure one may be of each joint. `clouds`: the part of every point of every state's cloud.
pub fn doubts(evidence: &Evidence, found: &Settled, clouds: &[Vec<u8>], seed: u64) -> (Vec<String>, Vec<Certainty>) {
    let mut out = Vec::new();
    let mut certainty = Vec::new();
    let tree = &found.tree;
    if tree.joints.is_empty() {
        out.push("nothing moves: one part without joints".to_string());
    }
    for (j, joint) in tree.joints.iter().enumerate() {
        let members = found.owners.members(evidence, joint.child);
        let (rival, nats) = rival(evidence, tree, j, &members, seed);
        let rival = rival.joints[j].screw.kind;
        if nats < REFUTED {
            out.push(format!(
                "undecidable: '{}' may as well be {}: it moved too little to tell ({nats:.1} nats apart; 10 would do)",
                joint.name,
                name(rival)
            ));
        }
        let [axis, pivot, value] = found.report.sigmas[j].map(|sigma| OPTIMISTIC * sigma);
        let axis = axis.to_degrees();
        certainty.push(Certainty { axis_deg: axis, pivot, value, rival, nats });
        if axis > LOOSE_AXIS_DEG {
            out.push(format!("joint '{}': the depth says where its axis points only to {axis:.1} deg", joint.name));
        }
        if pivot > LOOSE_PIVOT * evidence.extent() as f64 {
            out.push(format!("joint '{}': the depth says where its axis lies only to {pivot:.3} units", joint.name));
        }
        if let Some(share) = second_piece(evidence, found, clouds, joint) {
            out.push(format!(
                "'{}' has two pieces that do not touch ({:.0} % of it is the second) and always moved together: if they \
                 are two parts, record them moving one at a time",
                tree.parts[joint.child],
                100.0 * share
            ));
        }
        let unseen = unseen_states(evidence, found, joint, &members);
        if !unseen.is_empty() {
            out.push(format!(
                "joint '{}': its part is hardly seen in state{} {unseen:?}; the value there is a guess",
                joint.name,
                if unseen.len() == 1 { "" } else { "s" }
            ));
        }
    }
    if found.unexplained > UNEXPLAINED {
        out.push(format!(
            "{:.1} % of the surface moved in a way that no part explains (soft, or too small a part, or frames that differ)",
            100.0 * found.unexplained
        ));
    }
    if evidence.n_states() == 2 && !tree.joints.is_empty() {
        out.push(
            "two states only: parts that moved alike (two drawers pulled out equally far) come out as one; if that may be so, record more \
             states, or move one part at a time"
                .to_string(),
        );
    }
    (out, certainty)
}

fn name(kind: JointKind) -> &'static str {
    match kind {
        JointKind::Prismatic => "a slide",
        JointKind::Fixed => "fixed",
        _ => "a hinge",
    }
}

/// The tree with joint `j` of the other type, fitted as well as it can be, and how many nats it is behind.
pub fn rival(
    evidence: &Evidence,
    tree: &KinematicTree,
    j: usize,
    members: &[Member],
    seed: u64,
) -> (KinematicTree, f64) {
    let voxel = evidence.lattice.voxel as f64;
    let settings = Settings { gates: [0.6 * voxel, 0.6 * voxel], rounds: 4, partners: 6 };
    let mut free = vec![false; tree.joints.len()];
    free[j] = true;
    let own = refine(evidence, &mut tree.clone(), members, &free, &settings, seed);
    let mut other = tree.clone();
    let kind = imitate(&mut other.joints[j], members);
    // The imitation is coarse: give it room to find its place.
    let wide = Settings { gates: [2.0 * voxel, 0.6 * voxel], rounds: 8, partners: 6 };
    refine(evidence, &mut other, members, &free, &wide, seed);
    let theirs = refine(evidence, &mut other, members, &free, &settings, seed);
    // A hinge has two unknowns more than a slide.
    let extra = two_unknowns(members.len()) * if kind == JointKind::Prismatic { -1.0 } else { 1.0 };
    // A hinge that hardly turns is the slide in other words, not a rival.
    let turn = other.joints[j].values.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    let same = if kind.turns() && turn < SAME_TURN { REFUTED } else { 0.0 };
    let nats = behind(members.len(), theirs.cost, own.cost) + extra + same;
    (other, nats)
}

/// How many nats worse than `own` a fit with cost `theirs` explains `n` samples.
pub fn behind(n: usize, theirs: f64, own: f64) -> f64 {
    let floor = 1e-6;
    0.5 * (n as f64 / CORRELATED) * ((theirs + floor) / (own + floor)).ln()
}

/// What two unknowns must gain on `n` samples, nats (the Bayesian information criterion).
pub fn two_unknowns(n: usize) -> f64 {
    (n as f64 / CORRELATED).max(2.0).ln()
}

/// Turns a hinge into the slide that moves the part's middle alike, and a slide into a hinge far away.
fn imitate(joint: &mut Joint, members: &[Member]) -> JointKind {
    let n = members.len().max(1) as f64;
    let centre = members.iter().map(|m| m.sample.point.as_dvec3()).sum::<DVec3>() / n;
    let far = joint.values.iter().copied().fold(0.0, |m: f64, v| if v.abs() > m.abs() { v } else { m });
    let screw = &mut joint.screw;
    if screw.kind.turns() {
        let moved = screw.motion(far).apply(centre) - centre;
        let shift = moved.length();
        screw.axis = moved.try_normalize().unwrap_or(DVec3::X);
        screw.kind = JointKind::Prismatic;
        let scale = if far == 0.0 { 0.0 } else { shift / far };
        joint.values.iter_mut().for_each(|v| *v *= scale);
    } else {
        let reach = members.iter().map(|m| m.sample.point.as_dvec3().distance(centre)).fold(0.0, f64::max);
        let radius = 20.0 * (reach + far.abs());
        let side = screw.axis.any_orthonormal_vector();
        // Motion along the axis is a small turn about a line to the side.
        screw.kind = JointKind::Revolute;
        screw.pivot = centre - side * radius;
        screw.axis = side.cross(screw.axis);
        joint.values.iter_mut().for_each(|v| *v /= radius);
    }
    screw.kind
}

/// Share of the second largest piece of a part, when it is large and apart from the largest.
fn second_piece(evidence: &Evidence, found: &Settled, clouds: &[Vec<u8>], joint: &Joint) -> Option<f64> {
    // All points where the first state has them.
    let cell = GAP * evidence.lattice.voxel;
    let mut cells: HashMap<IVec3, usize> = HashMap::new();
    for (state, labels) in clouds.iter().enumerate() {
        let back = found.tree.poses_at(state)[joint.child].inverse();
        let own = evidence.clouds[state].points.iter().zip(labels).filter(|(_, l)| **l as usize == joint.child);
        for (x, _) in own {
            let x: Vec3 = back.apply(x.as_dvec3()).as_vec3();
            *cells.entry((x / cell).floor().as_ivec3()).or_insert(0) += 1;
        }
    }
    // A cell that only one state in five fills holds stray labels.
    let least = clouds.len().div_ceil(5);
    cells.retain(|_, n| *n >= least);
    let total: usize = cells.values().sum();
    let mut sizes = Vec::new();
    while let Some(start) = cells.keys().copied().min_by_key(|c| c.to_array()) {
        let (mut stack, mut size) = (vec![start], 0);
        size += cells.remove(&start).unwrap_or(0);
        while let Some(at) = stack.pop() {
            for k in 0..27 {
                let next = at + IVec3::new(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
                if let Some(n) = cells.remove(&next) {
                    size += n;
                    stack.push(next);
                }
            }
        }
        sizes.push(size);
    }
    sizes.sort_unstable_by(|a, b| b.cmp(a));
    let share = *sizes.get(1)? as f64 / total as f64;
    (share > PIECE).then_some(share)
}

/// States in which too little of the part is confirmed.
fn unseen_states(evidence: &Evidence, found: &Settled, joint: &Joint, members: &[Member]) -> Vec<usize> {
    let n = evidence.n_states();
    let between = evidence.between(&poses_of(&found.tree, joint.child, n));
    let stride = members.len().div_ceil(2000).max(1);
    let (mut confirmed, mut asked) = (vec![0usize; n], vec![0usize; n]);
    for Member { sample: s, .. } in members.iter().step_by(stride) {
        let v = evidence.ask_all(s, &between[s.state]);
        for t in (0..n).filter(|t| *t != s.state) {
            asked[t] += 1;
            confirmed[t] += (v.support >> t & 1) as usize;
        }
    }
    let shown = found.owners.shown[joint.child];
    (0..n).filter(|&t| shown >> t & 1 == 0 || (confirmed[t] as f64) < SEEN * asked[t] as f64).collect()
}
