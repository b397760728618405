//! Makes the task of an object: geometry proposes places to hold, the demonstrator tries the best
//! of them in the simulator, and the first that works is taken. Geometry does not know the arm's
//! reach; a try does.

use crate::env::{ACTION, Env, Outcome};
use crate::expert::Expert;
use crate::grasp::{self, Size};
use crate::scene::{Scene, SceneConfig};
use crate::task::{TaskKind, TaskSpec};
use crate::{SimError, object};
use mujoco_rs::prelude::*;
use std::path::Path;

/// Tries per place, and how many of them must succeed to look no further.
const TRIES: u64 = 3;
/// Sizes that are tried, times what the arm reaches with ease: a handle may be too thick for the
/// gripper or too near to the next.
const SIZES: [f64; 5] = [1.0, 0.75, 1.4, 0.55, 1.8];

/// Steps of 50 ms in which nothing may happen, and the share of the way from which something has.
const ALONE: usize = 20;
const BY_ITSELF: f64 = 0.25;

/// What was found out on the way.
#[derive(Clone, Debug)]
pub struct Made {
    /// The task with the place to hold that worked best.
    pub task: TaskSpec,
    /// Successes of `TRIES` with the place that was taken.
    pub worked: usize,
    /// How often it was tried.
    pub of: usize,
}

/// The task of an object: the first place to hold that works in every try, or else the best.
///
/// # Errors
/// When the gripper fits nowhere, or the demonstrator never succeeds.
pub fn make_task(path: &Path, kind: TaskKind, joint: Option<&str>, scale: Option<f64>) -> Result<Made, SimError> {
    if let Some(s) = scale.filter(|s| !(1e-4..=1e4).contains(s)) {
        return Err(SimError::task(
            format!("{s} is not a size"),
            "--scale",
            "simulated metres per unit of the model, for instance 0.5",
        ));
    }
    let path = object::model_file(path)?;
    let place = path.display().to_string();
    let sizes: Vec<Size> = match scale {
        Some(s) => vec![Size::Exactly(s)],
        None => SIZES.iter().map(|f| Size::Reachable(*f)).collect(),
    };
    let config = SceneConfig { object: path.clone(), spoil: Vec::new(), visuals: false };
    let mut best: Option<Made> = None;
    let (mut places, mut in_the_way, mut by_itself) = (0, 0, 0);
    'sizes: for size in sizes {
        for candidate in grasp::candidates(&path, kind, joint, size)? {
            let scene = Scene::new(&config, &candidate.task)?;
            let mut env = Env::new(&scene);
            if touches_arm(&mut env) {
                in_the_way += 1;
                continue;
            }
            if moves_by_itself(&mut env)? {
                by_itself += 1;
                continue;
            }
            places += 1;
            // Seeds far from those of demonstrations and rollouts.
            let runs = (0..TRIES).map(|k| demonstrate(&mut env, u64::MAX - k, |_, _| ()));
            let worked = runs.collect::<Result<Vec<_>, _>>()?.iter().filter(|o| **o == Outcome::Success).count();
            if best.as_ref().is_none_or(|b| worked > b.worked) {
                best = Some(Made { task: candidate.task, worked, of: TRIES as usize });
            }
            if worked == TRIES as usize {
                break 'sizes;
            }
        }
    }
    match best {
        Some(made) if made.worked > 0 => Ok(made),
        None if by_itself > 0 => Err(SimError::task(
            "the part moves by itself before anything touches it: opening it would show nothing",
            place,
            "--joint for another joint; or it falls, or its collision shapes overlap where it is closed",
        )),
        None if in_the_way > 0 => Err(SimError::task(
            "wherever the gripper could hold it, the object stands where the arm begins",
            place,
            "--scale for a smaller object",
        )),
        Some(_) => Err(SimError::task(
            format!("the demonstrator opened it in none of {} tries at {places} places", TRIES * places),
            match in_the_way {
                0 => place,
                n => format!("{place}; at {n} more places it stands where the arm begins"),
            },
            "--joint for another joint, or --scale for another size: it may be out of reach or stuck",
        )),
        None => Err(SimError::task(
            "the gripper (80 mm wide open) can close on no part that moves",
            place,
            "--joint for another joint, or --scale for a smaller object",
        )),
    }
}

/// Whether the part goes a quarter of its way within a second in which the arm keeps still: pushed
/// out by shapes that overlap, or falling.
fn moves_by_itself(env: &mut Env) -> Result<bool, SimError> {
    env.reset(u64::MAX);
    for _ in 0..ALONE {
        env.step(&[0.0; ACTION])?;
    }
    Ok(env.moved_at_most() > BY_ITSELF)
}

/// Whether arm and object touch where an episode begins: then the arm pushes the part, or is stuck,
/// before it has done anything.
fn touches_arm(env: &mut Env) -> bool {
    let model = env.scene.model.clone();
    let arm = model.name_to_id(MjtObjBase::mjOBJ_BODY, "link0").expect("a body of our own arm");
    env.data_mut().contact().iter().any(|c| {
        let bodies = c.geom.map(|g| model.geom_bodyid()[g.max(0) as usize] as usize);
        let [a, b] = bodies.map(|body| object::hangs_on(&model, body, arm));
        // Body 0 is the world: table and floor.
        a != b && !bodies.contains(&0)
    })
}

/// One episode of the demonstrator from `seed`; `each` sees the environment before every action.
/// Ends at success or at the horizon.
///
/// # Errors
/// Never in practice: the demonstrator's actions are finite.
pub fn demonstrate(env: &mut Env, seed: u64, mut each: impl FnMut(&Env, &[f64; 7])) -> Result<Outcome, SimError> {
    env.reset(seed);
    let mut expert = Expert::new(seed);
    for _ in 0..env.scene.task.horizon {
        let action = expert.act(env);
        each(env, &action);
        env.step(&action)?;
        if env.success() {
            break;
        }
    }
    Ok(env.outcome())
}
