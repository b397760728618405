//! What hangs on what: parts that need not hang on another moving part, and chains whose links may
//! change places.

use super::pass::{Round, judge_all, prune_parts};
use crate::model::estimate::Estimate;
use crate::model::motions::poses_of;
use crate::model::nearest_screw::nearest_screw;
use crate::model::owners::{ASKING, Owners};
use crate::observe::evidence::Evidence;
use crate::score::verdict::{Verdict, contradictions};
use glam::DVec3;
use hingecast_geom::pose::rotation_vector;
use hingecast_geom::{JointKind, KinematicTree, Pose, Screw};

/// Axes that point the same way to within this angle, radians.
const PARALLEL_RAD: f64 = 0.05;

/// What a state that shows a sample where it should be is worth, contradictions.
const SHOWN_WORTH: f64 = 0.1;

/// A hinge and the slide that it hangs on change places where that explains more.
pub fn order_links(round: &Round, estimate: &mut Estimate) {
    if swap(round.evidence, &mut estimate.tree, &mut estimate.verdicts) {
        // What was a part of its own because the chain was the wrong way round.
        judge_all(round.evidence, estimate);
        prune_parts(estimate);
    }
}

/// Parts hang on their grandparents where one screw says as much there.
pub fn shorten_chains(round: &Round, estimate: &mut Estimate) {
    simplify(round.evidence, &mut estimate.tree, &estimate.owners);
}

/// Whether a hinge and a slide change places.
///
/// A turn about an axis and a slide along it commute, so the part at their end does not know which
/// of them comes first (the seat of a swivel chair); only what takes part in one of them does. The
/// order that explains more stays.
fn swap(evidence: &Evidence, tree: &mut KinematicTree, verdicts: &mut [Vec<Verdict>]) -> bool {
    // Under the part that no state contradicts and most show.
    let shown = |verdicts: &[Vec<Verdict>], i: usize| {
        verdicts.iter().filter(|v| v[i].against == 0).map(|v| v[i].support.count_ones()).max().unwrap_or(0)
    };
    let cost = |verdicts: &[Vec<Verdict>]| -> f64 {
        (0..verdicts[0].len()).map(|i| contradictions(verdicts, i) - SHOWN_WORTH * shown(verdicts, i) as f64).sum()
    };
    let mut swapped = false;
    for j in 0..tree.joints.len() {
        let link = tree.joints[j].parent;
        let Some(up) = tree.joints.iter().position(|up| up.child == link) else { continue };
        let (a, b) = (tree.joints[up].screw, tree.joints[j].screw);
        let alone = tree.joints.iter().filter(|o| o.parent == link).count() == 1;
        let parallel = a.axis.cross(b.axis).length() < PARALLEL_RAD;
        if !alone || !parallel || a.kind.turns() == b.kind.turns() {
            continue;
        }
        let mut other = tree.clone();
        (other.joints[up].screw, other.joints[j].screw) = (b, a);
        other.joints[up].values.clone_from(&tree.joints[j].values);
        other.joints[j].values.clone_from(&tree.joints[up].values);
        let mut theirs = verdicts.to_vec();
        theirs[link] = evidence.judge(&poses_of(&other, link, evidence.n_states()));
        if cost(&theirs) < cost(verdicts) {
            *tree = other;
            verdicts.clone_from_slice(&theirs);
            swapped = true;
        }
    }
    swapped
}

/// Samples may be off by this many voxels when a part is hung on its grandparent.
const ALIKE_VOXELS: f64 = 1.0;

/// Hangs parts on their grandparents where one screw says as much there: of two drawers that slide
/// alike, neither carries the other.
fn simplify(evidence: &Evidence, tree: &mut KinematicTree, owners: &Owners) {
    let n_states = evidence.n_states();
    for j in 0..tree.joints.len() {
        while let Some(up) = tree.joints.iter().find(|up| up.child == tree.joints[j].parent).cloned() {
            let joint = &tree.joints[j];
            // Motion of the part in its grandparent's frame, and where its samples are in the
            // canonical frame.
            let motions: Vec<Pose> =
                (0..n_states).map(|s| up.screw.motion(up.values[s]) * joint.screw.motion(joint.values[s])).collect();
            let poses = poses_of(tree, joint.child, n_states);
            let own = owners.members(evidence, joint.child);
            let stride = own.len().div_ceil(ASKING).max(1);
            let points: Vec<DVec3> = own
                .iter()
                .step_by(stride)
                .map(|m| poses[m.sample.state].inverse().apply(m.sample.point.as_dvec3()))
                .collect();
            let tolerance = ALIKE_VOXELS * evidence.lattice.voxel as f64;
            let Some((screw, values)) = one_screw(&motions, &points, joint.screw.kind, tolerance) else { break };
            let joint = &mut tree.joints[j];
            (joint.parent, joint.screw, joint.values) = (up.parent, screw, values);
        }
    }
}

/// The screw and values that move `points` as `motions` (the first is none) do, to within
/// `tolerance`.
fn one_screw(motions: &[Pose], points: &[DVec3], kind: JointKind, tolerance: f64) -> Option<(Screw, Vec<f64>)> {
    let centre = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
    let size = |p: &Pose| p.angle() + (p.apply(centre) - centre).length();
    let far = motions.iter().max_by(|a, b| size(a).total_cmp(&size(b)))?;
    let (screw, _) = nearest_screw(far, kind, centre)?;
    let value = |p: &Pose| {
        if kind.turns() { rotation_vector(p.rot).dot(screw.axis) } else { (p.apply(centre) - centre).dot(screw.axis) }
    };
    let values: Vec<f64> = motions.iter().map(value).collect();
    let alike = |(q, motion): (&f64, &Pose)| {
        let moved = screw.motion(*q);
        points.iter().all(|x| moved.apply(*x).distance(motion.apply(*x)) < tolerance)
    };
    values.iter().zip(motions).all(alike).then_some((screw, values))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slides_along_one_line_are_one_slide_and_a_chain_of_hinges_is_none() {
        let slide = Screw { kind: JointKind::Prismatic, axis: DVec3::X, pivot: DVec3::ZERO };
        let hinge = |x: f64| Screw { kind: JointKind::Revolute, axis: DVec3::Z, pivot: DVec3::new(x, 0.0, 0.0) };
        let values = [[0.0, 0.0], [0.3, 0.0], [0.3, 0.2], [0.1, 0.5]];
        let points = [DVec3::new(1.0, 0.2, 0.0), DVec3::new(1.4, -0.2, 0.3), DVec3::new(1.2, 0.1, -0.2)];
        let together = |up: Screw, own: Screw| -> Vec<Pose> {
            values.iter().map(|v| up.motion(v[0]) * own.motion(v[1])).collect()
        };
        let (screw, sums) = one_screw(&together(slide, slide), &points, slide.kind, 1e-6).unwrap();
        assert!(screw.axis.cross(DVec3::X).length() < 1e-9, "{screw:?}");
        for (sum, v) in sums.iter().zip(values) {
            assert!((sum * screw.axis.x - v[0] - v[1]).abs() < 1e-9, "{sums:?}");
        }
        assert!(one_screw(&together(hinge(0.0), hinge(1.0)), &points, JointKind::Revolute, 1e-3).is_none());
    }
}
