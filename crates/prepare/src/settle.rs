//! Cameras that drifted along a scan, brought back by all that the scan shows: floor, walls and
//! clutter hold a camera far better than the object alone does.

use crate::error::PrepareError;
use crate::scan::{everything, extent};
use hingecast_articulate::observe::cameras;
use hingecast_articulate::{DepthView, Depths, OTHER};
use hingecast_geom::{Pose, Progress};

/// Cells along the longest side of a scan in which its views are compared.
const CELLS: f32 = 120.0;
/// Points of a view: a few in every cell, over all views.
const POINTS: usize = 5000;

/// At least this share of all that a scan's views show must agree between them.
const STANDS_STILL: f64 = 0.45;
/// The object may agree with itself worse than before by this factor: noise.
const WORSE: f32 = 1.1;

/// Cameras of all scans.
#[derive(Clone, Debug)]
pub struct Settled {
    /// Of every state and view: camera_from_world as corrected; as recorded where views agree already.
    /// What all views of a state have in common stays: only the other states could tell.
    pub cameras: Vec<Vec<Pose>>,
    /// Whether what is around the object stands still with it in every scan.
    pub held: bool,
}

/// Settles the cameras of each scan on its pixels of class `OBJECT` and `OTHER`. Where there are `OTHER`s, a
/// state in which the `OBJECT` agrees less with itself afterwards stays as it was recorded: what is around a
/// turntable holds no camera.
///
/// # Errors
/// A view that cannot be read, the wish to stop.
pub fn settle(depths: &mut dyn Depths, progress: &Progress) -> Result<Settled, PrepareError> {
    let n = depths.n_states();
    let mut out = Settled { cameras: Vec::new(), held: true };
    for state in 0..n {
        progress.report(state, n, "views of each scan")?;
        let mut object = depths.views(state)?;
        let recorded = poses(&object);
        let mut views = everything(&object);
        if let Some(voxel) = voxel(&views) {
            cameras::align(&mut views, voxel, POINTS, cameras::TETHER);
        }
        let mut settled = poses(&views);
        if let Some(voxel) = voxel(&views) {
            out.held &= cameras::agreement(&views, voxel, POINTS) > STANDS_STILL;
        }
        let masked = object.iter().any(|v| v.class.contains(&OTHER));
        if let Some(voxel) = voxel(&object).filter(|_| masked && settled != recorded) {
            let mut off = |cameras: &[Pose]| {
                object.iter_mut().zip(cameras).for_each(|(v, c)| v.camera.camera_from_world = *c);
                cameras::disagreement(&object, voxel, cameras::POINTS)
            };
            if off(&settled) > WORSE * off(&recorded) {
                (settled, out.held) = (recorded, false);
            }
        }
        out.cameras.push(settled);
    }
    Ok(out)
}

/// Edge of the cells in which views are compared, scene units.
fn voxel(views: &[DepthView]) -> Option<f32> {
    extent(views, 0.0).map(|(lo, hi)| (hi - lo).max_element() / CELLS)
}

fn poses(views: &[DepthView]) -> Vec<Pose> {
    views.iter().map(|v| v.camera.camera_from_world).collect()
}
