//! What the exports share of a link: its frame, its files, its colour and its damping.
//!
//! Link frames: axes of the canonical world; origin on the joint axis nearest the part's centre of
//! mass (revolute), at the centre of mass (prismatic), at the world origin (root). Mesh files are
//! in link frames.

use crate::{PartModel, Twin};
use glam::{DVec3, Vec3};
use hingecast_geom::{Joint, KinematicTree, TriMesh};

/// Origin of the link frame of `part`, canonical world.
pub fn link_origin(twin: &Twin, part: usize) -> DVec3 {
    let com = twin.parts[part].inertial.com;
    match twin.tree.joint_of(part) {
        None => DVec3::ZERO,
        Some(j) if j.screw.kind.turns() => j.screw.foot(com),
        Some(_) => com,
    }
}

/// Pairs of parts that touch by construction, carrier first: those that share a joint, and those
/// that would if the parts of nothing between them (`is_empty`) were none.
pub fn touching(tree: &KinematicTree, is_empty: impl Fn(usize) -> bool) -> Vec<[usize; 2]> {
    let mut out = Vec::new();
    for joint in &tree.joints {
        let mut carrier = joint.parent;
        out.push([carrier, joint.child]);
        while let Some(up) = tree.joint_of(carrier).filter(|_| is_empty(carrier)) {
            carrier = up.parent;
            out.push([carrier, joint.child]);
        }
    }
    out
}

/// Viscous damping of `joint`: not observable from still states, so chosen that a free swing loses
/// 63 % of its speed in one second. N m s/rad or N s/m.
pub fn damping(twin: &Twin, joint: &Joint) -> f64 {
    const SECONDS: f64 = 1.0;
    moved_inertia(twin, joint) / SECONDS
}

/// Of the part that `joint` carries: about its axis, kg m^2, or its mass, kg.
fn moved_inertia(twin: &Twin, joint: &Joint) -> f64 {
    let i = &twin.parts[joint.child].inertial;
    if joint.screw.kind.turns() {
        let about_com = joint.screw.axis.dot(i.inertia * joint.screw.axis);
        about_com + i.mass * joint.screw.distance(i.com).powi(2)
    } else {
        i.mass
    }
}

/// Inertia of the motor that `joint` does not have: engines that take none for a mistake put a large
/// one in its place (Genesis 1.4: 0.1 kg m^2). A thousandth of what the part itself has. kg m^2 or kg
pub fn armature(twin: &Twin, joint: &Joint) -> f64 {
    1e-3 * moved_inertia(twin, joint)
}

/// Mean vertex colour in [0, 1], for formats without vertex colours.
pub fn mean_color(mesh: &TriMesh) -> [f64; 3] {
    let n = mesh.colors.len().max(1) as f64;
    let sum = mesh.colors.iter().fold([0.0; 3], |s, c| [0, 1, 2].map(|k| s[k] + c[k] as f64));
    if mesh.colors.is_empty() { [0.6; 3] } else { sum.map(|s| s / n / 255.0) }
}

pub(crate) fn visual_file(part: usize) -> String {
    format!("visual/part_{part}.obj")
}

pub(crate) fn texture_file(part: usize) -> String {
    format!("visual/part_{part}.png")
}

pub(crate) fn hull_file(part: usize, hull: usize) -> String {
    format!("collision/part_{part}_{hull}.obj")
}

/// Points and triangles of a part as it is drawn, relative to `origin`: corners of its charts where it has a
/// texture, else vertices of its mesh.
pub(crate) fn drawn(model: &PartModel, origin: DVec3) -> (Vec<Vec3>, &[[u32; 3]]) {
    let local = |v: &Vec3| (v.as_dvec3() - origin).as_vec3();
    let vertices = &model.mesh.vertices;
    match &model.texture {
        Some(t) => (t.vertices.iter().map(|&v| local(&vertices[v as usize])).collect(), &t.faces),
        None => (vertices.iter().map(local).collect(), &model.mesh.faces),
    }
}
