//! How far what was found is from the truth, each thing in its own unit.

use super::scene::{Boxes, Scene};
use glam::DVec3;
use hingecast_articulate::Articulation;
use hingecast_geom::{Joint, KinematicTree};

/// How far a found joint is from a true one of the same type.
#[derive(Clone, Copy, Debug)]
pub struct Off {
    /// Angle between the axes, radians.
    pub axis: f64,
    /// Distance of the found pivot from the true line, scene units; 0 for a slide.
    pub pivot: f64,
    /// Largest error of a value, counted from the first state: radians for a hinge, scene units for
    /// a slide.
    pub value: f64,
}

/// Most that a joint may be off.
#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    /// Radians.
    pub axis: f64,
    /// Scene units.
    pub pivot: f64,
    /// Values of a hinge, radians.
    pub angle: f64,
    /// Values of a slide, scene units.
    pub length: f64,
}

/// Of exact depth on a grid of 80 cells, 0.025 scene units each.
pub const USUAL: Bounds = Bounds { axis: 1.5e-3, pivot: 1e-3, angle: 1e-3, length: 2e-4 };

/// Of exact depth on a grid of 56 cells, 0.036 each.
pub const COARSE: Bounds = Bounds { axis: 5e-3, pivot: 1e-3, angle: 1e-3, length: 4e-4 };

/// Of two states: little tells whether a drawer rises on its way.
pub const TWO_STATES: Bounds = Bounds { axis: 1.5e-3, pivot: 2e-3, angle: 1e-3, length: 3e-3 };

/// Coarse, of a drawer that is seen from above alone, and not in all states.
pub const HALF_HIDDEN: Bounds = Bounds { axis: 2.5e-2, pivot: 1e-3, angle: 1e-3, length: 5e-4 };

/// Coarse, of depth with noise of 0.3 % in frames that are a third of a voxel off.
pub const NOISY: Bounds = Bounds { axis: 2e-2, pivot: 2e-2, angle: 5e-3, length: 2e-3 };

impl Off {
    /// None if the types differ.
    pub fn new(found: &Joint, truth: &Joint) -> Option<Self> {
        if found.screw.kind != truth.screw.kind {
            return None;
        }
        let sign = if found.screw.axis.dot(truth.screw.axis) < 0.0 { -1.0 } else { 1.0 };
        let gap = |(f, t): (&f64, &f64)| (sign * (f - found.values[0]) - (t - truth.values[0])).abs();
        Some(Self {
            axis: found.screw.axis.cross(truth.screw.axis).length().clamp(0.0, 1.0).asin(),
            pivot: if truth.screw.kind.turns() {
                found.screw.distance(truth.screw.foot(found.screw.pivot))
            } else {
                0.0
            },
            value: found.values.iter().zip(&truth.values).map(gap).fold(0.0, f64::max),
        })
    }

    /// Largest error in units of its bound; at most 1 is within the bounds.
    fn worst(&self, turns: bool, most: &Bounds) -> f64 {
        let value = self.value / if turns { most.angle } else { most.length };
        (self.axis / most.axis).max(self.pivot / most.pivot).max(value)
    }
}

/// The joint of a tree that is nearest to a true one of its type, and how far off it is.
pub fn nearest(tree: &KinematicTree, truth: &Joint) -> Option<(usize, Off)> {
    let each = tree.joints.iter().enumerate().filter_map(|(k, j)| Some((k, Off::new(j, truth)?)));
    let worst = |off: &Off| off.worst(truth.screw.kind.turns(), &USUAL);
    each.min_by(|a, b| worst(&a.1).total_cmp(&worst(&b.1)))
}

/// The joint that is the true one, within bounds.
pub fn assert_joint(tree: &KinematicTree, truth: &Joint, most: &Bounds) -> usize {
    let (k, off) = nearest(tree, truth).unwrap_or_else(|| panic!("no {:?} in {tree:?}", truth.screw.kind));
    eprintln!("{:?} of {}: {off:?}", truth.screw.kind, truth.name);
    assert!(off.worst(truth.screw.kind.turns(), most) <= 1.0, "{off:?}\ntruth {truth:?}\nnearest {:?}", tree.joints[k]);
    k
}

/// The same number of parts as in truth, and each joint within bounds on the right parent. `[k]`:
/// the found part that is the true part k.
pub fn assert_tree(tree: &KinematicTree, scene: &Scene, most: &Bounds) -> Vec<usize> {
    assert_eq!(tree.parts.len(), scene.boxes.len(), "{tree:?}");
    let mut names = vec![0; scene.boxes.len()];
    let joints: Vec<usize> = scene.tree.joints.iter().map(|truth| assert_joint(tree, truth, most)).collect();
    for (truth, k) in scene.tree.joints.iter().zip(&joints) {
        names[truth.child] = tree.joints[*k].child;
    }
    for (truth, k) in scene.tree.joints.iter().zip(&joints) {
        assert_eq!(tree.joints[*k].parent, names[truth.parent], "{tree:?}");
    }
    let mut distinct = names.clone();
    distinct.sort_unstable();
    distinct.dedup();
    assert_eq!(distinct.len(), names.len(), "one found joint is two true ones: {tree:?}");
    names
}

/// Share of the samples whose part is the one whose boxes they lie on. `names[k]`: the found part
/// that is the true part k.
pub fn labelled_right(found: &Articulation, scene: &Scene, names: &[usize]) -> f64 {
    let (mut right, mut clear) = (0, 0);
    for s in &found.samples {
        let poses = scene.tree.poses_at(s.state);
        let distance = |k: usize| from_boxes(poses[k].inverse().apply(s.point.as_dvec3()), &scene.boxes[k]);
        let mut order: Vec<usize> = (0..scene.boxes.len()).collect();
        order.sort_by(|a, b| distance(*a).total_cmp(&distance(*b)));
        // Where two parts are this near to each other, a voxel holds both.
        if distance(order[1]) - distance(order[0]) > found.voxel as f64 {
            clear += 1;
            right += usize::from(names[order[0]] == s.part as usize);
        }
    }
    right as f64 / clear as f64
}

/// Distance of a point from the nearest face of some boxes.
pub fn from_boxes(x: DVec3, part: &Boxes) -> f64 {
    let each = part.iter().map(|(lo, hi)| {
        let outside = (*lo - x).max(x - *hi);
        if outside.max_element() > 0.0 { outside.max(DVec3::ZERO).length() } else { -outside.max_element() }
    });
    each.fold(f64::INFINITY, f64::min)
}
