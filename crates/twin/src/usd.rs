//! A twin as a USD layer in text (`.usda`), with UsdPhysics: what Isaac Sim, Newton and Omniverse
//! open. Links are siblings under one articulation, placed as all joints stand at 0.
//!
//! A joint's axis is X of its own frame, which is turned onto the axis that was found, exactly:
//! converters that take X, Y or Z of the link snap small tilts. Angles are degrees there.

use crate::link::{damping, drawn, link_origin, touching};
use crate::{PartModel, Twin};
use glam::{DMat3, DQuat, DVec3, Quat, Vec3};
use hingecast_geom::{Joint, JointKind, TriMesh};
use nalgebra::Matrix3;
use std::fmt::Write as _;

/// The text of the layer; textures are `meshes/visual/part_N.png` beside it.
pub fn to_string(twin: &Twin) -> String {
    let root = identifier(&twin.name, 0, "object");
    let links: Vec<String> = (0..twin.parts.len()).map(|i| identifier(&twin.parts[i].name, i, "link")).collect();
    let at = |part: usize| format!("</{root}/{}>", links[part]);
    let mut out = format!(
        "#usda 1.0\n(\n    defaultPrim = \"{root}\"\n    kilogramsPerUnit = 1\n    metersPerUnit = 1\n    upAxis = \"Z\"\n)\n\n"
    );
    let upright = DQuat::from_rotation_arc(twin.up.normalize_or(DVec3::Z), DVec3::Z);
    let _ = writeln!(
        out,
        "def Xform \"{root}\" (\n    prepend apiSchemas = [\"PhysicsArticulationRootAPI\"]\n    displayName = {}\n    kind = \"component\"\n)\n{{\n    quatd xformOp:orient = {}\n    uniform token[] xformOpOrder = [\"xformOp:orient\"]\n",
        quoted(&twin.name),
        quat(upright)
    );
    let pairs = touching(&twin.tree, |part| twin.parts[part].mesh.is_empty());
    for (part, model) in twin.parts.iter().enumerate() {
        let origin = link_origin(twin, part);
        let beside: Vec<String> = pairs.iter().filter(|p| p[1] == part).map(|p| at(p[0])).collect();
        let filtered = if beside.is_empty() { "" } else { ", \"PhysicsFilteredPairsAPI\"" };
        let _ = writeln!(
            out,
            "    def Xform \"{}\" (\n        prepend apiSchemas = [\"PhysicsRigidBodyAPI\", \"PhysicsMassAPI\"{filtered}]\n        displayName = {}\n    )\n    {{\n        double3 xformOp:translate = {}\n        uniform token[] xformOpOrder = [\"xformOp:translate\"]",
            links[part],
            quoted(&model.name),
            triple(origin)
        );
        if !beside.is_empty() {
            let _ = writeln!(out, "        rel physics:filteredPairs = [{}]", beside.join(", "));
        }
        mass(model, origin, &mut out);
        if !model.mesh.is_empty() {
            let look = model.texture.is_some().then(|| format!("</{root}/Looks/{}>", links[part]));
            visual(model, origin, look.as_deref(), &mut out);
        }
        for (k, hull) in model.hulls.iter().enumerate() {
            collision(hull, k, origin, &mut out);
        }
        out.push_str("    }\n\n");
        if twin.tree.joint_of(part).is_none() {
            let _ = writeln!(
                out,
                "    def PhysicsFixedJoint \"{}_stands\"\n    {{\n        rel physics:body1 = {}\n        quatf physics:localRot0 = {}\n    }}\n",
                links[part],
                at(part),
                quat(upright)
            );
        }
    }
    for (j, joint) in twin.tree.joints.iter().enumerate() {
        let name = identifier(&joint.name, j, "joint");
        // Links and joints are siblings, and may be called alike.
        let name = if links.contains(&name) { format!("{name}_joint") } else { name };
        articulated(twin, j, joint, &name, [&at(joint.parent), &at(joint.child)], &mut out);
    }
    let textured = twin.parts.iter().enumerate().filter(|(_, p)| p.texture.is_some());
    out.push_str("    def Scope \"Looks\"\n    {\n");
    textured.for_each(|(part, _)| material(&root, &links[part], part, &mut out));
    out + "    }\n}\n"
}

fn mass(model: &PartModel, origin: DVec3, out: &mut String) {
    let inertial = &model.inertial;
    let eigen = Matrix3::from_column_slice(&inertial.inertia.to_cols_array()).symmetric_eigen();
    let column = |k: usize| {
        let v = eigen.eigenvectors.column(k);
        DVec3::new(v[0], v[1], v[2])
    };
    // Right-handed: the third is made of the first two.
    let axes = DMat3::from_cols(column(0), column(1), column(0).cross(column(1)));
    let _ = writeln!(
        out,
        "        float physics:mass = {}\n        point3f physics:centerOfMass = {}\n        float3 physics:diagonalInertia = {}\n        quatf physics:principalAxes = {}",
        inertial.mass,
        triple(inertial.com - origin),
        triple(DVec3::from_slice(eigen.eigenvalues.as_slice())),
        quat(DQuat::from_mat3(&axes).normalize())
    );
}

fn visual(model: &PartModel, origin: DVec3, look: Option<&str>, out: &mut String) {
    let api =
        if look.is_some() { " (\n            prepend apiSchemas = [\"MaterialBindingAPI\"]\n        )" } else { "" };
    let _ = writeln!(out, "\n        def Mesh \"visual\"{api}\n        {{");
    let (points, faces) = drawn(model, origin);
    surface(&points, faces, out);
    if let (Some(texture), Some(look)) = (&model.texture, look) {
        let uv: Vec<String> = texture.corners.iter().map(|[u, v]| format!("({u:.6}, {v:.6})")).collect();
        let _ = writeln!(
            out,
            "            texCoord2f[] primvars:st = [{}] (\n                interpolation = \"vertex\"\n            )\n            rel material:binding = {look}",
            uv.join(", ")
        );
    } else if model.mesh.colors.len() == model.mesh.vertices.len() {
        let linear = |c: &[u8; 3]| single(Vec3::from(c.map(crate::color::linear)));
        let colors: Vec<String> = model.mesh.colors.iter().map(linear).collect();
        let _ = writeln!(
            out,
            "            color3f[] primvars:displayColor = [{}] (\n                interpolation = \"vertex\"\n            )",
            colors.join(", ")
        );
    }
    out.push_str("        }\n");
}

fn collision(hull: &TriMesh, k: usize, origin: DVec3, out: &mut String) {
    let _ = writeln!(
        out,
        "\n        def Mesh \"collision_{k}\" (\n            prepend apiSchemas = [\"PhysicsCollisionAPI\", \"PhysicsMeshCollisionAPI\"]\n        )\n        {{\n            uniform token physics:approximation = \"convexHull\"\n            uniform token purpose = \"guide\""
    );
    let local: Vec<Vec3> = hull.vertices.iter().map(|v| (v.as_dvec3() - origin).as_vec3()).collect();
    surface(&local, &hull.faces, out);
    out.push_str("        }\n");
}

/// Points and triangles of a mesh.
fn surface(points: &[Vec3], faces: &[[u32; 3]], out: &mut String) {
    let (lo, hi) = points.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(lo, hi), v| (lo.min(*v), hi.max(*v)));
    let points: Vec<String> = points.iter().map(|v| single(*v)).collect();
    let indices: Vec<String> = faces.iter().flatten().map(u32::to_string).collect();
    let _ = writeln!(
        out,
        "            float3[] extent = [{}, {}]\n            int[] faceVertexCounts = [{}]\n            int[] faceVertexIndices = [{}]\n            point3f[] points = [{}]\n            uniform token subdivisionScheme = \"none\"",
        single(lo),
        single(hi),
        vec!["3"; faces.len()].join(", "),
        indices.join(", "),
        points.join(", ")
    );
}

fn articulated(twin: &Twin, j: usize, joint: &Joint, name: &str, bodies: [&str; 2], out: &mut String) {
    let (kind, drive, unit) = match joint.screw.kind {
        JointKind::Fixed => ("PhysicsFixedJoint", "", 1.0),
        JointKind::Prismatic => ("PhysicsPrismaticJoint", "linear", 1.0),
        JointKind::Revolute | JointKind::Continuous => ("PhysicsRevoluteJoint", "angular", 1f64.to_degrees()),
    };
    let moves = joint.screw.kind != JointKind::Fixed;
    let api =
        if moves { format!("    prepend apiSchemas = [\"PhysicsDriveAPI:{drive}\"]\n    ") } else { String::new() };
    let turned = if moves { DQuat::from_rotation_arc(DVec3::X, joint.screw.axis) } else { DQuat::IDENTITY };
    // Links stand as the world does where all joints are at 0: both frames are turned alike.
    let _ = writeln!(
        out,
        "    def {kind} \"{name}\" (\n    {api}    displayName = {}\n    )\n    {{\n        rel physics:body0 = {}\n        rel physics:body1 = {}\n        point3f physics:localPos0 = {}\n        point3f physics:localPos1 = (0, 0, 0)\n        quatf physics:localRot0 = {}\n        quatf physics:localRot1 = {}",
        quoted(&joint.name),
        bodies[0],
        bodies[1],
        triple(link_origin(twin, joint.child) - link_origin(twin, joint.parent)),
        quat(turned),
        quat(turned)
    );
    if moves {
        out.push_str("        uniform token physics:axis = \"X\"\n");
        if joint.screw.kind != JointKind::Continuous {
            let [lo, hi] = joint.limits.map(|x| x * unit);
            let _ = writeln!(out, "        float physics:lowerLimit = {lo}\n        float physics:upperLimit = {hi}");
        }
        // A drive without stiffness is a damper.
        let _ = writeln!(
            out,
            "        float drive:{drive}:physics:damping = {:e}\n        float drive:{drive}:physics:stiffness = 0",
            damping(twin, joint) / unit
        );
        if let Some(c) = twin.tree.coupling_of(j) {
            let _ = writeln!(
                out,
                "        custom string hingecast:follows = {}\n        custom double[] hingecast:polynomial = {:?}",
                quoted(&twin.tree.joints[c.leader].name),
                c.polynomial
            );
        }
    }
    out.push_str("    }\n\n");
}

fn material(root: &str, link: &str, part: usize, out: &mut String) {
    let _ = writeln!(
        out,
        r#"        def Material "{link}"
        {{
            token outputs:surface.connect = </{root}/Looks/{link}/surface.outputs:surface>

            def Shader "surface"
            {{
                uniform token info:id = "UsdPreviewSurface"
                color3f inputs:diffuseColor.connect = </{root}/Looks/{link}/photograph.outputs:rgb>
                float inputs:roughness = 1
                token outputs:surface
            }}

            def Shader "photograph"
            {{
                uniform token info:id = "UsdUVTexture"
                asset inputs:file = @./meshes/visual/part_{part}.png@
                token inputs:sourceColorSpace = "sRGB"
                float2 inputs:st.connect = </{root}/Looks/{link}/corners.outputs:result>
                token inputs:wrapS = "clamp"
                token inputs:wrapT = "clamp"
                float3 outputs:rgb
            }}

            def Shader "corners"
            {{
                uniform token info:id = "UsdPrimvarReader_float2"
                string inputs:varname = "st"
                float2 outputs:result
            }}
        }}"#
    );
}

/// A name that USD allows: letters, digits, underscores. Where something had to go, the number makes it
/// one of its own; people see `displayName`.
fn identifier(name: &str, number: usize, kind: &str) -> String {
    let fine = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let starts_well = name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_');
    if starts_well && name.chars().all(fine) && name != "Looks" {
        return name.to_string();
    }
    let kept: String = name.chars().map(|c| if fine(c) { c } else { '_' }).collect();
    format!("{kind}_{number}_{kept}")
}

/// A string of USD's text form.
fn quoted(text: &str) -> String {
    let plain = text.replace('\\', "\\\\").replace('"', "\\\"").replace(['\n', '\r'], " ");
    format!("\"{plain}\"")
}

fn triple(v: DVec3) -> String {
    format!("({}, {}, {})", v.x, v.y, v.z)
}

fn single(v: Vec3) -> String {
    format!("({}, {}, {})", v.x, v.y, v.z)
}

/// Real part first.
fn quat(q: DQuat) -> String {
    let q: Quat = q.as_quat();
    format!("({}, {}, {}, {})", q.w, q.x, q.y, q.z)
}
