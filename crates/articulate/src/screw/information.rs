//! How sharply the depth of a state holds the pose of a part: the normal matrix of point to plane, r = n . (X - y), by a twist of
//! the part (v, w) in the world frame, dr = n . v + (X x n) . w.

use super::doubts::CORRELATED;
use super::evidence::Evidence;
use super::settle::Settled;
use nalgebra::{Matrix6, Vector6};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Nats per squared twist (v, w): rows of the upper triangle, one after the other.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Information(Vec<f64>);

impl Information {
    pub fn new(m: &Matrix6<f64>) -> Self {
        Self((0..6).flat_map(|i| (i..6).map(move |k| (i, k))).map(|at| m[at]).collect())
    }

    /// The whole matrix; what a damaged file leaves out counts as nothing known.
    pub fn matrix(&self) -> Matrix6<f64> {
        let mut entries = self.0.iter();
        let mut m = Matrix6::zeros();
        for i in 0..6 {
            for k in i..6 {
                m[(i, k)] = entries.next().copied().unwrap_or(0.0);
                m[(k, i)] = m[(i, k)];
            }
        }
        m
    }
}

/// Of every state and part. Neighbouring samples share their noise, so they count in groups.
pub fn of_parts(evidence: &Evidence, labels: &[Vec<u8>], found: &Settled) -> Vec<Vec<Information>> {
    let weight = 1.0 / (CORRELATED * found.report.rms.powi(2).max(1e-300));
    let of_state = |state: usize| {
        let cloud = &evidence.clouds[state];
        let mut sums = vec![Matrix6::zeros(); found.tree.parts.len()];
        for ((x, n), part) in cloud.points.iter().zip(&cloud.normals).zip(&labels[state]) {
            let (x, n) = (x.as_dvec3(), n.as_dvec3());
            let turn = x.cross(n);
            let row = Vector6::new(n.x, n.y, n.z, turn.x, turn.y, turn.z);
            sums[*part as usize] += row * row.transpose() * weight;
        }
        sums.iter().map(Information::new).collect()
    };
    (0..evidence.n_states()).into_par_iter().map(of_state).collect()
}
