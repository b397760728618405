//! Joints that move by less than the cameras see: a recording of them is never what was wanted.

use super::plan::Shot;
use super::ranges::{UsefulRange, sample, subtree};
use crate::object::ArticulatedObject;
use hingecast_geom::Joint;

/// A motion of fewer pixels than this, in the nearest camera, is lost in them.
const SEEN: f64 = 1.5;

/// A sentence for every joint that hardly moves, and one more if none does better.
pub(super) fn notes(object: &ArticulatedObject, ranges: &[UsefulRange], shots: &[Shot]) -> Vec<String> {
    let joints = &object.tree.joints;
    let still = |(j, range): (usize, &UsefulRange)| {
        let pixels = pixels(object, j, range, shots);
        (pixels < SEEN).then(|| sentence(&joints[j], range, pixels))
    };
    let mut out: Vec<String> = ranges.iter().enumerate().filter_map(still).collect();
    if joints.is_empty() {
        out.push("the object has no joint: nothing moves in this recording".into());
    } else if out.len() == joints.len() {
        out.push("nothing in this recording moves by as much as the cameras see: no build can find a joint".into());
    }
    out
}

/// How far the joint carries the farthest point that hangs on it, in pixels of the nearest camera.
fn pixels(object: &ArticulatedObject, joint: usize, range: &UsefulRange, shots: &[Shot]) -> f64 {
    let screw = &object.tree.joints[joint].screw;
    let carried = subtree(object, object.tree.joints[joint].child);
    let points = sample(carried.iter().map(|&p| &object.parts[p]));
    let [from, to] = [range.lower, range.upper].map(|q| screw.motion(q));
    let way = points.iter().map(|x| from.apply(*x).distance(to.apply(*x))).fold(0.0, f64::max);
    let near = |s: &Shot| {
        let depth = points.iter().map(|x| s.camera.camera_from_world.apply(*x).z).fold(f64::MAX, f64::min);
        s.camera.fx / depth.max(1e-9)
    };
    way * shots.iter().map(near).fold(0.0, f64::max)
}

fn sentence(joint: &Joint, range: &UsefulRange, pixels: f64) -> String {
    let name = &joint.name;
    let [lower, upper] = joint.limits;
    if lower == upper {
        return format!("joint '{name}' cannot move: its limits are {lower} .. {upper}");
    }
    let way = (range.upper - range.lower).abs();
    if !joint.screw.kind.turns() {
        return format!("joint '{name}' moves by {way:.5}, {pixels:.1} pixels: does the file count in metres?");
    }
    let degrees = way.to_degrees();
    // What was meant as radians and read as degrees is too small by 57.
    let narrow = upper - lower < 0.06;
    let hint = if narrow { "does the file count in radians?" } else { "it is stuck in its neighbours" };
    format!("joint '{name}' moves by {degrees:.2} deg, {pixels:.1} pixels: {hint}")
}
