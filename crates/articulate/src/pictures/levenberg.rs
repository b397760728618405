//! Joints and states' frames moved downhill, by Levenberg and Marquardt.

use super::information::Information;
use super::problem::{Guess, Problem, Shot};
use crate::fit::unknowns::slots;
use crate::model::tree_edit::count_from_first;
use hingecast_geom::{KinematicTree, Pose, Progress};
use hingecast_splat::{Engine, SplatError};

/// What the pictures made of it.
#[derive(Clone, Debug)]
pub struct Refined {
    /// Parts and joints, values counted from the first state.
    pub tree: KinematicTree,
    /// Where the parts of the gaussians really stand in the first state.
    pub first: Vec<Pose>,
    /// Per state: what its cameras take for the world, from the world.
    pub state_from_world: Vec<Pose>,
    /// Nats before and after.
    pub cost: [f64; 2],
}

/// Damping of the first try, share of the diagonal.
const DAMPING: f64 = 1e-3;
/// Steps, and the nats below which a further one is not worth a look at all pictures.
const ROUNDS: usize = 12;
const SETTLED: f64 = 0.5;

/// Moves the joints of `tree` and the states' frames so that the engine's gaussians (group = part)
/// look like the pictures, as far as the depth lets them. `information`: `[state][part]`.
///
/// # Errors
/// Those of the engine; the wish to stop.
pub fn refine_by_pictures(
    engine: &mut Engine,
    shots: &[Shot],
    tree: &KinematicTree,
    information: &[Vec<Information>],
    progress: &Progress,
) -> Result<Refined, SplatError> {
    let n_states = information.len();
    let mut guess = Guess { tree: tree.clone(), state_from_world: vec![Pose::IDENTITY; n_states] };
    if tree.joints.is_empty() {
        return Ok(Refined {
            first: tree.poses(&[]),
            tree: guess.tree,
            state_from_world: guess.state_from_world,
            cost: [0.0; 2],
        });
    }
    let (slots, zeros) = slots(tree, &vec![true; tree.joints.len()], n_states);
    let mut problem = Problem {
        shots,
        depth: (0..n_states).map(|s| tree.poses_at(s)).collect(),
        information: information.iter().map(|s| s.iter().map(Information::matrix).collect()).collect(),
        slots,
        zeros,
        weight: 1.0,
    };
    let first = problem.look(engine, &guess)?;
    let (cost, filled) = first.iter().fold((0.0, 0), |(c, f), s| (c + s.cost, f + s.filled));
    // As log-likelihood: the variance of a channel is cost / (3 filled).
    problem.weight = 3.0 * filled as f64 / (2.0 * cost.max(1e-12));
    let mut sums = problem.sums(&guess, &first);
    let before = sums.cost;
    let mut damping = DAMPING;
    for round in 0..ROUNDS {
        progress.report(round, ROUNDS, &format!("joints by the pictures, {:.0} nats", before - sums.cost))?;
        let Some((next, seen)) = problem.step(engine, &guess, &sums, damping)? else { break };
        let tried = problem.sums(&next, &seen);
        if tried.cost >= sums.cost {
            damping *= 10.0;
            continue;
        }
        let gain = sums.cost - tried.cost;
        (guess, sums, damping) = (next, tried, (damping * 0.1).max(1e-4));
        if gain < SETTLED {
            break;
        }
    }
    let first = guess.tree.poses_at(0);
    count_from_first(&mut guess.tree);
    Ok(Refined { tree: guess.tree, first, state_from_world: guess.state_from_world, cost: [before, sums.cost] })
}
