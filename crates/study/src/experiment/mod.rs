//! The question that a twin must answer: does a policy that was made with one of the two work on
//! the other, and how wrong may a twin be before it does not?
//!
//! For every object: a policy cloned from demonstrations on the true object acts on that object, on
//! its twins and on spoiled objects, the same seeds everywhere; and back, a policy from
//! demonstrations on the twin acts on the true object. Here are the rows that this gives; `steps`
//! remembers what is finished, `table` and `plot` show it, the verb `experiment` runs the stages.

pub mod cast;
pub mod plan;
pub mod plot;
pub mod steps;
pub mod table;

use crate::simulate::rollout::{EpisodeResult, compare};
use hingecast::failure::{Failure, Result};
use hingecast_geom::folder::may_become;
use hingecast_policy::statistics::{Comparison, wilson};
use hingecast_sim::{Outcome, Spoil, SpotPath};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// Where a policy acts.
#[derive(Clone, Debug, PartialEq)]
pub enum World {
    /// The twin that `build` makes.
    Twin,
    /// The twin of the classical method.
    Track,
    /// The true object with a joint that is wrong on purpose.
    Spoiled(Vec<Spoil>),
    /// The true object, and the policy comes from the twin.
    Back,
}

impl World {
    /// # Errors
    /// When it is none of them.
    pub(crate) fn read(text: &str) -> Result<Self> {
        Ok(match text {
            "twin" => Self::Twin,
            "track" => Self::Track,
            "back" => Self::Back,
            spoil => Self::Spoiled(Spoil::read(spoil).map_err(|_| {
                let hint = "twin, track, back, or a spoiled one: axis=DEGREES, pivot=MM, limits=SHARE, edge";
                Failure::new(format!("there is no world '{text}'"), "--world", hint)
            })?),
        })
    }
}

/// How far a world's joint is from the true one, whatever any policy does.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct TwinError {
    /// Between the axes, both pointing so that positive motion opens, degrees: a hinge on the wrong
    /// side has 180.
    pub axis_deg: f64,
    /// From the foot of the spot on the true axis to this world's axis, simulated mm; `None` for
    /// slides.
    pub pivot_mm: Option<f64>,
    /// Between the spots where this world's joint and the true one have moved as far as the task
    /// asks, simulated mm.
    pub goal_mm: f64,
}

impl TwinError {
    pub(crate) fn between(truth: &SpotPath, this: &SpotPath) -> Self {
        let foot = truth.screw.foot(truth.spot);
        let hinges = truth.screw.kind.turns() && this.screw.kind.turns();
        Self {
            axis_deg: truth.screw.axis.angle_between(this.screw.axis).to_degrees(),
            pivot_mm: hinges.then(|| 1e3 * this.screw.distance(foot)),
            goal_mm: 1e3 * truth.goal().distance(this.goal()),
        }
    }
}

/// One way to count successes, over all training seeds.
#[derive(Clone, Debug, Serialize)]
pub struct Count {
    /// Episodes that count, of all training seeds together.
    pub successes: usize,
    /// Wilson's 95 % interval of the rate, 0 to 1. It takes all episodes as independent; `per_seed`
    /// shows how far training seeds differ.
    pub interval: [f64; 2],
    /// The true object's rate minus this one's, same policies and episodes. `None` for the true
    /// object itself and for `back`, whose policies are others.
    pub against_true: Option<Comparison>,
    /// Episodes that count of each training seed's policy.
    pub per_seed: Vec<usize>,
}

/// One line of the table.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// Name of the object, as its folder has it.
    pub object: String,
    /// "true", "twin", "track", "axis=30", ..., "back".
    pub world: String,
    /// Why there are no figures; `None` when there are.
    pub failed: Option<String>,
    /// How wrong the joint is that the policies met. `None` for `back`, where they met the true
    /// one, and without figures.
    pub error: Option<TwinError>,
    /// Of all training seeds together; 0 without figures.
    pub episodes: usize,
    /// The joint moved as far as the task asks. `None` without figures.
    pub success: Option<Count>,
    /// The part ended where the true joint would have it. `None` without figures.
    pub as_true: Option<Count>,
    /// Median distance of the spot from the true way at the end, simulated mm. `None` without
    /// figures, and when every simulation diverged.
    pub median_off_mm: Option<f64>,
    /// How many episodes ended how; what never came up is left out.
    pub outcomes: BTreeMap<Outcome, usize>,
}

impl Row {
    pub(crate) fn failed(object: &str, world: &str, why: impl Into<String>) -> Self {
        Self { failed: Some(why.into()), ..Self::empty(object, world) }
    }

    fn empty(object: &str, world: &str) -> Self {
        Self {
            object: object.to_string(),
            world: world.to_string(),
            failed: None,
            error: None,
            episodes: 0,
            success: None,
            as_true: None,
            median_off_mm: None,
            outcomes: BTreeMap::new(),
        }
    }

    /// `episodes[k]`: those of the policy of training seed k. `truth`: the same policies on the
    /// true object, at least as many episodes.
    pub(crate) fn measured(
        object: &str,
        world: &str,
        error: Option<TwinError>,
        episodes: &[Vec<EpisodeResult>],
        truth: Option<&[Vec<EpisodeResult>]>,
    ) -> Self {
        let all: Vec<EpisodeResult> = episodes.concat();
        let theirs: Option<Vec<EpisodeResult>> = truth.map(|t| {
            let first = |(t, e): (&Vec<EpisodeResult>, &Vec<EpisodeResult>)| t[..e.len()].to_vec();
            t.iter().zip(episodes).flat_map(first).collect()
        });
        let count = |won: fn(&EpisodeResult) -> bool| {
            let per_seed: Vec<usize> = episodes.iter().map(|e| e.iter().filter(|r| won(r)).count()).collect();
            let successes = per_seed.iter().sum();
            Count {
                successes,
                interval: wilson(successes, all.len()),
                against_true: theirs.as_ref().map(|t| compare(t, &all, won)),
                per_seed,
            }
        };
        let mut outcomes = BTreeMap::new();
        all.iter().for_each(|r| *outcomes.entry(r.outcome).or_default() += 1);
        let mut off: Vec<f64> = all.iter().filter_map(|r| r.off_mm).collect();
        off.sort_by(f64::total_cmp);
        Self {
            error,
            episodes: all.len(),
            success: Some(count(EpisodeResult::won)),
            as_true: Some(count(|r| r.as_true)),
            median_off_mm: off.get(off.len() / 2).copied(),
            outcomes,
            ..Self::empty(object, world)
        }
    }
}

/// What was demonstrated on an object (or its twin), and how well that went.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Demonstrated {
    /// Name of the object, as its folder has it.
    pub object: String,
    /// "true" or "twin".
    pub on: String,
    /// Name of the joint that was opened, in that model's file.
    pub joint: String,
    /// Simulated metres per unit of the file.
    pub scale: f64,
    /// Successful episodes, which the policies learn from.
    pub kept: usize,
    /// How the other attempts ended, and how many did so.
    pub thrown_away: BTreeMap<Outcome, usize>,
}

/// `experiment.json`.
#[derive(Clone, Debug, Serialize)]
pub struct Experiment {
    /// Every flag's value, from [`plan::Plan::settings`].
    pub settings: serde_json::Value,
    /// One of each object that could be demonstrated on, and a second, on its twin, for `back`.
    pub demonstrated: Vec<Demonstrated>,
    /// Of each object in turn: the true object first, then its other worlds.
    pub rows: Vec<Row>,
}

impl Experiment {
    /// Whether an experiment may write into `folder`: it is new, empty, or one.
    ///
    /// # Errors
    /// The folder holds something else.
    pub fn may_become(folder: &Path) -> Result<()> {
        let hint = "give a new folder: hingecast experiment -o FOLDER";
        Ok(may_become("experiment's folder", folder, &["experiment.json"], hint)?)
    }
}
