//! The range over which a joint is worth playing.
//!
//! Limits in files are wider than the physical ones, and 0 is the mesh as stored, neither closed
//! nor open. So: sample points of the moving side, follow them from 0 outwards in small steps, and
//! count those whose path pierces a surface of the other side. The range ends where a fifth has
//! gone through something, at the beginning of that rise. If what is left is wider than a person
//! would move it, keep the end at which the object is the most compact: that is the closed one.
//!
//! A rack behind a door, or a seat below a lid, goes nowhere while all else is closed. What is
//! stuck like that is asked once more with everything else open.

use super::scene::Scene;
use crate::object::{ArticulatedObject, PartGeometry};
use glam::{DVec3, Vec3A};
use hingecast_geom::{JointKind, TriMesh};

/// Where a joint is played, and why it ends there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UsefulRange {
    /// Radians or scene units; `lower` is the closed end.
    pub lower: f64,
    /// The open end.
    pub upper: f64,
    /// Only when other joints are open: a rack behind a door.
    pub behind: bool,
}

/// A person's hand moves a door this far without walking around it.
const WIDEST_TURN_DEG: f64 = 100.0;
const STEPS: usize = 60;
const POINTS: usize = 3000;
/// Share of the moving points that may pierce the rest. Real files overlap: a door's rim leaves its
/// frame (7 % of its points), a drawer grazes its rails (14 %), scissors their other half (10 %); a
/// lid that hits its body goes to 40 %.
const PIERCING: f64 = 0.2;
/// Share gained in one step that belongs to a collision, not to grazing.
const RISE: f64 = 0.004;

/// A joint is stuck if it has less than this share of its limits, or of a hand's reach.
const STUCK: f64 = 0.25;
/// ... and something else is in its way if it goes this many times farther once that is open.
const FREED: f64 = 2.0;

/// One range a joint of the tree, other joints at 0, or open if only that frees it.
pub(super) fn each_alone(object: &ArticulatedObject) -> Vec<UsefulRange> {
    let joints = &object.tree.joints;
    let closed = vec![0.0; joints.len()];
    let mut ranges: Vec<UsefulRange> = (0..joints.len()).map(|j| useful_range(object, j, &closed)).collect();
    let width = |r: &UsefulRange| (r.upper - r.lower).abs();
    let open: Vec<f64> = ranges.iter().map(|r| r.upper).collect();
    for (j, joint) in joints.iter().enumerate() {
        let whole = (joint.limits[1] - joint.limits[0]).min(widest(joint.screw.kind));
        if width(&ranges[j]) < STUCK * whole {
            let freed = useful_range(object, j, &open);
            if width(&freed) > FREED * width(&ranges[j]) {
                ranges[j] = UsefulRange { behind: true, ..freed };
            }
        }
    }
    ranges
}

fn widest(kind: JointKind) -> f64 {
    if kind == JointKind::Prismatic { f64::INFINITY } else { WIDEST_TURN_DEG.to_radians() }
}

/// `others`: values of all joints; its own does not count.
fn useful_range(object: &ArticulatedObject, joint: usize, others: &[f64]) -> UsefulRange {
    let j = &object.tree.joints[joint];
    let [lower, upper] = j.limits;
    let rest = 0f64.clamp(lower, upper);
    let moving = subtree(object, j.child);
    // Seen from the parent, which holds the axis.
    let mut others = others.to_vec();
    others[joint] = 0.0;
    let poses = object.tree.poses(&others);
    let from_world = poses[j.parent].inverse();
    let standing = object.parts.iter().zip(&poses).enumerate().filter(|(i, _)| !moving.contains(i));
    let standing = Scene::new(standing.map(|(_, (part, pose))| (part, from_world * *pose)));
    let points = sample(moving.iter().map(|&i| &object.parts[i]));
    let step = (upper - lower) / STEPS as f64;
    let reach = |limit: f64| {
        let n = ((limit - rest).abs() / step).round() as usize;
        let q = |k: usize| if n == 0 { rest } else { rest + (limit - rest) * k as f64 / n as f64 };
        let mut pierced = vec![false; points.len()];
        let mut shares = vec![0.0];
        for k in 0..n {
            let (from, to) = (j.screw.motion(q(k)), j.screw.motion(q(k + 1)));
            for (p, pierced) in points.iter().zip(&mut pierced).filter(|(_, done)| !**done) {
                let (a, b) = (from.apply(*p).as_vec3(), to.apply(*p).as_vec3());
                *pierced = standing.cast(Vec3A::from(a), Vec3A::from(b - a), 1.0).is_some();
            }
            let share = pierced.iter().filter(|&&x| x).count() as f64 / points.len().max(1) as f64;
            shares.push(share);
            if share > PIERCING {
                // Back to where this rise began.
                let mut end = k;
                while end > 0 && shares[end] - shares[end - 1] > RISE {
                    end -= 1;
                }
                return q(end);
            }
        }
        limit
    };
    let (mut lo, mut hi) = (reach(lower), reach(upper));
    let widest = widest(j.screw.kind);
    let compact = |q: f64| {
        let mut all = vec![0.0; object.tree.joints.len()];
        all[joint] = q;
        let (lo, hi) = object.bounds(&all);
        (hi - lo).element_product()
    };
    let low_is_closed = compact(lo) <= compact(hi);
    if hi - lo > widest {
        if low_is_closed { hi = lo + widest } else { lo = hi - widest }
    }
    let (lower, upper) = if low_is_closed { (lo, hi) } else { (hi, lo) };
    UsefulRange { lower, upper, behind: false }
}

/// The part and everything it carries.
pub(super) fn subtree(object: &ArticulatedObject, part: usize) -> Vec<usize> {
    let mut out = vec![part];
    let mut next = 0;
    while next < out.len() {
        let parent = out[next];
        out.extend(object.tree.joints.iter().filter(|j| j.parent == parent).map(|j| j.child));
        next += 1;
    }
    out
}

/// Points spread over the surfaces by area.
pub(super) fn sample<'a>(parts: impl Iterator<Item = &'a PartGeometry>) -> Vec<DVec3> {
    let mut mesh = TriMesh::default();
    for p in parts {
        mesh.append(&TriMesh { vertices: p.vertices.clone(), faces: p.faces.clone(), colors: Vec::new() });
    }
    mesh.sample_surface(POINTS, 0).into_iter().map(|(x, _)| x.as_dvec3()).collect()
}
