//! Clustering of feature rows: k-means++ (Arthur and Vassilvitskii 2007), HDBSCAN from a crate, and
//! the mean silhouette (Rousseeuw 1987) that chooses between part counts.

use rayon::prelude::*;

/// Lloyd's iterations from the best of `restarts` k-means++ seedings. `rows` are (n, d). Label per
/// row.
pub fn kmeans(rows: &[Vec<f32>], k: usize, restarts: usize, seed: u64) -> Vec<usize> {
    let mut best: Option<(f64, Vec<usize>)> = None;
    for restart in 0..restarts {
        let (cost, labels) = kmeans_once(rows, k, seed.wrapping_add(restart as u64));
        if best.as_ref().is_none_or(|b| cost < b.0) {
            best = Some((cost, labels));
        }
    }
    best.map(|b| b.1).unwrap_or_default()
}

fn squared_distance(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

fn kmeans_once(rows: &[Vec<f32>], k: usize, seed: u64) -> (f64, Vec<usize>) {
    let mut rng = fastrand::Rng::with_seed(seed);
    let n = rows.len();
    if n == 0 || k == 0 {
        return (0.0, vec![0; n]);
    }
    // Seeds spread out: each next one drawn with probability proportional to its squared distance
    // to the rest.
    let mut centres = vec![rows[rng.usize(0..n)].clone()];
    let mut nearest: Vec<f32> = vec![f32::INFINITY; n];
    while centres.len() < k {
        let last = centres.last().expect("one is there");
        nearest.par_iter_mut().zip(rows).for_each(|(d, row)| *d = d.min(squared_distance(row, last)));
        let total: f64 = nearest.iter().map(|d| *d as f64).sum();
        let mut t = rng.f64() * total;
        let pick = nearest.iter().position(|d| {
            t -= *d as f64;
            t <= 0.0
        });
        centres.push(rows[pick.unwrap_or(n - 1)].clone());
    }
    let mut labels = vec![0; n];
    let mut cost = f64::INFINITY;
    for _ in 0..100 {
        let assigned: Vec<(usize, f32)> = rows
            .par_iter()
            .map(|row| {
                let distances = centres.iter().map(|c| squared_distance(row, c)).enumerate();
                distances.min_by(|a, b| a.1.total_cmp(&b.1)).expect("k > 0")
            })
            .collect();
        let new_cost: f64 = assigned.iter().map(|a| a.1 as f64).sum();
        labels = assigned.into_iter().map(|a| a.0).collect();
        for (c, centre) in centres.iter_mut().enumerate() {
            let members: Vec<&Vec<f32>> = rows.iter().zip(&labels).filter(|(_, l)| **l == c).map(|(r, _)| r).collect();
            if members.is_empty() {
                continue;
            }
            for (d, value) in centre.iter_mut().enumerate() {
                *value = members.iter().map(|m| m[d]).sum::<f32>() / members.len() as f32;
            }
        }
        if !(new_cost < cost * (1.0 - 1e-6)) {
            break;
        }
        cost = new_cost;
    }
    (cost, labels)
}

/// HDBSCAN labels; noise (which the algorithm leaves out) goes to the cluster of its nearest
/// labelled row. `None` when it finds fewer than two clusters.
pub fn hdbscan(rows: &[Vec<f32>], min_cluster: usize) -> Option<Vec<usize>> {
    let parameters = hdbscan::HdbscanHyperParams::builder().min_cluster_size(min_cluster).min_samples(10).build();
    let labels = hdbscan::Hdbscan::new(rows, parameters).cluster().ok()?;
    if labels.iter().max().copied().unwrap_or(-1) < 1 {
        return None;
    }
    let settled: Vec<usize> = (0..rows.len()).filter(|&i| labels[i] >= 0).collect();
    let out = (0..rows.len())
        .into_par_iter()
        .map(|i| {
            if labels[i] >= 0 {
                return labels[i] as usize;
            }
            let distance = |j: &usize| squared_distance(&rows[i], &rows[*j]);
            let nearest = settled.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
            labels[*nearest.expect("some row is labelled")] as usize
        })
        .collect();
    Some(out)
}

/// Mean silhouette from a dissimilarity matrix (n, n): 1 = well apart, 0 = on the border, below =
/// wrong cluster.
pub fn silhouette(dissimilarity: &[Vec<f32>], labels: &[usize]) -> f64 {
    let n = labels.len();
    let k = labels.iter().max().map_or(0, |m| m + 1);
    let sizes: Vec<usize> = (0..k).map(|c| labels.iter().filter(|l| **l == c).count()).collect();
    let scores: Vec<f64> = (0..n)
        .into_par_iter()
        .map(|i| {
            let mut sums = vec![0.0f64; k];
            for (j, d) in dissimilarity[i].iter().enumerate() {
                sums[labels[j]] += *d as f64;
            }
            let own = labels[i];
            if sizes[own] < 2 {
                return 0.0;
            }
            let a = sums[own] / (sizes[own] - 1) as f64;
            let others = (0..k).filter(|&c| c != own && sizes[c] > 0).map(|c| sums[c] / sizes[c] as f64);
            let b = others.fold(f64::INFINITY, f64::min);
            if b.is_finite() { (b - a) / a.max(b).max(1e-30) } else { 0.0 }
        })
        .collect();
    scores.iter().sum::<f64>() / n.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn three_blobs() -> (Vec<Vec<f32>>, Vec<usize>) {
        let mut rng = fastrand::Rng::with_seed(5);
        let centres = [[0.0, 0.0], [5.0, 0.0], [0.0, 5.0]];
        (0..240)
            .map(|i| {
                let c = centres[i % 3];
                (vec![c[0] + rng.f32() - 0.5, c[1] + rng.f32() - 0.5], i % 3)
            })
            .unzip()
    }

    fn same_partition(a: &[usize], b: &[usize]) -> bool {
        (0..a.len()).all(|i| (0..a.len()).all(|j| (a[i] == a[j]) == (b[i] == b[j])))
    }

    #[test]
    fn both_find_three_blobs_and_the_silhouette_agrees() {
        let (rows, truth) = three_blobs();
        let labels = kmeans(&rows, 3, 4, 1);
        assert!(same_partition(&labels, &truth));
        assert!(same_partition(&hdbscan(&rows, 20).unwrap(), &truth));
        let d: Vec<Vec<f32>> =
            rows.iter().map(|a| rows.iter().map(|b| squared_distance(a, b).sqrt()).collect()).collect();
        let two = kmeans(&rows, 2, 4, 1);
        assert!(silhouette(&d, &labels) > silhouette(&d, &two));
        assert!(silhouette(&d, &labels) > 0.8);
    }
}
