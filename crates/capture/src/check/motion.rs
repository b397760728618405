//! Does anything move? Points of one state are looked for in the pictures of the others: what has
//! moved stands where those see past it.

use super::pixels::Look;
use super::{Finding, Severity, warning};
use crate::Recording;
use glam::DVec3;
use hingecast_geom::Camera;

/// A point this much in front of what is seen contradicts it: share of the object's extent.
const IN_FRONT: f64 = 0.015;
/// A recording in which no two states contradict each other in more points than this, and than so
/// many times what a state contradicts itself, shows no motion. Share of the points.
const MOVES: f64 = 0.004;
const NOISE: f64 = 1.5;
/// Fewer points of a state tell nothing.
const FEW: usize = 50;
/// With no more than this beyond what a state contradicts itself, not even something small moves.
const NOTHING: f64 = 2e-4;

/// `by_state`: frames with depth, of every state.
pub(super) fn nothing_moves(recording: &Recording, looks: &[Option<Look>], by_state: &[Vec<usize>]) -> Option<Finding> {
    let n = by_state.len();
    let cloud = |s: usize| -> Vec<(usize, Vec<DVec3>)> {
        let of = |&i: &usize| Some((i, looks[i].as_ref()?.points(&recording.frames[i].camera, 1.0)));
        by_state[s].iter().filter_map(of).collect()
    };
    let clouds: Vec<_> = (0..n).map(cloud).collect();
    let all = clouds.iter().flatten().flat_map(|(_, x)| x);
    let (lo, hi) = all.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), &x| (l.min(x), h.max(x)));
    let few = |c: &Vec<(usize, Vec<DVec3>)>| c.len() < 2 || c.iter().map(|(_, x)| x.len()).sum::<usize>() < FEW;
    if n < 2 || clouds.iter().any(few) {
        return None;
    }
    let tolerance = IN_FRONT * (hi - lo).length();
    // Share of the points of `s` that stand in front of what the views of `r` see.
    let contradicts = |s: usize, r: usize| {
        let (mut wrong, mut asked) = (0usize, 0usize);
        for (i, from) in &clouds[s] {
            for &j in by_state[r].iter().filter(|j| *j != i) {
                if let Some(look) = &looks[j] {
                    let (w, a) = in_front(from, look, &recording.frames[j].camera, tolerance);
                    (wrong, asked) = (wrong + w, asked + a);
                }
            }
        }
        wrong as f64 / asked.max(1) as f64
    };
    let own: Vec<f64> = (0..n).map(|s| contradicts(s, s)).collect();
    let pairs = (0..n).flat_map(|s| [(s, s + 1), (s, n / 2), (s, n - 1)]).filter(|(s, r)| s != r && *r < n);
    let noise = own.iter().copied().fold(0.0, f64::max);
    let most = pairs.map(|(s, r)| contradicts(s, r)).fold(0.0, f64::max);
    if most > NOISE * noise + MOVES {
        return None;
    }
    let what = format!(
        "nothing moves between the states: at most {:.2} % of the points have left, within a state {:.2} %",
        100.0 * most,
        100.0 * noise
    );
    let hint =
        "each state should show the object in another configuration; a part that is small against it is no matter";
    let mut finding = warning("nothing-moves", what, recording.root.display().to_string(), hint);
    // Without masks, what moves may be too small a piece of the room for these few points.
    let masked = looks.iter().flatten().all(|look| look.has_mask);
    if most < noise + NOTHING && masked {
        finding.severity = Severity::Error;
        finding.hint =
            "move every part between the states, by more than the sensor's errors; or is it one scan, split?".into();
    }
    Some(finding)
}

/// How many points a view sees past, of those that it could see. The pixels around must do so, too:
/// an edge is a matter of rounding.
fn in_front(points: &[DVec3], look: &Look, camera: &Camera, tolerance: f64) -> (usize, usize) {
    let (mut wrong, mut asked) = (0, 0);
    for &x in points {
        let (uv, z) = camera.project(x);
        let Some(i) = look.pixel(uv).filter(|_| z > 0.0) else { continue };
        // Background without depth: with a mask, nothing of the object is there.
        let past = |i: usize| match f64::from(look.depth[i]) {
            seen if seen > 0.0 => seen - z > tolerance,
            _ => look.has_mask && look.object[i] == 0,
        };
        asked += usize::from(look.depth[i] > 0.0 || look.has_mask);
        wrong += usize::from(around(i, look.width, look.height).all(past));
    }
    (wrong, asked)
}

/// A pixel and its neighbours, as far as they are in the picture.
fn around(i: usize, width: usize, height: usize) -> impl Iterator<Item = usize> {
    let (x, y) = (i % width, i / width);
    let rows = y.saturating_sub(1)..(y + 2).min(height);
    rows.flat_map(move |y| (x.saturating_sub(1)..(x + 2).min(width)).map(move |x| y * width + x))
}
