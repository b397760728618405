//! Gaussians carried from state to state: Dynamic 3D Gaussians (Luiten et al. 2024).
//!
//! Each state starts where constant velocity would bring every gaussian (x + (x - x_p), likewise
//! for rotations); then means and quaternions follow the pictures under the rigidity losses of
//! [`super::physics`]. Scales and opacities stay those of the first state; colours may follow the
//! light a little.

use super::neighbours::neighbours;
use super::physics::{K, Neighbourhood, PhysicsWeights};
use super::trajectories::Trajectories;
use hingecast_geom::{Cancelled, Gaussians, Progress};
use hingecast_splat::{Engine, Gradients, LossConfig, Rates, SplatError, Target, plane};
use serde::{Deserialize, Serialize};

/// Settings of the tracking.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Steps per state; one view each.
    pub steps: usize,
    /// First and last step size of the means / diagonal; exponential in between.
    pub rate: [f32; 2],
    /// Step size of the quaternions at the start; falls as that of the means does.
    pub quat_rate: f32,
    /// Weights of the losses that keep things rigid.
    pub physics: PhysicsWeights,
    /// Weight of the depth loss.
    pub depth: f32,
}

impl Default for Config {
    fn default() -> Self {
        Self { steps: 360, rate: [8e-4, 8e-5], quat_rate: 4e-3, physics: Default::default(), depth: 0.5 }
    }
}

/// Where every gaussian stood in the states before.
struct Past {
    means: Vec<[f32; 3]>,
    quats: Vec<[f32; 4]>,
}

/// Keeps a finished state: its number, means, quaternions.
pub type Save<'a, E> = dyn FnMut(usize, &[[f32; 3]], &[[f32; 4]]) -> Result<(), E> + 'a;

/// Tracks `first` (state 0) through all states. `targets(s)` gives the training views of state s;
/// `done` holds the states of an earlier, interrupted run; `save(s, means, quats)` is called after
/// each state.
///
/// # Errors
/// What `targets` and `save` answer, the engine's complaints, [`Cancelled`].
pub fn run<E: From<SplatError> + From<Cancelled>>(
    first: &Gaussians,
    n_states: usize,
    diagonal: f64,
    targets: &dyn Fn(usize) -> Result<Vec<Target>, E>,
    done: Trajectories,
    save: &mut Save<E>,
    config: &Config,
    seed: u64,
    threads: usize,
    progress: &Progress,
) -> Result<Trajectories, E> {
    let mut tracks = done;
    if tracks.means.is_empty() {
        tracks.means.push(first.means.clone());
        tracks.quats.push(first.quats.clone());
        save(0, &tracks.means[0], &tracks.quats[0])?;
    }
    let near = neighbours(&first.means, K);
    let mut hood = Neighbourhood::new(&first.means, &near, diagonal);
    let mut engine = Engine::from_gaussians(first, threads)?;
    let loss = LossConfig { depth: config.depth, depth_scale: 0.01 * diagonal as f32, ..Default::default() };
    for state in tracks.means.len()..n_states {
        let before = |back: usize| {
            let s = state.saturating_sub(back);
            Past { means: tracks.means[s].clone(), quats: tracks.quats[s].clone() }
        };
        let (previous, earlier) = (before(1), before(2));
        start_by_velocity(&mut engine, &previous, &earlier);
        hood.set_previous(&previous.means, &previous.quats);
        let views = targets(state)?;
        // A generator per state: a resumed run draws the same views as an uninterrupted one.
        let mut rng = fastrand::Rng::with_seed(seed ^ (state as u64) << 20);
        let mut order: Vec<usize> = Vec::new();
        let mut gradients = Gradients::default();
        for step in 0..config.steps {
            if order.is_empty() {
                order = (0..views.len()).collect();
                rng.shuffle(&mut order);
            }
            let Some(view) = order.pop() else { break };
            let terms = engine.loss_and_gradients(&views[view], &loss, &mut gradients)?;
            add_physics(&engine, &mut hood, &config.physics, &mut gradients);
            let t = step as f32 / config.steps as f32;
            let decay = (config.rate[1] / config.rate[0]).powf(t);
            let rates = Rates {
                means: config.rate[0] * diagonal as f32 * decay,
                quats: config.quat_rate * decay,
                sh0: 1e-3,
                ..Rates::ZERO
            };
            engine.adam_step(&gradients, &rates)?;
            if step % 20 == 0 {
                let at = (state - 1) * config.steps + step;
                progress.report(
                    at,
                    (n_states - 1) * config.steps,
                    &format!("state {state}, psnr {:.1}", terms.psnr()),
                )?;
            }
        }
        let now = engine.gaussians();
        save(state, &now.means, &now.quats)?;
        tracks.means.push(now.means);
        tracks.quats.push(now.quats);
        // Only means and quaternions are saved: the colours of every state start from the first
        // one's, or a resumed run would take other steps than an uninterrupted one.
        let params = engine.params_mut();
        first.sh0.iter().enumerate().for_each(|(i, color)| params.set(plane::SH0, i, *color));
    }
    Ok(tracks)
}

/// Puts the engine's gaussians where constant velocity carries them and forgets Adam's momentum.
fn start_by_velocity(engine: &mut Engine, previous: &Past, earlier: &Past) {
    let params = engine.params_mut();
    for i in 0..previous.means.len() {
        let (x, x0) = (previous.means[i], earlier.means[i]);
        params.set(plane::MEANS, i, std::array::from_fn::<f32, 3, _>(|a| 2.0 * x[a] - x0[a]));
        let (q, q0) = (previous.quats[i], earlier.quats[i]);
        // q and -q are the same rotation: extrapolate on the near side.
        let sign = if (0..4).map(|a| q[a] * q0[a]).sum::<f32>() < 0.0 { -1.0 } else { 1.0 };
        let ahead: [f32; 4] = std::array::from_fn(|a| 2.0 * q[a] - sign * q0[a]);
        let norm = ahead.iter().map(|x| x * x).sum::<f32>().sqrt();
        params.set(plane::QUATS, i, if norm > 1e-6 { ahead.map(|x| x / norm) } else { q });
    }
    engine.reset_moments();
}

fn add_physics(engine: &Engine, hood: &mut Neighbourhood, weights: &PhysicsWeights, gradients: &mut Gradients) {
    let params = engine.params();
    let n = params.len();
    let means: Vec<[f32; 3]> = (0..n).map(|i| params.get(plane::MEANS, i)).collect();
    let quats: Vec<[f32; 4]> = (0..n).map(|i| params.get(plane::QUATS, i)).collect();
    let (mut gm, mut gq) = (vec![[0.0f32; 3]; n], vec![[0.0f32; 4]; n]);
    hood.add_gradients(&means, &quats, weights, &mut gm, &mut gq);
    for a in 0..3 {
        gradients.params.plane_mut(plane::MEANS + a).iter_mut().zip(&gm).for_each(|(g, x)| *g += x[a]);
    }
    for a in 0..4 {
        gradients.params.plane_mut(plane::QUATS + a).iter_mut().zip(&gq).for_each(|(g, x)| *g += x[a]);
    }
}
