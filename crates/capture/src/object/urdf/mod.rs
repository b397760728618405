//! URDF: links with visuals, joints; the PartNet-Mobility layout is a URDF whose base joint turns
//! y-up meshes upright.
//!
//! Only what is seen is read: visuals and joints. Fixed joints, and joints that don't matter
//! (wheels, buttons), merge their child into the parent's part, at 0.

mod joint;
mod partnet;
mod places;
mod visual;

use super::mesh_file::Library;
use super::xml::{Reader, children};
use super::{ArticulatedObject, PartGeometry};
use crate::CaptureError;
use hingecast_geom::{Joint, JointKind, Pose, Screw};
use joint::UrdfJoint;
use places::Places;
use roxmltree::{Document, Node};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use visual::Visuals;

/// Whether a document that may not even parse is a URDF that was never expanded: elements or
/// expressions of xacro.
pub(super) fn is_xacro(xml: &Document) -> bool {
    let expression = |value: &str| value.contains("${") || value.contains("$(");
    xml.descendants().filter(Node::is_element).any(|n| {
        n.tag_name().namespace().is_some_and(|space| space.contains("xacro"))
            || n.attributes().any(|a| expression(a.value()))
    })
}

/// Says how an unexpanded file is made a URDF.
pub(super) fn not_expanded(file: &Path) -> CaptureError {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let stem = name.split('.').next().unwrap_or("robot");
    let hint = format!("xacro {stem}.xacro > {stem}.urdf");
    let what = "the file is xacro that was not expanded: it holds xacro elements or ${...} expressions";
    CaptureError::new(what, file.display().to_string(), hint)
}

pub(super) fn load(file: &Path, xml: &Document) -> Result<ArticulatedObject, CaptureError> {
    let folder = file.parent().unwrap_or(Path::new("."));
    let reader = Reader { file };
    let robot = xml.root_element();
    if is_xacro(xml) {
        return Err(not_expanded(file));
    }
    let links: Vec<(String, Node)> =
        children(robot, "link").map(|l| Ok((reader.text(l, "name")?, l))).collect::<Result<_, CaptureError>>()?;
    let mut joints: Vec<UrdfJoint> = children(robot, "joint").map(|j| reader.joint(j)).collect::<Result<_, _>>()?;
    for j in &joints {
        for link in [&j.parent, &j.child] {
            if !links.iter().any(|(name, _)| name == link) {
                let hint = "correct the joint's parent or child";
                return Err(reader.error(format!("joint {} names the link {link}, which is not there", j.name), hint));
            }
        }
    }
    // The walk below goes to a link once for every joint that ends in it: two such joints make it
    // endless (a cycle) or exponential (diamonds).
    let mut ends: BTreeSet<&str> = BTreeSet::new();
    if let Some(j) = joints.iter().find(|j| !ends.insert(&j.child)) {
        let what = format!("the link {} is the child of two joints; {} is the second", j.child, j.name);
        return Err(reader.error(what, "let every link be the child of one joint"));
    }
    reader.resolve_followers(&mut joints)?;
    let places = Places::of(file);
    let mut library = Library::default();
    let names = partnet::names(folder, &links);
    let mut minor = partnet::minor_joints(folder, &joints, &names);
    let partnet = partnet::is_partnet(folder);
    if partnet {
        for joint in partnet::idle_joints(&links, &joints, &places).difference(&minor.clone()) {
            library.note(format!("joint '{joint}' stays at 0: what it moves has no surface"));
            minor.insert(joint.clone());
        }
    }

    // Walk from the roots: canonical pose of each link, and the part it belongs to.
    let mut object = ArticulatedObject {
        name: robot.attribute("name").unwrap_or("object").trim_start_matches("partnet_").to_string(),
        source: file.to_path_buf(),
        // PartNet-Mobility normalises its objects; a URDF otherwise is in metres by its standard.
        metric: !partnet,
        ..Default::default()
    };
    let children_of = |link: &str| joints.iter().filter(move |j| j.parent == link).collect::<Vec<_>>();
    let is_child: BTreeSet<&str> = joints.iter().map(|j| j.child.as_str()).collect();
    let mut placed: BTreeMap<String, (usize, Pose)> = BTreeMap::new();
    let mut queue: Vec<(String, Option<usize>, Pose)> = links
        .iter()
        .filter(|(name, _)| !is_child.contains(name.as_str()))
        .map(|(name, _)| (name.clone(), None, Pose::IDENTITY))
        .collect();
    let mut next = 0;
    while next < queue.len() {
        let (link, part, pose) = queue[next].clone();
        next += 1;
        let part = part.unwrap_or_else(|| {
            object.parts.push(PartGeometry::default());
            object.parts.len() - 1
        });
        object.parts[part].links.push(link.clone());
        placed.insert(link.clone(), (part, pose));
        for j in children_of(&link) {
            let world_from_joint = pose * j.parent_from_joint;
            let merges = j.kind == JointKind::Fixed || minor.contains(&j.name);
            let child_part = if merges {
                Some(part)
            } else {
                object.parts.push(PartGeometry::default());
                let child = object.parts.len() - 1;
                joint::note(j).into_iter().for_each(|sentence| library.note(sentence));
                let screw =
                    Screw { kind: j.kind, axis: world_from_joint.rotate(j.axis), pivot: world_from_joint.trans };
                let joint =
                    Joint { name: j.name.clone(), parent: part, child, screw, values: Vec::new(), limits: j.limits };
                object.tree.joints.push(joint);
                Some(child)
            };
            queue.push((j.child.clone(), child_part, world_from_joint));
        }
    }
    if placed.len() < links.len() {
        return Err(reader.error("some links hang in a cycle of joints", "let every link be the child of one joint"));
    }

    joint::couple(&joints, &mut object.tree).into_iter().for_each(|sentence| library.note(sentence));

    let materials = reader.materials(robot)?;
    let (may_lack_meshes, missing) = (partnet, Vec::new());
    let mut visuals = Visuals { reader: &reader, places: &places, materials, library, may_lack_meshes, missing };
    for (name, node) in &links {
        let (part, pose) = placed[name];
        for visual in children(*node, "visual") {
            if let Some((geometry, origin, scale)) = visuals.read(visual)? {
                object.parts[part].append(&geometry, &(pose * origin), scale);
            }
        }
    }
    let Visuals { mut library, missing, .. } = visuals;
    if !missing.is_empty() {
        library.note(format!("left out, as the data set never had these meshes: {}", missing.join(", ")));
    }
    let seen = |link: &str| links.iter().any(|(n, l)| n == link && children(*l, "visual").next().is_some());
    let hint = "correct the links and joints: a link that moves needs a <visual>, or its joint is fixed";
    object.finish(library, &names, seen).map_err(|e| reader.error(e, hint))
}
