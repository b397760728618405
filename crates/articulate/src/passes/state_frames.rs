//! Noisy recordings: the states' frames, brought together by what stands still in all of them.

use super::pass::Round;
use crate::model::estimate::Estimate;
use crate::model::mean::{mean_point, without_mean};
use crate::observe::cloud::merge;
use crate::observe::evidence::Evidence;
use crate::observe::sample::{Motion, Sample};
use glam::Vec3;
use hingecast_geom::Pose;
use hingecast_geom::icp::{self, Surface};
use rayon::prelude::*;

/// Samples that hold a state's frame.
const HOLDING: usize = 3000;
/// Fewer samples of the base than this do not hold a state's frame.
const FEW: usize = 150;
/// Pull towards the state's own frame in directions that its base leaves open, share of the pull
/// towards the surface.
const TETHER: f64 = 0.003;

/// Brings the states' frames together where depth or poses are noisy.
pub fn align_states(round: &Round, estimate: &mut Estimate) {
    if round.evidence.is_noisy() {
        let moved = frames(round.evidence, &estimate.owners.labels, round.seed);
        for (world, m) in estimate.world_from_state.iter_mut().zip(&moved) {
            *world = *m * *world;
        }
        estimate.reframe = Some(moved);
    }
}

/// Corrections that bring the base of every state onto the base of all others; their mean is
/// nothing.
fn frames(evidence: &Evidence, labels: &[u8], seed: u64) -> Vec<Pose> {
    let n_states = evidence.n_states();
    let mut rng = fastrand::Rng::with_seed(seed);
    let own: Vec<Vec<Sample>> = (0..n_states)
        .map(|state| {
            let base = evidence.samples.iter().zip(labels).filter(|(s, l)| s.state == state && **l == 0);
            let mut base: Vec<Sample> = base.map(|(s, _)| *s).collect();
            rng.shuffle(&mut base);
            base.truncate(HOLDING);
            base
        })
        .collect();
    let voxel = evidence.lattice.voxel as f64;
    let centre = mean_point(own.iter().flatten().map(|s| s.point));
    let mut out = vec![Pose::IDENTITY; n_states];
    for _ in 0..3 {
        // Everything that stands still, seen by all states together.
        let moved = own.iter().zip(&out).flat_map(|(samples, pose)| {
            let m = Motion::from(*pose);
            samples.iter().map(move |s| (m.apply(s.point), m.rot * s.normal, 1.0))
        });
        let cloud = merge(moved, evidence.lattice.voxel, 2);
        let all = Surface::new(cloud.points, cloud.normals);
        out = own
            .par_iter()
            .zip(&out)
            .map(|(samples, pose)| {
                if samples.len() < FEW {
                    return *pose;
                }
                let points: Vec<Vec3> = samples.iter().map(|s| s.point).collect();
                let normals: Vec<Vec3> = samples.iter().map(|s| s.normal).collect();
                icp::align_tethered(&points, &normals, &all, *pose, &[voxel, voxel, 0.6 * voxel, 0.6 * voxel], TETHER).0
            })
            .collect();
        out = without_mean(&out, centre);
    }
    out
}
