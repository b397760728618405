//! The slow twin of [`Network::loss`] in f64: one sequence, one step, one number after the other,
//! straight from the formulas in `lstm.rs` and `head.rs`. Tests take central differences of it.

use super::{Batch, Head, Linear, Network};
use crate::ACTION_SIZE;

fn sigmoid(x: f64) -> f64 {
    1.0 / (1.0 + (-x).exp())
}

fn softplus(x: f64) -> f64 {
    x.max(0.0) + (-x.abs()).exp().ln_1p()
}

fn linear(layer: &Linear, p: &[f64], x: &[f64]) -> Vec<f64> {
    (0..layer.outputs)
        .map(|o| {
            let row = &p[layer.weight.clone()][o * layer.inputs..][..layer.inputs];
            p[layer.bias.clone()][o] + row.iter().zip(x).map(|(w, x)| w * x).sum::<f64>()
        })
        .collect()
}

/// ln N(a; mean, std)
fn log_density(a: f64, mean: f64, std: f64) -> f64 {
    -0.5 * ((a - mean) / std).powi(2) - std.ln() - 0.5 * std::f64::consts::TAU.ln()
}

fn row_loss(net: &Network, heads: &[Vec<f64>], action: &[f32]) -> f64 {
    let config = &net.config;
    let a = |d: usize| f64::from(action[d]);
    match config.head {
        Head::Action => (0..ACTION_SIZE).map(|d| (heads[0][d].tanh() - a(d)).powi(2)).sum::<f64>() / ACTION_SIZE as f64,
        Head::Gaussian => -(0..ACTION_SIZE)
            .map(|d| {
                let std = softplus(heads[1][d]) * config.init_std / 2f64.ln();
                log_density(a(d), heads[0][d].clamp(-9.0, 9.0).tanh(), std.clamp(config.min_std, 7.5))
            })
            .sum::<f64>(),
        Head::Gmm => {
            let all: f64 = heads[2].iter().map(|l| l.exp()).sum();
            let density: f64 = (0..config.num_modes)
                .map(|m| {
                    let log: f64 = (0..ACTION_SIZE)
                        .map(|d| {
                            let k = m * ACTION_SIZE + d;
                            log_density(a(d), heads[0][k].tanh(), softplus(heads[1][k]) + config.min_std)
                        })
                        .sum();
                    heads[2][m].exp() / all * log.exp()
                })
                .sum();
            -density.ln()
        }
    }
}

/// Mean loss over all rows of the batch.
pub fn loss(net: &Network, parameters: &[f64], batch: &Batch) -> f64 {
    let p = parameters;
    let mut total = 0.0;
    for b in 0..batch.sequences {
        let mut states: Vec<[Vec<f64>; 2]> =
            net.lstm.iter().map(|l| [vec![0.0; l.hidden], vec![0.0; l.hidden]]).collect();
        for t in 0..batch.steps {
            let row = b * batch.steps + t;
            let seen = &batch.observations[row * net.inputs..][..net.inputs];
            let mut x: Vec<f64> = seen.iter().map(|v| f64::from(*v)).collect();
            for (layer, [hidden, cells]) in net.lstm.iter().zip(&mut states) {
                let h = layer.hidden;
                let gate = |j: usize| -> f64 {
                    let w_ih = &p[layer.weight_ih.clone()][j * layer.inputs..][..layer.inputs];
                    let w_hh = &p[layer.weight_hh.clone()][j * h..][..h];
                    let from_input: f64 = w_ih.iter().zip(&x).map(|(w, x)| w * x).sum();
                    let from_state: f64 = w_hh.iter().zip(&*hidden).map(|(w, h)| w * h).sum();
                    from_input + p[layer.bias_ih.clone()][j] + from_state + p[layer.bias_hh.clone()][j]
                };
                let gates: Vec<f64> = (0..4 * h).map(gate).collect();
                for j in 0..h {
                    let (i, f) = (sigmoid(gates[j]), sigmoid(gates[h + j]));
                    let (g, o) = (gates[2 * h + j].tanh(), sigmoid(gates[3 * h + j]));
                    cells[j] = f * cells[j] + i * g;
                    hidden[j] = o * cells[j].tanh();
                }
                x.clone_from(hidden);
            }
            for layer in &net.mlp {
                x = linear(layer, p, &x).into_iter().map(|v| v.max(0.0)).collect();
            }
            let heads: Vec<Vec<f64>> = net.heads.iter().map(|layer| linear(layer, p, &x)).collect();
            total += row_loss(net, &heads, &batch.actions[row * ACTION_SIZE..][..ACTION_SIZE]);
        }
    }
    total / (batch.sequences * batch.steps) as f64
}
