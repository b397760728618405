//! Parts one after another: what no known part explains must belong to a new one.
//!
//! Per round: the samples that every known part's motion would put into empty space are *open*. For pairs of states and
//! every possible parent, open samples of one state are sought in the other ([`super::hypotheses`]), the best finds are
//! aligned (ICP), turned into a hinge and a slide, and asked in all states ([`super::scan`]). The finalists are refined by
//! Gauss-Newton, and the one that removes the most contradictions, measured within the noise, becomes a part.

use super::evidence::{Evidence, Motion, Sample, Verdict, contradictions};
use super::finals::{Final, Ground};
use super::jury::Jury;
use super::plausible::plausibility;
use super::propose::{MANY_STATES, Proposal, propose};
use hingecast_geom::{Cancelled, KinematicTree, Pose, Progress};
use rayon::prelude::*;

/// What was found, before labels are settled.
pub struct Discovery {
    pub tree: KinematicTree,
    /// Per part, per sample.
    pub verdicts: Vec<Vec<Verdict>>,
    pub cost: Cost,
}

/// What a part costs, in contradictions that it has to remove to be worth having.
#[derive(Clone, Copy)]
pub struct Cost {
    /// For its screw and its values.
    part: f64,
    /// For what is explained by chance, share of what is left to explain.
    chance: f64,
}

impl Cost {
    /// `still`: the verdicts if nothing moved.
    fn new(still: &[Verdict], n_states: usize) -> Self {
        let all: f64 = still.iter().map(|v| v.against.count_ones() as f64).sum();
        let chance = PART_COST_CHANCE / n_states as f64;
        if n_states < MANY_STATES {
            return Self { part: (PART_COST + chance) * all, chance: 0.0 };
        }
        Self { part: PART_COST * all, chance }
    }

    /// Of a part where so many contradictions are left without it.
    pub fn of(&self, left: f64) -> f64 {
        self.part + self.chance * left
    }
}

/// Proposals that are refined before one is chosen, and how many voxels apart they are. Few states leave a flat part free to
/// slide in its own plane, where refining cannot pull it back: then neighbours are tried as well.
const FINALISTS: (usize, f32) = (12, 8.0);
const NEIGHBOURS: (usize, f32) = (24, 2.5);
/// A part has at least this share of all samples, and this many.
const LEAST_SHARE: f64 = 0.002;
const LEAST: usize = 25;

/// With few states a wrong motion can look best for the first part and leave the others in pieces, so this many
/// alternatives are followed; from [`MANY_STATES`] on the first choice has always been right.
const BEAM: usize = 4;

/// Share of all contradictions that a single rigid thing would have: a part's screw and its values have to be paid for by what they
/// explain.
const PART_COST: f64 = 0.015;
/// With few states more is explained by chance: share of what is left, times the number of states. Below [`MANY_STATES`] of all: there
/// leftovers of parts that are right invite further ones (`three_drawers`).
const PART_COST_CHANCE: f64 = 0.06;

/// A set of parts under construction.
pub struct Node {
    pub tree: KinematicTree,
    /// Per part, per sample.
    pub verdicts: Vec<Vec<Verdict>>,
    /// Samples that every part contradicts.
    pub open: Vec<usize>,
    /// Contradictions removed so far, by tight count, times plausibility.
    merit: f64,
}

pub fn discover(
    evidence: &mut Evidence,
    max_parts: usize,
    seed: u64,
    progress: &Progress,
) -> Result<Discovery, Cancelled> {
    let n_states = evidence.n_states();
    let verdicts = vec![evidence.judge(&vec![Pose::IDENTITY; n_states])];
    let tree = KinematicTree { parts: vec!["base".to_string()], joints: Vec::new() };
    let open = open_samples(&verdicts);
    let cost = Cost::new(&verdicts[0], n_states);
    let mut front = vec![Node { tree, verdicts, open, merit: 0.0 }];
    let mut best: Option<Node> = None;
    let width = if n_states < MANY_STATES { BEAM } else { 1 };
    for round in 0..max_parts {
        progress.report(round, max_parts, &format!("{} parts", round + 1))?;
        let mut next: Vec<Node> = Vec::new();
        for node in front {
            let grown = grow(evidence, &node, width, cost, seed);
            progress.check()?;
            next.extend(grown);
            if best.as_ref().is_none_or(|b| node.merit > b.merit) {
                best = Some(node);
            }
        }
        next.sort_by(|a, b| b.merit.total_cmp(&a.merit));
        next.dedup_by(|b, a| {
            (a.merit - b.merit).abs() < 0.005 * a.merit && a.open.len().abs_diff(b.open.len()) < LEAST
        });
        next.truncate(width);
        front = next;
        if front.is_empty() {
            break;
        }
    }
    let best = front.into_iter().chain(best).max_by(|a, b| a.merit.total_cmp(&b.merit)).expect("the first node");
    Ok(Discovery { tree: best.tree, verdicts: best.verdicts, cost })
}

/// The `width` best ways to add a part.
fn grow(evidence: &mut Evidence, node: &Node, width: usize, cost: Cost, seed: u64) -> Vec<Node> {
    let cost = cost.of(node.open.iter().map(|&i| contradictions(&node.verdicts, i)).sum());
    let n_states = evidence.n_states();
    let least = ((LEAST_SHARE * evidence.samples.len() as f64) as usize).max(LEAST);
    if node.open.len() < least {
        return Vec::new();
    }
    let poses: Vec<Vec<Pose>> = (0..node.tree.parts.len()).map(|p| poses_of(&node.tree, p, n_states)).collect();
    evidence.mark_taken(&poses);
    let evidence = &*evidence;
    let jury = Jury::new(evidence, &node.open, &node.verdicts, seed);
    let proposals: Vec<Proposal> = (0..node.tree.parts.len())
        .flat_map(|p| propose(evidence, p, &poses[p], &node.open, &node.verdicts, &jury, seed))
        .collect();
    let ground = Ground { evidence, node, poses: &poses, jury: &jury, cost, seed };
    let mut finals: Vec<Final> = finalists(evidence, proposals).par_iter().map(|p| ground.best(p)).collect();
    finals.sort_by(|a, b| b.merit.total_cmp(&a.merit));
    finals
        .into_iter()
        .filter(|f| f.explained.len() >= least && f.merit > 0.0)
        .take(width)
        .map(|f| {
            let mut verdicts = node.verdicts.clone();
            verdicts.push(evidence.judge(&poses_of(&f.tree, f.tree.parts.len() - 1, n_states)));
            let open = open_samples(&verdicts);
            Node { tree: f.tree, verdicts, open, merit: node.merit + f.merit }
        })
        .collect()
}

/// World from canonical of a part in every state.
pub fn poses_of(tree: &KinematicTree, part: usize, n_states: usize) -> Vec<Pose> {
    (0..n_states).map(|s| tree.poses_at(s)[part]).collect()
}

/// World at state t from world at state a, for every part. [part][a][t]
pub fn motions_of(evidence: &Evidence, tree: &KinematicTree) -> Vec<Vec<Vec<Motion>>> {
    (0..tree.parts.len()).map(|p| evidence.between(&poses_of(tree, p, evidence.n_states()))).collect()
}

/// Samples that every part contradicts.
fn open_samples(verdicts: &[Vec<Verdict>]) -> Vec<usize> {
    (0..verdicts[0].len()).filter(|&i| contradictions(verdicts, i) > 0.0).collect()
}

/// The best proposals that differ.
fn finalists(evidence: &Evidence, mut all: Vec<Proposal>) -> Vec<Proposal> {
    let merit = |p: &Proposal| p.gain * plausibility(&p.screw, &p.scan.values, p.parent, &p.crowd, evidence.extent());
    all.sort_by(|a, b| merit(b).total_cmp(&merit(a)));
    // In the parent's frame: where the proposal has its samples in state s, and where another would take them from
    // where the first state has them.
    let own = |p: &Proposal, s: usize| Motion::from(p.screw.motion(p.scan.values[s]));
    let other = |o: &Proposal, p: &Proposal, s: usize| {
        let (v, first) = (&o.scan.values, p.scan.values[0]);
        Motion::from(o.screw.motion(v[s] - v[0]) * p.screw.motion(first))
    };
    let mut out: Vec<Proposal> = Vec::new();
    // First what differs much, then, with few states, what differs little.
    let tiers = if evidence.n_states() < MANY_STATES { &[FINALISTS, NEIGHBOURS][..] } else { &[FINALISTS][..] };
    for (most, apart) in tiers {
        let mut rest = Vec::new();
        for p in all {
            let same = |o: &Proposal| {
                o.screw.kind == p.screw.kind
                    && o.parent == p.parent
                    && (0..p.scan.values.len()).all(|s| {
                        let (a, b) = (own(&p, s), other(o, &p, s));
                        let gap = |x: &Sample| a.apply(x.point).distance(b.apply(x.point));
                        p.crowd.iter().step_by(8).all(|x| gap(x) < apart * evidence.lattice.voxel)
                    })
            };
            if out.len() < *most && !out.iter().any(same) {
                out.push(p);
            } else {
                rest.push(p);
            }
        }
        all = rest;
    }
    out
}
