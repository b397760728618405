//! Is depth in the unit of the poses, and is that what the recording says?

use super::carry::{Fate, carry};
use super::pixels::Look;
use super::{Finding, Fix, error};
use crate::recording::stray::median;
use crate::{CaptureError, Recording};

/// Factors by which depth units are mistaken: metres, centimetres, millimetres, tenths, RealSense
/// and TUM units.
const UNITS: [f64; 10] = [1e-4, 1e-3, 1e-2, 0.1, 0.2, 5.0, 10.0, 100.0, 1e3, 1e4];
/// Below this share of points that land on the object in another view, not all is well.
const DISAGREES: f64 = 0.5;
/// A unit in which more do is believed if so many times as many do.
const BETTER: f64 = 2.0;
/// Fewer points say nothing.
const FEW: usize = 50;
/// Nearest and farthest that a depth camera's middle pixel is from what it shows, metres.
const METRES: [f64; 2] = [0.02, 30.0];

/// Depth in the wrong unit: points of one view miss the object in the others, and hit it at another
/// scale. Scans of several apps may differ: each state is asked.
pub(super) fn check(recording: &Recording, looks: &[Option<Look>], by_state: &[Vec<usize>]) -> Vec<Finding> {
    let score = |state: usize, scale: f64| {
        let mut fate = Fate::default();
        let views = &by_state[state];
        for &i in views {
            let from = looks[i].as_ref()?.points(&recording.frames[i].camera, scale);
            for &j in views.iter().filter(|&&j| j != i) {
                carry(&from, looks[j].as_ref()?, &recording.frames[j].camera, scale, 0.0, &mut fate);
            }
        }
        (fate.all > FEW).then(|| fate.on_object as f64 / fate.all as f64)
    };
    // Of each state that is wrong: share of points that hit, and the unit in which they do.
    let wrong: Vec<(usize, f64, Option<f64>)> = (0..by_state.len())
        .filter_map(|state| Some((state, score(state, 1.0).filter(|now| *now < DISAGREES)?)))
        .map(|(state, now)| {
            let best = UNITS.iter().filter_map(|&u| Some((u, score(state, u)?))).max_by(|a, b| a.1.total_cmp(&b.1));
            (state, now, best.filter(|best| best.1 >= DISAGREES.max(BETTER * now)).map(|best| best.0))
        })
        .collect();
    let Some(&(_, _, first)) = wrong.first() else {
        return not_metres(recording, looks, by_state).into_iter().collect();
    };
    let root = recording.root.display();
    let asked = by_state.iter().filter(|views| views.len() > 1).count();
    let all = wrong.len() >= asked && wrong.iter().all(|w| w.2 == first);
    let finding = |(state, now, unit): &(usize, f64, Option<f64>)| {
        let of = if all { String::new() } else { format!(" of state {state}") };
        let place = format!("{root}: depth_unit_scale_factor{of}");
        let e = match unit {
            Some(unit) => CaptureError::new(
                format!("depth is in the wrong unit: it agrees between views when multiplied by {unit}"),
                format!("{place} = {}", recording.frames[by_state[*state][0]].depth_scale),
                "multiply depth_unit_scale_factor by that",
            ),
            None => CaptureError::new(
                format!("depth and camera poses disagree: {:.0} % of points miss the object", 100.0 * (1.0 - now)),
                place,
                "check poses and intrinsics (camera-to-world, OpenGL axes), and that depth is z and not ray length",
            ),
        };
        let code = if unit.is_some() { "depth-unit" } else { "views-disagree" };
        let mut finding = error(code, e);
        match unit.filter(|_| all) {
            Some(factor) => finding.fix = Some(Fix::ScaleDepth { factor }),
            None => finding.state = (!all).then_some(*state),
        }
        finding
    };
    let named = if all { &wrong[..1] } else { &wrong };
    named.iter().map(finding).collect()
}

/// Depth and poses agree, and both are millimetres, say, in a recording that says metres.
fn not_metres(recording: &Recording, looks: &[Option<Look>], by_state: &[Vec<usize>]) -> Option<Finding> {
    if !recording.metric {
        return None;
    }
    let looked = by_state.iter().flatten().filter_map(|&i| looks[i].as_ref());
    let depth: Vec<f64> = looked.flat_map(|look| &look.depth).map(|z| f64::from(*z)).filter(|z| *z > 0.0).collect();
    if depth.len() < FEW {
        return None;
    }
    let far = median(depth);
    if (METRES[0]..METRES[1]).contains(&far) {
        return None;
    }
    let what = format!("the recording says that it is metric, and what it shows is {far:.3} metres away");
    let place = format!("{}: metric = true", recording.root.display());
    let hint = "bring depth and poses to metres (millimetres are a common mistake), or say \"metric\": false";
    Some(error("depth-unit", CaptureError::new(what, place, hint)))
}
