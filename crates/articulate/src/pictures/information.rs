//! How sharply the depth of a state holds the pose of a part: the normal matrix of point to plane,
//! r = n . (X - y), by a twist of the part (v, w) in the world frame, dr = n . v + (X x n) . w.

use crate::model::estimate::Estimate;
use crate::model::twist::along;
use crate::observe::evidence::Evidence;
use crate::score::compare::CORRELATED;
use nalgebra::Matrix6;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Nats per squared twist (v, w): rows of the upper triangle, one after the other.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Information([f64; 21]);

/// Row and column of every entry.
fn places() -> impl Iterator<Item = (usize, usize)> {
    (0..6).flat_map(|i| (i..6).map(move |k| (i, k)))
}

impl Information {
    /// Keeps the upper triangle of a symmetric matrix.
    pub fn new(m: &Matrix6<f64>) -> Self {
        let mut out = [0.0; 21];
        out.iter_mut().zip(places()).for_each(|(entry, at)| *entry = m[at]);
        Self(out)
    }

    /// The whole matrix.
    pub fn matrix(&self) -> Matrix6<f64> {
        let mut m = Matrix6::zeros();
        for (entry, (i, k)) in self.0.iter().zip(places()) {
            (m[(i, k)], m[(k, i)]) = (*entry, *entry);
        }
        m
    }
}

/// Of every state and part. Neighbouring samples share their noise, so they count in groups.
pub fn of_parts(evidence: &Evidence, labels: &[Vec<u8>], found: &Estimate) -> Vec<Vec<Information>> {
    let weight = 1.0 / (CORRELATED * found.report.rms.powi(2).max(1e-300));
    let of_state = |state: usize| {
        let cloud = &evidence.clouds[state];
        let mut sums = vec![Matrix6::zeros(); found.tree.parts.len()];
        for ((x, n), part) in cloud.points.iter().zip(&cloud.normals).zip(&labels[state]) {
            let row = along(n.as_dvec3(), x.as_dvec3());
            sums[*part as usize] += row * row.transpose() * weight;
        }
        sums.iter().map(Information::new).collect()
    };
    (0..evidence.n_states()).into_par_iter().map(of_state).collect()
}
