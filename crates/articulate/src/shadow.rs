//! Hinges that may be the other side of another hinge's part: a lid thinner than a cell shows its
//! inside only when it is open, and that looks like a second lid on the same line.

use crate::model::owners::Member;
use hingecast_geom::{Joint, JointKind};

/// Largest angle between the axes, radians, and distance of the lines, voxels.
const ANGLE: f64 = 0.035;
const APART: f64 = 1.0;
/// Of the shorter part's reach along the axis, at least this share lies beside the other: doors above
/// each other share a line, too.
const BESIDE: f64 = 0.5;
/// Farther than this from its first value a joint has moved, radians.
const AWAY: f64 = 0.05;
/// Share of a part's samples, at each end, that may lie beyond its reach.
const STRAY: f64 = 0.05;

/// Indices of joints that may be shadows, each with that of the joint whose part it may be a side of.
/// `reach`: where along the axis of the second joint the part of the first begins and ends; `pairs`: how
/// many pairs of states show each joint; `voxel`: scene units.
pub fn shadows(
    joints: &[Joint],
    reach: &dyn Fn(usize, usize) -> (f64, f64),
    pairs: &[usize],
    voxel: f32,
) -> Vec<(usize, usize)> {
    let one_line = |a: &Joint, b: &Joint| {
        let turn = a.screw.axis.cross(b.screw.axis).length();
        let apart = (b.screw.pivot - a.screw.pivot).cross(a.screw.axis).length();
        turn < ANGLE && apart < APART * f64::from(voxel)
    };
    // Whether `j` moves only where `k` does.
    let goes_along = |j: usize, k: usize| {
        let moves = |j: usize, s: usize| (joints[j].values[s] - joints[j].values[0]).abs() > AWAY;
        (0..joints[j].values.len()).all(|s| !moves(j, s) || moves(k, s))
    };
    let beside = |j: usize, k: usize| {
        let ((a, b), (c, d)) = (reach(j, j), reach(k, j));
        b.min(d) - a.max(c) > BESIDE * (b - a).min(d - c)
    };
    let is_hinge = |j: &usize| joints[*j].screw.kind == JointKind::Revolute;
    let hinges: Vec<usize> = (0..joints.len()).filter(is_hinge).collect();
    let of = |j: usize| {
        hinges.iter().copied().find(|&k| {
            let weaker = k != j && joints[k].parent == joints[j].parent && (pairs[j], k) < (pairs[k], j);
            weaker && one_line(&joints[j], &joints[k]) && goes_along(j, k) && beside(j, k)
        })
    };
    hinges.iter().filter_map(|&j| Some((j, of(j)?))).collect()
}

/// Where a part begins and ends along a joint's axis; a turn about that changes nothing.
pub fn reach(members: &[Member], along: &Joint) -> (f64, f64) {
    let place = |m: &Member| (m.sample.point.as_dvec3() - along.screw.pivot).dot(along.screw.axis);
    let mut places: Vec<f64> = members.iter().map(place).collect();
    places.sort_by(f64::total_cmp);
    let last = places.len().saturating_sub(1) as f64;
    let at = |share: f64| places.get((last * share) as usize).copied().unwrap_or(0.0);
    (at(STRAY), at(1.0 - STRAY))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use hingecast_geom::Screw;

    fn hinge(axis: DVec3, pivot: DVec3, values: [f64; 5]) -> Joint {
        let screw = Screw { kind: JointKind::Revolute, axis, pivot };
        Joint { name: "hinge".into(), parent: 0, child: 1, screw, values: values.to_vec(), limits: [0.0, 3.5] }
    }

    #[test]
    fn the_inside_of_a_lid_is_named_and_a_door_above_a_door_is_not() {
        let lid = hinge(DVec3::X, DVec3::ZERO, [0.0, 0.0, 0.5, 1.6, 1.7]);
        let inside = hinge(-DVec3::X, DVec3::new(0.4, 0.0, 0.005), [0.0, 0.0, 0.0, 2.8, 3.3]);
        let pairs = [34, 6];
        let beside = |_: usize, _: usize| (-0.5, 0.5);
        let joints = [lid.clone(), inside.clone()];
        assert_eq!(shadows(&joints, &beside, &pairs, 0.02), [(1, 0)]);
        assert_eq!(shadows(&[inside.clone(), lid.clone()], &beside, &[6, 34], 0.02), [(0, 1)]);
        // Above each other.
        let above = |j: usize, _: usize| if j == 0 { (-0.5, 0.1) } else { (0.12, 0.6) };
        assert!(shadows(&joints, &above, &pairs, 0.02).is_empty());
        // It moves where the other rests.
        let own = hinge(DVec3::X, DVec3::ZERO, [0.0, 0.7, 0.0, 1.0, 0.2]);
        assert!(shadows(&[lid.clone(), own], &beside, &pairs, 0.02).is_empty());
        // Another line.
        let away = hinge(DVec3::X, DVec3::new(0.0, 0.3, 0.0), [0.0, 0.0, 0.0, 2.8, 3.3]);
        assert!(shadows(&[lid, away], &beside, &pairs, 0.02).is_empty());
    }
}
