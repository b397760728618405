//! What breaks ties between motions that explain the recording nearly equally well.
//!
//! Two states of a cabinet with two equal doors are explained as well by doors that change places. Real joints are seldom
//! like that, so a few percent go to motions that are usual. They never outweigh evidence of more than that.

use super::evidence::Sample;
use hingecast_geom::{JointKind, Screw};

/// A part that hangs on the base, not on another moving part.
const ON_BASE: f64 = 0.15;
/// A slide where a hinge far away would do.
const SLIDE: f64 = 0.02;
/// A turn by half a circle loses this, and smaller turns much less: flat things look the same upside down, but few hinges
/// open that far.
const TURN: f64 = 0.3;
/// An axis along the part's faces or square to them, as in nearly everything that people build.
const FACES: f64 = 0.15;
/// Angle between an axis and a face that counts as along it, radians.
const ALONG: f64 = 0.03;
/// A hinge that its part reaches.
const REACHED: f64 = 0.25;
/// Distance that counts as reaching, share of the object's extent.
const NEAR: f64 = 0.04;

/// Factor above or about 1. `crowd` stands in the frame of the screw, as of any one state.
pub fn plausibility(screw: &Screw, values: &[f64], parent: usize, crowd: &[Sample], extent: f32) -> f64 {
    let (lo, hi) = values.iter().fold((0.0, 0.0), |(lo, hi), v| (f64::min(lo, *v), f64::max(hi, *v)));
    let mut factor = if parent == 0 { 1.0 + ON_BASE } else { 1.0 };
    let aligned = |s: &Sample| {
        let along = screw.axis.dot(s.normal.as_dvec3()).abs().min(1.0);
        let off = along.asin().min(along.acos()) / ALONG;
        (-off * off).exp()
    };
    factor *= 1.0 + FACES * crowd.iter().map(aligned).sum::<f64>() / crowd.len().max(1) as f64;
    if screw.kind == JointKind::Prismatic {
        return factor * (1.0 + SLIDE) * (1.0 + REACHED);
    }
    factor *= 1.0 - TURN * ((hi - lo) / std::f64::consts::PI).min(1.0).powi(4);
    let mut distances: Vec<f64> = crowd.iter().map(|s| screw.distance(s.point.as_dvec3())).collect();
    distances.sort_by(f64::total_cmp);
    let nearest = distances.get(distances.len() / 50).copied().unwrap_or(f64::INFINITY);
    factor * (1.0 + REACHED * (-(nearest / (NEAR * extent as f64)).powi(2)).exp())
}
