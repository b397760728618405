//! Flat patches of surface that belong to one part as a whole.

use super::smooth::Near;
use crate::score::verdict::Verdict;
use hingecast_geom::icp::Surface;

/// A flat patch has at least this many samples.
const PATCH_SAMPLES: usize = 30;
/// Contradicted share of a patch up to which a part can own all of it, and from which on it cannot.
const CLEAN_SHARE: f32 = 0.03;
const SOILED_SHARE: f32 = 0.10;
/// Share of a patch that must be its owner's already: thin lips are contradicted by noise alone.
const BEGUN_SHARE: f32 = 0.3;

/// A connected flat patch that one part alone can own without contradictions is that part's. The
/// wall of a drawer slides in its own plane: deep inside it could stand still as well, but where it
/// sticks out it cannot, and it is one wall. `twins`: pairs of parts that moved nearly alike and
/// count as one here.
pub fn whole_patches(
    labels: &mut [u8],
    cloud: &Surface,
    near: &[Near],
    verdicts: &[Verdict],
    twins: &[[usize; 2]],
    voxel: f32,
) {
    let (points, normals) = (&cloud.points, &cloud.normals);
    let n_parts = verdicts.len() / labels.len().max(1);
    let one = |p: usize, q: usize| p == q || twins.contains(&[p.min(q), p.max(q)]);
    let flat = |i: usize, j: usize| {
        let gap = points[j] - points[i];
        normals[i].dot(normals[j]) > 0.97 && gap.length() < 2.0 * voxel && normals[i].dot(gap).abs() < 0.3 * voxel
    };
    let mut seen = vec![false; labels.len()];
    for first in 0..labels.len() {
        if std::mem::replace(&mut seen[first], true) {
            continue;
        }
        let mut patch = vec![first];
        let mut next = 0;
        while next < patch.len() {
            let i = patch[next];
            next += 1;
            for &(j, _) in &near[i] {
                let j = j as usize;
                if !seen[j] && flat(i, j) {
                    seen[j] = true;
                    patch.push(j);
                }
            }
        }
        if patch.len() < PATCH_SAMPLES {
            continue;
        }
        let soiled = |p: usize| {
            let against = patch.iter().filter(|&&i| verdicts[i * n_parts + p].against != 0).count();
            against as f32 / patch.len() as f32
        };
        let shares: Vec<f32> = (0..n_parts).map(soiled).collect();
        let clean: Vec<usize> = (0..n_parts).filter(|&p| shares[p] < SOILED_SHARE).collect();
        let begun = |p: usize| patch.iter().filter(|&&i| one(labels[i] as usize, p)).count() as f32;
        if let Some(&owner) = clean.first()
            && clean.iter().all(|p| one(owner, *p))
            && shares[owner] < CLEAN_SHARE
            && begun(owner) > BEGUN_SHARE * patch.len() as f32
        {
            patch.retain(|&i| !one(labels[i] as usize, owner));
            patch.iter().for_each(|&i| labels[i] = owner as u8);
        }
    }
}
