//! How long COLMAP's unit is, by a sensor's depth: each point of the model that a picture shows has
//! a depth in the model and one in the depth map. The scale is the median of their quotients.

use super::super::Source;
use super::model::Model;
use crate::CaptureError;

/// Fewer comparisons than this say nothing.
const LEAST: usize = 50;
/// Of these pictures; the median of a few has what that of all has.
const PICTURES: usize = 40;
/// The middle half of the quotients may differ by this much: worse is no depth of these pictures.
const SPREAD: f64 = 0.2;

/// Brings poses to the unit of the depth, metres, and says so.
///
/// # Errors
/// When a depth map cannot be read, or its depths and the model's do not belong together.
pub(super) fn to_metres(source: &mut Source, model: &Model) -> Result<(), CaptureError> {
    let mut quotients = Vec::new();
    let step = source.shots.len().div_ceil(PICTURES).max(1);
    for (shot, image) in source.shots.iter().zip(&model.images).step_by(step) {
        let Some(grid) = &shot.depth else { continue };
        let map = grid.depth()?;
        let (sx, sy) = (map.width as f64 / shot.camera.width as f64, map.height as f64 / shot.camera.height as f64);
        for (at, id) in &image.seen {
            let Some(point) = model.points.get(id) else { continue };
            let z_model = shot.camera.camera_from_world.apply(*point).z;
            let (u, v) = ((at.x * sx) as usize, (at.y * sy) as usize);
            if at.x < 0.0 || at.y < 0.0 || u >= map.width || v >= map.height {
                continue;
            }
            let z = f64::from(map.values[v * map.width + u]) * shot.depth_scale;
            if z.is_finite() && z > 0.0 && z_model > 0.0 {
                quotients.push(z / z_model);
            }
        }
    }
    if quotients.len() < LEAST {
        source.notes.push(format!(
            "COLMAP's unit is its own, and only {} points have a depth to compare: it is taken for a metre",
            quotients.len()
        ));
        return Ok(());
    }
    quotients.sort_by(f64::total_cmp);
    let at = |share: f64| quotients[((quotients.len() - 1) as f64 * share) as usize];
    let (scale, spread) = (at(0.5), (at(0.75) - at(0.25)) / at(0.5));
    if spread > SPREAD {
        return Err(CaptureError::new(
            format!("depth and model do not fit: metres per unit differ by {:.0} % among points", 100.0 * spread),
            source
                .shots
                .first()
                .and_then(|s| s.depth.as_ref())
                .map_or(String::new(), |d| d.path().display().to_string()),
            "depth/ must hold the depth of these pictures, aligned to them, as 16-bit PNG of millimetres",
        ));
    }
    for shot in &mut source.shots {
        shot.camera.camera_from_world.trans *= scale;
    }
    source.metric = true;
    source.notes.push(format!(
        "one unit of the COLMAP model is {scale:.4} m, by the depth at {} points (half of them within {:.1} %); poses \
         were brought to metres",
        quotients.len(),
        100.0 * spread
    ));
    Ok(())
}
