//! Loss and gradient of a batch: parts of it on their own threads, added in a fixed order.

use super::gemm::{Matrix, fill_rows, gemm, sum_rows};
use super::lstm::{self, LstmMemory, Transposed};
use super::{Linear, Network, head};
use crate::ACTION_SIZE;
use rayon::prelude::*;

/// Sequences of one part of a batch. Fixed, so that sums have the same order with any number of
/// threads; large enough for the matrix products to be worth their packing.
const PART: usize = 50;

/// Sequences with the actions to learn. `observations`: (sequences, steps, inputs); `actions`:
/// (sequences, steps, 7).
#[derive(Clone, Copy)]
pub struct Batch<'a> {
    /// Number of sequences.
    pub sequences: usize,
    /// Steps of every sequence.
    pub steps: usize,
    /// What was seen before each action, as it goes into the network.
    pub observations: &'a [f32],
    /// What the demonstrator did then, each number in [-1, 1].
    pub actions: &'a [f32],
}

/// Memory that one step after the other uses again.
#[derive(Default)]
pub struct Workspace {
    /// Of each LSTM layer.
    transposed: Vec<Transposed>,
    parts: Vec<Part>,
}

#[derive(Default)]
struct Part {
    /// (T B, inputs): time-major.
    x: Vec<f32>,
    actions: Vec<f32>,
    lstm: Vec<LstmMemory>,
    /// (T B, outputs) of each layer with ReLU.
    mlp: Vec<Vec<f32>>,
    heads: Vec<Vec<f32>>,
    /// Gradients of what the heads, or the layer just done, were given; and a second one to write
    /// into.
    d_rows: Vec<f32>,
    d_next: Vec<f32>,
    loss: f64,
    gradients: Vec<f32>,
}

impl Workspace {
    /// Gradients of the last [`Network::loss_and_gradient`], one vector per part: their sum, in
    /// this order, is the gradient.
    pub fn gradients(&self) -> Vec<&[f32]> {
        self.parts.iter().map(|p| &p.gradients[..]).collect()
    }
}

impl Network {
    /// Mean loss over all rows of the batch; no gradients.
    ///
    /// # Panics
    /// When the batch is empty, its arrays do not fit its sizes, or the parameters are of another
    /// network.
    pub fn loss(&self, parameters: &[f32], batch: &Batch, workspace: &mut Workspace) -> f64 {
        self.run(parameters, batch, workspace, false)
    }

    /// Mean loss over all rows of the batch; the gradient is in the workspace afterwards.
    ///
    /// # Panics
    /// As [`Network::loss`].
    pub fn loss_and_gradient(&self, parameters: &[f32], batch: &Batch, workspace: &mut Workspace) -> f64 {
        self.run(parameters, batch, workspace, true)
    }

    fn run(&self, parameters: &[f32], batch: &Batch, workspace: &mut Workspace, backward: bool) -> f64 {
        let rows = batch.sequences * batch.steps;
        assert!(rows > 0 && batch.observations.len() == rows * self.inputs);
        assert!(batch.actions.len() == rows * ACTION_SIZE && parameters.len() == self.parameters());
        let weight = 1.0 / rows as f64;
        workspace.parts.resize_with(batch.sequences.div_ceil(PART), Part::default);
        workspace.transposed.resize_with(self.lstm.len(), Transposed::default);
        self.lstm.iter().zip(&mut workspace.transposed).for_each(|(layer, t)| t.update(layer, parameters));
        let transposed = &workspace.transposed;
        let parts = workspace.parts.par_iter_mut().enumerate();
        parts.for_each(|(i, part)| {
            let first = i * PART;
            let sequences = PART.min(batch.sequences - first);
            part.x.resize(sequences * batch.steps * self.inputs, 0.0);
            part.actions.resize(sequences * batch.steps * ACTION_SIZE, 0.0);
            time_major(batch.observations, first, sequences, batch.steps, self.inputs, &mut part.x);
            time_major(batch.actions, first, sequences, batch.steps, ACTION_SIZE, &mut part.actions);
            self.forward(parameters, transposed, sequences, batch.steps, part);
            part.loss = head::loss_and_gradient(&self.config, &mut part.heads, &part.actions, weight);
            if backward {
                part.gradients.resize(self.parameters(), 0.0);
                self.backward(parameters, sequences, batch.steps, part);
            }
        });
        workspace.parts.iter().map(|p| p.loss).sum()
    }

    fn forward(&self, parameters: &[f32], transposed: &[Transposed], sequences: usize, steps: usize, part: &mut Part) {
        let rows = sequences * steps;
        let Part { x, lstm, mlp, heads, .. } = part;
        lstm.resize_with(self.lstm.len(), LstmMemory::default);
        mlp.resize_with(self.mlp.len(), Vec::new);
        heads.resize_with(self.heads.len(), Vec::new);
        for (l, layer) in self.lstm.iter().enumerate() {
            let (below, here) = lstm.split_at_mut(l);
            let input = below.last().map_or(&x[..], |m| m.output(sequences, layer.inputs));
            lstm::forward(layer, parameters, &transposed[l], input, sequences, steps, &mut here[0]);
        }
        let features = self.features(x, lstm, sequences);
        for (l, layer) in self.mlp.iter().enumerate() {
            let (below, here) = mlp.split_at_mut(l);
            let input = below.last().map_or(features, |v| &v[..]);
            linear_forward(layer, parameters, input, rows, &mut here[0]);
            here[0].iter_mut().for_each(|v| *v = v.max(0.0));
        }
        let features = mlp.last().map_or(features, |v| &v[..]);
        for (layer, output) in self.heads.iter().zip(heads) {
            linear_forward(layer, parameters, features, rows, output);
        }
    }

    /// What the layers after the LSTM are given.
    fn features<'a>(&self, x: &'a [f32], lstm: &'a [LstmMemory], sequences: usize) -> &'a [f32] {
        self.lstm.last().zip(lstm.last()).map_or(x, |(layer, memory)| memory.output(sequences, layer.hidden))
    }

    /// From the gradients in `part.heads` down to the first layer.
    fn backward(&self, parameters: &[f32], sequences: usize, steps: usize, part: &mut Part) {
        let rows = sequences * steps;
        let Part { x, lstm, mlp, heads, d_rows, d_next, gradients, .. } = part;
        let features = self.features(x, lstm, sequences);

        // The heads share their input: their gradients of it add up.
        let input = mlp.last().map_or(features, |v| &v[..]);
        for (i, (layer, d_output)) in self.heads.iter().zip(&*heads).enumerate() {
            let keep = if i == 0 { 0.0 } else { 1.0 };
            linear_backward(layer, parameters, input, d_output, rows, gradients, Some((d_rows, keep)));
        }
        for (l, layer) in self.mlp.iter().enumerate().rev() {
            // ReLU: nothing flows where it was flat.
            d_rows.iter_mut().zip(&mlp[l]).for_each(|(d, v)| *d = if *v > 0.0 { *d } else { 0.0 });
            let input = if l > 0 { &mlp[l - 1][..] } else { features };
            let wanted = l > 0 || !self.lstm.is_empty();
            linear_backward(layer, parameters, input, d_rows, rows, gradients, wanted.then_some((&mut *d_next, 0.0)));
            std::mem::swap(d_rows, d_next);
        }
        for (l, layer) in self.lstm.iter().enumerate().rev() {
            let (below, here) = lstm.split_at_mut(l);
            let input = below.last().map_or(&x[..], |m| m.output(sequences, layer.inputs));
            d_next.resize(if l > 0 { rows * layer.inputs } else { 0 }, 0.0);
            let d_x = (l > 0).then_some(&mut d_next[..]);
            lstm::backward(layer, parameters, input, d_rows, sequences, steps, &mut here[0], gradients, d_x);
            std::mem::swap(d_rows, d_next);
        }
    }
}

/// (sequences, steps, width) -> (steps, sequences, width), of some of the sequences.
fn time_major(from: &[f32], first: usize, sequences: usize, steps: usize, width: usize, to: &mut [f32]) {
    for t in 0..steps {
        for b in 0..sequences {
            let source = ((first + b) * steps + t) * width;
            to[(t * sequences + b) * width..][..width].copy_from_slice(&from[source..source + width]);
        }
    }
}

fn linear_forward(layer: &Linear, parameters: &[f32], x: &[f32], rows: usize, out: &mut Vec<f32>) {
    out.resize(rows * layer.outputs, 0.0);
    fill_rows(out, &parameters[layer.bias.clone()]);
    let weight = Matrix::new(&parameters[layer.weight.clone()], layer.outputs, layer.inputs);
    gemm(Matrix::new(x, rows, layer.inputs), weight.transposed(), 1.0, out);
}

/// `d_x`: where the gradient of the input goes, and how much of what is there stays.
fn linear_backward(
    layer: &Linear,
    parameters: &[f32],
    x: &[f32],
    d_out: &[f32],
    rows: usize,
    gradients: &mut [f32],
    d_x: Option<(&mut Vec<f32>, f32)>,
) {
    let d = Matrix::new(d_out, rows, layer.outputs);
    gemm(d.transposed(), Matrix::new(x, rows, layer.inputs), 0.0, &mut gradients[layer.weight.clone()]);
    sum_rows(d_out, &mut gradients[layer.bias.clone()]);
    if let Some((d_x, keep)) = d_x {
        d_x.resize(rows * layer.inputs, 0.0);
        let weight = Matrix::new(&parameters[layer.weight.clone()], layer.outputs, layer.inputs);
        gemm(d, weight, keep, d_x);
    }
}
