//! Cameras that drifted along a scan, brought back by all that the scan shows: floor, walls and
//! clutter hold a camera far better than the object alone does.

use crate::error::PrepareError;
use crate::scan::extent;
use hingecast_articulate::Depths;
use hingecast_articulate::observe::cameras;
use hingecast_geom::{Pose, Progress};

/// Cells along the longest side of a scan in which its views are compared.
const CELLS: f32 = 120.0;
/// Points of a view: a few in every cell, over all views.
const POINTS: usize = 5000;

/// Of every state and view: camera_from_world as corrected; as recorded where views agree already.
/// What all views of a state have in common stays: only the other states could tell.
///
/// # Errors
/// A view that cannot be read, the wish to stop.
pub fn settle(depths: &mut dyn Depths, progress: &Progress) -> Result<Vec<Vec<Pose>>, PrepareError> {
    let n = depths.n_states();
    let mut out = Vec::new();
    for state in 0..n {
        progress.report(state, n, "views of each scan")?;
        let mut views = depths.views(state)?;
        if let Some((lo, hi)) = extent(&views, 0.0) {
            cameras::align(&mut views, (hi - lo).max_element() / CELLS, POINTS);
        }
        out.push(views.iter().map(|v| v.camera.camera_from_world).collect());
    }
    Ok(out)
}
