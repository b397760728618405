//! From rigid motions of parts to joints: no rotation means prismatic, else a hinge through the
//! fixed points.

use super::fixed_points::{Rule, fixed, lattice, ransac_line};
use super::segment::Segmentation;
use glam::DVec3;
use hingecast_geom::pose::rotation_vector;
use hingecast_geom::{Joint, JointKind, KinematicTree, Pose, Screw};
use serde::{Deserialize, Serialize};

/// Settings of the axis fit.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Which candidate points count as left in place by the motion.
    pub fixed: Rule,
    /// Spacing of the candidate lattice / diagonal.
    pub lattice: f64,
    /// The lattice reaches this share of the diagonal beyond the part.
    pub margin: f64,
    /// The motion "has no rotation" when the part's rim turns by less than this share of what its
    /// middle shifts.
    pub prismatic_share: f64,
}

impl Default for Config {
    fn default() -> Self {
        Self { fixed: Rule::TopK(120), lattice: 0.01, margin: 0.15, prismatic_share: 0.25 }
    }
}

/// Joints of every part relative to part 0 (the classical way knows no chains).
/// `points[p]`: positions of part p's gaussians in state 0. Answers the tree and its doubts.
pub fn run(
    segmentation: &Segmentation,
    points: &[Vec<DVec3>],
    diagonal: f64,
    config: &Config,
    seed: u64,
) -> (KinematicTree, Vec<String>) {
    let motions = &segmentation.motions;
    let n_states = motions[0].len();
    let mut tree = KinematicTree::default();
    let mut doubts = Vec::new();
    for part in 0..motions.len() {
        tree.parts.push(if part == 0 { "base".to_string() } else { format!("part_{part}") });
        if part == 0 {
            continue;
        }
        // Canonical world at state 0: the root stands still by definition.
        let relative: Vec<Pose> = (0..n_states).map(|s| motions[0][s].inverse() * motions[part][s]).collect();
        let name = format!("joint_{part}");
        let (screw, values) = fit(&relative, &points[part], diagonal, config, seed, &name, &mut doubts);
        let limits = values.iter().fold([0.0f64; 2], |l, v| [l[0].min(*v), l[1].max(*v)]);
        tree.joints.push(Joint { name, parent: 0, child: part, screw, values, limits });
    }
    if motions.len() == 1 {
        doubts.push("nothing moves: one part without joints".to_string());
    }
    (tree, doubts)
}

fn fit(
    motions: &[Pose],
    points: &[DVec3],
    diagonal: f64,
    config: &Config,
    seed: u64,
    name: &str,
    doubts: &mut Vec<String>,
) -> (Screw, Vec<f64>) {
    let centre = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
    let radius =
        (points.iter().map(|x| (*x - centre).length_squared()).sum::<f64>() / points.len().max(1) as f64).sqrt();
    let shift = |m: &Pose| m.apply(centre) - centre;
    let most_shift = motions.iter().map(|m| shift(m).length()).fold(0.0, f64::max);
    let most_turn = motions.iter().map(|m| m.angle() * radius).fold(0.0, f64::max);

    let share = most_turn / most_shift.max(1e-12);
    if (0.5..2.0).contains(&(share / config.prismatic_share)) {
        doubts.push(format!(
            "joint '{name}': the motion turns the part's rim by {share:.2} of what it shifts its middle: \
             hinge or slide is a close call"
        ));
    }
    if share < config.prismatic_share {
        // Direction: principal axis of the shifts (they all lie on one line through 0).
        let mut m = nalgebra::Matrix3::<f64>::zeros();
        for motion in motions {
            let d = nalgebra::Vector3::from(shift(motion).to_array());
            m += d * d.transpose();
        }
        let eigen = m.symmetric_eigen();
        let v = eigen.eigenvectors.column(eigen.eigenvalues.imax());
        let mut axis = DVec3::new(v[0], v[1], v[2]).normalize_or(DVec3::Z);
        if motions.iter().map(|m| shift(m).dot(axis)).sum::<f64>() < 0.0 {
            axis = -axis;
        }
        let values = motions.iter().map(|m| shift(m).dot(axis)).collect();
        return (Screw { kind: JointKind::Prismatic, axis, pivot: centre }, values);
    }

    // Motions that hardly turn say little about where the axis is; weigh by using those that turn
    // enough.
    let strongest = motions.iter().map(Pose::angle).fold(0.0, f64::max);
    let telling: Vec<Pose> = motions.iter().filter(|m| m.angle() > 0.3 * strongest).copied().collect();
    let (mut lo, mut hi) = (centre, centre);
    for x in points {
        lo = lo.min(*x);
        hi = hi.max(*x);
    }
    let margin = DVec3::splat(config.margin * diagonal);
    let spacing = config.lattice * diagonal;
    let mut candidates = lattice(lo - margin, hi + margin, spacing);
    candidates.extend_from_slice(points);
    let stay = fixed(&candidates, &telling, config.fixed);
    // Sign by the rotation vectors themselves, all turned into one half-space.
    let turn = telling
        .iter()
        .map(|m| rotation_vector(m.rot))
        .fold(DVec3::ZERO, |sum: DVec3, w| if sum.dot(w) < 0.0 { sum - w } else { sum + w });
    let line = ransac_line(&stay, 2.0 * spacing, seed);
    let (pivot, mut axis) = line.unwrap_or_else(|| {
        doubts.push(format!("joint '{name}': no line through the points that stay; its axis is the mean rotation"));
        (centre, turn.normalize_or(DVec3::Z))
    });
    if axis.dot(turn) < 0.0 {
        axis = -axis;
    }
    let off = axis.dot(turn.normalize_or(axis)).clamp(-1.0, 1.0).acos().to_degrees();
    if off > 5.0 {
        doubts.push(format!(
            "joint '{name}': its fixed points and its rotations disagree about the axis by {off:.0} deg"
        ));
    }
    let mut values: Vec<f64> = motions.iter().map(|m| rotation_vector(m.rot).dot(axis)).collect();
    // Most states to the positive side, as a person would count.
    if values.iter().sum::<f64>() < 0.0 {
        axis = -axis;
        values.iter_mut().for_each(|v| *v = -*v);
    }
    (Screw { kind: JointKind::Revolute, axis, pivot }, values)
}
