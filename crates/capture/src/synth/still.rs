//! Joints that move by less than the cameras see: a recording of them is never what was wanted.

use super::plan::Shot;
use super::ranges::{sample, subtree};
use crate::object::ArticulatedObject;
use hingecast_geom::Joint;

/// A motion of fewer pixels than this, in the nearest camera, is lost in them.
const SEEN: f64 = 1.5;

/// A joint that goes through less than this share of its limits is stuck, rather than read in the
/// wrong unit.
const STUCK: f64 = 0.2;

/// A sentence for every joint that hardly moves in the recorded `states`, and one more if none does
/// better.
pub(super) fn notes(object: &ArticulatedObject, states: &[Vec<f64>], shots: &[Shot]) -> Vec<String> {
    let joints = &object.tree.joints;
    let still = |j: usize| {
        let all = states.iter().map(|q| q[j]);
        let range = all.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], q| [lo.min(q), hi.max(q)]);
        let pixels = pixels(object, j, range, shots);
        (pixels < SEEN).then(|| sentence(&joints[j], range, pixels))
    };
    let mut out: Vec<String> = (0..joints.len()).filter_map(still).collect();
    if joints.is_empty() {
        out.push("the object has no joint: nothing moves in this recording".into());
    } else if out.len() == joints.len() {
        out.push("nothing in this recording moves by as much as the cameras see: no build can find a joint".into());
    }
    out
}

/// How far the joint carries the farthest point that hangs on it, in pixels of the nearest camera.
fn pixels(object: &ArticulatedObject, joint: usize, range: [f64; 2], shots: &[Shot]) -> f64 {
    let screw = &object.tree.joints[joint].screw;
    let carried = subtree(object, object.tree.joints[joint].child);
    let points = sample(carried.iter().map(|&p| &object.parts[p]));
    let [from, to] = range.map(|q| screw.motion(q));
    let way = points.iter().map(|x| from.apply(*x).distance(to.apply(*x))).fold(0.0, f64::max);
    let near = |s: &Shot| {
        let depth = points.iter().map(|x| s.camera.camera_from_world.apply(*x).z).fold(f64::MAX, f64::min);
        s.camera.fx / depth.max(1e-9)
    };
    way * shots.iter().map(near).fold(0.0, f64::max)
}

fn sentence(joint: &Joint, [from, to]: [f64; 2], pixels: f64) -> String {
    let name = &joint.name;
    let [lower, upper] = joint.limits;
    if lower == upper {
        return format!("joint '{name}' cannot move: its limits are {lower} .. {upper}");
    }
    let way = to - from;
    let stuck = "it is stuck in its neighbours, or hardly played; --range NAME=FROM:TO moves it by hand";
    if !joint.screw.kind.turns() {
        let hint = if way < STUCK * (upper - lower) { stuck } else { "does the file count in metres?" };
        return format!("joint '{name}' moves by {way:.5}, {pixels:.1} pixels: {hint}");
    }
    let degrees = way.to_degrees();
    // What was meant as radians and read as degrees is too small by 57.
    let narrow = upper - lower < 0.06;
    let hint = if narrow { "does the file count in radians?" } else { stuck };
    format!("joint '{name}' moves by {degrees:.2} deg, {pixels:.1} pixels: {hint}")
}
