//! From a discovery to the final answer: labels of all samples, states brought into one frame by what stands still, all
//! joints refined together.

use super::adopt::asked_again;
use super::cameras::{mean_point, without_mean};
use super::discover::{Cost, Discovery, poses_of};
use super::doubts::{REFUTED, rival};
use super::evidence::{Evidence, Motion, Sample, Verdict, contradictions};
use super::hypotheses::nearest_screw;
use super::labels::label;
use super::refine::{Report, Settings, refine};
use super::straight::straighten;
use crate::icp::{self, Surface};
use glam::{DVec3, Vec3};
use hingecast_geom::pose::rotation_vector;
use hingecast_geom::{JointKind, KinematicTree, Pose, Screw};
use rayon::prelude::*;

/// The final tree, and what it was found with.
pub struct Settled {
    pub tree: KinematicTree,
    /// Part of every sample of the evidence.
    pub labels: Vec<u8>,
    /// Per state: world from the world that its cameras believed in.
    pub rig: Vec<Pose>,
    pub report: Report,
    /// Share of the samples that every part contradicts.
    pub unexplained: f64,
}

/// Samples that hold a state's frame.
const HOLDING: usize = 3000;
/// Fewer samples of the base than this do not hold a state's frame.
const FEW: usize = 150;
/// Pull towards the state's own frame in directions that its base leaves open, share of the pull towards the surface.
const TETHER: f64 = 0.003;
/// A settled tree to settle again on other evidence.
pub fn again(evidence: &Evidence, tree: KinematicTree, cost: Cost) -> Discovery {
    Discovery { verdicts: judge_all(evidence, &tree), tree, cost }
}

pub fn settle(evidence: &mut Evidence, found: &Discovery, seed: u64) -> Settled {
    let n_states = evidence.n_states();
    let voxel = evidence.lattice.voxel as f64;
    let mut tree = found.tree.clone();
    let mut rig = vec![Pose::IDENTITY; n_states];
    let mut labels = label(evidence, &found.verdicts);
    ask_again(evidence, &mut tree, &labels, seed);
    let mut verdicts = prune(evidence, &mut tree, found.cost);
    labels = label(evidence, &verdicts);
    slides(evidence, &mut tree, &labels, seed);
    let free = vec![true; tree.joints.len()];
    let noisy = evidence.is_noisy();
    let mut report = Report::default();
    for round in 0..3 {
        simplify(evidence, &mut tree, &labels);
        if noisy {
            let moved = frames(evidence, &labels, seed);
            for (r, m) in rig.iter_mut().zip(&moved) {
                *r = *m * *r;
            }
            evidence.transform(&moved);
        }
        let members: Vec<(Sample, usize)> =
            evidence.samples.iter().zip(&labels).map(|(s, l)| (*s, *l as usize)).filter(|m| m.1 != 0).collect();
        let gate = if round == 0 { 1.0 } else { 0.6 } * voxel;
        let settings = Settings { gates: [gate, 0.5 * gate], rounds: 6, partners: 6 };
        report = refine(evidence, &mut tree, &members, &free, &settings, seed ^ round);
        straighten(evidence, &mut tree, &labels, seed);
        verdicts = judge_all(evidence, &tree);
        labels = label(evidence, &verdicts);
    }
    let n = evidence.samples.len();
    let unexplained = (0..n).filter(|&i| verdicts.iter().all(|v| v[i].against != 0)).count() as f64 / n.max(1) as f64;
    tidy(&mut tree);
    Settled { tree, labels, rig, report, unexplained }
}

/// The verdicts on every sample under every part.
fn judge_all(evidence: &Evidence, tree: &KinematicTree) -> Vec<Vec<Verdict>> {
    (0..tree.parts.len()).map(|p| evidence.judge(&poses_of(tree, p, evidence.n_states()))).collect()
}

/// Samples that carry the label of a part.
pub fn members(evidence: &Evidence, labels: &[u8], part: usize) -> Vec<(Sample, usize)> {
    let own = evidence.samples.iter().zip(labels).filter(|(_, l)| **l as usize == part);
    own.map(|(s, _)| (*s, part)).collect()
}

/// Asks all states for the value of every joint once more, now that all parts are known.
fn ask_again(evidence: &mut Evidence, tree: &mut KinematicTree, labels: &[u8], seed: u64) {
    let n_states = evidence.n_states();
    for j in 0..tree.joints.len() {
        let poses: Vec<Vec<Pose>> = (0..tree.parts.len()).map(|p| poses_of(tree, p, n_states)).collect();
        let (child, parent) = (tree.joints[j].child, tree.joints[j].parent);
        // What the other parts explain must not hold this one.
        let others: Vec<Vec<Pose>> = (0..poses.len()).filter(|p| *p != child).map(|p| poses[p].clone()).collect();
        evidence.mark_taken(&others);
        let mut asking: Vec<Sample> = members(evidence, labels, child).into_iter().map(|m| m.0).collect();
        fastrand::Rng::with_seed(seed ^ j as u64).shuffle(&mut asking);
        asking.truncate(ASKING);
        if !asking.is_empty() {
            tree.joints[j].values = asked_again(evidence, &tree.joints[j], &asking, &poses[parent]);
        }
    }
}

/// A hinge this many extents away from the object may be a slide.
const FAR: f64 = 2.0;

/// Turns hinges that lie far away into slides where a slide explains the recording as well.
fn slides(evidence: &Evidence, tree: &mut KinematicTree, labels: &[u8], seed: u64) {
    let centre = mean_point(evidence.samples.iter().map(|s| s.point));
    for j in 0..tree.joints.len() {
        let joint = &tree.joints[j];
        if !joint.screw.kind.turns() || joint.screw.distance(centre) < FAR * evidence.extent() as f64 {
            continue;
        }
        let own = members(evidence, labels, joint.child);
        let (slide, nats) = rival(evidence, tree, j, &own, seed);
        if nats < REFUTED {
            *tree = slide;
        }
    }
}

/// Samples may be off by this many voxels when a part is hung on its grandparent.
const ALIKE: f64 = 1.0;

/// Hangs parts on their grandparents where one screw says as much there: of two drawers that slide alike, neither carries the other.
fn simplify(evidence: &Evidence, tree: &mut KinematicTree, labels: &[u8]) {
    let n_states = evidence.n_states();
    for j in 0..tree.joints.len() {
        while let Some(up) = tree.joints.iter().find(|up| up.child == tree.joints[j].parent).cloned() {
            let joint = &tree.joints[j];
            // Motion of the part in its grandparent's frame, and where its samples are in the canonical frame.
            let motions: Vec<Pose> =
                (0..n_states).map(|s| up.screw.motion(up.values[s]) * joint.screw.motion(joint.values[s])).collect();
            let poses = poses_of(tree, joint.child, n_states);
            let own = members(evidence, labels, joint.child);
            let stride = own.len().div_ceil(ASKING).max(1);
            let points: Vec<DVec3> =
                own.iter().step_by(stride).map(|(s, _)| poses[s.state].inverse().apply(s.point.as_dvec3())).collect();
            let tolerance = ALIKE * evidence.lattice.voxel as f64;
            let Some((screw, values)) = one_screw(&motions, &points, joint.screw.kind, tolerance) else { break };
            let joint = &mut tree.joints[j];
            (joint.parent, joint.screw, joint.values) = (up.parent, screw, values);
        }
    }
}

/// The screw and values that move `points` as `motions` (the first is none) do, to within `tolerance`.
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

/// Samples that ask for a value.
const ASKING: usize = 500;

/// Drops parts that the others make superfluous: those without children that explain less than they cost. Answers the
/// verdicts of what is left.
fn prune(evidence: &Evidence, tree: &mut KinematicTree, cost: Cost) -> Vec<Vec<Verdict>> {
    let mut verdicts = judge_all(evidence, tree);
    loop {
        let left = |verdicts: &[Vec<Verdict>]| (0..verdicts[0].len()).map(|i| contradictions(verdicts, i)).sum::<f64>();
        let with = left(&verdicts);
        // What it removes beyond its cost.
        let gain = |p: usize| {
            let mut without = verdicts.clone();
            without.remove(p);
            let without = left(&without);
            without - with - cost.of(without)
        };
        let leaf = |p: &usize| !tree.joints.iter().any(|j| j.parent == *p);
        let weakest = (1..tree.parts.len()).filter(leaf).map(|p| (gain(p), p)).min_by(|a, b| a.0.total_cmp(&b.0));
        let Some((_, part)) = weakest.filter(|w| w.0 < 0.0) else { return verdicts };
        tree.joints.retain(|j| j.child != part);
        for joint in &mut tree.joints {
            joint.child -= usize::from(joint.child > part);
            joint.parent -= usize::from(joint.parent > part);
        }
        tree.parts.remove(part);
        for (k, name) in tree.parts.iter_mut().enumerate().skip(1) {
            *name = format!("part_{k}");
        }
        for joint in &mut tree.joints {
            joint.name = format!("joint_{}", joint.child);
        }
        verdicts.remove(part);
    }
}

/// Corrections that bring the base of every state onto the base of all others; their mean is nothing.
fn frames(evidence: &Evidence, labels: &[u8], seed: u64) -> Vec<Pose> {
    let n_states = evidence.n_states();
    let mut rng = fastrand::Rng::with_seed(seed);
    let own: Vec<Vec<Sample>> = (0..n_states)
        .map(|state| {
            let base = evidence.samples.iter().zip(labels).filter(|(s, l)| s.state == state && **l == 0);
            let mut base: Vec<Sample> = base.map(|(s, _)| *s).collect();
            rng.shuffle(&mut base);
            base.truncate(HOLDING);
            base
        })
        .collect();
    let voxel = evidence.lattice.voxel as f64;
    let centre = mean_point(own.iter().flatten().map(|s| s.point));
    let mut out = vec![Pose::IDENTITY; n_states];
    for _ in 0..3 {
        // Everything that stands still, seen by all states together.
        let moved = own.iter().zip(&out).flat_map(|(samples, pose)| {
            let m = Motion::from(*pose);
            samples.iter().map(move |s| (m.apply(s.point), m.rot * s.normal))
        });
        let cloud = super::cloud::merge(moved, evidence.lattice.voxel, 2);
        let all = Surface::new(cloud.points, cloud.normals);
        out = own
            .par_iter()
            .zip(&out)
            .map(|(samples, pose)| {
                if samples.len() < FEW {
                    return *pose;
                }
                let points: Vec<Vec3> = samples.iter().map(|s| s.point).collect();
                let normals: Vec<Vec3> = samples.iter().map(|s| s.normal).collect();
                icp::align_tethered(&points, &normals, &all, *pose, &[voxel, voxel, 0.6 * voxel, 0.6 * voxel], TETHER).0
            })
            .collect();
        out = without_mean(&out, centre);
    }
    out
}

/// Values count from the first state, mostly upwards; limits are what was seen.
fn tidy(tree: &mut KinematicTree) {
    for joint in &mut tree.joints {
        let zero = joint.values[0];
        joint.values.iter_mut().for_each(|v| *v -= zero);
        if joint.values.iter().sum::<f64>() < 0.0 {
            joint.screw.axis = -joint.screw.axis;
            joint.values.iter_mut().for_each(|v| *v = -*v);
        }
        joint.limits = joint.values.iter().fold([0.0f64; 2], |l, v| [l[0].min(*v), l[1].max(*v)]);
    }
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
