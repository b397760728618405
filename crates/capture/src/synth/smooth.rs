//! Noise that neighbouring pixels share.

use hingecast_geom::random::normal;

/// Noise of unit variance at its nodes, bilinear between them.
pub(super) struct Smooth {
    nodes: Vec<f64>,
    columns: usize,
    cell: f64,
}

impl Smooth {
    /// Of a picture of `w` x `h` pixels; nodes are `cell` pixels apart.
    pub fn new(w: usize, h: usize, cell: f64, rng: &mut fastrand::Rng) -> Self {
        let columns = (w as f64 / cell) as usize + 2;
        let rows = (h as f64 / cell) as usize + 2;
        Self { nodes: (0..columns * rows).map(|_| normal(rng)).collect(), columns, cell }
    }

    pub fn at(&self, x: usize, y: usize) -> f64 {
        let (u, v) = (x as f64 / self.cell, y as f64 / self.cell);
        let (c, r) = (u as usize, v as usize);
        let (fu, fv) = (u.fract(), v.fract());
        let node = |dc: usize, dr: usize| self.nodes[(r + dr) * self.columns + c + dc];
        (node(0, 0) * (1.0 - fu) + node(1, 0) * fu) * (1.0 - fv) + (node(0, 1) * (1.0 - fu) + node(1, 1) * fu) * fv
    }
}
