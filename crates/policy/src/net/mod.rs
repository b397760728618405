//! The networks of behaviour cloning, forward and backward by hand: LSTM layers, an MLP, linear
//! heads, Adam.
//!
//! ```text
//! observation (inputs) -> [LSTM x layers] -> [linear + ReLU] x mlp -> heads
//! heads: action | mean, scale | mean, scale, logits
//! ```
//! Names, order of parameters and initial values are those of robomimic 0.3 on PyTorch
//! (`models/base_nets.py`, `models/policy_nets.py`), so that weights go from one to the other by
//! name. Everything is row-major f32; a batch of B sequences of T steps is T x B rows, the rows of
//! one time together. [`mod@reference`] is the slow twin in f64.

mod adam;
mod gemm;
mod head;
mod lstm;
mod math;
mod network;
pub mod reference;
mod step;

pub use adam::Adam;
pub use head::{EVAL_STD, sample};
pub use network::{Batch, Workspace};
pub use step::State;

use crate::ACTION_SIZE;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// What the last layer says about the action.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Head {
    /// The action itself, tanh; mean squared error.
    Action,
    /// One gaussian; negative log likelihood.
    Gaussian,
    /// A mixture of gaussians; negative log likelihood.
    Gmm,
}

/// The shape of a network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NetConfig {
    /// Stacked LSTM layers; 0 = none: an MLP that sees one step.
    pub rnn_layers: usize,
    /// Hidden numbers of an LSTM layer.
    pub rnn_hidden: usize,
    /// Sizes of the layers with ReLU before the heads (robomimic's actor_layer_dims).
    pub actor_layer_dims: Vec<usize>,
    /// action, gaussian or gmm.
    pub head: Head,
    /// Gaussians of the mixture (gmm).
    pub num_modes: usize,
    /// Least standard deviation in training, in units of the action (gaussian, gmm).
    pub min_std: f64,
    /// Standard deviation that an output of 0 stands for, in units of the action (gaussian).
    pub init_std: f64,
}

impl Default for NetConfig {
    /// robomimic's settings for BC-RNN on Lift from low-dimensional observations.
    fn default() -> Self {
        Self {
            rnn_layers: 2,
            rnn_hidden: 400,
            actor_layer_dims: Vec::new(),
            head: Head::Gmm,
            num_modes: 5,
            min_std: 1e-4,
            init_std: 0.1,
        }
    }
}

impl NetConfig {
    /// What no network can be made of: in words, with the field's name and value.
    ///
    /// # Errors
    /// The first such field.
    pub fn check(&self) -> Result<(), String> {
        let sizes = [("rnn_layers", self.rnn_layers, 0, 16), ("num_modes", self.num_modes, 1, 1000)];
        let hidden = [("rnn_hidden", self.rnn_hidden)].into_iter();
        let hidden = hidden.chain(self.actor_layer_dims.iter().map(|n| ("actor_layer_dims", *n)));
        for (name, value, least, most) in sizes.into_iter().chain(hidden.map(|(name, n)| (name, n, 1, 16_384))) {
            if !(least..=most).contains(&value) {
                return Err(format!("{name} = {value}, {least} to {most} is expected"));
            }
        }
        for (name, value) in [("min_std", self.min_std), ("init_std", self.init_std)] {
            if !(value > 0.0 && value <= 7.5) {
                return Err(format!("{name} = {value}, above 0 and at most 7.5 is expected"));
            }
        }
        Ok(())
    }
}

/// A named block of the parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Tensor {
    /// robomimic's name.
    pub name: String,
    /// Rows and columns of a matrix; one number for a vector.
    pub shape: Vec<usize>,
    /// Where its numbers, row-major, lie among the parameters.
    pub range: Range<usize>,
    /// Initial values are uniform in +- this.
    bound: f64,
}

/// y = x W' + b.
#[derive(Clone, Debug)]
struct Linear {
    inputs: usize,
    outputs: usize,
    /// (outputs, inputs)
    weight: Range<usize>,
    bias: Range<usize>,
}

#[derive(Clone, Debug)]
struct LstmLayer {
    inputs: usize,
    hidden: usize,
    /// (4 hidden, inputs): input, forget, cell, output gate.
    weight_ih: Range<usize>,
    /// (4 hidden, hidden)
    weight_hh: Range<usize>,
    /// PyTorch keeps two biases whose sum acts; so do we, because Adam moves both.
    bias_ih: Range<usize>,
    bias_hh: Range<usize>,
}

/// The shape of a network: where each parameter lies. The numbers themselves are with the caller.
#[derive(Clone, Debug)]
pub struct Network {
    /// The shape that it was made from.
    pub config: NetConfig,
    /// Numbers of an observation.
    pub inputs: usize,
    /// In order; they cover all parameters.
    pub tensors: Vec<Tensor>,
    lstm: Vec<LstmLayer>,
    mlp: Vec<Linear>,
    /// action | mean, scale | mean, scale, logits
    heads: Vec<Linear>,
}

impl Network {
    /// Lays the parameters out for observations of `inputs` numbers.
    pub fn new(config: &NetConfig, inputs: usize) -> Self {
        let mut net =
            Self { config: config.clone(), inputs, tensors: vec![], lstm: vec![], mlp: vec![], heads: vec![] };
        let (mut width, hidden) = (inputs, config.rnn_hidden);
        // The recurrent layers first, as `parameters()` of robomimic's networks lists the LSTM
        // after MLP and decoder; the order matters to nobody: Adam works per number and files are
        // read by name.
        for layer in 0..config.rnn_layers {
            let bound = 1.0 / (hidden as f64).sqrt();
            let mut push =
                |what: &str, shape: &[usize]| net.push(format!("policy.nets.rnn.nets.{what}_l{layer}"), shape, bound);
            let weight_ih = push("weight_ih", &[4 * hidden, width]);
            let weight_hh = push("weight_hh", &[4 * hidden, hidden]);
            let bias_ih = push("bias_ih", &[4 * hidden]);
            let bias_hh = push("bias_hh", &[4 * hidden]);
            net.lstm.push(LstmLayer { inputs: width, hidden, weight_ih, weight_hh, bias_ih, bias_hh });
            width = hidden;
        }
        for (i, outputs) in config.actor_layer_dims.iter().enumerate() {
            // Every second module of PyTorch's Sequential is the ReLU.
            let linear = net.linear(&format!("policy.nets.mlp._model.{}", 2 * i), width, *outputs);
            net.mlp.push(linear);
            width = *outputs;
        }
        let modes = config.num_modes;
        let heads: &[(&str, usize)] = match config.head {
            Head::Action => &[("action", ACTION_SIZE)],
            Head::Gaussian => &[("mean", ACTION_SIZE), ("scale", ACTION_SIZE)],
            Head::Gmm => &[("mean", modes * ACTION_SIZE), ("scale", modes * ACTION_SIZE), ("logits", modes)],
        };
        for (name, outputs) in heads {
            let linear = net.linear(&format!("policy.nets.decoder.nets.{name}"), width, *outputs);
            net.heads.push(linear);
        }
        net
    }

    fn push(&mut self, name: String, shape: &[usize], bound: f64) -> Range<usize> {
        let start = self.parameters();
        let range = start..start + shape.iter().product::<usize>();
        self.tensors.push(Tensor { name, shape: shape.to_vec(), range: range.clone(), bound });
        range
    }

    fn linear(&mut self, name: &str, inputs: usize, outputs: usize) -> Linear {
        let bound = 1.0 / (inputs as f64).sqrt();
        let weight = self.push(format!("{name}.weight"), &[outputs, inputs], bound);
        let bias = self.push(format!("{name}.bias"), &[outputs], bound);
        Linear { inputs, outputs, weight, bias }
    }

    /// How many numbers there are to learn.
    pub fn parameters(&self) -> usize {
        self.tensors.last().map_or(0, |t| t.range.end)
    }

    /// PyTorch's defaults: U(+-1/sqrt(hidden)) in the LSTM, U(+-1/sqrt(inputs)) in linear layers,
    /// biases included.
    pub fn initial_parameters(&self, seed: u64) -> Vec<f32> {
        let mut rng = fastrand::Rng::with_seed(seed);
        let mut out = Vec::with_capacity(self.parameters());
        for tensor in &self.tensors {
            out.extend(tensor.range.clone().map(|_| (tensor.bound * (2.0 * rng.f64() - 1.0)) as f32));
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The number that robomimic prints for BC-RNN-GMM on Lift (19 observed numbers).
    #[test]
    fn lift_has_robomimics_number_of_parameters() {
        assert_eq!(Network::new(&NetConfig::default(), 19).parameters(), 1_986_875);
    }

    #[test]
    fn initial_values_fill_their_interval() {
        let net = Network::new(&NetConfig { rnn_hidden: 16, ..Default::default() }, 19);
        let parameters = net.initial_parameters(3);
        assert_eq!(parameters.len(), net.parameters());
        let hh = &net.tensors[1];
        assert_eq!((hh.name.as_str(), &hh.shape[..]), ("policy.nets.rnn.nets.weight_hh_l0", &[64, 16][..]));
        let largest = parameters[hh.range.clone()].iter().fold(0.0f32, |m, v| m.max(v.abs()));
        assert!(largest > 0.24 && largest <= 0.25, "{largest}");
        assert_ne!(parameters, net.initial_parameters(4));
    }
}
