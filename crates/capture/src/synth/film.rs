//! A film of play: after a scan, in which all stands still, one hand-held camera looks on while a hand
//! moves one joint after another, rests on the way, lets go and takes the next.
//!
//! The scan is state 0; every picture of the play is a state of its own, with one view.

use super::ranges::UsefulRange;
use super::trajectory::{self, Stand};
use super::world::Site;
use crate::object::ArticulatedObject;
use glam::DVec3;

/// Folders of the two captures.
pub(super) const SCAN: &str = "scan";
pub(super) const PLAY: &str = "play";
/// Pictures a second of the play; those of the scan are taken as a person walks.
pub(super) const SECS_PER_PICTURE: f64 = 0.1;
pub(super) const SECS_PER_VIEW: f64 = 0.5;
/// Share of a joint's time in which nothing moves: before it, half-way, and after it.
const RESTS: [f64; 3] = [0.12, 0.12, 0.06];
/// How far the first stroke of a joint goes, share of its range: at least, and how much more at most.
const HALF_WAY: [f64; 2] = [0.4, 0.2];
/// The joint that was opened first is closed again by this much, where nothing is behind it.
const PUSHED_BACK: f64 = 0.4;
/// A hand holds on through rests that are not longer than this many pictures.
const HOLDS_ON: usize = 12;

/// From one value to another, share of the joint's range, between two times, share of the play.
struct Stroke {
    joint: usize,
    from: f64,
    to: f64,
    start: f64,
    end: f64,
}

/// Joint values of the scan and then of the `pictures` of the play.
pub(super) fn joint_values(
    object: &ArticulatedObject,
    ranges: &[UsefulRange],
    pictures: usize,
    seed: u64,
) -> Vec<Vec<f64>> {
    let mut rng = fastrand::Rng::with_seed(seed ^ 0x6669_6c6d);
    let behind: Vec<bool> = ranges.iter().map(|r| r.behind).collect();
    let strokes = strokes(&behind, &mut rng);
    let at = |time: f64| {
        let mut shares = vec![0.0; ranges.len()];
        for s in strokes.iter().filter(|s| s.start <= time) {
            let t = ((time - s.start) / (s.end - s.start)).min(1.0);
            shares[s.joint] = s.from + (s.to - s.from) * t * t * (3.0 - 2.0 * t);
        }
        let mut q: Vec<f64> = shares.iter().zip(ranges).map(|(f, r)| r.lower + f * (r.upper - r.lower)).collect();
        object.tree.follow(&mut q);
        q
    };
    let last = pictures.saturating_sub(1).max(1) as f64;
    std::iter::once(at(0.0)).chain((0..pictures).map(|k| at(k as f64 / last))).collect()
}

/// One joint after another; those behind others last.
fn strokes(behind: &[bool], rng: &mut fastrand::Rng) -> Vec<Stroke> {
    let mut order: Vec<usize> = (0..behind.len()).collect();
    rng.shuffle(&mut order);
    order.sort_by_key(|&j| behind[j]);
    let push_back = order.len() > 1 && !behind.contains(&true);
    let turns = order.len() + usize::from(push_back);
    let each = 1.0 / turns.max(1) as f64;
    let moving = 0.5 * (1.0 - RESTS.iter().sum::<f64>());
    let mut out = Vec::new();
    for (k, &joint) in order.iter().enumerate() {
        let half = HALF_WAY[0] + HALF_WAY[1] * rng.f64();
        let first = (k as f64 + RESTS[0]) * each;
        let second = first + (moving + RESTS[1]) * each;
        out.push(Stroke { joint, from: 0.0, to: half, start: first, end: first + moving * each });
        out.push(Stroke { joint, from: half, to: 1.0, start: second, end: second + moving * each });
    }
    if let Some(&joint) = order.first().filter(|_| push_back) {
        let start = (order.len() as f64 + RESTS[0]) * each;
        let end = start + (1.0 - RESTS[0] - RESTS[2]) * each;
        out.push(Stroke { joint, from: 1.0, to: 1.0 - PUSHED_BACK, start, end });
    }
    out
}

/// States in which a hand holds that moves its joint in `moving`: through short rests, too.
pub(super) fn held(moving: Vec<usize>) -> Vec<usize> {
    let mut out: Vec<usize> = Vec::new();
    for state in moving {
        if let Some(&last) = out.last().filter(|last| state - **last <= HOLDS_ON) {
            out.extend(last + 1..state);
        }
        out.push(state);
    }
    out
}

/// Where the camera of the play stands, picture by picture.
pub(super) fn stands(pictures: usize, front: DVec3, site: Option<&Site>, seed: u64) -> Vec<Stand> {
    let mut rng = fastrand::Rng::with_seed(seed ^ 0x0066_696c_6d5f);
    trajectory::look_on(pictures, front, site, &mut rng)
}

/// Seconds at which a view was taken, counted from the start of its capture.
pub(super) fn time(state: usize, view: usize) -> f64 {
    if state == 0 { view as f64 * SECS_PER_VIEW } else { (state - 1) as f64 * SECS_PER_PICTURE }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joints_move_one_after_the_other_and_rest_between() {
        let mut rng = fastrand::Rng::with_seed(3);
        let strokes = strokes(&[false, false], &mut rng);
        assert!(strokes.windows(2).all(|w| w[0].end < w[1].start), "one at a time");
        for joint in 0..2 {
            let own: Vec<&Stroke> = strokes.iter().filter(|s| s.joint == joint).collect();
            assert_eq!((own[0].from, own[1].to), (0.0, 1.0));
            assert!(own.windows(2).all(|w| w[0].to == w[1].from));
        }
        assert!(strokes[0].start > 0.0 && strokes.iter().all(|s| s.end < 1.0));
    }

    #[test]
    fn a_hand_holds_on_through_a_short_rest_only() {
        assert_eq!(held(vec![3, 4, 8, 30]), [3, 4, 5, 6, 7, 8, 30]);
    }
}
