//! How far a part goes, and how large the object may be for an arm to follow it.

use super::*;

/// Two digits: a twin whose box differs by a voxel gets the same scale.
pub(super) fn two_digits(s: f64) -> f64 {
    let unit = 10f64.powf(s.log10().floor() - 1.0);
    (s / unit).floor() * unit
}

fn corners([lo, hi]: [DVec3; 2]) -> impl Iterator<Item = DVec3> {
    (0..8).map(move |k: usize| {
        let pick = |bit: usize, l: f64, h: f64| if k >> bit & 1 == 0 { l } else { h };
        DVec3::new(pick(0, lo.x, hi.x), pick(1, lo.y, hi.y), pick(2, lo.z, hi.z))
    })
}

/// How far the farthest corner of a box goes.
pub(super) fn farthest(part: [DVec3; 2], motion: &Pose) -> f64 {
    corners(part).map(|c| motion.apply(c).distance(c)).fold(0.0, f64::max)
}

/// At most 1; so that the farthest point of the part neither travels nor stands beyond what the arm
/// does with ease.
pub(super) fn reachable_scale(data: &mut Probe, hand: Hand, joint: &ObjectJoint) -> f64 {
    let (closed, open) = ends(data, hand, joint);
    pose_joint(data, joint, closed);
    let Some([lo, hi]) = object_bounds(data, hand) else { return 1.0 };
    let part = bounds(data, |g| is_part(data.model(), g, joint)).unwrap_or([lo, hi]);
    let screw = object::screw(data, joint);
    let motion = screw.motion(0.6 * (open - closed));
    // The grasp is somewhere short of the farthest corner; 0.85 of it is usual.
    let way = 0.85 * farthest(part, &motion);
    let top = corners(part).map(|c| motion.apply(c).z.max(c.z) - lo.z).fold(0.0, f64::max);
    let limits = [LONGEST_WAY / way, HIGHEST / top, LARGEST / (hi - lo).length()];
    two_digits(limits.into_iter().filter(|s| s.is_finite() && *s > 0.0).fold(1.0, f64::min))
}

/// The refusal of a joint that nobody could open.
pub(super) fn hardly_moves(joint: &ObjectJoint, way: f64, place: String) -> SimError {
    let [lo, hi] = joint.range;
    let range = if joint.slides { format!("{lo} .. {hi}") } else { format!("{:.2} deg", (hi - lo).to_degrees()) };
    let what = format!("joint '{}' hardly moves: {range}, {:.1} mm at most", joint.name, 1e3 * way);
    let hint = "does the file count in radians? <compiler angle=\"radian\"/>; or take another --joint";
    SimError::task(what, place, hint)
}
