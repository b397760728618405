//! Joint errors as in PARIS, DTA and ArtGS, plus our stricter pivot distance and the sweep.

use glam::DVec3;
use hingecast_geom::{Joint, JointKind, KinematicTree, Pose, Screw, TriMesh};
use serde::{Deserialize, Serialize};

/// How far off the joint of one true part is.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct JointErrors {
    /// Of the true joint.
    pub name: String,
    /// Of the true joint.
    pub true_type: JointKind,
    /// `None` when no part was matched: every error is then the miss value of metrics.md.
    pub found_type: Option<JointKind>,
    /// Whether the found joint has the true type.
    pub type_right: bool,
    /// Angle between the axes, 0 to 90 degrees.
    pub axis_deg: f64,
    /// Published tables' unit: 10 x scene units. Hinges only.
    pub axis_pos: Option<f64>,
    /// Foot of the true part's centroid on the true axis to the found axis line, scene units.
    /// Hinges only.
    pub pivot: Option<f64>,
    /// Over all pairs (first state, state s): degrees for hinges, scene units for slides.
    pub motion_mean: f64,
    /// The largest over the states.
    pub motion_max: f64,
    /// Mean |(q_p(s) - q_p(0)) - (q_g(s) - q_g(0))|, deg or scene units.
    pub state_mean: f64,
    /// |found range - range that the recording showed|, deg or scene units.
    pub range_error: f64,
    /// Mean and largest distance between points of the part on the found and the true path over the
    /// shown range.
    pub sweep_mean: f64,
    /// The largest on the way.
    pub sweep_max: f64,
}

/// `matching[t]`: found part of true part t. `true_meshes` in the reference state.
pub fn errors(
    found: &KinematicTree,
    truth: &KinematicTree,
    matching: &[Option<usize>],
    true_meshes: &[TriMesh],
    diagonal: f64,
) -> Vec<JointErrors> {
    let poses = truth.poses_at(0);
    truth
        .joints
        .iter()
        .map(|joint| {
            // The true screw where it stood in the first state: moved along with the parent.
            let screw = joint.screw.transformed(&poses[joint.parent]);
            let found_joint = matching[joint.child].and_then(|f| found.joint_of(f));
            match found_joint {
                Some(f) => compare(f, found, joint, truth, &screw, &true_meshes[joint.child]),
                None => miss(joint, diagonal),
            }
        })
        .collect()
}

/// Angle for hinges in degrees, length for slides.
fn in_table_units(kind: JointKind, value: f64) -> f64 {
    if kind.turns() { value.to_degrees() } else { value }
}

fn shown(values: &[f64]) -> f64 {
    let (lo, hi) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(*v), hi.max(*v)));
    (hi - lo).max(0.0)
}

fn miss(joint: &Joint, diagonal: f64) -> JointErrors {
    let full = in_table_units(joint.screw.kind, shown(&joint.values));
    JointErrors {
        name: joint.name.clone(),
        true_type: joint.screw.kind,
        found_type: None,
        type_right: false,
        axis_deg: 90.0,
        axis_pos: joint.screw.kind.turns().then_some(10.0 * diagonal),
        pivot: joint.screw.kind.turns().then_some(diagonal),
        motion_mean: full,
        motion_max: full,
        state_mean: full,
        range_error: full,
        sweep_mean: diagonal,
        sweep_max: diagonal,
    }
}

fn compare(
    found: &Joint,
    found_tree: &KinematicTree,
    truth: &Joint,
    true_tree: &KinematicTree,
    true_screw: &Screw,
    part: &TriMesh,
) -> JointErrors {
    let kind = truth.screw.kind;
    let centroid = centroid(part);
    let phi = found.screw.axis.dot(true_screw.axis).clamp(-1.0, 1.0).acos().to_degrees();
    let hinges = kind.turns() && found.screw.kind.turns();
    let pivot = hinges.then(|| found.screw.distance(true_screw.foot(centroid)));

    // World motion of the part between the first state and state s, by both trees.
    let n = truth.values.len().min(found.values.len());
    let moved = |tree: &KinematicTree, part: usize, s: usize| {
        let pose = |s: usize| tree.poses_at(s)[part];
        pose(s) * pose(0).inverse()
    };
    let motions: Vec<f64> = (1..n)
        .map(|s| {
            let (p, g) = (moved(found_tree, found.child, s), moved(true_tree, truth.child, s));
            if kind.turns() { (p.inverse() * g).angle().to_degrees() } else { (p.trans - g.trans).length() }
        })
        .collect();
    let sign = if found.screw.axis.dot(true_screw.axis) < 0.0 { -1.0 } else { 1.0 };
    let states: Vec<f64> = (0..n)
        .map(|s| (sign * (found.values[s] - found.values[0]) - (truth.values[s] - truth.values[0])).abs())
        .map(|e| in_table_units(kind, e))
        .collect();
    let mean = |x: &[f64]| if x.is_empty() { 0.0 } else { x.iter().sum::<f64>() / x.len() as f64 };

    // Sweep over the shown range from the first state, parents still.
    let points: Vec<DVec3> = part.sample_surface(300, 2).into_iter().map(|s| s.0.as_dvec3()).collect();
    let start = truth.values[0];
    let (lo, hi) = truth.values.iter().fold((start, start), |(lo, hi), v| (lo.min(*v), hi.max(*v)));
    let mut distances = Vec::new();
    for k in 0..=20 {
        let q = lo + (hi - lo) * k as f64 / 20.0 - start;
        let (g, p): (Pose, Pose) = (true_screw.motion(q), found.screw.motion(sign * q));
        distances.extend(points.iter().map(|x| (g.apply(*x) - p.apply(*x)).length()));
    }
    JointErrors {
        name: truth.name.clone(),
        true_type: kind,
        found_type: Some(found.screw.kind),
        type_right: kind == found.screw.kind || hinges,
        axis_deg: phi.min(180.0 - phi),
        axis_pos: hinges.then(|| 10.0 * line_distance(&found.screw, true_screw)),
        pivot,
        motion_mean: mean(&motions),
        motion_max: motions.iter().copied().fold(0.0, f64::max),
        state_mean: mean(&states),
        range_error: in_table_units(kind, ((found.limits[1] - found.limits[0]) - shown(&truth.values)).abs()),
        sweep_mean: mean(&distances),
        sweep_max: distances.iter().copied().fold(0.0, f64::max),
    }
}

/// Distance between two lines; for (nearly) parallel ones the distance of a point to the other.
fn line_distance(p: &Screw, g: &Screw) -> f64 {
    let n = p.axis.cross(g.axis);
    let between = g.pivot - p.pivot;
    if n.length() < 1e-6 { between.cross(p.axis).length() } else { n.dot(between).abs() / n.length() }
}

fn centroid(mesh: &TriMesh) -> DVec3 {
    let samples = mesh.sample_surface(1000, 3);
    samples.iter().map(|s| s.0.as_dvec3()).sum::<DVec3>() / samples.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crossing_lines_score_zero_on_position_but_not_on_pivot() {
        let screw = |axis: DVec3, pivot: DVec3| Screw { kind: JointKind::Revolute, axis, pivot };
        let g = screw(DVec3::Z, DVec3::ZERO);
        let p = screw(DVec3::new(0.1, 0.0, 1.0).normalize(), DVec3::new(0.0, 0.0, 5.0));
        assert!(line_distance(&p, &g) < 1e-12);
        assert!(p.distance(g.foot(DVec3::X)) > 0.4);
        assert!((line_distance(&g, &screw(DVec3::Z, DVec3::X)) - 1.0).abs() < 1e-12);
    }
}
