//! From a discovery to the final answer: labels of all samples, states brought into one frame by what stands still, all
//! joints refined together.

use super::adopt::asked_again;
use super::cameras::{mean_point, without_mean};
use super::chains::{simplify, swap};
use super::discover::{Cost, Discovery, poses_of};
use super::doubts::{REFUTED, rival};
use super::evidence::{Evidence, Motion, Sample, Verdict, contradictions};
use super::hidden;
use super::labels::label;
use super::nearby::look_beside;
use super::refine::{Member, Report, Settings, refine};
use super::straight::straighten;
use super::{alike, askew};
use crate::icp::{self, Surface};
use glam::Vec3;
use hingecast_geom::{KinematicTree, Pose};
use rayon::prelude::*;

/// What belongs to which part.
#[derive(Clone)]
pub struct Owners {
    /// Part of every sample of the evidence.
    pub labels: Vec<u8>,
    /// Per part, the states that show it, one bit each.
    pub shown: Vec<u64>,
}

impl Owners {
    /// Samples of a part, from states that show it.
    pub fn members(&self, evidence: &Evidence, part: usize) -> Vec<Member> {
        self.all(evidence).filter(|m| m.part == part).collect()
    }

    /// Samples of all parts, from states that show these.
    fn all<'a>(&'a self, evidence: &'a Evidence) -> impl Iterator<Item = Member> + 'a {
        let member = |(s, l): (&Sample, &u8)| Member { sample: *s, part: *l as usize, shown: self.shown[*l as usize] };
        let members = evidence.samples.iter().zip(&self.labels).map(member);
        members.filter(|m| m.shown >> m.sample.state & 1 == 1)
    }
}

/// The final tree, and what it was found with.
pub struct Settled {
    pub tree: KinematicTree,
    pub owners: Owners,
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
    if swap(evidence, &mut tree, &mut verdicts) {
        // What was a part of its own because the chain was the wrong way round.
        verdicts = prune(evidence, &mut tree, found.cost);
    }
    labels = label(evidence, &verdicts);
    let hidden = hidden::hidden(evidence, &mut tree, &labels, &verdicts, seed);
    if hidden.iter().any(|states| !states.is_empty()) {
        labels = label(evidence, &judge_all(evidence, &tree));
    }
    let mut shown = vec![u64::MAX; tree.parts.len()];
    for (joint, states) in tree.joints.iter().zip(&hidden) {
        states.iter().for_each(|(t, _)| shown[joint.child] &= !(1 << t));
    }
    let mut owners = Owners { labels, shown };
    if askew::turn(evidence, &mut tree, &owners, &verdicts[0], seed) {
        owners.labels = label(evidence, &judge_all(evidence, &tree));
    }
    slides(evidence, &mut tree, &owners, seed);
    let free = vec![true; tree.joints.len()];
    let noisy = evidence.is_noisy();
    let mut report = Report::default();
    for round in 0..3 {
        simplify(evidence, &mut tree, &owners);
        if noisy {
            let moved = frames(evidence, &owners.labels, seed);
            for (r, m) in rig.iter_mut().zip(&moved) {
                *r = *m * *r;
            }
            evidence.transform(&moved);
        }
        look_beside(evidence, &mut tree, &owners, seed);
        let members: Vec<Member> = owners.all(evidence).filter(|m| m.part != 0).collect();
        let gate = if round == 0 { 1.0 } else { 0.6 } * voxel;
        let settings = Settings { gates: [gate, 0.5 * gate], rounds: 6, partners: 6 };
        report = refine(evidence, &mut tree, &members, &free, &settings, seed ^ round);
        straighten(evidence, &mut tree, &owners, seed);
        hidden::hold(&mut tree, &hidden);
        verdicts = judge_all(evidence, &tree);
        owners.labels = label(evidence, &verdicts);
    }
    if alike::split(evidence, &mut tree, &mut owners, &verdicts[0], seed) {
        // Not labelled by the grid again: that takes the new parts for one.
        let members: Vec<Member> = owners.all(evidence).filter(|m| m.part != 0).collect();
        let settings = Settings { gates: [0.6 * voxel, 0.3 * voxel], rounds: 6, partners: 6 };
        let free = vec![true; tree.joints.len()];
        report = refine(evidence, &mut tree, &members, &free, &settings, seed ^ 3);
        straighten(evidence, &mut tree, &owners, seed);
        verdicts = judge_all(evidence, &tree);
    }
    let n = evidence.samples.len();
    let unexplained = (0..n).filter(|&i| verdicts.iter().all(|v| v[i].against != 0)).count() as f64 / n.max(1) as f64;
    tidy(&mut tree);
    Settled { tree, owners, rig, report, unexplained }
}

/// The verdicts on every sample under every part.
fn judge_all(evidence: &Evidence, tree: &KinematicTree) -> Vec<Vec<Verdict>> {
    (0..tree.parts.len()).map(|p| evidence.judge(&poses_of(tree, p, evidence.n_states()))).collect()
}

/// Asks all states for the value of every joint once more, now that all parts are known.
fn ask_again(evidence: &mut Evidence, tree: &mut KinematicTree, labels: &[u8], seed: u64) {
    for j in 0..tree.joints.len() {
        let child = tree.joints[j].child;
        let place = mark_others(evidence, tree, j);
        let own = evidence.samples.iter().zip(labels).filter(|(_, l)| **l as usize == child);
        let asking = some(own.map(|(s, _)| *s), seed ^ j as u64);
        if !asking.is_empty() {
            tree.joints[j].values = asked_again(evidence, &tree.joints[j], &asking, &place);
        }
    }
}

/// Marks what parts other than the child of joint `j` explain: it must not hold that child. Answers the poses of its parent.
pub fn mark_others(evidence: &mut Evidence, tree: &KinematicTree, j: usize) -> Vec<Pose> {
    let (child, n_states) = (tree.joints[j].child, evidence.n_states());
    let others = (0..tree.parts.len()).filter(|p| *p != child);
    evidence.mark_taken(&others.map(|p| poses_of(tree, p, n_states)).collect::<Vec<_>>());
    poses_of(tree, tree.joints[j].parent, n_states)
}

/// Some of the samples of a part, to ask for its value.
pub fn some(own: impl Iterator<Item = Sample>, seed: u64) -> Vec<Sample> {
    let mut asking: Vec<Sample> = own.collect();
    fastrand::Rng::with_seed(seed).shuffle(&mut asking);
    asking.truncate(ASKING);
    asking
}

/// A hinge this many extents away from the object may be a slide.
const FAR: f64 = 2.0;

/// Turns hinges that lie far away into slides where a slide explains the recording as well.
fn slides(evidence: &Evidence, tree: &mut KinematicTree, owners: &Owners, seed: u64) {
    let centre = mean_point(evidence.samples.iter().map(|s| s.point));
    for j in 0..tree.joints.len() {
        let joint = &tree.joints[j];
        if !joint.screw.kind.turns() || joint.screw.distance(centre) < FAR * evidence.extent() as f64 {
            continue;
        }
        let own = owners.members(evidence, joint.child);
        let (slide, nats) = rival(evidence, tree, j, &own, seed);
        if nats < REFUTED {
            *tree = slide;
        }
    }
}

/// Samples that ask for a value.
pub const ASKING: usize = 500;

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
        let weakest = leaves(tree).map(|p| (gain(p), p)).min_by(|a, b| a.0.total_cmp(&b.0));
        let Some((_, part)) = weakest.filter(|w| w.0 < 0.0) else { return verdicts };
        *tree = without(tree, part);
        verdicts.remove(part);
    }
}

/// Moving parts that carry no other.
pub fn leaves(tree: &KinematicTree) -> impl Iterator<Item = usize> {
    (1..tree.parts.len()).filter(|p| tree.joints.iter().all(|j| j.parent != *p))
}

/// The tree without a part that carries no other, the others counted anew.
pub fn without(tree: &KinematicTree, part: usize) -> KinematicTree {
    let mut tree = tree.clone();
    tree.joints.retain(|j| j.child != part);
    for joint in &mut tree.joints {
        joint.child -= usize::from(joint.child > part);
        joint.parent -= usize::from(joint.parent > part);
        joint.name = format!("joint_{}", joint.child);
    }
    tree.parts.remove(part);
    for (k, name) in tree.parts.iter_mut().enumerate().skip(1) {
        *name = format!("part_{k}");
    }
    tree
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
            samples.iter().map(move |s| (m.apply(s.point), m.rot * s.normal, 1.0))
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
pub fn tidy(tree: &mut KinematicTree) {
    for j in 0..tree.joints.len() {
        let (zero, screw) = (tree.joints[j].values[0], tree.joints[j].screw);
        if zero != 0.0 {
            // What hangs on it is moved along to where it is 0 now.
            let moved = screw.motion(zero);
            let hangs = |k: &usize| tree.ancestry(tree.joints[*k].parent).contains(&j);
            for k in (0..tree.joints.len()).filter(hangs).collect::<Vec<_>>() {
                tree.joints[k].screw = tree.joints[k].screw.transformed(&moved);
            }
        }
        let joint = &mut tree.joints[j];
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
    use glam::DVec3;
    use hingecast_geom::{Joint, JointKind, Screw};

    /// However values are counted, every part goes from state to state as before.
    #[test]
    fn counting_from_the_first_state_moves_nothing() {
        let joint = |parent: usize, axis: DVec3, values: [f64; 3]| Joint {
            name: "j".into(),
            parent,
            child: parent + 1,
            screw: Screw { kind: JointKind::Revolute, axis: axis.normalize(), pivot: DVec3::new(0.3, -0.1, 0.2) },
            values: values.to_vec(),
            limits: [0.0; 2],
        };
        let joints = vec![
            joint(0, DVec3::new(0.2, 0.1, 1.0), [0.4, 0.9, -0.3]),
            joint(1, DVec3::new(1.0, 0.3, -0.2), [-0.2, -0.4, -0.9]),
            joint(2, DVec3::new(0.0, 1.0, 0.2), [0.1, 0.5, 0.7]),
        ];
        let before = KinematicTree { parts: ["a", "b", "c", "d"].map(String::from).to_vec(), joints };
        let mut after = before.clone();
        tidy(&mut after);
        assert!(after.joints.iter().all(|j| j.values[0] == 0.0 && j.values.iter().sum::<f64>() > 0.0));
        let x = DVec3::new(0.7, -0.4, 0.9);
        for (state, part) in (1..3).flat_map(|s| (1..4).map(move |p| (s, p))) {
            let moved = |tree: &KinematicTree| (tree.poses_at(state)[part] * tree.poses_at(0)[part].inverse()).apply(x);
            assert!(moved(&before).distance(moved(&after)) < 1e-12, "state {state} part {part}");
        }
    }
}
