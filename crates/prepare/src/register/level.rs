//! States that share a frame, but not quite: each state's own share of what tracking drifted, taken out on
//! all that the scans show.

use super::{balanced, fine, pair::farthest, scan, scan_of};
use crate::error::PrepareError;
use crate::scan::{Scan, everything};
use hingecast_articulate::Depths;
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

/// Of every state: the frame of state 0 from the recorded one. Everything that was seen, views' pixels of
/// class `OBJECT` and `OTHER`, brings them together; the `OBJECT` must agree. Empty: the states agree
/// already. `None`: what is around the object did not stand still with it, as around a turntable.
///
/// # Errors
/// A state without surface, a view that cannot be read, the wish to stop.
pub fn level(depths: &mut dyn Depths, seed: u64, progress: &Progress) -> Result<Option<Vec<Pose>>, PrepareError> {
    let n = depths.n_states();
    let mut scans = Vec::new();
    for state in 0..n {
        progress.report(state, 2 * n, "do the scans share a frame?")?;
        scans.push(scan_of(&everything(&depths.views(state)?), state)?);
    }
    let (recorded, order) = (vec![Pose::IDENTITY; n], (0..n).collect::<Vec<_>>());
    let found = fine::together(&scans, recorded.clone(), &order, &|_, _| None, seed);
    let voxel = scans.iter().map(|s| s.fine_voxel).fold(0.0, f32::max);
    let side = scans.iter().map(|s| s.voxel() * s.space.lattice.size.max_element() as f32).fold(0.0, f32::max);
    let moved = (1..n).map(|s| farthest(&found[s], &Pose::IDENTITY, &scans[s].coarse.points)).fold(0.0, f64::max);
    if moved < SHARP * f64::from(voxel) {
        return Ok(Some(Vec::new()));
    }
    if moved > FARTHEST * f64::from(side) || lying(&scans, &found, voxel).any(|share| share < LIES) {
        return Ok(None);
    }
    let mut objects = Vec::new();
    for state in 0..n {
        progress.report(n + state, 2 * n, "do the scans share a frame?")?;
        objects.push(scan(depths, state)?);
    }
    let total = |poses: &[Pose]| lying(&objects, poses, voxel).sum::<f64>();
    let as_well = total(&found) >= AS_WELL * total(&recorded);
    Ok(as_well.then_some(found))
}

/// Of every state but the first: the share of its samples that lie on the surface of the state before it, 0..1.
fn lying(scans: &[Scan], poses: &[Pose], voxel: f32) -> impl Iterator<Item = f64> {
    (1..scans.len()).map(move |s| {
        let before = fine::surface(std::iter::once((&scans[s - 1], poses[s - 1])));
        let (points, normals) = fine::carried(&balanced::evenly(&scans[s].fine, SAMPLES), &poses[s]);
        let lies = points.iter().zip(&normals).filter(|(x, m)| fine::lies_on(&before, **x, **m, voxel, voxel));
        lies.count() as f64 / points.len().max(1) as f64
    })
}
