//! What breaks ties between motions that explain the recording nearly equally well.
//!
//! Two states of a cabinet with two equal doors are explained as well by doors that change places.
//! Real joints are seldom like that, so a few percent go to motions that are usual. They never
//! outweigh evidence of more than that.

use crate::observe::sample::Sample;
use hingecast_geom::{JointKind, Screw};

/// A part that hangs on the base, not on another moving part.
const ON_BASE_GAIN: f64 = 0.15;
/// A slide where a hinge far away would do.
const SLIDE_GAIN: f64 = 0.02;
/// A turn by half a circle loses this, and smaller turns much less: flat things look the same
/// upside down, but few hinges open that far.
const HALF_TURN_LOSS: f64 = 0.3;
/// An axis along the part's faces or square to them, as in nearly everything that people build.
const ALONG_FACES_GAIN: f64 = 0.15;
/// Angle between an axis and a face that counts as along it, radians.
const ALONG_RAD: f64 = 0.03;
/// A hinge that its part reaches.
const REACHED_GAIN: f64 = 0.25;
/// Distance that counts as reaching, share of the object's extent.
const REACH_SHARE: f64 = 0.04;

/// Factor above or about 1. `samples` stands in the frame of the screw, as of any one state.
pub fn prior(screw: &Screw, values: &[f64], parent: usize, samples: &[Sample], extent: f32) -> f64 {
    let (lo, hi) = values.iter().fold((0.0, 0.0), |(lo, hi), v| (f64::min(lo, *v), f64::max(hi, *v)));
    let mut factor = if parent == 0 { 1.0 + ON_BASE_GAIN } else { 1.0 };
    let aligned = |s: &Sample| {
        let along = screw.axis.dot(s.normal.as_dvec3()).abs().min(1.0);
        let off = along.asin().min(along.acos()) / ALONG_RAD;
        (-off * off).exp()
    };
    factor *= 1.0 + ALONG_FACES_GAIN * samples.iter().map(aligned).sum::<f64>() / samples.len().max(1) as f64;
    if screw.kind == JointKind::Prismatic {
        return factor * (1.0 + SLIDE_GAIN) * (1.0 + REACHED_GAIN);
    }
    factor *= 1.0 - HALF_TURN_LOSS * ((hi - lo) / std::f64::consts::PI).min(1.0).powi(4);
    let mut distances: Vec<f64> = samples.iter().map(|s| screw.distance(s.point.as_dvec3())).collect();
    distances.sort_by(f64::total_cmp);
    let nearest = distances.get(distances.len() / 50).copied().unwrap_or(f64::INFINITY);
    factor * (1.0 + REACHED_GAIN * (-(nearest / (REACH_SHARE * extent as f64)).powi(2)).exp())
}
