//! MJCF text of a twin: the same links and joints as the URDF, for MuJoCo.

use crate::link::{armature, damping, hull_file, link_origin, mean_color, texture_file, touching, visual_file};
use crate::xml::{escape, xyz};
use crate::{Twin, cuboid};
use glam::DVec3;
use hingecast_geom::JointKind;
use std::fmt::Write as _;

/// The whole file. It names the mesh files that [`crate::write`] puts beside it.
pub fn to_string(twin: &Twin) -> String {
    let mut out = String::new();
    let _ = writeln!(out, "<mujoco model=\"{}\">", escape(&twin.name));
    let _ =
        writeln!(out, "  <compiler angle=\"radian\" meshdir=\"meshes\" texturedir=\"meshes\" autolimits=\"true\"/>");
    let _ = writeln!(out, "  <statistic extent=\"{:.6}\"/>", twin.diagonal);
    let _ = writeln!(out, "  <asset>");
    for (i, part) in twin.parts.iter().enumerate() {
        // "shell": a visual mesh need not enclose a volume; mass comes from <inertial>.
        let _ = writeln!(out, "    <mesh name=\"visual_{i}\" file=\"{}\" inertia=\"shell\"/>", visual_file(i));
        if part.texture.is_some() {
            let file = texture_file(i);
            let _ = writeln!(out, "    <texture name=\"photo_{i}\" type=\"2d\" file=\"{file}\"/>");
            let _ = writeln!(
                out,
                "    <material name=\"photo_{i}\" texture=\"photo_{i}\" specular=\"0\" shininess=\"0\"/>"
            );
        }
        for k in (0..part.hulls.len()).filter(|&k| cuboid::of(&part.hulls[k]).is_none()) {
            let _ = writeln!(out, "    <mesh name=\"hull_{i}_{k}\" file=\"{}\" inertia=\"convex\"/>", hull_file(i, k));
        }
    }
    let _ = writeln!(out, "  </asset>\n  <worldbody>");
    let roots: Vec<usize> = (0..twin.parts.len()).filter(|&p| twin.tree.joint_of(p).is_none()).collect();
    for &root in &roots {
        body(twin, root, DVec3::ZERO, 2, &mut out);
    }
    let _ = writeln!(out, "  </worldbody>\n  <contact>");
    // Parts that share a joint touch there by construction. MuJoCo filters such pairs itself only
    // when the parent can move.
    for pair in touching(&twin.tree, |part| twin.parts[part].mesh.is_empty()) {
        let [a, b] = pair.map(|part| escape(&twin.tree.parts[part]));
        let _ = writeln!(out, "    <exclude body1=\"{a}\" body2=\"{b}\"/>");
    }
    let _ = writeln!(out, "  </contact>");
    if !twin.tree.couplings.is_empty() {
        let _ = writeln!(out, "  <equality>");
        for c in &twin.tree.couplings {
            let [a, b] = [c.follower, c.leader].map(|j| escape(&twin.tree.joints[j].name));
            let polynomial: Vec<String> = c.polynomial.iter().map(|x| format!("{x:.9}")).collect();
            let _ = writeln!(out, "    <joint joint1=\"{a}\" joint2=\"{b}\" polycoef=\"{}\"/>", polynomial.join(" "));
        }
        let _ = writeln!(out, "  </equality>");
    }
    out + "</mujoco>\n"
}

fn body(twin: &Twin, part: usize, parent_origin: DVec3, depth: usize, out: &mut String) {
    let pad = "  ".repeat(depth);
    let origin = link_origin(twin, part);
    let model = &twin.parts[part];
    let _ = writeln!(out, "{pad}<body name=\"{}\" pos=\"{}\">", escape(&model.name), xyz(origin - parent_origin));
    let m = model.inertial.inertia;
    let _ = writeln!(
        out,
        "{pad}  <inertial pos=\"{}\" mass=\"{:.9e}\" fullinertia=\"{:.9e} {:.9e} {:.9e} {:.9e} {:.9e} {:.9e}\"/>",
        xyz(model.inertial.com - origin),
        model.inertial.mass,
        m.x_axis.x,
        m.y_axis.y,
        m.z_axis.z,
        m.y_axis.x,
        m.z_axis.x,
        m.z_axis.y
    );
    if let Some(joint) = twin.tree.joint_of(part) {
        let kind = match joint.screw.kind {
            JointKind::Fixed => None,
            JointKind::Prismatic => Some("slide"),
            JointKind::Revolute | JointKind::Continuous => Some("hinge"),
        };
        if let Some(kind) = kind {
            let range = if joint.screw.kind == JointKind::Continuous {
                String::new()
            } else {
                format!(" range=\"{:.9} {:.9}\"", joint.limits[0], joint.limits[1])
            };
            let _ = writeln!(
                out,
                "{pad}  <joint name=\"{}\" type=\"{kind}\" axis=\"{}\"{range} damping=\"{:.6e}\" armature=\"{:.6e}\"/>",
                escape(&joint.name),
                xyz(joint.screw.axis),
                damping(twin, joint),
                armature(twin, joint)
            );
        }
    }
    let [r, g, b] = mean_color(&model.mesh);
    let plain = format!("rgba=\"{r:.4} {g:.4} {b:.4} 1\"");
    let look = if model.texture.is_some() { format!("material=\"photo_{part}\"") } else { plain.clone() };
    let _ = writeln!(
        out,
        "{pad}  <geom name=\"visual_{part}\" type=\"mesh\" mesh=\"visual_{part}\" contype=\"0\" conaffinity=\"0\" group=\"2\" density=\"0\" {look}/>"
    );
    for (k, hull) in model.hulls.iter().enumerate() {
        let shape = match cuboid::of(hull) {
            Some(c) => {
                let [size, pos] = [c.half, c.centre - origin].map(xyz);
                let q = c.rot;
                format!(
                    "type=\"box\" size=\"{size}\" pos=\"{pos}\" quat=\"{:.9} {:.9} {:.9} {:.9}\"",
                    q.w, q.x, q.y, q.z
                )
            }
            None => format!("type=\"mesh\" mesh=\"hull_{part}_{k}\""),
        };
        let _ = writeln!(out, "{pad}  <geom name=\"hull_{part}_{k}\" {shape} group=\"3\" {plain}/>");
    }
    for joint in twin.tree.joints.iter().filter(|j| j.parent == part) {
        body(twin, joint.child, origin, depth + 1, out);
    }
    let _ = writeln!(out, "{pad}</body>");
}
