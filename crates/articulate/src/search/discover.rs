//! The search itself: the best few sets of parts, each grown by its best few candidates.

use super::candidates::{Candidate, candidates};
use super::finalists::finalists;
use super::partial::Partial;
use super::rank_candidates::{Ranked, Ranking};
use crate::config::MANY_STATES;
use crate::model::estimate::Discovery;
use crate::model::motions::poses_of;
use crate::observe::evidence::Evidence;
use crate::score::claims::Claims;
use crate::score::consensus::Consensus;
use crate::score::part_cost::PartCost;
use crate::score::verdict::{Verdict, contradictions};
use hingecast_geom::{Cancelled, KinematicTree, Pose, Progress};
use rayon::prelude::*;

/// A part has at least this share of all samples, and this many.
const LEAST_SHARE: f64 = 0.002;
const LEAST: usize = 25;

/// With few states a wrong motion can look best for the first part and leave the others in pieces,
/// so this many alternatives are followed; from [`MANY_STATES`] on the first choice has always been
/// right.
const BEAM: usize = 4;

/// Parts one after another, until nothing worth its cost is left. At most `max_parts` of them, and
/// the base.
///
/// # Errors
/// The wish to stop.
pub fn discover(evidence: &Evidence, max_parts: usize, seed: u64, progress: &Progress) -> Result<Discovery, Cancelled> {
    let n_states = evidence.n_states();
    let verdicts = vec![evidence.judge(&vec![Pose::IDENTITY; n_states])];
    let tree = KinematicTree { parts: vec!["base".to_string()], ..Default::default() };
    let open = open_samples(&verdicts);
    let cost = PartCost::new(&verdicts[0], n_states);
    let mut front = vec![Partial { tree, verdicts, open, merit: 0.0 }];
    let mut best: Option<Partial> = None;
    let width = if n_states < MANY_STATES { BEAM } else { 1 };
    for round in 0..max_parts {
        // How many parts there will be nobody knows: no share of the work, no time to go.
        progress.report(round + 1, 0, &format!("looking for part {}", round + 1))?;
        let mut next: Vec<Partial> = Vec::new();
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
fn grow(evidence: &Evidence, node: &Partial, width: usize, cost: PartCost, seed: u64) -> Vec<Partial> {
    let cost = cost.of(node.open.iter().map(|&i| contradictions(&node.verdicts, i)).sum());
    let n_states = evidence.n_states();
    let least = ((LEAST_SHARE * evidence.samples.len() as f64) as usize).max(LEAST);
    if node.open.len() < least {
        return Vec::new();
    }
    let poses: Vec<Vec<Pose>> = (0..node.tree.parts.len()).map(|p| poses_of(&node.tree, p, n_states)).collect();
    let claims = Claims::of_parts(evidence, &poses);
    let consensus = Consensus::new(evidence, &node.open, &node.verdicts, seed);
    let found: Vec<Candidate> = (0..node.tree.parts.len())
        .flat_map(|p| candidates(evidence, &claims, p, &poses[p], &node.open, &node.verdicts, &consensus, seed))
        .collect();
    let ranking =
        Ranking { evidence, partial: node, poses: &poses, claims: &claims, consensus: &consensus, cost, seed };
    let mut ranked: Vec<Ranked> = finalists(evidence, found).par_iter().map(|p| ranking.best(p)).collect();
    ranked.sort_by(|a, b| b.merit.total_cmp(&a.merit));
    ranked
        .into_iter()
        .filter(|f| f.explained.len() >= least && f.merit > 0.0)
        .take(width)
        .map(|f| {
            let mut verdicts = node.verdicts.clone();
            verdicts.push(evidence.judge(&poses_of(&f.tree, f.tree.parts.len() - 1, n_states)));
            let open = open_samples(&verdicts);
            Partial { tree: f.tree, verdicts, open, merit: node.merit + f.merit }
        })
        .collect()
}

/// Samples that every part contradicts.
fn open_samples(verdicts: &[Vec<Verdict>]) -> Vec<usize> {
    (0..verdicts[0].len()).filter(|&i| contradictions(verdicts, i) > 0.0).collect()
}
