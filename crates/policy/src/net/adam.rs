//! Adam (Kingma & Ba 2015) with PyTorch's order of operations and defaults.
//!
//! ```text
//! m = 0.9 m + 0.1 g      v = 0.999 v + 0.001 g^2      p -= rate / (1 - 0.9^t) m / (sqrt(v) / sqrt(1 - 0.999^t) + 1e-8)
//! ```

use super::math::vectorised;
use rayon::prelude::*;

const BETA_1: f64 = 0.9;
const BETA_2: f64 = 0.999;
const EPSILON: f32 = 1e-8;
/// Numbers that one thread updates at a time: three arrays of this fit into a core's cache.
const BLOCK: usize = 16_384;

/// The state of the optimiser: one number of each mean per parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Adam {
    /// Running means of the gradient.
    pub first: Vec<f32>,
    /// Running means of the square of the gradient.
    pub second: Vec<f32>,
    /// Steps taken.
    pub steps: u64,
}

impl Adam {
    /// Before the first step of so many parameters.
    pub fn new(parameters: usize) -> Self {
        Self { first: vec![0.0; parameters], second: vec![0.0; parameters], steps: 0 }
    }

    /// One step along the sum of `gradients`, added in their order.
    ///
    /// # Panics
    /// When the parameters or a gradient are not as many as the state is for.
    pub fn step(&mut self, parameters: &mut [f32], gradients: &[&[f32]], rate: f64) {
        assert!(parameters.len() == self.first.len() && gradients.iter().all(|g| g.len() == parameters.len()));
        self.steps += 1;
        let t = self.steps.min(1_000_000) as i32;
        let rate = (rate / (1.0 - BETA_1.powi(t))) as f32;
        let root = (1.0 - BETA_2.powi(t)).sqrt() as f32;
        let blocks = parameters.par_chunks_mut(BLOCK);
        let blocks = blocks.zip(self.first.par_chunks_mut(BLOCK)).zip(self.second.par_chunks_mut(BLOCK)).enumerate();
        blocks.for_each(|(i, ((p, m), v))| {
            let mut sum = [0.0f32; BLOCK];
            let sum = &mut sum[..p.len()];
            for (k, g) in gradients.iter().enumerate() {
                let g = &g[i * BLOCK..][..sum.len()];
                if k == 0 { sum.copy_from_slice(g) } else { add(sum, g) }
            }
            update(p, m, v, sum, rate, root);
        });
    }
}

vectorised! {
    /// Adds `from` to `to`, number by number.
    pub fn add(to: &mut [f32], from: &[f32]) {
        to.iter_mut().zip(from).for_each(|(t, f)| *t += f);
    }
}

vectorised! {
    /// One block: both means, then the parameters; `g` is the gradient.
    pub fn update(p: &mut [f32], m: &mut [f32], v: &mut [f32], g: &[f32], rate: f32, root: f32) {
        let n = g.len();
        let (p, m, v) = (&mut p[..n], &mut m[..n], &mut v[..n]);
        for j in 0..n {
            m[j] += (g[j] - m[j]) * (1.0 - BETA_1) as f32;
            v[j] = v[j] * BETA_2 as f32 + g[j] * g[j] * (1.0 - BETA_2) as f32;
            p[j] -= rate * (m[j] / (v[j].sqrt() / root + EPSILON));
        }
    }
}
