//! One observation at a time, for rollouts: the hidden state stays between calls.

use super::lstm::cell_forward;
use super::{Linear, Network};

/// Hidden state and cells of every LSTM layer.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    layers: Vec<[Vec<f32>; 2]>,
}

impl Network {
    /// The state before anything was seen.
    pub fn initial_state(&self) -> State {
        State { layers: self.lstm.iter().map(|l| [vec![0.0; l.hidden], vec![0.0; l.hidden]]).collect() }
    }

    /// The heads' outputs for one observation; moves `state` on.
    pub fn step(&self, parameters: &[f32], observation: &[f32], state: &mut State) -> Vec<Vec<f32>> {
        let mut x = observation.to_vec();
        for (layer, [hidden, cells]) in self.lstm.iter().zip(&mut state.layers) {
            let mut gates = Linear {
                inputs: layer.inputs,
                outputs: 4 * layer.hidden,
                weight: layer.weight_ih.clone(),
                bias: layer.bias_ih.clone(),
            }
            .apply(parameters, &x);
            let recurrent = Linear {
                inputs: layer.hidden,
                outputs: 4 * layer.hidden,
                weight: layer.weight_hh.clone(),
                bias: layer.bias_hh.clone(),
            };
            gates.iter_mut().zip(recurrent.apply(parameters, hidden)).for_each(|(g, r)| *g += r);
            let before = cells.clone();
            let mut tanh_cells = vec![0.0; layer.hidden];
            cell_forward(&mut gates, &before, cells, &mut tanh_cells, hidden);
            x.clone_from(hidden);
        }
        for layer in &self.mlp {
            x = layer.apply(parameters, &x);
            x.iter_mut().for_each(|v| *v = v.max(0.0));
        }
        self.heads.iter().map(|layer| layer.apply(parameters, &x)).collect()
    }
}

impl Linear {
    fn apply(&self, parameters: &[f32], x: &[f32]) -> Vec<f32> {
        let rows = parameters[self.weight.clone()].chunks_exact(self.inputs);
        rows.zip(&parameters[self.bias.clone()]).map(|(row, bias)| bias + dot(row, x)).collect()
    }
}

/// Eight running sums, so that they fit a vector register.
fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0f32; 8];
    let (whole_a, whole_b) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f32 = whole_a.remainder().iter().zip(whole_b.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in whole_a.zip(whole_b) {
        for k in 0..8 {
            sums[k] += x[k] * y[k];
        }
    }
    sums.iter().sum::<f32>() + rest
}
