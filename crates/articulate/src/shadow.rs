//! Joints that may be the other side of another joint's part: a lid thinner than a cell shows its
//! inside only when it is open, and that looks like a second lid on the same line; so does the inside of
//! a drawer, which slides as that does.

use crate::model::owners::Member;
use glam::DVec3;
use hingecast_geom::{Joint, JointKind};

/// Largest angle between the axes, radians, and distance of the lines, voxels.
const ANGLE: f64 = 0.035;
const APART: f64 = 1.0;
/// Of the shorter part's reach - along a hinge's axis, across a slide's -, at least this share lies beside
/// the other: doors above each other share a line, too, and drawers a direction.
const BESIDE: f64 = 0.5;
/// Farther than this from its first value a joint has moved, radians; voxels.
const AWAY: f64 = 0.05;
const AWAY_VOXELS: f64 = 1.0;
/// Share of a part's samples, at each end, that may lie beyond its reach.
const STRAY: f64 = 0.05;

/// Indices of joints that may be shadows, each with that of the joint whose part it may be a side of.
/// `reach`: where the part of a joint begins and ends along a line through a point; `pairs`: how many pairs of
/// states show each joint; `voxel`: scene units.
pub fn shadows(
    joints: &[Joint],
    reach: &dyn Fn(usize, DVec3, DVec3) -> (f64, f64),
    pairs: &[usize],
    voxel: f32,
) -> Vec<(usize, usize)> {
    let voxel = f64::from(voxel);
    let is_hinge = |j: usize| joints[j].screw.kind == JointKind::Revolute;
    let alike = |j: usize, k: usize| {
        let (a, b) = (&joints[j].screw, &joints[k].screw);
        let one_line = (b.pivot - a.pivot).cross(a.axis).length() < APART * voxel;
        a.kind == b.kind && a.axis.cross(b.axis).length() < ANGLE && (one_line || !is_hinge(j))
    };
    // Whether `j` moves only where `k` does.
    let goes_along = |j: usize, k: usize| {
        let away = if is_hinge(j) { AWAY } else { AWAY_VOXELS * voxel };
        let moves = |j: usize, s: usize| (joints[j].values[s] - joints[j].values[0]).abs() > away;
        (0..joints[j].values.len()).all(|s| !moves(j, s) || moves(k, s))
    };
    let beside = |j: usize, k: usize| {
        let screw = &joints[j].screw;
        let lines = if is_hinge(j) { vec![screw.axis] } else { across(screw.axis).to_vec() };
        lines.into_iter().all(|line| {
            let ((a, b), (c, d)) = (reach(j, screw.pivot, line), reach(k, screw.pivot, line));
            b.min(d) - a.max(c) > BESIDE * (b - a).min(d - c)
        })
    };
    let of = |j: usize| {
        (0..joints.len()).find(|&k| {
            let weaker = k != j && joints[k].parent == joints[j].parent && (pairs[j], k) < (pairs[k], j);
            weaker && alike(j, k) && goes_along(j, k) && beside(j, k)
        })
    };
    (0..joints.len()).filter_map(|j| Some((j, of(j)?))).collect()
}

/// Two directions across an axis, as near to those of the frame as they can be: furniture stands along it.
fn across(axis: DVec3) -> [DVec3; 2] {
    let along = axis.abs();
    let e = DVec3::AXES.into_iter().min_by(|a, b| a.dot(along).total_cmp(&b.dot(along))).unwrap_or(DVec3::X);
    let first = axis.cross(e).normalize_or_zero();
    [first, axis.cross(first)]
}

/// Where a part begins and ends along a line through `from`; a hinge's turn about its axis changes nothing
/// along that, a slide nothing across it.
pub fn reach(members: &[Member], from: DVec3, line: DVec3) -> (f64, f64) {
    let place = |m: &Member| (m.sample.point.as_dvec3() - from).dot(line);
    let mut places: Vec<f64> = members.iter().map(place).collect();
    places.sort_by(f64::total_cmp);
    let last = places.len().saturating_sub(1) as f64;
    let at = |share: f64| places.get((last * share) as usize).copied().unwrap_or(0.0);
    (at(STRAY), at(1.0 - STRAY))
}

#[cfg(test)]
mod tests {
    use super::*;
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
        let beside = |_: usize, _: DVec3, _: DVec3| (-0.5, 0.5);
        let joints = [lid.clone(), inside.clone()];
        assert_eq!(shadows(&joints, &beside, &pairs, 0.02), [(1, 0)]);
        assert_eq!(shadows(&[inside.clone(), lid.clone()], &beside, &[6, 34], 0.02), [(0, 1)]);
        // Above each other.
        let above = |j: usize, _: DVec3, _: DVec3| if j == 0 { (-0.5, 0.1) } else { (0.12, 0.6) };
        assert!(shadows(&joints, &above, &pairs, 0.02).is_empty());
        // It moves where the other rests.
        let own = hinge(DVec3::X, DVec3::ZERO, [0.0, 0.7, 0.0, 1.0, 0.2]);
        assert!(shadows(&[lid.clone(), own], &beside, &pairs, 0.02).is_empty());
        // Another line.
        let away = hinge(DVec3::X, DVec3::new(0.0, 0.3, 0.0), [0.0, 0.0, 0.0, 2.8, 3.3]);
        assert!(shadows(&[lid, away], &beside, &pairs, 0.02).is_empty());
    }

    #[test]
    fn the_inside_of_a_drawer_is_named_and_a_drawer_beside_a_drawer_is_not() {
        let slide = |values| {
            let mut slide = hinge(DVec3::X, DVec3::ZERO, values);
            slide.screw.kind = JointKind::Prismatic;
            slide
        };
        let joints = [slide([0.0, 0.0, 0.0, 0.2, 0.4]), slide([0.0, 0.0, 0.0, 0.001, 0.1])];
        let within = |j: usize, _: DVec3, _: DVec3| if j == 0 { (-0.3, 0.3) } else { (-0.2, 0.25) };
        assert_eq!(shadows(&joints, &within, &[22, 10], 0.02), [(1, 0)]);
        // One above the other, as wide as it.
        let above = |j: usize, _: DVec3, line: DVec3| match (j, line.z.abs() > 0.5) {
            (0, true) => (0.1, 0.4),
            (_, true) => (-0.3, 0.05),
            _ => (-0.3, 0.3),
        };
        assert!(shadows(&joints, &above, &[22, 10], 0.02).is_empty());
        // Pulled out where the other rests.
        let other = slide([0.0, 0.0, 0.3, 0.1, 0.1]);
        assert!(shadows(&[joints[0].clone(), other], &within, &[22, 10], 0.02).is_empty());
    }
}
