//! The measured surface of a state: masked depth pixels as points with normals, world frame.

use crate::failure::Result;
use crate::stages::inputs::Inputs;
use crate::stages::pixels::{normal, unproject};
use glam::Vec3;
use hingecast_capture::Split;
use hingecast_geom::icp::Surface;
use rayon::prelude::*;

/// The surface of `state` from about `wanted` pixels spread over all its training views.
pub fn of_state(inputs: &Inputs, state: usize, wanted: usize) -> Result<Surface> {
    let frames = inputs.recording.frames_of(state, Split::Train);
    let views = frames.par_iter().map(|&f| inputs.view(f)).collect::<Result<Vec<_>>>()?;
    let pixels: usize = views.iter().map(|v| v.mask.iter().filter(|m| **m == 1).count()).sum();
    let stride = ((pixels as f64 / wanted as f64).sqrt().round() as usize).max(1);
    let parts: Vec<(Vec<Vec3>, Vec<Vec3>)> = views
        .par_iter()
        .map(|view| {
            let (mut points, mut normals) = (Vec::new(), Vec::new());
            unproject(view, stride, &mut |x, i| {
                if let Some(n) = normal(view, i) {
                    points.push(x.as_vec3());
                    normals.push(n);
                }
            });
            (points, normals)
        })
        .collect();
    let (points, normals): (Vec<_>, Vec<_>) = parts.into_iter().unzip();
    Ok(Surface::new(points.concat(), normals.concat()))
}
