//! The local-rigidity losses of Dynamic 3D Gaussians (Luiten et al. 2024, eqs. 5-8) with analytic gradients.
//!
//! For gaussian i, neighbour j, previous state p:
//! ```text
//! rigid     w | (x_j - x_i)_p  -  R_i,p R_i^-1 (x_j - x_i) |     neighbours move as i turns
//! rotation  w | q_j q_j,p^-1   -  q_i q_i,p^-1 |                 neighbours turn alike
//! isometry  w | |x_j - x_i|_0  -  |x_j - x_i| |                  distances stay as in the first state
//! ```
//! each averaged over all pairs; w = exp(-d_ij^2 / (2 h^2)) with h the mean neighbour distance, so that the
//! falloff follows the object's size. Lengths are divided by the diagonal before they are weighed.

use rayon::prelude::*;

/// Neighbours per gaussian, as published.
pub const K: usize = 20;

#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PhysicsWeights {
    pub rigid: f32,
    pub rotation: f32,
    pub isometry: f32,
}

impl Default for PhysicsWeights {
    fn default() -> Self {
        Self { rigid: 4.0, rotation: 4.0, isometry: 2.0 }
    }
}

/// The fixed graph of neighbours from the first state.
pub struct Neighbourhood {
    /// (n, K) indices.
    index: Vec<u32>,
    /// (n, K) weights.
    weight: Vec<f32>,
    /// (n, K) distances in the first state.
    rest: Vec<f32>,
    /// Edges that end in gaussian i: reverse[start[i]..start[i+1]].
    start: Vec<u32>,
    reverse: Vec<u32>,
    inv_diagonal: f32,
    edges: Vec<[f32; 7]>,
}

impl Neighbourhood {
    /// `near[i]`: the K nearest neighbours of gaussian i in the first state, whose positions are `means`.
    ///
    /// # Panics
    /// When a list does not hold exactly K neighbours.
    pub fn new(means: &[[f32; 3]], near: &[Vec<u32>], diagonal: f64) -> Self {
        let n = means.len();
        let mut index = Vec::with_capacity(n * K);
        let mut rest = Vec::with_capacity(n * K);
        for (i, list) in near.iter().enumerate() {
            assert_eq!(list.len(), K);
            for &j in list {
                index.push(j);
                rest.push(length(sub(means[j as usize], means[i])));
            }
        }
        let h = rest.iter().sum::<f32>() / rest.len().max(1) as f32;
        let weight = rest.iter().map(|d| (-d * d / (2.0 * h * h).max(1e-20)).exp()).collect();
        let mut start = vec![0u32; n + 1];
        index.iter().for_each(|&j| start[j as usize + 1] += 1);
        (0..n).for_each(|i| start[i + 1] += start[i]);
        let mut fill = start.clone();
        let mut reverse = vec![0u32; index.len()];
        for (e, &j) in index.iter().enumerate() {
            reverse[fill[j as usize] as usize] = e as u32;
            fill[j as usize] += 1;
        }
        let edges = vec![[0.0; 7]; index.len()];
        Self { index, weight, rest, start, reverse, inv_diagonal: 1.0 / diagonal as f32, edges }
    }

    /// Adds the gradients of the three losses at `means`, `quats` (wxyz, any length > 0) to `grad_means`,
    /// `grad_quats`, given the previous state. Answers the loss. The same bytes on any number of threads.
    pub fn add_gradients(
        &mut self,
        means: &[[f32; 3]],
        quats: &[[f32; 4]],
        previous_means: &[[f32; 3]],
        previous_quats: &[[f32; 4]],
        weights: &PhysicsWeights,
        grad_means: &mut [[f32; 3]],
        grad_quats: &mut [[f32; 4]],
    ) -> f64 {
        let per_edge = 1.0 / self.index.len().max(1) as f32;
        let (index, weight, rest, inv_diagonal) = (&self.index, &self.weight, &self.rest, self.inv_diagonal);
        // What turned each gaussian since the previous state: u = q q_p^-1, and q's own rotation.
        let turned: Vec<([f32; 4], [f32; 4])> = quats
            .par_iter()
            .zip(previous_quats)
            .map(|(q, p)| {
                let q = unit(*q);
                (q, multiply(q, conjugate(unit(*p))))
            })
            .collect();

        // First pass, by source gaussian: per-edge gradients, and the rigid loss's gradient of the own rotation.
        let own: Vec<(f64, [f32; 4])> = self
            .edges
            .par_chunks_mut(K)
            .enumerate()
            .map(|(i, edges)| {
                let (q, u_i) = turned[i];
                let r = matrix(q);
                let r_previous = matrix(unit(previous_quats[i]));
                let mut loss = 0.0f64;
                let mut grad_r = [[0.0f32; 3]; 3];
                for (k, edge) in edges.iter_mut().enumerate() {
                    let e = i * K + k;
                    let (j, w) = (index[e] as usize, weight[e] * per_edge);
                    let d = sub(means[j], means[i]);
                    let before = sub(previous_means[j], previous_means[i]);
                    // rigid, seen from the gaussian's own frame: R_p' before - R' d
                    let back = sub(transpose_times(&r_previous, before), transpose_times(&r, d));
                    let size = length(back).max(1e-12);
                    let scale = weights.rigid * w * inv_diagonal;
                    loss += (scale * size) as f64;
                    let g = back.map(|x| -x / size * scale);
                    let mut grad_d = times(&r, g);
                    for a in 0..3 {
                        for b in 0..3 {
                            grad_r[a][b] += d[a] * g[b];
                        }
                    }
                    // isometry
                    let now = length(d).max(1e-12);
                    let stretch = now - rest[e];
                    let scale = weights.isometry * w * inv_diagonal;
                    loss += (scale * stretch.abs()) as f64;
                    let s = scale * stretch.signum() / now;
                    (0..3).for_each(|a| grad_d[a] += s * d[a]);
                    // rotation
                    let u_j = turned[j].1;
                    let du: [f32; 4] = std::array::from_fn(|a| u_j[a] - u_i[a]);
                    let size = du.iter().map(|x| x * x).sum::<f32>().sqrt().max(1e-12);
                    let scale = weights.rotation * w;
                    loss += (scale * size) as f64;
                    let gu = du.map(|x| x / size * scale);
                    *edge = [grad_d[0], grad_d[1], grad_d[2], gu[0], gu[1], gu[2], gu[3]];
                }
                (loss, matrix_gradient(q, &grad_r))
            })
            .collect();

        // Second pass, by receiving gaussian: its own edges pull with -g, the edges that end in it with +g.
        let (edges, start, reverse) = (&self.edges, &self.start, &self.reverse);
        grad_means.par_iter_mut().zip(grad_quats.par_iter_mut()).enumerate().for_each(|(i, (gm, gq))| {
            let mut sum = [0.0f32; 7];
            for edge in &edges[i * K..(i + 1) * K] {
                (0..7).for_each(|a| sum[a] -= edge[a]);
            }
            for &e in &reverse[start[i] as usize..start[i + 1] as usize] {
                (0..7).for_each(|a| sum[a] += edges[e as usize][a]);
            }
            (0..3).for_each(|a| gm[a] += sum[a]);
            // u = q p^-1: right multiplication by a unit quaternion is orthogonal, its transpose multiplies by p.
            let from_u = multiply([sum[3], sum[4], sum[5], sum[6]], unit(previous_quats[i]));
            let total: [f32; 4] = std::array::from_fn(|a| from_u[a] + own[i].1[a]);
            // Through the normalisation q / |q|.
            let size = quats[i].iter().map(|x| x * x).sum::<f32>().sqrt().max(1e-12);
            let q = turned[i].0;
            let along: f32 = (0..4).map(|a| total[a] * q[a]).sum();
            (0..4).for_each(|a| gq[a] += (total[a] - along * q[a]) / size);
        });
        own.iter().map(|o| o.0).sum()
    }
}

fn sub(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn length(a: [f32; 3]) -> f32 {
    (a[0] * a[0] + a[1] * a[1] + a[2] * a[2]).sqrt()
}

fn unit(q: [f32; 4]) -> [f32; 4] {
    let n = q.iter().map(|x| x * x).sum::<f32>().sqrt().max(1e-12);
    q.map(|x| x / n)
}

fn conjugate(q: [f32; 4]) -> [f32; 4] {
    [q[0], -q[1], -q[2], -q[3]]
}

fn multiply(a: [f32; 4], b: [f32; 4]) -> [f32; 4] {
    [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    ]
}

/// Rotation matrix of a unit quaternion, row-major.
fn matrix([w, x, y, z]: [f32; 4]) -> [[f32; 3]; 3] {
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
}

fn times(m: &[[f32; 3]; 3], v: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|a| m[a][0] * v[0] + m[a][1] * v[1] + m[a][2] * v[2])
}

fn transpose_times(m: &[[f32; 3]; 3], v: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|a| m[0][a] * v[0] + m[1][a] * v[1] + m[2][a] * v[2])
}

/// dL/dq of `matrix(q)` given dL/dR.
fn matrix_gradient([w, x, y, z]: [f32; 4], g: &[[f32; 3]; 3]) -> [f32; 4] {
    [
        2.0 * (x * (g[2][1] - g[1][2]) + y * (g[0][2] - g[2][0]) + z * (g[1][0] - g[0][1])),
        2.0 * (w * (g[2][1] - g[1][2]) + y * (g[0][1] + g[1][0]) + z * (g[0][2] + g[2][0])
            - 2.0 * x * (g[1][1] + g[2][2])),
        2.0 * (w * (g[0][2] - g[2][0]) + x * (g[0][1] + g[1][0]) + z * (g[1][2] + g[2][1])
            - 2.0 * y * (g[0][0] + g[2][2])),
        2.0 * (w * (g[1][0] - g[0][1]) + x * (g[0][2] + g[2][0]) + y * (g[1][2] + g[2][1])
            - 2.0 * z * (g[0][0] + g[1][1])),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Scene {
        hood: Neighbourhood,
        means: Vec<[f32; 3]>,
        quats: Vec<[f32; 4]>,
        before: (Vec<[f32; 3]>, Vec<[f32; 4]>),
    }

    fn scene() -> Scene {
        let mut rng = fastrand::Rng::with_seed(2);
        let mut random = |n: usize| (0..n).map(|_| rng.f32() - 0.5).collect::<Vec<f32>>();
        let n = 40;
        let means: Vec<[f32; 3]> = (0..n).map(|_| random(3).try_into().unwrap()).collect();
        let near = crate::track::neighbours(&means, K);
        let hood = Neighbourhood::new(&means, &near, 1.7);
        let mut jitter = |a: f32| random(1)[0] * a;
        let moved = means.iter().map(|x| x.map(|v| v + jitter(0.2))).collect();
        let quats = (0..n).map(|_| [1.0 + jitter(0.3), jitter(0.8), jitter(0.8), jitter(0.8)]).collect();
        let quats_before = (0..n).map(|_| [1.0, jitter(0.5), jitter(0.5), jitter(0.5)]).collect();
        Scene { hood, means: moved, quats, before: (means, quats_before) }
    }

    fn evaluate(s: &mut Scene) -> (f64, Vec<[f32; 3]>, Vec<[f32; 4]>) {
        let (mut gm, mut gq) = (vec![[0.0; 3]; s.means.len()], vec![[0.0; 4]; s.means.len()]);
        let weights = PhysicsWeights::default();
        let (m, q, b) = (s.means.clone(), s.quats.clone(), s.before.clone());
        let loss = s.hood.add_gradients(&m, &q, &b.0, &b.1, &weights, &mut gm, &mut gq);
        (loss, gm, gq)
    }

    #[test]
    fn gradients_agree_with_central_differences() {
        let mut s = scene();
        let (_, gm, gq) = evaluate(&mut s);
        let step = 3e-4;
        for i in [0, 7, 23] {
            for a in 0..7 {
                let mut at = |delta: f32| {
                    let slot = if a < 3 { &mut s.means[i][a] } else { &mut s.quats[i][a - 3] };
                    *slot += delta;
                    let loss = evaluate(&mut s).0;
                    let slot = if a < 3 { &mut s.means[i][a] } else { &mut s.quats[i][a - 3] };
                    *slot -= delta;
                    loss
                };
                let numeric = (at(step) - at(-step)) / (2.0 * step as f64);
                let analytic = if a < 3 { gm[i][a] } else { gq[i][a - 3] } as f64;
                let scale = numeric.abs().max(analytic.abs()).max(2e-3);
                assert!((numeric - analytic).abs() < 0.02 * scale, "{i} {a}: {numeric} against {analytic}");
            }
        }
    }

    #[test]
    fn a_rigid_move_costs_nothing() {
        let mut s = scene();
        let q = unit([0.9, 0.2, -0.3, 0.1]);
        let r = matrix(q);
        s.means = s.before.0.iter().map(|x| times(&r, *x).map(|v| v + 0.3)).collect();
        s.quats = s.before.1.iter().map(|p| multiply(q, *p)).collect();
        assert!(evaluate(&mut s).0 < 1e-5);
    }
}
