//! From a discovery to the final estimate: a list of named passes over frozen evidence.
//!
//! [`FIRST`] once, [`ROUND`] three times, [`LAST`] once. Every pass takes the estimate of the one before; none touches the evidence. Only
//! `align_states` asks for its frames to be moved, which the driver does, on evidence of its own.

pub mod align_axes;
pub mod ask_values;
pub mod chains;
pub mod driver;
pub mod far_hinges;
pub mod pass;
pub mod refine_joints;
pub mod split_coupled;
pub mod state_frames;
pub mod turn_axes;
pub mod two_values;
pub mod value_search;
pub mod visibility;

use crate::error::ArticulateError;
use crate::model::estimate::Estimate;
use pass::{Pass, Round};

/// Once, on what was discovered.
pub const FIRST: &[Pass] = &[
    optional("ask_values", ask_values::ask_values),
    needed("judge", |round, estimate| pass::judge_all(round.evidence, estimate)),
    optional("prune", |_, estimate| pass::prune_parts(estimate)),
    optional("order_links", chains::order_links),
    needed("label", pass::label_by_verdicts),
    optional("find_hidden", visibility::find_hidden),
    optional("turn_axes", turn_axes::turn_axes),
    optional("far_hinges", far_hinges::far_hinges),
];

/// Three times.
pub const ROUND: &[Pass] = &[
    optional("shorten_chains", chains::shorten_chains),
    optional("align_states", state_frames::align_states),
    optional("search_values", value_search::search_values),
    optional("refine_joints", refine_joints::refine_joints),
    optional("align_axes", align_axes::align_axes),
    optional("hold_hidden", visibility::hold_hidden),
    needed("relabel", pass::relabel),
];

/// How often [`ROUND`] is gone through.
pub const ROUNDS: usize = 3;

/// Once, at the end.
pub const LAST: &[Pass] = &[optional("split_coupled", split_coupled::split_coupled)];

const fn optional(name: &'static str, run: fn(&Round, &mut Estimate)) -> Pass {
    Pass { name, run, optional: true }
}

const fn needed(name: &'static str, run: fn(&Round, &mut Estimate)) -> Pass {
    Pass { name, run, optional: false }
}

/// Every pass in order, each with the round that it belongs to; [`FIRST`] counts as round 0 and
/// [`LAST`] as the one after the rounds.
pub fn schedule() -> impl Iterator<Item = (usize, &'static Pass)> {
    let first = FIRST.iter().map(|p| (0, p));
    let rounds = (0..ROUNDS).flat_map(|round| ROUND.iter().map(move |p| (round, p)));
    first.chain(rounds).chain(LAST.iter().map(|p| (ROUNDS, p)))
}

/// Names that `passes.skip` takes.
pub fn optional_names() -> impl Iterator<Item = &'static str> {
    [FIRST, ROUND, LAST].into_iter().flatten().filter(|p| p.optional).map(|p| p.name)
}

/// Whether all `names` are those of passes that can be left out.
///
/// # Errors
/// One is not, by name.
pub fn known(names: &[String]) -> Result<(), ArticulateError> {
    match names.iter().find(|name| optional_names().all(|known| known != **name)) {
        None => Ok(()),
        Some(name) => {
            let all: Vec<&str> = optional_names().collect();
            let what = format!("no pass '{name}' that could be left out");
            Err(ArticulateError::input(what, "passes.skip", format!("one of {}", all.join(", "))))
        }
    }
}
