//! One LSTM layer over a batch of sequences that begin with a state of zeros (Hochreiter &
//! Schmidhuber 1997, as PyTorch has it).
//!
//! ```text
//! [i f g o] = x W_ih' + b_ih + h W_hh' + b_hh      i f o through sigmoid, g through tanh
//! c' = f c + i g          h' = o tanh(c')
//! ```
//! Backward from dh' (from above, plus from the next step) and dc' (from the next step):
//! ```text
//! dc = dc' + dh' o (1 - tanh(c')^2)
//! di = dc g i (1-i)   df = dc c f (1-f)   dg = dc i (1-g^2)   do = dh' tanh(c') o (1-o)      (before the activations)
//! dh = [di df dg do] W_hh          passed back: dc f
//! ```

use super::LstmLayer;
use super::gemm::{Matrix, fill_rows, gemm, sum_rows, transpose};
use super::math::{sigmoid, tanh, vectorised};

/// What the backward pass needs of the forward pass. B sequences, T steps, H hidden.
#[derive(Default)]
pub struct LstmMemory {
    /// (T B, 4 H): the gates after their activations; in the backward pass the gradients before
    /// them.
    gates: Vec<f32>,
    /// ((T+1) B, H): row blocks 0 are the zeros before the first step.
    cells: Vec<f32>,
    hidden: Vec<f32>,
    /// (T B, H)
    tanh_cells: Vec<f32>,
    /// (B, H): what the next step passes back.
    next_hidden: Vec<f32>,
    next_cells: Vec<f32>,
    /// 4 H
    bias: Vec<f32>,
}

impl LstmMemory {
    fn resize(&mut self, sequences: usize, steps: usize, hidden: usize) {
        let (rows, block) = (sequences * steps, sequences * hidden);
        self.gates.resize(rows * 4 * hidden, 0.0);
        self.cells.resize(rows * hidden + block, 0.0);
        self.hidden.resize(rows * hidden + block, 0.0);
        self.tanh_cells.resize(rows * hidden, 0.0);
        self.next_hidden.resize(block, 0.0);
        self.next_cells.resize(block, 0.0);
        self.bias.resize(4 * hidden, 0.0);
        self.cells[..block].fill(0.0);
        self.hidden[..block].fill(0.0);
    }

    /// (T B, H): the hidden state after each step.
    pub fn output(&self, sequences: usize, hidden: usize) -> &[f32] {
        &self.hidden[sequences * hidden..]
    }
}

/// The weights transposed: (inputs, 4 H) and (H, 4 H). Once per training step, for all parts of a
/// batch.
#[derive(Default)]
pub struct Transposed {
    weight_ih: Vec<f32>,
    weight_hh: Vec<f32>,
}

impl Transposed {
    /// Transposes the layer's weights as they are in `parameters` now.
    pub fn update(&mut self, layer: &LstmLayer, parameters: &[f32]) {
        transpose(&parameters[layer.weight_ih.clone()], layer.inputs, &mut self.weight_ih);
        transpose(&parameters[layer.weight_hh.clone()], layer.hidden, &mut self.weight_hh);
    }
}

/// `x`: (T B, inputs).
pub fn forward(
    layer: &LstmLayer,
    parameters: &[f32],
    transposed: &Transposed,
    x: &[f32],
    sequences: usize,
    steps: usize,
    memory: &mut LstmMemory,
) {
    let (h, rows, block) = (layer.hidden, sequences * steps, sequences * layer.hidden);
    memory.resize(sequences, steps, h);
    let LstmMemory { gates, cells, hidden, tanh_cells, bias, .. } = memory;
    let (b_ih, b_hh) = (&parameters[layer.bias_ih.clone()], &parameters[layer.bias_hh.clone()]);
    bias.iter_mut().zip(b_ih.iter().zip(b_hh)).for_each(|(b, (i, h))| *b = i + h);

    // What the inputs say, for all steps in one product.
    let w_hh = Matrix::new(&transposed.weight_hh, h, 4 * h);
    fill_rows(gates, bias);
    gemm(Matrix::new(x, rows, layer.inputs), Matrix::new(&transposed.weight_ih, layer.inputs, 4 * h), 1.0, gates);

    for t in 0..steps {
        let gates = &mut gates[4 * t * block..4 * (t + 1) * block];
        let (hidden_before, hidden_after) = hidden[t * block..(t + 2) * block].split_at_mut(block);
        let (cells_before, cells_after) = cells[t * block..(t + 2) * block].split_at_mut(block);
        // The state before the first step is zero.
        if t > 0 {
            gemm(Matrix::new(hidden_before, sequences, h), w_hh, 1.0, gates);
        }
        let tanh_cells = &mut tanh_cells[t * block..(t + 1) * block];
        for b in 0..sequences {
            let r = b * h..(b + 1) * h;
            cell_forward(
                &mut gates[4 * b * h..4 * (b + 1) * h],
                &cells_before[r.clone()],
                &mut cells_after[r.clone()],
                &mut tanh_cells[r.clone()],
                &mut hidden_after[r],
            );
        }
    }
}

/// `x` as in the forward pass; `d_output`: (T B, H). Writes the layer's gradients; with `d_x` also
/// those of its inputs.
pub fn backward(
    layer: &LstmLayer,
    parameters: &[f32],
    x: &[f32],
    d_output: &[f32],
    sequences: usize,
    steps: usize,
    memory: &mut LstmMemory,
    gradients: &mut [f32],
    d_x: Option<&mut [f32]>,
) {
    let (h, rows, block) = (layer.hidden, sequences * steps, sequences * layer.hidden);
    let w_hh = Matrix::new(&parameters[layer.weight_hh.clone()], 4 * h, h);
    let LstmMemory { gates, cells, hidden, tanh_cells, next_hidden, next_cells, .. } = memory;
    next_hidden.fill(0.0);
    next_cells.fill(0.0);
    for t in (0..steps).rev() {
        let gates = &mut gates[4 * t * block..4 * (t + 1) * block];
        for b in 0..sequences {
            let r = b * h..(b + 1) * h;
            let at = |r: &std::ops::Range<usize>| t * block + r.start..t * block + r.end;
            cell_backward(
                &mut gates[4 * b * h..4 * (b + 1) * h],
                &cells[at(&r)],
                &tanh_cells[at(&r)],
                &d_output[at(&r)],
                &next_hidden[r.clone()],
                &mut next_cells[r],
            );
        }
        if t > 0 {
            gemm(Matrix::new(gates, sequences, 4 * h), w_hh, 0.0, next_hidden);
        }
    }

    // From here on `gates` holds their gradients, for all steps.
    let d_gates = Matrix::new(gates, rows, 4 * h);
    let before = Matrix::new(&hidden[..rows * h], rows, h);
    gemm(d_gates.transposed(), Matrix::new(x, rows, layer.inputs), 0.0, &mut gradients[layer.weight_ih.clone()]);
    gemm(d_gates.transposed(), before, 0.0, &mut gradients[layer.weight_hh.clone()]);
    sum_rows(gates, &mut gradients[layer.bias_ih.clone()]);
    gradients.copy_within(layer.bias_ih.clone(), layer.bias_hh.start);
    if let Some(d_x) = d_x {
        let w_ih = Matrix::new(&parameters[layer.weight_ih.clone()], 4 * h, layer.inputs);
        gemm(d_gates, w_ih, 0.0, d_x);
    }
}

vectorised! {
    /// One row: gates through their activations (in place), new cells and hidden state.
    pub fn cell_forward(gates: &mut [f32], before: &[f32], cells: &mut [f32], tanh_cells: &mut [f32], hidden: &mut [f32]) {
        let h = hidden.len();
        let (i, rest) = gates.split_at_mut(h);
        let (f, rest) = rest.split_at_mut(h);
        let (g, o) = rest.split_at_mut(h);
        let (o, before, cells, tanh_cells) = (&mut o[..h], &before[..h], &mut cells[..h], &mut tanh_cells[..h]);
        for j in 0..h {
            i[j] = sigmoid(i[j]);
            f[j] = sigmoid(f[j]);
            g[j] = tanh(g[j]);
            o[j] = sigmoid(o[j]);
            cells[j] = f[j] * before[j] + i[j] * g[j];
            tanh_cells[j] = tanh(cells[j]);
            hidden[j] = o[j] * tanh_cells[j];
        }
    }
}

vectorised! {
    /// One row: activations become gradients (in place); `next_cells` comes from the next step and
    /// leaves for the one before.
    pub fn cell_backward(
        gates: &mut [f32], before: &[f32], tanh_cells: &[f32], d_output: &[f32], next_hidden: &[f32], next_cells: &mut [f32],
    ) {
        let h = before.len();
        let (i, rest) = gates.split_at_mut(h);
        let (f, rest) = rest.split_at_mut(h);
        let (g, o) = rest.split_at_mut(h);
        let (o, tanh_cells, d_output) = (&mut o[..h], &tanh_cells[..h], &d_output[..h]);
        let (next_hidden, next_cells) = (&next_hidden[..h], &mut next_cells[..h]);
        for j in 0..h {
            let d_hidden = d_output[j] + next_hidden[j];
            let d_cell = next_cells[j] + d_hidden * o[j] * (1.0 - tanh_cells[j] * tanh_cells[j]);
            next_cells[j] = d_cell * f[j];
            let (gate_i, gate_g) = (i[j], g[j]);
            i[j] = d_cell * gate_g * gate_i * (1.0 - gate_i);
            g[j] = d_cell * gate_i * (1.0 - gate_g * gate_g);
            f[j] = d_cell * before[j] * f[j] * (1.0 - f[j]);
            o[j] = d_hidden * tanh_cells[j] * o[j] * (1.0 - o[j]);
        }
    }
}
