//! URDF text of a twin. Written by hand: the format is small, and the reader in the tests is
//! someone else's.

use crate::link::{damping, hull_file, link_origin, mean_color, visual_file};
use crate::xml::{escape, xyz};
use crate::{Twin, cuboid};
use hingecast_geom::JointKind;
use std::fmt::Write as _;

/// The `<mujoco>` element makes MuJoCo resolve the mesh paths as every other loader does, and keep the
/// base, which it would melt into the world.
pub fn to_string(twin: &Twin) -> String {
    let mut out = String::new();
    let _ = writeln!(out, "<?xml version=\"1.0\"?>\n<robot name=\"{}\">", escape(&twin.name));
    let _ = writeln!(
        out,
        "  <mujoco><compiler meshdir=\".\" strippath=\"false\" discardvisual=\"true\" fusestatic=\"false\" balanceinertia=\"true\"/></mujoco>"
    );
    for (i, part) in twin.parts.iter().enumerate() {
        let origin = link_origin(twin, i);
        let com = part.inertial.com - origin;
        let m = part.inertial.inertia;
        let _ = writeln!(out, "  <link name=\"{}\">", escape(&part.name));
        let _ = writeln!(
            out,
            "    <inertial><origin xyz=\"{}\"/><mass value=\"{:.9e}\"/><inertia ixx=\"{:.9e}\" ixy=\"{:.9e}\" ixz=\"{:.9e}\" iyy=\"{:.9e}\" iyz=\"{:.9e}\" izz=\"{:.9e}\"/></inertial>",
            xyz(com),
            part.inertial.mass,
            m.x_axis.x,
            m.y_axis.x,
            m.z_axis.x,
            m.y_axis.y,
            m.z_axis.y,
            m.z_axis.z
        );
        // A material here would hide the one of the OBJ, and with it the photographs.
        let material = if part.texture.is_some() {
            String::new()
        } else {
            let [r, g, b] = mean_color(&part.mesh);
            format!("<material name=\"color_{i}\"><color rgba=\"{r:.4} {g:.4} {b:.4} 1\"/></material>")
        };
        let _ = writeln!(
            out,
            "    <visual><geometry><mesh filename=\"{}\"/></geometry>{material}</visual>",
            path(&visual_file(i))
        );
        for (k, hull) in part.hulls.iter().enumerate() {
            let shape = match cuboid::of(hull) {
                Some(c) => {
                    let [size, at, rpy] = c.words(origin);
                    format!("<origin xyz=\"{at}\" rpy=\"{rpy}\"/><geometry><box size=\"{size}\"/></geometry>")
                }
                None => format!("<geometry><mesh filename=\"{}\"/></geometry>", path(&hull_file(i, k))),
            };
            let _ = writeln!(out, "    <collision>{shape}</collision>");
        }
        let _ = writeln!(out, "  </link>");
    }
    for (id, joint) in twin.tree.joints.iter().enumerate() {
        let kind = match joint.screw.kind {
            JointKind::Fixed => "fixed",
            JointKind::Revolute => "revolute",
            JointKind::Continuous => "continuous",
            JointKind::Prismatic => "prismatic",
        };
        let offset = link_origin(twin, joint.child) - link_origin(twin, joint.parent);
        let _ = writeln!(out, "  <joint name=\"{}\" type=\"{kind}\">", escape(&joint.name));
        let _ = writeln!(out, "    <origin xyz=\"{}\"/>", xyz(offset));
        let _ = writeln!(
            out,
            "    <parent link=\"{}\"/><child link=\"{}\"/>",
            escape(&twin.tree.parts[joint.parent]),
            escape(&twin.tree.parts[joint.child])
        );
        if joint.screw.kind != JointKind::Fixed {
            let _ = writeln!(out, "    <axis xyz=\"{}\"/>", xyz(joint.screw.axis));
            let _ = writeln!(
                out,
                "    <limit lower=\"{:.9}\" upper=\"{:.9}\" effort=\"1000\" velocity=\"10\"/>",
                joint.limits[0], joint.limits[1]
            );
            // URDF knows lines only; `export` says so of the others.
            if let Some((c, [offset, multiplier])) = twin.tree.coupling_of(id).and_then(|c| Some((c, c.line()?))) {
                let leader = escape(&twin.tree.joints[c.leader].name);
                let _ = writeln!(
                    out,
                    "    <mimic joint=\"{leader}\" multiplier=\"{multiplier:.9}\" offset=\"{offset:.9}\"/>"
                );
            }
            let _ = writeln!(out, "    <dynamics damping=\"{:.6e}\" friction=\"0\"/>", damping(twin, joint));
        }
        let _ = writeln!(out, "  </joint>");
    }
    out + "</robot>\n"
}

fn path(file: &str) -> String {
    format!("meshes/{file}")
}
