//! Every picture of a film placed on the scan's surface.
//!
//! The room stands still, and most of what a picture shows is room and what has not moved; what has
//! moved lies farther off than weights reach that let go.

use crate::error::PrepareError;
use crate::register::fine;
use crate::scan::extent;
use glam::{DQuat, DVec3, Vec3};
use hingecast_articulate::DepthView;
use hingecast_articulate::observe::cloud::gather;
use hingecast_geom::icp::Surface;
use hingecast_geom::{Pose, Progress};

/// Cells along the longest side of the scan.
const CELLS: f32 = 320.0;
/// Pixels of a view of the scan that are looked at, and points of a picture that are placed.
const PIXELS: usize = 20_000;
const POINTS: usize = 4000;
/// Rounds of each picture. The first rounds reach three cells far, the others two.
const ROUNDS: usize = 10;
const FAR_ROUNDS: usize = 4;
/// A correction by more than this is none: radians, and shares of the scan's longest side.
const MOST_TURN: f64 = 0.1;
const MOST_SHIFT: f64 = 0.05;
/// Tracking drifts smoothly: a correction is the mean of those of so many pictures to either side.
const SMOOTH: usize = 2;

/// How the pictures lie on the scan.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Placing {
    /// Largest correction beyond the registration of the film as a whole: radians, scene units.
    pub farthest: (f64, f64),
    /// Median distance of the pictures' points from the scan's surface where they lie on it, scene
    /// units.
    pub off: f64,
    /// Pictures that could not be placed and keep their recorded cameras.
    pub lost: usize,
}

/// Moves the cameras of `film`, in the order of time and about in the scan's frame, onto the surface
/// that `scan` shows.
///
/// # Errors
/// The wish to stop.
pub fn onto(scan: &[DepthView], film: &mut [DepthView], progress: &Progress) -> Result<Placing, PrepareError> {
    let Some((lo, hi)) = extent(scan, 0.0) else { return Ok(Placing { lost: film.len(), ..Placing::default() }) };
    let side = (hi - lo).max_element();
    let voxel = side / CELLS;
    let cloud = gather(scan, voxel, scan.first().map_or(1, |v| v.stride_for(PIXELS)), 1);
    let surface = Surface::new(cloud.points, cloud.normals);
    let (mut corrections, mut off, mut lost) = (Vec::new(), Vec::new(), 0);
    let mut before = Pose::IDENTITY;
    for (k, view) in film.iter().enumerate() {
        progress.report(k, film.len(), "pictures of the film")?;
        let (mut points, mut normals): (Vec<Vec3>, Vec<Vec3>) = (Vec::new(), Vec::new());
        view.planes(view.stride_for(POINTS), &mut |x, n, _| {
            points.push(x);
            normals.push(n);
        });
        let (mut pose, mut scale, mut median) = (before, f64::from(voxel), f64::INFINITY);
        for round in 0..ROUNDS {
            let gate = if round < FAR_ROUNDS { 3.0 } else { 2.0 } * voxel;
            let (better, [_, m]) = fine::step(&points, &normals, &surface, pose, gate, scale);
            (pose, median) = (better, m);
            scale = (3.0 * median).clamp(0.05 * f64::from(voxel), f64::from(voxel));
        }
        let centre = view.camera.centre();
        let placed = median.is_finite()
            && pose.angle() < MOST_TURN
            && (pose.apply(centre) - centre).length() < MOST_SHIFT * f64::from(side);
        if placed {
            before = pose;
            off.push(median);
        } else {
            lost += 1;
        }
        corrections.push(before);
    }
    let centres: Vec<DVec3> = film.iter().map(|v| v.camera.centre()).collect();
    let smooth = smoothed(&corrections, &centres);
    let mut farthest = (0.0f64, 0.0f64);
    for ((view, c), centre) in film.iter_mut().zip(&smooth).zip(&centres) {
        farthest = (farthest.0.max(c.angle()), farthest.1.max((c.apply(*centre) - *centre).length()));
        view.camera.camera_from_world = view.camera.camera_from_world * c.inverse();
    }
    off.sort_by(f64::total_cmp);
    Ok(Placing { farthest, off: off.get(off.len() / 2).copied().unwrap_or(0.0), lost })
}

/// The mean of each correction and those around it, taken where its camera stands.
fn smoothed(corrections: &[Pose], centres: &[DVec3]) -> Vec<Pose> {
    let one = |k: usize| {
        let reach = SMOOTH.min(k).min(corrections.len() - 1 - k);
        let around = &corrections[k - reach..=k + reach];
        let n = around.len() as f64;
        let turn = around.iter().map(|c| c.rot.to_scaled_axis()).sum::<DVec3>() / n;
        let shift = around.iter().map(|c| c.apply(centres[k]) - centres[k]).sum::<DVec3>() / n;
        let turn = DQuat::from_scaled_axis(turn);
        Pose::new(turn, centres[k] + shift - turn * centres[k])
    };
    (0..corrections.len()).map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_steady_drift_is_left_as_it_is_and_a_jump_is_spread() {
        let centres = vec![DVec3::new(1.0, 2.0, 3.0); 9];
        let steady: Vec<Pose> = (0..9).map(|k| Pose::new(DQuat::IDENTITY, DVec3::X * f64::from(k))).collect();
        for (a, b) in smoothed(&steady, &centres).iter().zip(&steady) {
            assert!((a.trans - b.trans).length() < 1e-12);
        }
        let mut jump = vec![Pose::IDENTITY; 9];
        jump[4].trans.x = 1.0;
        let smooth = smoothed(&jump, &centres);
        assert!((smooth[4].trans.x - 0.2).abs() < 1e-12 && (smooth[2].trans.x - 0.2).abs() < 1e-12);
        assert!(smooth[0].trans.x == 0.0);
    }
}
