//! The local-rigidity losses of Dynamic 3D Gaussians (Luiten et al. 2024, eqs. 5-8) with analytic
//! gradients.
//!
//! For gaussian i, neighbour j, previous state p:
//! ```text
//! rigid     w | (x_j - x_i)_p  -  R_i,p R_i^-1 (x_j - x_i) |     neighbours move as i turns
//! rotation  w | q_j q_j,p^-1   -  q_i q_i,p^-1 |                 neighbours turn alike
//! isometry  w | |x_j - x_i|_0  -  |x_j - x_i| |                  distances stay as in the first state
//! ```
//! each averaged over all pairs; w = exp(-d_ij^2 / (2 h^2)) with h the mean neighbour distance, so
//! that the falloff follows the object's size. Lengths are divided by the diagonal before they are
//! weighed.

use rayon::prelude::*;

/// Neighbours per gaussian, as published.
pub const K: usize = 20;

/// Weights of the three losses.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PhysicsWeights {
    /// Neighbours keep their places in the frame that turns with a gaussian.
    pub rigid: f32,
    /// Neighbours turn alike.
    pub rotation: f32,
    /// Neighbours keep their distances of the first state.
    pub isometry: f32,
}

impl Default for PhysicsWeights {
    fn default() -> Self {
        Self { rigid: 4.0, rotation: 4.0, isometry: 2.0 }
    }
}

/// What a gaussian's neighbours need to know of it, in half a cache line: position, padding, what
/// turned it since the previous state (u = q q_p^-1).
type Node = [f32; 8];

/// Gradient that an edge i -> j exerts on j (and, negated, on i): by the position, padding, by u.
type Edge = [f32; 8];

/// The fixed graph of neighbours from the first state, and the state before the one that is being
/// fitted.
pub struct Neighbourhood {
    /// (n, K) indices.
    index: Vec<u32>,
    /// (n, K) weights / number of edges.
    weight: Vec<f32>,
    /// (n, K) distances in the first state.
    rest: Vec<f32>,
    /// Edges that end in gaussian i: `reverse[start[i]..start[i+1]]`.
    start: Vec<u32>,
    reverse: Vec<u32>,
    inv_diagonal: f32,
    /// Unit quaternions of the previous state. (n)
    previous_quats: Vec<[f32; 4]>,
    /// R_i,p^-1 (x_j - x_i)_p per edge, components apart. (n) x `[x, y, z][K]`
    previous_offsets: Vec<[[f32; K]; 3]>,
    edges: Vec<Edge>,
}

impl Neighbourhood {
    /// `near[i]`: the K nearest neighbours of gaussian i in the first state, whose positions are
    /// `means`.
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
        let per_edge = 1.0 / index.len().max(1) as f32;
        let weight = rest.iter().map(|d| per_edge * (-d * d / (2.0 * h * h).max(1e-20)).exp()).collect();
        let mut start = vec![0u32; n + 1];
        index.iter().for_each(|&j| start[j as usize + 1] += 1);
        (0..n).for_each(|i| start[i + 1] += start[i]);
        let mut fill = start.clone();
        let mut reverse = vec![0u32; index.len()];
        for (e, &j) in index.iter().enumerate() {
            reverse[fill[j as usize] as usize] = e as u32;
            fill[j as usize] += 1;
        }
        let edges = vec![[0.0; 8]; index.len()];
        let inv_diagonal = 1.0 / diagonal as f32;
        let (previous_quats, previous_offsets) = (Vec::new(), Vec::new());
        Self { index, weight, rest, start, reverse, inv_diagonal, previous_quats, previous_offsets, edges }
    }

    /// Sets the state before the one to be fitted: positions and quaternions (wxyz, any length >
    /// 0).
    pub fn set_previous(&mut self, means: &[[f32; 3]], quats: &[[f32; 4]]) {
        self.previous_quats = quats.iter().map(|q| unit(*q)).collect();
        let (index, quats) = (&self.index, &self.previous_quats);
        self.previous_offsets = (0..means.len())
            .into_par_iter()
            .map(|i| {
                let r = matrix(quats[i]);
                let mut out = [[0.0; K]; 3];
                for k in 0..K {
                    let back = transpose_times(&r, sub(means[index[i * K + k] as usize], means[i]));
                    (0..3).for_each(|a| out[a][k] = back[a]);
                }
                out
            })
            .collect();
    }

    /// Adds the gradients of the three losses at `means`, `quats` (wxyz, any length > 0) to
    /// `grad_means`, `grad_quats`. Answers the loss. The same bytes on any number of threads.
    ///
    /// # Panics
    /// When no previous state of the same size was set.
    pub fn add_gradients(
        &mut self,
        means: &[[f32; 3]],
        quats: &[[f32; 4]],
        weights: &PhysicsWeights,
        grad_means: &mut [[f32; 3]],
        grad_quats: &mut [[f32; 4]],
    ) -> f64 {
        assert_eq!(self.previous_quats.len(), means.len(), "set_previous first");
        let previous_quats = &self.previous_quats;
        let nodes: Vec<Node> = (0..means.len())
            .into_par_iter()
            .with_min_len(1024)
            .map(|i| {
                let ([x, y, z], u) = (means[i], multiply(unit(quats[i]), conjugate(previous_quats[i])));
                [x, y, z, 0.0, u[0], u[1], u[2], u[3]]
            })
            .collect();

        // First pass, by source gaussian: per-edge gradients, and the rigid loss's gradient of the
        // own rotation.
        let scales = [weights.rigid * self.inv_diagonal, weights.isometry * self.inv_diagonal, weights.rotation];
        let (index, weight, rest, offsets) = (&self.index, &self.weight, &self.rest, &self.previous_offsets);
        let own: Vec<(f32, [f32; 4])> = self
            .edges
            .par_chunks_mut(K)
            .with_min_len(256)
            .enumerate()
            .map(|(i, edges)| {
                let span = i * K..(i + 1) * K;
                let source = Source {
                    node: &nodes[i],
                    quat: unit(quats[i]),
                    index: &index[span.clone()],
                    weight: &weight[span.clone()],
                    rest: &rest[span],
                    offsets: &offsets[i],
                };
                pull(&source, &nodes, &scales, edges)
            })
            .collect();

        // Second pass, by receiving gaussian: its own edges pull with -g, the edges that end in it
        // with +g.
        let (edges, start, reverse) = (&self.edges, &self.start, &self.reverse);
        let receive = |(i, (gm, gq)): (usize, (&mut [f32; 3], &mut [f32; 4]))| {
            let mut sum = [0.0f32; 8];
            for edge in &edges[i * K..(i + 1) * K] {
                (0..8).for_each(|a| sum[a] -= edge[a]);
            }
            for &e in &reverse[start[i] as usize..start[i + 1] as usize] {
                let edge = &edges[e as usize];
                (0..8).for_each(|a| sum[a] += edge[a]);
            }
            (0..3).for_each(|a| gm[a] += sum[a]);
            // u = q p^-1: right multiplication by a unit quaternion is orthogonal, its transpose
            // multiplies by p.
            let from_u = multiply([sum[4], sum[5], sum[6], sum[7]], previous_quats[i]);
            let total: [f32; 4] = std::array::from_fn(|a| from_u[a] + own[i].1[a]);
            // Through the normalisation q / |q|.
            let size = quats[i].iter().map(|x| x * x).sum::<f32>().sqrt().max(1e-12);
            let q = unit(quats[i]);
            let along: f32 = (0..4).map(|a| total[a] * q[a]).sum();
            (0..4).for_each(|a| gq[a] += (total[a] - along * q[a]) / size);
        };
        grad_means.par_iter_mut().zip(grad_quats.par_iter_mut()).enumerate().with_min_len(256).for_each(receive);
        own.iter().map(|o| o.0 as f64).sum()
    }
}

/// One gaussian and its K edges.
struct Source<'a> {
    node: &'a Node,
    quat: [f32; 4],
    index: &'a [u32],
    weight: &'a [f32],
    rest: &'a [f32],
    offsets: &'a [[f32; K]; 3],
}

/// The first pass for one gaussian: writes its edges' gradients, answers the loss and dL/dq by its
/// own rotation. `scales`: rigid, isometry, rotation. The widest vectors that the CPU has; the bits
/// are the same with any.
fn pull(source: &Source, nodes: &[Node], scales: &[f32; 3], edges: &mut [Edge]) -> (f32, [f32; 4]) {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx2")]
        fn wide(source: &Source, nodes: &[Node], scales: &[f32; 3], edges: &mut [Edge]) -> (f32, [f32; 4]) {
            pull_lanes(source, nodes, scales, edges)
        }
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the feature was just found.
            return unsafe { wide(source, nodes, scales, edges) };
        }
    }
    pull_lanes(source, nodes, scales, edges)
}

/// Neighbours in lanes: every loop over `k` is one formula for all K edges, which the compiler
/// turns into vectors.
#[inline(always)]
fn pull_lanes(source: &Source, nodes: &[Node], scales: &[f32; 3], edges: &mut [Edge]) -> (f32, [f32; 4]) {
    let (mut d, mut du) = ([[0.0f32; K]; 3], [[0.0f32; K]; 4]);
    for k in 0..K {
        let other = &nodes[source.index[k] as usize];
        (0..3).for_each(|a| d[a][k] = other[a] - source.node[a]);
        (0..4).for_each(|a| du[a][k] = other[4 + a] - source.node[4 + a]);
    }
    let r = matrix(source.quat);
    let (weight, rest): (&[f32; K], &[f32; K]) =
        (source.weight.try_into().expect("K weights"), source.rest.try_into().expect("K distances"));
    let (mut g, mut pull_d) = ([[0.0f32; K]; 3], [[0.0f32; K]; 3]);
    let mut loss = [0.0f32; K];
    for k in 0..K {
        // rigid, seen from the gaussian's own frame: R_p' before - R' d
        let back: [f32; 3] =
            [0, 1, 2].map(|a| source.offsets[a][k] - (r[0][a] * d[0][k] + r[1][a] * d[1][k] + r[2][a] * d[2][k]));
        let size = (back[0] * back[0] + back[1] * back[1] + back[2] * back[2]).sqrt().max(1e-12);
        let scale = scales[0] * weight[k];
        let along = -scale / size;
        g[0][k] = back[0] * along;
        g[1][k] = back[1] * along;
        g[2][k] = back[2] * along;
        // isometry
        let now = (d[0][k] * d[0][k] + d[1][k] * d[1][k] + d[2][k] * d[2][k]).sqrt().max(1e-12);
        let stretch = now - rest[k];
        let iso = scales[1] * weight[k];
        let s = iso.copysign(stretch) / now;
        for a in 0..3 {
            pull_d[a][k] = r[a][0] * g[0][k] + r[a][1] * g[1][k] + r[a][2] * g[2][k] + s * d[a][k];
        }
        // rotation
        let turn =
            (du[0][k] * du[0][k] + du[1][k] * du[1][k] + du[2][k] * du[2][k] + du[3][k] * du[3][k]).sqrt().max(1e-12);
        let rotation = scales[2] * weight[k];
        let along = rotation / turn;
        (0..4).for_each(|a| du[a][k] *= along);
        loss[k] = scale * size + iso * stretch.abs() + rotation * turn;
    }
    let mut grad_r = [[0.0f32; 3]; 3];
    for a in 0..3 {
        for b in 0..3 {
            grad_r[a][b] = (0..K).map(|k| d[a][k] * g[b][k]).sum();
        }
    }
    for (k, edge) in edges.iter_mut().enumerate() {
        *edge = [pull_d[0][k], pull_d[1][k], pull_d[2][k], 0.0, du[0][k], du[1][k], du[2][k], du[3][k]];
    }
    (loss.iter().sum(), matrix_gradient(source.quat, &grad_r))
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

#[cfg(test)]
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
        let near = crate::classical::neighbours::neighbours(&means, K);
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
        s.hood.set_previous(&b.0, &b.1);
        let loss = s.hood.add_gradients(&m, &q, &weights, &mut gm, &mut gq);
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
