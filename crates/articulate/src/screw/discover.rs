//! Parts one after another: what no known part explains must belong to a new one.
//!
//! Per round: the samples that every known part's motion would put into empty space are *open*. For pairs of states and
//! every possible parent, open samples of one state are sought in the other ([`super::hypotheses`]), the best finds are
//! aligned (ICP), turned into a hinge and a slide, and asked in all states ([`super::scan`]). The screw that the most
//! states agree with becomes a part, refined by Gauss-Newton.

use super::evidence::{Evidence, Motion, Sample, Verdict};
use super::hypotheses::{Duel, Hypothesis, distinct, nearest_screw};
use super::refine::{self, refine};
use super::scan::{Scan, centroid, points, scan, whole_range};
use crate::icp;
use hingecast_geom::{Cancelled, Joint, JointKind, KinematicTree, Pose, Progress, Screw};
use rayon::prelude::*;

/// What was found, before labels are settled.
pub struct Discovery {
    pub tree: KinematicTree,
    /// Per part, per sample.
    pub verdicts: Vec<Vec<Verdict>>,
    /// Share of the samples that no part explains.
    pub unexplained: f64,
}

/// Pairs of states per parent and round.
const PAIRS: usize = 6;
/// Hypotheses per pair that are aligned, and of these asked in all states.
const ALIGNED: usize = 40;
const ASKED: usize = 6;
/// Samples that ask.
const CROWD: usize = 200;
/// A part has at least this share of all samples, and this many.
const LEAST_SHARE: f64 = 0.002;
const LEAST: usize = 25;
/// Mean agreement over the states below which a screw is not believed.
const BELIEF: f32 = 0.35;

/// A screw on a parent, ready to become a part.
struct Proposal {
    parent: usize,
    source: usize,
    screw: Screw,
    scan: Scan,
    /// Source samples that take part, in the parent's canonical frame as of the source state.
    crowd: Vec<Sample>,
}

pub fn discover(evidence: &mut Evidence, max_parts: usize, seed: u64, progress: &Progress) -> Result<Discovery, Cancelled> {
    let n_states = evidence.n_states();
    let mut tree = KinematicTree { parts: vec!["base".to_string()], joints: Vec::new() };
    let mut verdicts = vec![evidence.judge(&vec![Pose::IDENTITY; n_states])];
    let least = ((LEAST_SHARE * evidence.samples.len() as f64) as usize).max(LEAST);
    let mut open;
    loop {
        progress.report(tree.parts.len() - 1, max_parts.min(tree.parts.len() + 1), "looking for parts")?;
        let poses: Vec<Vec<Pose>> =
            (0..tree.parts.len()).map(|p| (0..n_states).map(|s| tree.poses_at(s)[p]).collect()).collect();
        evidence.mark_taken(&poses);
        open = open_samples(&verdicts);
        if open.len() < least || tree.parts.len() >= max_parts {
            break;
        }
        let proposals: Vec<Proposal> = (0..tree.parts.len())
            .filter_map(|p| propose(evidence, p, &poses[p], &open, &verdicts[p], seed))
            .collect();
        let Some(best) = proposals.into_iter().max_by(|a, b| a.scan.total().total_cmp(&b.scan.total())) else { break };
        if std::env::var_os("PROBE").is_some() {
            eprintln!(
                "  open {} of {}; best {:?} on {} total {:.2} of {} scores {:.2?}",
                open.len(), evidence.samples.len(), best.screw, best.parent, best.scan.total(), n_states, best.scan.scores
            );
        }
        if best.scan.total() < BELIEF * n_states as f32 {
            break;
        }
        let before = tree.clone();
        adopt(evidence, &mut tree, best, seed);
        let part = tree.parts.len() - 1;
        let own: Vec<Pose> = (0..n_states).map(|s| tree.poses_at(s)[part]).collect();
        let verdict = evidence.judge(&own);
        let explained = open.iter().filter(|&&i| verdict[i].against == 0).count();
        if std::env::var_os("PROBE").is_some() {
            eprintln!("  explains {explained}; {:?} {:.3?}", tree.joints[part - 1].screw, tree.joints[part - 1].values);
        }
        if explained < least {
            tree = before;
            break;
        }
        verdicts.push(verdict);
    }
    Ok(Discovery { tree, verdicts, unexplained: open.len() as f64 / evidence.samples.len().max(1) as f64 })
}

/// Samples that every part contradicts.
fn open_samples(verdicts: &[Vec<Verdict>]) -> Vec<usize> {
    (0..verdicts[0].len()).filter(|&i| verdicts.iter().all(|v| v[i].against != 0)).collect()
}

/// The best screw of a new part on `parent`, whose poses are `place` (world from its canonical frame).
fn propose(
    evidence: &Evidence,
    parent: usize,
    place: &[Pose],
    open: &[usize],
    verdict: &[Verdict],
    seed: u64,
) -> Option<Proposal> {
    let n = evidence.n_states();
    // Open samples of state b that the parent's motion would put into empty space of state a.
    let mut counts = vec![0usize; n * n];
    for &i in open {
        let b = evidence.samples[i].state;
        (0..n).filter(|a| verdict[i].against >> a & 1 == 1).for_each(|a| counts[b * n + a] += 1);
    }
    let mut pairs: Vec<usize> = (0..n * n).filter(|&k| counts[k] >= 20).collect();
    pairs.sort_by(|x, y| counts[*y].cmp(&counts[*x]).then(x.cmp(y)));
    let pairs = varied(&pairs, n);
    let back: Vec<Pose> = place.iter().map(Pose::inverse).collect();
    let mut best: Option<Proposal> = None;
    for (k, &pair) in pairs.iter().enumerate() {
        let (b, a) = (pair / n, pair % n);
        let into = |s: &Sample| Sample {
            state: s.state,
            point: Motion::from(back[s.state]).apply(s.point),
            normal: Motion::from(back[s.state]).rot * s.normal,
        };
        let source: Vec<Sample> = open
            .iter()
            .filter(|&&i| evidence.samples[i].state == b && verdict[i].against >> a & 1 == 1)
            .map(|&i| into(&evidence.samples[i]))
            .collect();
        let cloud = &evidence.clouds[a];
        let m = Motion::from(back[a]);
        let untaken = |i: &usize| evidence.spaces[a].bits(cloud.points[*i]) & super::space::TAKEN == 0;
        let targets = (0..cloud.points.len())
            .filter(untaken)
            .map(|i| (m.apply(cloud.points[i]), m.rot * cloud.normals[i]))
            .collect();
        let duel = Duel { source, targets, space: &evidence.spaces[a], place: Motion::from(place[a]) };
        let hypotheses = duel.propose(ALIGNED, seed ^ (k as u64 + 1) << 8);
        let aligned = align(evidence, &duel, &hypotheses, a, place, &back);
        let asked: Vec<Proposal> = aligned
            .into_par_iter()
            .map(|(h, crowd)| {
                let mut rng = fastrand::Rng::with_seed(seed);
                let mut crowd = crowd;
                rng.shuffle(&mut crowd);
                crowd.truncate(CROWD);
                let extent = (evidence.lattice.size.as_vec3() * evidence.lattice.voxel).max_element();
                let range = whole_range(&h.screw, extent);
                let found = scan(evidence, &crowd, place, &h.screw, range, 1.5 * evidence.lattice.voxel);
                Proposal { parent, source: b, screw: h.screw, scan: found, crowd }
            })
            .collect();
        for p in asked {
            if best.as_ref().is_none_or(|o| p.scan.total() > o.scan.total()) {
                best = Some(p);
            }
        }
    }
    best
}

/// The first pairs of a sorted list, at most two from one source state and two to one target.
fn varied(pairs: &[usize], n: usize) -> Vec<usize> {
    let (mut from, mut to) = (vec![0; n], vec![0; n]);
    let mut out = Vec::new();
    for &k in pairs {
        if from[k / n] < 2 && to[k % n] < 2 {
            from[k / n] += 1;
            to[k % n] += 1;
            out.push(k);
            if out.len() == PAIRS {
                break;
            }
        }
    }
    out
}

/// Aligns hypotheses by ICP and answers, of the best that differ, hinge and slide with the samples that fit.
fn align(
    evidence: &Evidence,
    duel: &Duel,
    hypotheses: &[Hypothesis],
    a: usize,
    place: &[Pose],
    back: &[Pose],
) -> Vec<(Hypothesis, Vec<Sample>)> {
    let voxel = evidence.lattice.voxel as f64;
    let gates = [3.0, 2.5, 2.0, 1.5, 1.5, 1.0, 1.0, 1.0].map(|g| g * voxel);
    let mut all: Vec<(Hypothesis, Pose)> = hypotheses
        .par_iter()
        .filter_map(|h| {
            let start = h.screw.motion(h.q);
            let near = duel.fitting(&start.into(), 1);
            if near.len() < 12 {
                return None;
            }
            let (pose, _) = icp::align(&points(&near), &normals(&near), &evidence.clouds[a], place[a] * start, &gates);
            let pose = back[a] * pose;
            let score = duel.fitting(&pose.into(), 0).len();
            Some((Hypothesis { score, ..*h }, pose))
        })
        .collect();
    all.sort_by(|x, y| y.0.score.cmp(&x.0.score));
    let extent = points(&duel.source);
    let mut out = Vec::new();
    let mut kept: Vec<Hypothesis> = Vec::new();
    for (h, pose) in all {
        let crowd = duel.fitting(&pose.into(), 0);
        if crowd.len() < 12 {
            continue;
        }
        for kind in [JointKind::Revolute, JointKind::Prismatic] {
            let Some((screw, q)) = nearest_screw(&pose, kind, centroid(&crowd)) else { continue };
            let new = Hypothesis { screw, q, score: h.score };
            let with: Vec<Hypothesis> = kept.iter().copied().chain([new]).collect();
            if distinct(with, &extent, 2.0 * voxel as f32, usize::MAX).len() > kept.len() {
                kept.push(new);
                out.push((new, crowd.clone()));
            }
        }
        if out.len() >= 2 * ASKED {
            break;
        }
    }
    out
}

fn normals(samples: &[Sample]) -> Vec<glam::Vec3> {
    samples.iter().map(|s| s.normal).collect()
}

/// Adds the proposal to the tree as a part and refines its screw and values.
fn adopt(evidence: &Evidence, tree: &mut KinematicTree, p: Proposal, seed: u64) {
    let n_states = evidence.n_states();
    let child = tree.parts.len();
    let mut values = p.scan.values.clone();
    let place: Vec<Pose> = (0..n_states).map(|s| tree.poses_at(s)[p.parent]).collect();
    tree.parts.push(format!("part_{child}"));
    // Values count from state 0; the crowd stands where state `source` has it.
    let zero = values[0];
    values.iter_mut().for_each(|v| *v -= zero);
    let joint =
        Joint { name: format!("joint_{child}"), parent: p.parent, child, screw: p.screw, values, limits: [0.0; 2] };
    tree.joints.push(joint);
    let mut free = vec![false; tree.joints.len()];
    *free.last_mut().expect("just pushed") = true;
    let crowd: Vec<(Sample, usize)> = p
        .crowd
        .iter()
        .map(|s| {
            let m = Motion::from(place[p.source]);
            (Sample { state: p.source, point: m.apply(s.point), normal: m.rot * s.normal }, child)
        })
        .collect();
    let voxel = evidence.lattice.voxel as f64;
    let coarse = refine::Settings { gates: [3.0 * voxel, 1.0 * voxel], rounds: 10, partners: n_states };
    refine(evidence, tree, &crowd, &free, &coarse, seed);
    // Now everything that moves with it, from all states.
    for gate in [1.5, 0.7] {
        let own: Vec<Pose> = (0..n_states).map(|s| tree.poses_at(s)[child]).collect();
        let rest: Vec<Pose> = place.clone();
        let (mine, parents) = (evidence.judge(&own), evidence.judge(&rest));
        let members: Vec<(Sample, usize)> = evidence
            .samples
            .iter()
            .enumerate()
            .filter(|(i, _)| mine[*i].against == 0 && parents[*i].against != 0)
            .map(|(_, s)| (*s, child))
            .collect();
        if members.len() < LEAST {
            break;
        }
        let fine = refine::Settings { gates: [gate * voxel, 0.5 * gate * voxel], rounds: 6, partners: 4 };
        refine(evidence, tree, &members, &free, &fine, seed);
    }
    let joint = tree.joints.last_mut().expect("just pushed");
    joint.limits = joint.values.iter().fold([0.0f64; 2], |l, v| [l[0].min(*v), l[1].max(*v)]);
}
