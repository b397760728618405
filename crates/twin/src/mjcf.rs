//! MJCF text of a twin: the same links and joints as the URDF, for MuJoCo and for robosuite.

use crate::link::{armature, damping, hull_file, link_origin, mean_color, texture_file, touching, visual_file};
use crate::xml::{escape, wxyz, xyz};
use crate::{Twin, cuboid};
use glam::{DQuat, DVec3};
use hingecast_geom::JointKind;
use std::fmt::Write as _;

/// Who reads the file.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Reader {
    MuJoCo,
    /// Takes paths from the file on, collision in group 0 and the rest in 1.
    Robosuite,
}

impl Reader {
    fn folder(self) -> &'static str {
        if self == Self::MuJoCo { "" } else { "meshes/" }
    }

    /// Groups of what is seen and of what collides.
    fn groups(self) -> [u8; 2] {
        if self == Self::MuJoCo { [2, 3] } else { [1, 0] }
    }
}

/// The whole file. It names the mesh files that [`crate::write`] puts beside it.
pub fn to_string(twin: &Twin) -> String {
    let mut out = String::new();
    let _ = writeln!(out, "<mujoco model=\"{}\">", escape(&twin.name));
    let _ =
        writeln!(out, "  <compiler angle=\"radian\" meshdir=\"meshes\" texturedir=\"meshes\" autolimits=\"true\"/>");
    let _ = writeln!(out, "  <statistic extent=\"{:.6}\"/>", twin.diagonal);
    assets(twin, Reader::MuJoCo, &mut out);
    out.push_str("  <worldbody>\n");
    for root in roots(twin) {
        body(twin, root, DVec3::ZERO, 2, Reader::MuJoCo, &mut out);
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

/// An object as robosuite's `MujocoXMLObject` takes it (1.5.2): metres along z, its foot's middle in the
/// origin; a body `object` in a body, and three sites that say how large it is.
pub fn for_robosuite(twin: &Twin) -> String {
    let mut out = format!("<mujoco model=\"{}\">\n", escape(&twin.name));
    assets(twin, Reader::Robosuite, &mut out);
    let upright = DQuat::from_rotation_arc(twin.up, DVec3::Z);
    // In the first state.
    let poses = twin.tree.poses(&vec![0.0; twin.tree.joints.len()]);
    let points = twin
        .parts
        .iter()
        .zip(&poses)
        .flat_map(|(part, pose)| part.mesh.vertices.iter().map(move |v| upright * pose.apply(v.as_dvec3())));
    let (lo, hi) = points.fold((DVec3::MAX, DVec3::MIN), |(lo, hi), x| (lo.min(x), hi.max(x)));
    let (lo, hi) = if lo.cmple(hi).all() { (lo, hi) } else { (DVec3::ZERO, DVec3::ZERO) };
    let foot = ((lo + hi) / 2.0).with_z(lo.z);
    let _ = writeln!(out, "  <worldbody>\n    <body>\n      <body name=\"object\">");
    let _ = writeln!(out, "        <body name=\"upright\" pos=\"{}\" quat=\"{}\">", xyz(-foot), wxyz(upright));
    for root in roots(twin) {
        body(twin, root, DVec3::ZERO, 5, Reader::Robosuite, &mut out);
    }
    let _ = writeln!(out, "        </body>\n      </body>");
    let size = hi - lo;
    let sites = [
        ("bottom", DVec3::ZERO),
        ("top", size.with_x(0.0).with_y(0.0)),
        ("horizontal_radius", DVec3::new(size.truncate().length() / 2.0, 0.0, 0.0)),
    ];
    for (name, at) in sites {
        let _ = writeln!(out, "      <site name=\"{name}_site\" pos=\"{}\" size=\"0.005\" rgba=\"0 0 0 0\"/>", xyz(at));
    }
    out + "    </body>\n  </worldbody>\n</mujoco>\n"
}

fn roots(twin: &Twin) -> Vec<usize> {
    (0..twin.parts.len()).filter(|&p| twin.tree.joint_of(p).is_none()).collect()
}

fn assets(twin: &Twin, reader: Reader, out: &mut String) {
    let folder = reader.folder();
    out.push_str("  <asset>\n");
    for (i, part) in twin.parts.iter().enumerate() {
        // "shell": a visual mesh need not enclose a volume; mass comes from <inertial>.
        let file = visual_file(i);
        let _ = writeln!(out, "    <mesh name=\"visual_{i}\" file=\"{folder}{file}\" inertia=\"shell\"/>");
        if part.texture.is_some() {
            let file = texture_file(i);
            let _ = writeln!(out, "    <texture name=\"photo_{i}\" type=\"2d\" file=\"{folder}{file}\"/>");
            let _ = writeln!(
                out,
                "    <material name=\"photo_{i}\" texture=\"photo_{i}\" specular=\"0\" shininess=\"0\"/>"
            );
        }
        for k in (0..part.hulls.len()).filter(|&k| cuboid::of(&part.hulls[k]).is_none()) {
            let file = hull_file(i, k);
            let _ = writeln!(out, "    <mesh name=\"hull_{i}_{k}\" file=\"{folder}{file}\" inertia=\"convex\"/>");
        }
    }
    out.push_str("  </asset>\n");
}

fn body(twin: &Twin, part: usize, parent_origin: DVec3, depth: usize, reader: Reader, out: &mut String) {
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
                format!(" limited=\"true\" range=\"{:.9} {:.9}\"", joint.limits[0], joint.limits[1])
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
    let [seen, collides] = reader.groups();
    let [r, g, b] = mean_color(&model.mesh);
    let plain = format!("rgba=\"{r:.4} {g:.4} {b:.4} 1\"");
    let look = if model.texture.is_some() { format!("material=\"photo_{part}\"") } else { plain.clone() };
    let _ = writeln!(
        out,
        "{pad}  <geom name=\"visual_{part}\" type=\"mesh\" mesh=\"visual_{part}\" contype=\"0\" conaffinity=\"0\" group=\"{seen}\" density=\"0\" {look}/>"
    );
    for (k, hull) in model.hulls.iter().enumerate() {
        let shape = match cuboid::of(hull) {
            Some(c) => {
                let [size, pos] = [c.half, c.centre - origin].map(xyz);
                format!("type=\"box\" size=\"{size}\" pos=\"{pos}\" quat=\"{}\"", wxyz(c.rot))
            }
            None => format!("type=\"mesh\" mesh=\"hull_{part}_{k}\""),
        };
        let _ = writeln!(out, "{pad}  <geom name=\"hull_{part}_{k}\" {shape} group=\"{collides}\" {plain}/>");
    }
    for joint in twin.tree.joints.iter().filter(|j| j.parent == part) {
        body(twin, joint.child, origin, depth + 1, reader, out);
    }
    let _ = writeln!(out, "{pad}</body>");
}
