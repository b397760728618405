//! Where the front of an object is: the side towards which it opens.

use crate::object::ArticulatedObject;
use crate::synth::ranges::{UsefulRange, sample, subtree};
use glam::DVec3;
use hingecast_geom::{Joint, JointKind};

/// An axis that is nearer to the vertical than this cosine carries a door, otherwise a lid.
const UPRIGHT: f64 = 0.7;

/// The horizontal axis direction (+-x or +-y) towards which the parts open; -y if none does.
///
/// A drawer opens the way it slides. A door (upright axis) shows, once open, from its hinge to the
/// front. A lid or flap (lying axis) lies in front of its hinge when it is closed (a lid) or when
/// it is open (the flap of an oven). Large parts count more.
pub(crate) fn front(object: &ArticulatedObject, ranges: &[UsefulRange]) -> DVec3 {
    let mut ahead = DVec3::ZERO;
    for (joint, range) in object.tree.joints.iter().zip(ranges) {
        let points = sample(subtree(object, joint.child).iter().map(|&p| &object.parts[p]));
        if points.is_empty() || range.lower == range.upper {
            continue;
        }
        let centre = points.iter().sum::<DVec3>() / points.len() as f64;
        let size = points.iter().map(|x| x.distance(centre)).fold(0.0, f64::max);
        let flat = |v: DVec3| DVec3::new(v.x, v.y, 0.0);
        ahead += flat(opens_towards(joint, range, centre)).normalize_or_zero() * size;
    }
    // In this order, so that ties go to -y, where the samples have their front.
    let sides = [DVec3::NEG_Y, DVec3::NEG_X, DVec3::X, DVec3::Y];
    let least = 1e-6 * ahead.length();
    sides.into_iter().fold(
        DVec3::NEG_Y,
        |best, side| {
            if side.dot(ahead) > best.dot(ahead) + least { side } else { best }
        },
    )
}

/// `centre` of what the joint carries, at 0.
fn opens_towards(joint: &Joint, range: &UsefulRange, centre: DVec3) -> DVec3 {
    let screw = &joint.screw;
    if screw.kind == JointKind::Prismatic {
        return screw.axis * (range.upper - range.lower);
    }
    let from_hinge = |q: f64| (screw.motion(q).apply(centre) - screw.pivot).reject_from_normalized(screw.axis);
    if screw.axis.z.abs() > UPRIGHT {
        from_hinge(range.upper)
    } else {
        from_hinge(range.lower) + from_hinge(range.upper)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synth::useful_ranges;

    /// As objects/README.md has it.
    #[test]
    fn samples_have_their_front_where_they_open() {
        let objects = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../objects");
        for name in ["microwave", "three_drawers", "cabinet_two_door", "hinged_box", "pedal_bin", "covered_box"] {
            let object = ArticulatedObject::load(&objects.join(name)).unwrap();
            let wanted = if name == "covered_box" { DVec3::NEG_X } else { DVec3::NEG_Y };
            assert_eq!(front(&object, &useful_ranges(&object)), wanted, "{name}");
        }
    }
}
