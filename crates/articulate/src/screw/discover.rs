//! Parts one after another: what no known part explains must belong to a new one.
//!
//! Per round: the samples that every known part's motion would put into empty space are *open*. For pairs of states and
//! every possible parent, open samples of one state are sought in the other ([`super::hypotheses`]), the best finds are
//! aligned (ICP), turned into a hinge and a slide, and asked in all states ([`super::scan`]). The finalists are refined by
//! Gauss-Newton, and the one that removes the most contradictions, measured within the noise, becomes a part.

use super::adopt::adopt;
use super::evidence::{Evidence, Motion, Sample, Verdict};
use super::jury::Jury;
use super::propose::{Proposal, propose};
use hingecast_geom::{Cancelled, JointKind, KinematicTree, Pose, Progress};
use rayon::prelude::*;

/// What was found, before labels are settled.
pub struct Discovery {
    pub tree: KinematicTree,
    /// Per part, per sample.
    pub verdicts: Vec<Vec<Verdict>>,
    /// Share of the samples that no part explains.
    pub unexplained: f64,
}

/// Proposals that are refined before one is chosen.
const FINALISTS: usize = 10;
/// A part has at least this share of all samples, and this many.
const LEAST_SHARE: f64 = 0.002;
const LEAST: usize = 25;

pub fn discover(
    evidence: &mut Evidence,
    max_parts: usize,
    seed: u64,
    progress: &Progress,
) -> Result<Discovery, Cancelled> {
    let n_states = evidence.n_states();
    let mut tree = KinematicTree { parts: vec!["base".to_string()], joints: Vec::new() };
    let mut verdicts = vec![evidence.judge(&vec![Pose::IDENTITY; n_states])];
    let least = ((LEAST_SHARE * evidence.samples.len() as f64) as usize).max(LEAST);
    let mut open;
    loop {
        progress.report(tree.parts.len() - 1, max_parts.min(tree.parts.len() + 1), "looking for parts")?;
        let poses: Vec<Vec<Pose>> = (0..tree.parts.len()).map(|p| poses_of(&tree, p, n_states)).collect();
        evidence.mark_taken(&poses);
        open = open_samples(&verdicts);
        if open.len() < least || tree.parts.len() >= max_parts {
            break;
        }
        let jury = Jury::new(evidence, &open, &verdicts, seed);
        let proposals: Vec<Proposal> = (0..tree.parts.len())
            .flat_map(|p| propose(evidence, p, &poses[p], &open, &verdicts, &jury, seed))
            .collect();
        let finals: Vec<(f64, KinematicTree)> = finalists(evidence, proposals)
            .par_iter()
            .map(|p| {
                let mut tree = tree.clone();
                adopt(evidence, &mut tree, p, seed);
                let own = poses_of(&tree, tree.parts.len() - 1, n_states);
                (jury.gain(evidence, &own, true) * plausibility(&tree, &p.crowd), tree)
            })
            .collect();
        if std::env::var_os("PROBE").is_some() {
            eprintln!("  open {} of {}", open.len(), evidence.samples.len());
            for (g, t) in &finals {
                let j = t.joints.last().unwrap();
                eprintln!("    {g:.0} on {} {:?} {:.3} at {:.3} {:.2?}", j.parent, j.screw.kind, j.screw.axis, j.screw.pivot, j.values);
            }
        }
        // The first of equals: finalists are sorted.
        let Some((_, with)) = finals.into_iter().rev().max_by(|a, b| a.0.total_cmp(&b.0)) else { break };
        let own = poses_of(&with, with.parts.len() - 1, n_states);
        let verdict = evidence.judge(&own);
        let explained = open.iter().filter(|&&i| verdict[i].against == 0 && verdict[i].support != 0).count();
        if std::env::var_os("PROBE").is_some() {
            let j = with.joints.last().unwrap();
            eprintln!("  explains {explained}; {} {:?} {:.3?}", j.parent, j.screw, j.values);
        }
        if explained < least {
            break;
        }
        tree = with;
        verdicts.push(verdict);
    }
    Ok(Discovery { tree, verdicts, unexplained: open.len() as f64 / evidence.samples.len().max(1) as f64 })
}

/// World from canonical of a part in every state.
pub fn poses_of(tree: &KinematicTree, part: usize, n_states: usize) -> Vec<Pose> {
    (0..n_states).map(|s| tree.poses_at(s)[part]).collect()
}

/// Samples that every part contradicts.
fn open_samples(verdicts: &[Vec<Verdict>]) -> Vec<usize> {
    (0..verdicts[0].len()).filter(|&i| verdicts.iter().all(|v| v[i].against != 0)).collect()
}

/// The best proposals that differ.
fn finalists(evidence: &Evidence, mut all: Vec<Proposal>) -> Vec<Proposal> {
    all.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    // In the parent's frame: where the proposal has its samples in state s, and where another would take them from
    // where the first state has them.
    let own = |p: &Proposal, s: usize| Motion::from(p.screw.motion(p.scan.values[s]));
    let other = |o: &Proposal, p: &Proposal, s: usize| {
        let (v, first) = (&o.scan.values, p.scan.values[0]);
        Motion::from(o.screw.motion(v[s] - v[0]) * p.screw.motion(first))
    };
    let mut out: Vec<Proposal> = Vec::new();
    for p in all {
        let same = |o: &Proposal| {
            o.screw.kind == p.screw.kind
                && o.parent == p.parent
                && (0..p.scan.values.len()).all(|s| {
                    let (a, b) = (own(&p, s), other(o, &p, s));
                    let apart = |x: &Sample| a.apply(x.point).distance(b.apply(x.point));
                    p.crowd.iter().step_by(8).all(|x| apart(x) < 3.0 * evidence.lattice.voxel)
                })
        };
        if !out.iter().any(same) {
            out.push(p);
            if out.len() == FINALISTS {
                break;
            }
        }
    }
    out
}

/// Among equally good explanations: no chain without need, no hinge where a slide does, no great turn, and an axis that
/// lies along the part's faces or square to them, as in nearly everything that people build.
fn plausibility(tree: &KinematicTree, crowd: &[Sample]) -> f64 {
    let joint = tree.joints.last().expect("a part was added");
    let (lo, hi) = joint.values.iter().fold((0.0, 0.0), |(lo, hi), v| (f64::min(lo, *v), f64::max(hi, *v)));
    let chain = if joint.parent == 0 { 1.05 } else { 1.0 };
    let kind = if joint.screw.kind == JointKind::Prismatic { 1.02 } else { 1.0 };
    let turn = if joint.screw.kind.turns() { 1.0 - 0.05 * ((hi - lo) / std::f64::consts::PI).min(1.0) } else { 1.0 };
    // The crowd stands where the source state has it: in the parent's frame, where the axis is.
    let aligned = |s: &Sample| {
        let along = joint.screw.axis.dot(s.normal.as_dvec3()).abs().min(1.0);
        let off = along.asin().min(along.acos()) / ALONG_FACES;
        (-off * off).exp()
    };
    let faces = crowd.iter().map(aligned).sum::<f64>() / crowd.len().max(1) as f64;
    chain * kind * turn * (1.0 + 0.08 * faces)
}

/// Angle between an axis and a face that counts as along it, radians.
const ALONG_FACES: f64 = 0.03;
