//! Do cameras, depth, masks and states agree in space? Points of one view are carried into other
//! views.

use super::carry::{Fate, carry};
use super::pixels::Look;
use super::{Finding, Fix, Severity, address, error, warning};
use crate::recording::transforms::Document;
use crate::{CaptureError, Recording, Split};
use glam::{DMat3, DVec3};

/// Views of a state that are compared with each other.
const VIEWS: usize = 8;
/// Findings, and how much of their surface states share ([`CheckReport::shared`](super::CheckReport)).
pub(super) fn check(
    documents: &[Document],
    recording: &Recording,
    looks: &[Option<Look>],
    out: &mut Vec<Finding>,
) -> Vec<Vec<f64>> {
    one_place(recording, out);
    if !look_inward(recording) {
        let place = format!("{}: frames[].transform_matrix", recording.root.display());
        let hint =
            "nerfstudio's axes are x right, y up, z back; negate the matrices' columns 2 and 3 (OpenCV to OpenGL)";
        let e =
            CaptureError::new("the cameras look away from each other's middle: their axes are OpenCV's", place, hint);
        out.push(Finding { fix: Some(Fix::FlipCameraAxes), ..error("camera-axes", e) });
        // With wrong axes nothing below means anything.
        return Vec::new();
    }
    empty_depth(documents, recording, looks, out);
    let by_state: Vec<Vec<usize>> = (0..recording.n_states).map(|s| some_views(recording, looks, s)).collect();
    let wrong = super::unit::check(recording, looks, &by_state);
    if !wrong.is_empty() {
        out.extend(wrong);
        return Vec::new();
    }
    super::apart::views(documents, recording, looks, out);
    if !recording.registered {
        // What lies where says nothing before the worlds are brought together.
        let place = format!("{}: registered = false", recording.root.display());
        let hint = "nothing to do: `hingecast build` brings them together, or says what it lacks";
        out.push(warning("own-worlds", "each state has a world of its own".into(), place, hint));
        return Vec::new();
    }
    let shared = states_apart(recording, looks, &by_state, out);
    out.extend(super::motion::nothing_moves(recording, looks, &by_state));
    shared
}

/// Cameras of a state that stand at one point give no depth.
fn one_place(recording: &Recording, out: &mut Vec<Finding>) {
    // Who films a play may stand still.
    for s in (0..recording.n_states).filter(|s| !recording.is_filmed(*s)) {
        let centres: Vec<DVec3> =
            recording.frames_of(s, Split::Train).iter().map(|&i| recording.frames[i].camera.centre()).collect();
        let spread = centres.iter().map(|c| c.distance(centres[0])).fold(0.0, f64::max);
        let size = centres.iter().map(|c| c.length()).fold(1e-9, f64::max);
        if centres.len() > 2 && spread < 1e-4 * size {
            let place =
                format!("{}: state {s}, {} cameras at {:.3}", recording.root.display(), centres.len(), centres[0]);
            let hint = "walk around the object, or check that the poses were exported and not the identity";
            out.push(error("one-place", CaptureError::new("all cameras of a state stand at one place", place, hint)));
        }
    }
}

/// The point nearest to all optical axes should lie in front of the cameras. True also when there
/// is no such point.
fn look_inward(recording: &Recording) -> bool {
    let rays: Vec<(DVec3, DVec3)> = recording
        .frames
        .iter()
        .map(|f| (f.camera.centre(), f.camera.camera_from_world.inverse().rotate(DVec3::Z)))
        .collect();
    // Sum of (1 - d d') x = sum of (1 - d d') c.
    let (mut a, mut b) = (DMat3::ZERO, DVec3::ZERO);
    for (c, d) in &rays {
        let p = DMat3::IDENTITY - DMat3::from_cols(*d * d.x, *d * d.y, *d * d.z);
        (a, b) = (a + p, b + p * *c);
    }
    if rays.len() < 3 || a.determinant().abs() < 1e-6 * (rays.len() as f64).powi(3) {
        return true;
    }
    let focus = a.inverse() * b;
    let behind = rays.iter().filter(|(c, d)| (focus - *c).dot(*d) < 0.0).count();
    behind * 10 < rays.len() * 8
}

fn empty_depth(documents: &[Document], recording: &Recording, looks: &[Option<Look>], out: &mut Vec<Finding>) {
    for (i, look) in looks.iter().enumerate() {
        let Some(look) = look.as_ref().filter(|l| !l.depth.is_empty()) else { continue };
        let object = look.object.iter().filter(|&&m| m == 1).count();
        let known = look.object.iter().zip(&look.depth).filter(|(m, d)| **m == 1 && **d > 0.0).count();
        if object > 20 && known * 20 < object {
            let (_, _, place) = address(documents, recording, i);
            let path = recording.frames[i].depth.as_ref().map(|p| p.display().to_string()).unwrap_or_default();
            let hint = "check the depth file and its unit; too near or too far for the sensor gives no depth";
            out.push(warning(
                "depth-empty",
                "an image has no depth on the object".into(),
                format!("{place}: {path}"),
                hint,
            ));
        }
    }
}

/// Frames of a state with depth, spread over its views.
fn some_views(recording: &Recording, looks: &[Option<Look>], state: usize) -> Vec<usize> {
    let all: Vec<usize> = recording
        .frames_of(state, Split::Train)
        .into_iter()
        .filter(|&i| looks[i].as_ref().is_some_and(|l| !l.depth.is_empty()))
        .collect();
    let n = all.len().min(VIEWS);
    (0..n).map(|k| all[k * all.len() / n]).collect()
}

/// A state whose cloud lies elsewhere as a whole: its points meet the surfaces of no other state,
/// though they meet those of their own. Answers how much of their surface states share.
fn states_apart(
    recording: &Recording,
    looks: &[Option<Look>],
    by_state: &[Vec<usize>],
    out: &mut Vec<Finding>,
) -> Vec<Vec<f64>> {
    let n = by_state.len();
    let clouds: Vec<Vec<Vec<DVec3>>> = by_state
        .iter()
        .map(|views| {
            let of = |&i: &usize| looks[i].as_ref().map(|l| l.points(&recording.frames[i].camera, 1.0));
            views.iter().filter_map(of).collect()
        })
        .collect();
    let all: Vec<DVec3> = clouds.iter().flatten().flatten().copied().collect();
    if n < 2 || all.len() < 100 {
        return Vec::new();
    }
    // A tolerance of 4 % of a typical state's extent: the lid of a closed laptop counts as its
    // keyboard.
    let extent = |cloud: &Vec<Vec<DVec3>>| {
        let (lo, hi) =
            cloud.iter().flatten().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), &x| (l.min(x), h.max(x)));
        if lo.x <= hi.x { (hi - lo).length() } else { 0.0 }
    };
    let mut extents: Vec<f64> = clouds.iter().map(extent).collect();
    extents.sort_by(f64::total_cmp);
    let tolerance = 0.04 * extents[n / 2];
    let agreement = |s: usize, r: usize| {
        let mut fate = Fate::default();
        for (&i, from) in by_state[s].iter().zip(&clouds[s]) {
            for &j in by_state[r].iter().filter(|&&j| s != r || j != i) {
                if let Some(look) = &looks[j] {
                    carry(from, look, &recording.frames[j].camera, 1.0, tolerance, &mut fate);
                }
            }
        }
        fate.on_surface as f64 / fate.all.max(1) as f64
    };
    let table: Vec<Vec<f64>> =
        if n <= SHOWN { (0..n).map(|s| (0..n).map(|r| agreement(s, r)).collect()).collect() } else { Vec::new() };
    let agreement = |s: usize, r: usize| table.get(s).map_or_else(|| agreement(s, r), |own| own[r]);
    // Each state against a few others, near and far; one that agrees is enough.
    for s in 0..n {
        let own = agreement(s, s);
        let others = [s.wrapping_sub(1), s + 1, 0, n / 2, n - 1];
        let best = others.into_iter().filter(|&r| r < n && r != s).map(|r| agreement(s, r)).fold(0.0, f64::max);
        if own > 0.1 && best < SHARED_FRAME * own {
            let place = format!("{}: state {s}", recording.root.display());
            let what = format!(
                "a state does not share the others' frame: {:.0} % of its surface is where they see one, {:.0} % within itself",
                100.0 * best,
                100.0 * own
            );
            let hint = "register all states in one reconstruction; or scan with floor and wall in view and `hingecast import` one scan a state";
            let mut finding = error("states-apart", CaptureError::new(what, place, hint));
            finding.state = Some(s);
            // With two states nothing tells a registration that failed from an object of which most
            // has moved.
            if n == 2 {
                finding.severity = Severity::Warning;
            }
            out.push(finding);
        }
    }
    let of_own = |(s, row): (usize, &Vec<f64>)| -> Vec<f64> {
        let own = row[s].max(1e-9);
        row.iter().enumerate().map(|(r, share)| if r == s { 1.0 } else { (share / own).min(1.0) }).collect()
    };
    table.iter().enumerate().map(of_own).collect()
}

/// States of which it is answered how much of their surface they share.
const SHOWN: usize = 25;

/// Even a laptop whose lid makes half of it keeps more than this share of its agreement between two
/// states.
const SHARED_FRAME: f64 = 0.35;
