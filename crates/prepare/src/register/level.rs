//! States that share a frame, but not quite: each state's own share of what tracking drifted, taken out on
//! all that the scans show.

use super::{balanced, fine, pair::farthest, scan};
use crate::error::PrepareError;
use crate::scan::Scan;
use glam::Vec3;
use hingecast_articulate::Depths;
use hingecast_geom::icp::Surface;
use hingecast_geom::{Pose, Progress};

/// Nothing is done where no point moves by so many fine voxels.
const SHARP: f64 = 0.25;
/// Farthest correction, shares of the scan's longest side: more is no drift.
const FARTHEST: f64 = 0.05;
/// At least this share of a state must lie on the others once the room is brought together.
const LIES: f64 = 0.5;
/// The object must lie on itself as well as before, times this.
const AS_WELL: f64 = 0.95;
/// Samples of a state that are asked.
const SAMPLES: usize = 4000;

/// Of every state: the frame of state 0 from the recorded one. Views' pixels of class `OBJECT` of `all`
/// are everything that was seen, of `object` the object alone, as the masks have it. Empty: the states
/// agree already. `None`: what is around the object did not stand still with it, as around a turntable.
///
/// # Errors
/// A state without surface, a view that cannot be read, the wish to stop.
pub fn level(
    all: &mut dyn Depths,
    object: &mut dyn Depths,
    seed: u64,
    progress: &Progress,
) -> Result<Option<Vec<Pose>>, PrepareError> {
    let n = all.n_states();
    let mut scans = Vec::new();
    for state in 0..n {
        progress.report(state, 2 * n, "do the scans share a frame?")?;
        scans.push(scan(all, state)?);
    }
    let order: Vec<usize> = (0..n).collect();
    let found = fine::together(&scans, vec![Pose::IDENTITY; n], &order, &|_, _| None, seed);
    let voxel = scans.iter().map(|s| s.fine_voxel).fold(0.0, f32::max);
    let side = scans.iter().map(|s| s.voxel() * s.space.lattice.size.max_element() as f32).fold(0.0, f32::max);
    let moved = (1..n).map(|s| farthest(&found[s], &Pose::IDENTITY, &scans[s].coarse.points)).fold(0.0, f64::max);
    if moved < SHARP * f64::from(voxel) {
        return Ok(Some(Vec::new()));
    }
    if moved > FARTHEST * f64::from(side) {
        return Ok(None);
    }
    let room = Lying::new(&scans, &found, voxel);
    if (1..n).any(|s| room.share(&scans[s], s, &found) < LIES) {
        return Ok(None);
    }
    let mut things = Vec::new();
    for state in 0..n {
        progress.report(n + state, 2 * n, "do the scans share a frame?")?;
        things.push(scan(object, state)?);
    }
    let recorded = vec![Pose::IDENTITY; n];
    let (before, after) = (Lying::new(&things, &recorded, voxel), Lying::new(&things, &found, voxel));
    let total = |lying: &Lying, poses: &[Pose]| (1..n).map(|s| lying.share(&things[s], s, poses)).sum::<f64>();
    let as_well = total(&after, &found) >= AS_WELL * total(&before, &recorded);
    Ok(as_well.then_some(found))
}

/// The surface of every state, in one frame.
struct Lying {
    surfaces: Vec<Surface>,
    voxel: f32,
}

impl Lying {
    fn new(scans: &[Scan], poses: &[Pose], voxel: f32) -> Self {
        let surface = |(scan, pose): (&Scan, &Pose)| {
            let (points, normals) = fine::carried(&scan.fine, pose);
            Surface::new(points, normals)
        };
        Self { surfaces: scans.iter().zip(poses).map(surface).collect(), voxel }
    }

    /// Share of a state's samples that lie on the surface of the state before it, 0..1.
    fn share(&self, scan: &Scan, state: usize, poses: &[Pose]) -> f64 {
        let (points, normals) = fine::carried(&balanced::evenly(&scan.fine, SAMPLES), &poses[state]);
        let lies = |(x, m): &(&Vec3, &Vec3)| fine::lies_on(&self.surfaces[state - 1], **x, **m, self.voxel, self.voxel);
        points.iter().zip(&normals).filter(lies).count() as f64 / points.len().max(1) as f64
    }
}
