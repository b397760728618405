//! SDFormat text of a twin, for Gazebo and Drake: the same links and joints as the URDF.

use crate::link::{damping, hull_file, link_origin, mean_color, visual_file};
use crate::xml::{escape, xyz};
use crate::{PartModel, Twin, cuboid};
use glam::DVec3;
use hingecast_geom::{Joint, JointKind};
use std::fmt::Write as _;

/// The whole file. The model's frame is the canonical world; its base stands still in it, so a
/// simulator that places the model places it all. Link frames as in [`crate::link`].
pub fn to_string(twin: &Twin) -> String {
    let mut out = format!("<?xml version=\"1.0\"?>\n<sdf version=\"1.11\">\n<model name=\"{}\">\n", escape(&twin.name));
    for (i, part) in twin.parts.iter().enumerate() {
        link(i, part, link_origin(twin, i), &mut out);
        if twin.tree.joint_of(i).is_none() {
            let name = escape(&part.name);
            let _ = writeln!(
                out,
                "  <joint name=\"{name}_stands\" type=\"fixed\"><parent>world</parent><child>{name}</child></joint>"
            );
        }
    }
    for (id, j) in twin.tree.joints.iter().enumerate() {
        joint(twin, id, j, &mut out);
    }
    out + "</model>\n</sdf>\n"
}

fn link(i: usize, part: &PartModel, origin: DVec3, out: &mut String) {
    let m = part.inertial.inertia;
    let _ = writeln!(
        out,
        "  <link name=\"{}\">\n    <pose>{} 0 0 0</pose>\n    <inertial><pose>{} 0 0 0</pose><mass>{:.9e}</mass><inertia><ixx>{:.9e}</ixx><ixy>{:.9e}</ixy><ixz>{:.9e}</ixz><iyy>{:.9e}</iyy><iyz>{:.9e}</iyz><izz>{:.9e}</izz></inertia></inertial>",
        escape(&part.name),
        xyz(origin),
        xyz(part.inertial.com - origin),
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
        format!("<material><diffuse>{r:.4} {g:.4} {b:.4} 1</diffuse></material>")
    };
    let _ =
        writeln!(out, "    <visual name=\"visual\"><geometry>{}</geometry>{material}</visual>", mesh(&visual_file(i)));
    for (k, hull) in part.hulls.iter().enumerate() {
        let shape = match cuboid::of(hull) {
            Some(c) => {
                let [size, at, rpy] = c.words(origin);
                format!("<pose>{at} {rpy}</pose><geometry><box><size>{size}</size></box></geometry>")
            }
            None => format!("<geometry>{}</geometry>", mesh(&hull_file(i, k))),
        };
        let _ = writeln!(out, "    <collision name=\"hull_{k}\">{shape}</collision>");
    }
    out.push_str("  </link>\n");
}

fn mesh(file: &str) -> String {
    format!("<mesh><uri>meshes/{file}</uri></mesh>")
}

fn joint(twin: &Twin, id: usize, joint: &Joint, out: &mut String) {
    let kind = match joint.screw.kind {
        JointKind::Fixed => "fixed",
        JointKind::Prismatic => "prismatic",
        JointKind::Revolute => "revolute",
        JointKind::Continuous => "continuous",
    };
    let [parent, child] = [joint.parent, joint.child].map(|p| escape(&twin.tree.parts[p]));
    let _ = writeln!(
        out,
        "  <joint name=\"{}\" type=\"{kind}\">\n    <parent>{parent}</parent><child>{child}</child>",
        escape(&joint.name)
    );
    if joint.screw.kind != JointKind::Fixed {
        let limit = if joint.screw.kind == JointKind::Continuous {
            String::new()
        } else {
            format!("<lower>{:.9}</lower><upper>{:.9}</upper>", joint.limits[0], joint.limits[1])
        };
        // SDFormat knows lines only, as URDF does; `export` says so of the others.
        let line = twin.tree.coupling_of(id).and_then(|c| Some((c, c.line()?)));
        let mimic = line.map_or(String::new(), |(c, [offset, multiplier])| {
            let leader = escape(&twin.tree.joints[c.leader].name);
            format!("<mimic joint=\"{leader}\" axis=\"axis\"><multiplier>{multiplier:.9}</multiplier><offset>{offset:.9}</offset><reference>0</reference></mimic>")
        });
        let _ = writeln!(
            out,
            "    <axis><xyz>{}</xyz><limit>{limit}</limit><dynamics><damping>{:.6e}</damping></dynamics>{mimic}</axis>",
            xyz(joint.screw.axis),
            damping(twin, joint)
        );
    }
    out.push_str("  </joint>\n");
}
