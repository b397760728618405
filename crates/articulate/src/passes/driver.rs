//! Runs the passes, and writes down what each of them did.

use super::pass::Round;
use super::schedule;
use crate::label::by_verdicts::label;
use crate::model::estimate::{Discovery, Estimate, FitReport};
use crate::model::owners::Owners;
use crate::model::tree_edit::count_from_first;
use crate::observe::evidence::Evidence;
use crate::score::likelihood::Likelihood;
use hingecast_geom::progress::Cancelled;
use hingecast_geom::{Pose, Progress};
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// What one pass did.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PassRecord {
    /// Name of the pass.
    pub pass: String,
    /// Which time around, from 0.
    pub round: usize,
    /// Whether `passes.skip` left it out.
    pub skipped: bool,
    /// Parts afterwards, the base included.
    pub parts: usize,
    /// How well the tree explains what moved, before and after, nats by a few hundred samples;
    /// higher is better.
    pub nats: [f64; 2],
    /// Wall time.
    pub secs: f64,
}

/// Samples that the nats of a [`PassRecord`] are counted on.
const TRACED_SAMPLES: usize = 300;

/// Runs all passes but those whose names are in `skip`. Answers the evidence in the states' frames
/// as they are believed in the end.
///
/// # Errors
/// The wish to stop, between two passes.
pub fn settle(
    evidence: Evidence,
    found: Discovery,
    seed: u64,
    skip: &[String],
    progress: &Progress,
) -> Result<(Evidence, Estimate, Vec<PassRecord>), Cancelled> {
    let mut evidence = evidence;
    let likelihood = Likelihood::of_some(&found.verdicts[0], seed, TRACED_SAMPLES);
    let n_parts = found.tree.parts.len();
    let mut estimate = Estimate {
        owners: Owners { labels: label(&evidence, &found.verdicts), shown: vec![u64::MAX; n_parts] },
        hidden: vec![Vec::new(); found.tree.joints.len()],
        world_from_state: vec![Pose::IDENTITY; evidence.n_states()],
        reframe: None,
        report: FitReport::default(),
        unexplained: 0.0,
        tree: found.tree,
        verdicts: found.verdicts,
        cost: found.cost,
    };
    let mut nats = likelihood.nats(&evidence, &estimate.tree);
    let mut records = Vec::new();
    for (number, pass) in schedule() {
        // One pass takes a hundred times as long as another: no share, no time to go.
        progress.report(number + 1, 0, &format!("refining: {}", pass.name.replace('_', " ")))?;
        let (began, before) = (Instant::now(), estimate.tree.clone());
        let skipped = pass.optional && skip.iter().any(|name| name == pass.name);
        if !skipped {
            (pass.run)(&Round { evidence: &evidence, seed, number }, &mut estimate);
        }
        let moved = estimate.reframe.take();
        let same = moved.is_none() && estimate.tree == before;
        if let Some(moved) = moved {
            evidence = evidence.in_frames(&moved);
        }
        let secs = began.elapsed().as_secs_f64();
        let after = if same { nats } else { likelihood.nats(&evidence, &estimate.tree) };
        records.push(PassRecord {
            pass: pass.name.to_string(),
            round: number,
            skipped,
            parts: estimate.tree.parts.len(),
            nats: [nats, after],
            secs,
        });
        nats = after;
    }
    let n = evidence.samples.len();
    let against = |i: &usize| estimate.verdicts.iter().all(|v| v[*i].against != 0);
    estimate.unexplained = (0..n).filter(against).count() as f64 / n.max(1) as f64;
    estimate.report.sigmas.resize(estimate.tree.joints.len(), [0.0; 3]);
    count_from_first(&mut estimate.tree);
    Ok((evidence, estimate, records))
}
