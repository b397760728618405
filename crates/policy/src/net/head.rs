//! What the last layer says about the action: loss, gradient, and an action for a rollout. Per row,
//! a = demonstrated action.
//!
//! ```text
//! action    mu = tanh(x)                                    loss = mean (mu - a)^2
//! gaussian  mu = tanh(clamp(x, -9, 9)), s = clamp(softplus(y) init_std / ln 2, min_std, 7.5)
//! gmm       mu_m = tanh(x_m), s_m = softplus(y_m) + min_std, w = softmax(logits)
//!           loss = -ln sum_m w_m prod_d N(a_d; mu_md, s_md), mean over rows; gaussian is the case of one mode
//! ```
//! Source: robomimic 0.3, `models/policy_nets.py`. Gradients, r_m = share of mode m in that sum:
//! dL/dmu = -r (a - mu) / s^2,  dL/ds = -r ((a - mu)^2 / s^3 - 1 / s),  dL/dlogit = -(r - w), all divided by the rows.

use super::math::{sigmoid, softplus, tanh};
use super::{Head, NetConfig};
use crate::ACTION_SIZE;
use hingecast_geom::random::normal;

/// Standard deviation of an action in a rollout (robomimic's low_noise_eval), units of the action.
pub const EVAL_STD: f64 = 1e-4;
/// robomimic's mean_limits: beyond, tanh is flat.
const MEAN_LIMIT: f32 = 9.0;
/// robomimic's upper limit of a gaussian's standard deviation.
const STD_LIMIT: f32 = 7.5;

/// Mean and deviation of one number of one mode, and how both change with the network's outputs.
#[derive(Clone, Copy, Default)]
struct Component {
    mean: f32,
    std: f32,
    d_mean: f32,
    d_std: f32,
}

fn component(config: &NetConfig, x: f32, y: f32) -> Component {
    match config.head {
        Head::Gaussian => {
            let inside = x.abs() <= MEAN_LIMIT;
            let mean = tanh(x.clamp(-MEAN_LIMIT, MEAN_LIMIT));
            let scale = config.init_std as f32 / std::f32::consts::LN_2;
            let (free, least) = (softplus(y) * scale, config.min_std as f32);
            let std = free.clamp(least, STD_LIMIT);
            // As PyTorch's clamp: the bounds themselves still pass gradients.
            let d_std = if std == free { sigmoid(y) * scale } else { 0.0 };
            Component { mean, std, d_mean: if inside { 1.0 - mean * mean } else { 0.0 }, d_std }
        }
        _ => {
            let mean = tanh(x);
            Component { mean, std: softplus(y) + config.min_std as f32, d_mean: 1.0 - mean * mean, d_std: sigmoid(y) }
        }
    }
}

/// ln sum exp.
fn log_sum_exp(values: &[f64]) -> f64 {
    let largest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    largest + values.iter().map(|v| (v - largest).exp()).sum::<f64>().ln()
}

/// Sum of the rows' losses times `weight`; `outputs` (one per head, rows x width) become their
/// gradients.
pub fn loss_and_gradient(config: &NetConfig, outputs: &mut [Vec<f32>], actions: &[f32], weight: f64) -> f64 {
    match config.head {
        Head::Action => squared_error(&mut outputs[0], actions, weight / ACTION_SIZE as f64),
        Head::Gaussian | Head::Gmm => mixture(config, outputs, actions, weight),
    }
}

fn squared_error(outputs: &mut [f32], actions: &[f32], weight: f64) -> f64 {
    let mut loss = 0.0;
    for (x, a) in outputs.iter_mut().zip(actions) {
        let mean = tanh(*x);
        let error = mean - a;
        loss += f64::from(error) * f64::from(error);
        *x = 2.0 * weight as f32 * error * (1.0 - mean * mean);
    }
    loss * weight
}

fn mixture(config: &NetConfig, outputs: &mut [Vec<f32>], actions: &[f32], weight: f64) -> f64 {
    let modes = if config.head == Head::Gmm { config.num_modes } else { 1 };
    let width = modes * ACTION_SIZE;
    let [means, scales, rest @ ..] = outputs else { unreachable!("mean and scale") };
    let mut parts = vec![Component::default(); width];
    let mut joint = vec![0.0; modes];
    let mut mixing = vec![0.0; modes];
    let mut loss = 0.0;
    for (row, action) in actions.chunks_exact(ACTION_SIZE).enumerate() {
        let (x, y) = (&mut means[row * width..][..width], &mut scales[row * width..][..width]);
        for k in 0..width {
            parts[k] = component(config, x[k], y[k]);
        }
        // ln of each mode's weight times its density.
        if let Some(logits) = rest.first() {
            mixing.iter_mut().zip(&logits[row * modes..]).for_each(|(m, l)| *m = f64::from(*l));
            let total = log_sum_exp(&mixing);
            mixing.iter_mut().for_each(|m| *m -= total);
        }
        for m in 0..modes {
            joint[m] = mixing[m];
            for d in 0..ACTION_SIZE {
                let Component { mean, std, .. } = parts[m * ACTION_SIZE + d];
                let z = f64::from(action[d] - mean) / f64::from(std);
                joint[m] -= 0.5 * z * z + f64::from(std).ln() + HALF_LN_TWO_PI;
            }
        }
        let total = log_sum_exp(&joint);
        loss -= total;
        for m in 0..modes {
            let share = (joint[m] - total).exp() * weight;
            for d in 0..ACTION_SIZE {
                let k = m * ACTION_SIZE + d;
                let Component { mean, std, d_mean, d_std } = parts[k];
                let (error, s) = (f64::from(action[d] - mean), f64::from(std));
                x[k] = (-share * error / (s * s)) as f32 * d_mean;
                y[k] = (-share * (error * error / (s * s) - 1.0) / s) as f32 * d_std;
            }
            if let Some(logits) = rest.first_mut() {
                logits[row * modes + m] = (mixing[m].exp() * weight - share) as f32;
            }
        }
    }
    loss * weight
}

const HALF_LN_TWO_PI: f64 = 0.918_938_533_204_672_7;

/// An action as robomimic takes it in evaluation: a mode by its weight, then its mean with a
/// deviation of [`EVAL_STD`] (gmm); the mean itself (gaussian, action). `outputs`: one row per
/// head.
pub fn sample(config: &NetConfig, outputs: &[Vec<f32>], rng: &mut fastrand::Rng) -> [f64; ACTION_SIZE] {
    if config.head != Head::Gmm {
        let limit = if config.head == Head::Gaussian { MEAN_LIMIT } else { f32::INFINITY };
        return std::array::from_fn(|d| f64::from(tanh(outputs[0][d].clamp(-limit, limit))));
    }
    let logits: Vec<f64> = outputs[2].iter().map(|l| f64::from(*l)).collect();
    let total = log_sum_exp(&logits);
    let mut left = rng.f64();
    let mode = logits.iter().position(|l| {
        left -= (l - total).exp();
        left < 0.0
    });
    // Rounding may leave a crumb after the last mode.
    let mode = mode.unwrap_or(logits.len() - 1);
    std::array::from_fn(|d| f64::from(tanh(outputs[0][mode * ACTION_SIZE + d])) + EVAL_STD * normal(rng))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Modes come as often as their weights say, at their means, with the small deviation around
    /// them.
    #[test]
    fn modes_are_drawn_by_weight() {
        let config = NetConfig { num_modes: 3, ..Default::default() };
        let means: Vec<f32> = (0..21).map(|k| [-1.0, 0.0, 1.0][k / 7]).collect();
        let logits: Vec<f32> = [0.2f32, 0.5, 0.3].iter().map(|w| w.ln() + 3.0).collect();
        let mut rng = fastrand::Rng::with_seed(1);
        let (mut counts, mut squares, n) = ([0.0; 3], 0.0, 20_000);
        for _ in 0..n {
            let action = sample(&config, &[means.clone(), vec![0.0; 21], logits.clone()], &mut rng);
            let mode = ((action[0] / 1f64.tanh()).round() + 1.0) as usize;
            counts[mode] += 1.0 / n as f64;
            squares += (action[3] - f64::from(means[7 * mode]).tanh()).powi(2) / n as f64;
        }
        for (found, weight) in counts.iter().zip([0.2, 0.5, 0.3]) {
            assert!((found - weight).abs() < 0.015, "{counts:?}");
        }
        assert!((squares.sqrt() / EVAL_STD - 1.0).abs() < 0.05, "{}", squares.sqrt());
    }
}
