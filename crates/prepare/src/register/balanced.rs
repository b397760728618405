//! Samples drawn so that all facings count alike: a floor has most of a room's surface and says
//! least about where the room is (normal-space sampling, Rusinkiewicz and Levoy 2001).

use crate::scan::chosen;
use glam::Vec3;
use hingecast_articulate::observe::cloud::Cloud;

/// Bins of facing: by height, around.
const HEIGHTS: usize = 7;
const AROUND: usize = 16;

/// Indices of about `count` samples of the cloud, facings in turn.
pub(super) fn draw(cloud: &Cloud, up: Vec3, count: usize, seed: u64) -> Vec<usize> {
    let mut rng = fastrand::Rng::with_seed(seed);
    let (a, b) = up.any_orthonormal_pair();
    let mut bins: Vec<Vec<usize>> = vec![Vec::new(); HEIGHTS * AROUND];
    for (i, n) in cloud.normals.iter().enumerate() {
        let height = ((0.5 + 0.5 * n.dot(up)) * HEIGHTS as f32) as usize;
        let turn = n.dot(b).atan2(n.dot(a)) / std::f32::consts::TAU + 0.5;
        let turn = ((turn * AROUND as f32) as usize).min(AROUND - 1);
        bins[height.min(HEIGHTS - 1) * AROUND + turn].push(i);
    }
    bins.iter_mut().for_each(|bin| rng.shuffle(bin));
    let mut out = Vec::new();
    while out.len() < count {
        let before = out.len();
        for bin in &mut bins {
            out.extend(bin.pop());
        }
        if out.len() == before {
            break;
        }
    }
    out.truncate(count);
    out
}

/// Every so many samples of the cloud, whatever they face: as much as there is surface.
pub(super) fn evenly(cloud: &Cloud, count: usize) -> Cloud {
    let every = cloud.points.len().div_ceil(count.max(1)).max(1);
    chosen(cloud, &(0..cloud.points.len()).step_by(every).collect::<Vec<_>>())
}

/// The samples that [`draw`] draws.
pub(super) fn pick(cloud: &Cloud, count: usize, seed: u64) -> Cloud {
    chosen(cloud, &draw(cloud, Vec3::Z, count, seed))
}
