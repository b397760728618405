//! Parts as groups of gaussians whose distances to each other stay the same in all states.
//!
//! On a bounded number of gaussians the matrix D_ij = max over states |d_ij(s) - d_ij(0)| is
//! clustered (its rows are the features); rigid motions of the clusters then carry the labels to
//! all gaussians and settle the borders, which the distances alone leave vague near a hinge.

use super::cluster;
use super::motion::robust_kabsch;
use super::trajectories::Trajectories;
use crate::error::ArticulateError;
use glam::{DVec3, Vec3};
use hingecast_geom::{Pose, Progress};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// How gaussians are grouped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Clusterer {
    /// k-means++, the number of groups by silhouette.
    Kmeans,
    /// Density clusters.
    Hdbscan,
}

/// Settings of the grouping.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// How gaussians are grouped.
    pub cluster: Clusterer,
    /// Number of parts; 0 = chosen by the silhouette.
    pub parts: usize,
    /// Most parts that the silhouette may choose.
    pub max_parts: usize,
    /// Gaussians whose full distance matrix is clustered: n^2 floats, so 1500 take 9 MB.
    pub sample: usize,
    /// A part must hold at least this share of the gaussians.
    pub min_share: f64,
    /// Motions smaller than this share of the diagonal are noise of the tracking, not joints.
    pub noise: f64,
}

impl Default for Config {
    fn default() -> Self {
        Self { cluster: Clusterer::Kmeans, parts: 0, max_parts: 6, sample: 1500, min_share: 0.01, noise: 0.02 }
    }
}

/// Parts, and the motion of each between the first state and every state.
#[derive(Clone, Debug)]
pub struct Segmentation {
    /// Part of each gaussian; part 0 moves least. (n)
    pub labels: Vec<u8>,
    /// World at state s from world at state 0. `[part][state]`
    pub motions: Vec<Vec<Pose>>,
    /// Mean silhouette per part count tried, for the report.
    pub silhouettes: Vec<(usize, f64)>,
}

/// `reliable[i]`: gaussian i is opaque and was seen; only those are clustered.
///
/// # Errors
/// When there are too few reliable gaussians, or on request.
pub fn run(
    tracks: &Trajectories,
    reliable: &[bool],
    diagonal: f64,
    config: &Config,
    seed: u64,
    progress: &Progress,
) -> Result<Segmentation, ArticulateError> {
    let good: Vec<usize> = (0..reliable.len()).filter(|&i| reliable[i]).collect();
    if good.len() < 50 {
        return Err(ArticulateError::Input {
            what: format!("only {} gaussians are opaque and seen: nothing to group into parts", good.len()),
            place: "stage parts, the gaussians of the first state".into(),
            hint: "look at the report's renders: do the masks show the object? more views or `--set fit.gaussians=30000` help".into(),
        });
    }
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut sample = good.clone();
    rng.shuffle(&mut sample);
    sample.truncate(config.sample);
    sample.sort_unstable();
    let change = distance_change(tracks, &sample);
    progress.check()?;

    // The tracking's own jitter: what half of each gaussian's nearest neighbours' distances change
    // by anyway.
    let largest = change.par_iter().map(|r| r.iter().copied().fold(0.0, f32::max)).reduce(|| 0.0, f32::max);
    let mut silhouettes = Vec::new();
    let labels_of_sample = if (largest as f64) < config.noise * diagonal && config.parts == 0 {
        vec![0; sample.len()]
    } else {
        choose(&change, config, seed, &mut silhouettes)
    };
    progress.check()?;

    let k = labels_of_sample.iter().max().map_or(1, |m| m + 1);
    let mut labels: Vec<Option<u8>> = vec![None; reliable.len()];
    for (&i, &l) in sample.iter().zip(&labels_of_sample) {
        labels[i] = Some(l as u8);
    }
    let mut motions = rigid_motions(tracks, &labels, k);
    // Alternate: every gaussian to the motion that explains its track best, then the motions anew.
    for _ in 0..5 {
        let assigned = assign(tracks, &motions, None);
        for &i in &good {
            labels[i] = Some(assigned[i]);
        }
        motions = rigid_motions(tracks, &labels, k);
        progress.check()?;
    }
    let motions = sort_and_merge(tracks, &labels, motions, diagonal, config);
    let neighbours = crate::classical::neighbours::neighbours(&tracks.means[0], 12);
    let labels = assign(tracks, &motions, Some(&neighbours));
    Ok(Segmentation { labels, motions, silhouettes })
}

/// D_ij over the sampled gaussians.
fn distance_change(tracks: &Trajectories, sample: &[usize]) -> Vec<Vec<f32>> {
    let at: Vec<Vec<Vec3>> =
        tracks.means.iter().map(|state| sample.iter().map(|&i| Vec3::from(state[i])).collect()).collect();
    (0..sample.len())
        .into_par_iter()
        .map(|i| {
            let first: Vec<f32> = at[0].iter().map(|x| x.distance(at[0][i])).collect();
            let mut worst = vec![0.0f32; sample.len()];
            for state in &at[1..] {
                for j in 0..sample.len() {
                    worst[j] = worst[j].max((state[j].distance(state[i]) - first[j]).abs());
                }
            }
            worst
        })
        .collect()
}

/// Labels of the sample: the part count with the best silhouette, or the one that was asked for.
fn choose(change: &[Vec<f32>], config: &Config, seed: u64, silhouettes: &mut Vec<(usize, f64)>) -> Vec<usize> {
    if config.cluster == Clusterer::Hdbscan {
        let rows = principal(change, 6, seed);
        let least = ((config.min_share * change.len() as f64) as usize).max(15);
        if let Some(labels) = cluster::hdbscan(&rows, least) {
            let k = labels.iter().max().map_or(1, |m| m + 1);
            silhouettes.push((k, cluster::silhouette(change, &labels)));
            return labels;
        }
    }
    let counts = if config.parts > 0 { config.parts..=config.parts } else { 2..=config.max_parts };
    let mut best: Option<(f64, Vec<usize>)> = None;
    for k in counts {
        let labels = cluster::kmeans(change, k, 4, seed);
        let score = cluster::silhouette(change, &labels);
        silhouettes.push((k, score));
        if best.as_ref().is_none_or(|b| score > b.0) {
            best = Some((score, labels));
        }
    }
    best.map(|b| b.1).unwrap_or_else(|| vec![0; change.len()])
}

/// The rows in the space of their `d` strongest principal components (orthogonal iteration).
fn principal(rows: &[Vec<f32>], d: usize, seed: u64) -> Vec<Vec<f32>> {
    let n = rows.len();
    let width = rows.first().map_or(0, Vec::len);
    let mean: Vec<f32> = (0..width).map(|j| rows.iter().map(|r| r[j]).sum::<f32>() / n as f32).collect();
    let centred: Vec<Vec<f32>> = rows.iter().map(|r| r.iter().zip(&mean).map(|(x, m)| x - m).collect()).collect();
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut basis: Vec<Vec<f32>> = (0..d).map(|_| (0..width).map(|_| rng.f32() - 0.5).collect()).collect();
    let dot = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f32>();
    for _ in 0..20 {
        basis = basis
            .par_iter()
            .map(|v| {
                let mut out = vec![0.0f32; width];
                for row in &centred {
                    let t = dot(row, v);
                    out.iter_mut().zip(row).for_each(|(o, x)| *o += t * x);
                }
                out
            })
            .collect();
        for i in 0..d {
            let (done, rest) = basis.split_at_mut(i);
            let v = &mut rest[0];
            for u in done.iter() {
                let t = dot(u, v);
                v.iter_mut().zip(u).for_each(|(v, u)| *v -= t * u);
            }
            let norm = dot(v, v).sqrt().max(1e-30);
            v.iter_mut().for_each(|x| *x /= norm);
        }
    }
    centred.iter().map(|row| basis.iter().map(|v| dot(row, v)).collect()).collect()
}

/// One robust rigid motion per part and state from the labelled gaussians.
pub fn rigid_motions(tracks: &Trajectories, labels: &[Option<u8>], k: usize) -> Vec<Vec<Pose>> {
    (0..k)
        .map(|part| {
            let members: Vec<usize> = (0..labels.len()).filter(|&i| labels[i] == Some(part as u8)).collect();
            let at = |s: usize| members.iter().map(|&i| Vec3::from(tracks.means[s][i]).as_dvec3()).collect::<Vec<_>>();
            let first = at(0);
            (0..tracks.means.len())
                .into_par_iter()
                .map(|s| if s == 0 { None } else { robust_kabsch(&first, &at(s)) })
                .map(|found| found.map_or(Pose::IDENTITY, |f| f.0))
                .collect()
        })
        .collect()
}

/// The part whose motion explains each gaussian's track with the least squared error over all
/// states; with neighbours given, their errors are averaged in, so that single stragglers follow
/// their surroundings.
fn assign(tracks: &Trajectories, motions: &[Vec<Pose>], neighbours: Option<&Vec<Vec<u32>>>) -> Vec<u8> {
    let n = tracks.means[0].len();
    let k = motions.len();
    let errors: Vec<Vec<f64>> = (0..n)
        .into_par_iter()
        .map(|i| {
            let x = Vec3::from(tracks.means[0][i]).as_dvec3();
            (0..k)
                .map(|p| {
                    let at = |s: usize| Vec3::from(tracks.means[s][i]).as_dvec3();
                    (1..tracks.means.len()).map(|s| (motions[p][s].apply(x) - at(s)).length()).sum::<f64>()
                })
                .collect()
        })
        .collect();
    (0..n)
        .into_par_iter()
        .map(|i| {
            let cost = |p: usize| {
                let around = neighbours.map_or(0.0, |near| near[i].iter().map(|&j| errors[j as usize][p]).sum::<f64>());
                errors[i][p] * 4.0 + around
            };
            (0..k).min_by(|a, b| cost(*a).total_cmp(&cost(*b))).unwrap_or(0) as u8
        })
        .collect()
}

/// Puts the part that moves least first, drops parts that are too small, merges parts with the same
/// motion.
fn sort_and_merge(
    tracks: &Trajectories,
    labels: &[Option<u8>],
    motions: Vec<Vec<Pose>>,
    diagonal: f64,
    config: &Config,
) -> Vec<Vec<Pose>> {
    let k = motions.len();
    let members: Vec<Vec<DVec3>> = (0..k)
        .map(|p| {
            let own = (0..labels.len()).filter(|&i| labels[i] == Some(p as u8));
            own.map(|i| Vec3::from(tracks.means[0][i]).as_dvec3()).collect()
        })
        .collect();
    let total: usize = members.iter().map(Vec::len).sum();
    // How far two motions carry the points of a part apart, root mean square, in the worst state.
    let apart = |points: &[DVec3], a: &[Pose], b: &[Pose]| {
        (0..a.len())
            .map(|s| {
                let sum: f64 = points.iter().map(|x| (a[s].apply(*x) - b[s].apply(*x)).length_squared()).sum();
                (sum / points.len().max(1) as f64).sqrt()
            })
            .fold(0.0, f64::max)
    };
    let still = vec![Pose::IDENTITY; tracks.means.len()];
    let mut order: Vec<usize> =
        (0..k).filter(|&p| members[p].len() as f64 >= config.min_share * total as f64).collect();
    // The root is the largest of the parts that stay, else the one that moves least.
    let moved: Vec<f64> = (0..k).map(|p| apart(&members[p], &motions[p], &still)).collect();
    order.sort_by(|&a, &b| {
        let rank = |p: usize| if moved[p] < config.noise * diagonal { 0.0 } else { moved[p] };
        rank(a).total_cmp(&rank(b)).then(members[b].len().cmp(&members[a].len()))
    });
    let mut kept: Vec<usize> = Vec::new();
    for p in order {
        let same = |q: &usize| {
            let both: Vec<DVec3> = members[p].iter().chain(&members[*q]).copied().collect();
            apart(&both, &motions[p], &motions[*q]) < config.noise * diagonal
        };
        let asked = config.parts > 0;
        if asked || !kept.iter().any(same) {
            kept.push(p);
        }
    }
    if kept.is_empty() {
        return vec![still];
    }
    kept.iter().map(|&p| motions[p].clone()).collect()
}
