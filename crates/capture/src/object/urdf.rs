//! URDF: links with visuals, joints; the PartNet-Mobility layout is a URDF whose base joint turns
//! y-up meshes upright.
//!
//! Only what is seen is read: visuals and joints. Fixed joints, and joints that don't matter
//! (wheels, buttons), merge their child into the parent's part, at 0.

use super::mesh_file::Library;
use super::xml::{Reader, children};
use super::{ArticulatedObject, PartGeometry};
use crate::CaptureError;
use glam::{DMat3, DQuat, DVec3};
use hingecast_geom::{Joint, JointKind, Pose, Screw};
use roxmltree::{Document, Node};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

struct UrdfJoint {
    name: String,
    kind: JointKind,
    parent: String,
    child: String,
    parent_from_joint: Pose,
    axis: DVec3,
    limits: [f64; 2],
}

pub(super) fn load(file: &Path, xml: &Document) -> Result<ArticulatedObject, CaptureError> {
    let folder = file.parent().unwrap_or(Path::new("."));
    let reader = Reader { file };
    let robot = xml.root_element();
    let links: Vec<(String, Node)> =
        children(robot, "link").map(|l| Ok((reader.text(l, "name")?, l))).collect::<Result<_, CaptureError>>()?;
    let joints: Vec<UrdfJoint> = children(robot, "joint").map(|j| reader.joint(j)).collect::<Result<_, _>>()?;
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
    let names = partnet_names(folder, &links);
    let minor = minor_joints(folder, &joints, &names);

    // Walk from the roots: canonical pose of each link, and the part it belongs to.
    let mut object = ArticulatedObject {
        name: robot.attribute("name").unwrap_or("object").trim_start_matches("partnet_").to_string(),
        source: file.to_path_buf(),
        // PartNet-Mobility normalises its objects; a URDF otherwise is in metres by its standard.
        metric: !folder.join("mobility_v2.json").exists(),
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

    let mut library = Library::default();
    let colors = reader.named_colors(robot)?;
    for (name, node) in &links {
        let (part, pose) = placed[name];
        for visual in children(*node, "visual") {
            let mesh = reader.visual(visual, folder, &colors, &mut library)?;
            let (geometry, origin, scale) = mesh;
            object.parts[part].append(&geometry, &(pose * origin), scale);
        }
    }
    let seen = |link: &str| links.iter().any(|(n, l)| n == link && children(*l, "visual").next().is_some());
    object.finish(library, &names, seen).map_err(|e| reader.error(e, "correct the links and joints"))
}

/// Meanings of PartNet links: semantics.txt ("link_2 hinge lid") where it speaks of these links; in
/// some objects it numbers them otherwise, and the visuals' names ("lid-3") have to do.
fn partnet_names(folder: &Path, links: &[(String, Node)]) -> BTreeMap<String, String> {
    let text = std::fs::read_to_string(folder.join("semantics.txt")).unwrap_or_default();
    let words = |l: &str| l.split_whitespace().map(String::from).collect::<Vec<_>>();
    let rows: BTreeMap<String, String> =
        text.lines().map(words).filter(|w| w.len() == 3).map(|w| (w[0].clone(), w[2].clone())).collect();
    let with_visuals: BTreeSet<&String> =
        links.iter().filter(|(_, n)| children(*n, "visual").next().is_some()).map(|(name, _)| name).collect();
    if !rows.is_empty() && rows.keys().collect::<BTreeSet<_>>() == with_visuals {
        return rows;
    }
    if !folder.join("mobility_v2.json").exists() {
        return BTreeMap::new();
    }
    let of_visual = |n: &Node| {
        let name = children(*n, "visual").next()?.attribute("name")?;
        Some(name.rsplit_once('-').map_or(name, |(stem, _)| stem).to_string())
    };
    links.iter().filter_map(|(name, n)| Some((name.clone(), of_visual(n)?))).collect()
}

/// Joints that stay at 0: those that gt.json calls minor, or whose child is a wheel, knob or
/// button.
fn minor_joints(folder: &Path, joints: &[UrdfJoint], names: &BTreeMap<String, String>) -> BTreeSet<String> {
    let truth: Option<serde_json::Value> =
        std::fs::read_to_string(folder.join("gt.json")).ok().and_then(|t| serde_json::from_str(&t).ok());
    if let Some(list) = truth.as_ref().and_then(|t| t["joints"].as_array()) {
        let minor = list.iter().filter(|j| j["minor"] == true);
        return minor.filter_map(|j| Some(j["joint"].as_str()?.to_string())).collect();
    }
    let small = |name: &str| ["wheel", "caster", "knob", "button", "switch", "key"].iter().any(|w| name.contains(w));
    joints.iter().filter(|j| names.get(&j.child).is_some_and(|n| small(n))).map(|j| j.name.clone()).collect()
}

impl Reader<'_> {
    /// `<origin xyz rpy>` of an element: rotation about fixed x, then y, then z.
    fn origin(&self, node: Node) -> Result<Pose, CaptureError> {
        let Some(origin) = children(node, "origin").next() else { return Ok(Pose::IDENTITY) };
        let xyz = self.numbers::<3>(origin, "xyz")?.unwrap_or_default();
        let [r, p, y] = self.numbers::<3>(origin, "rpy")?.unwrap_or_default();
        let rot = DMat3::from_rotation_z(y) * DMat3::from_rotation_y(p) * DMat3::from_rotation_x(r);
        Ok(Pose::new(DQuat::from_mat3(&rot).normalize(), xyz.into()))
    }

    fn joint(&self, node: Node) -> Result<UrdfJoint, CaptureError> {
        let end = |key: &'static str| {
            let hint = "give <parent link=.../> and <child link=.../>";
            let found = children(node, key).next().and_then(|n| n.attribute("link"));
            found.map(String::from).ok_or_else(|| self.at(node, format!("the joint's {key} is missing"), hint))
        };
        let kind = match self.text(node, "type")?.as_str() {
            "fixed" => JointKind::Fixed,
            "revolute" => JointKind::Revolute,
            "continuous" => JointKind::Continuous,
            "prismatic" => JointKind::Prismatic,
            other => {
                let hint = "use fixed, revolute, continuous or prismatic";
                return Err(self.at(node, format!("joints of type {other} are not supported"), hint));
            }
        };
        let axis = match children(node, "axis").next() {
            Some(a) => self.numbers::<3>(a, "xyz")?.map_or(DVec3::X, DVec3::from),
            None => DVec3::X,
        };
        let Some(axis) = axis.try_normalize() else {
            return Err(self.at(node, "the joint's axis is zero", "give a direction"));
        };
        let pi = std::f64::consts::PI;
        let limits = match children(node, "limit").next() {
            Some(l) if matches!(kind, JointKind::Revolute | JointKind::Prismatic) => {
                let value = |key| Ok::<_, CaptureError>(self.numbers::<1>(l, key)?.map_or(0.0, |v| v[0]));
                [value("lower")?, value("upper")?]
            }
            _ if kind == JointKind::Continuous => [-pi, pi],
            _ => [0.0, 0.0],
        };
        if limits[0] > limits[1] {
            return Err(self.at(node, format!("the joint's limits {limits:?} are reversed"), "lower comes first"));
        }
        let parent_from_joint = self.origin(node)?;
        Ok(UrdfJoint {
            name: self.text(node, "name")?,
            kind,
            parent: end("parent")?,
            child: end("child")?,
            parent_from_joint,
            axis,
            limits,
        })
    }

    /// `<material name><color rgba/></material>` at the top, which visuals may name.
    fn named_colors(&self, robot: Node) -> Result<BTreeMap<String, [f32; 3]>, CaptureError> {
        let mut out = BTreeMap::new();
        for m in children(robot, "material") {
            if let Some(color) = self.color(m)? {
                out.insert(self.text(m, "name")?, color);
            }
        }
        Ok(out)
    }

    fn color(&self, material: Node) -> Result<Option<[f32; 3]>, CaptureError> {
        let Some(c) = children(material, "color").next() else { return Ok(None) };
        Ok(self.numbers::<4>(c, "rgba")?.map(|[r, g, b, _]| [r as f32, g as f32, b as f32]))
    }

    /// Geometry in its own frame, link_from_geometry, and scale.
    fn visual(
        &self,
        node: Node,
        folder: &Path,
        colors: &BTreeMap<String, [f32; 3]>,
        library: &mut Library,
    ) -> Result<(PartGeometry, Pose, DVec3), CaptureError> {
        let color = match children(node, "material").next() {
            Some(m) => self.color(m)?.or_else(|| colors.get(m.attribute("name")?).copied()),
            None => None,
        };
        let material = library.plain(color.unwrap_or([0.7; 3]));
        let shape = children(node, "geometry").next().and_then(|g| g.first_element_child());
        let Some(shape) = shape else { return Err(self.at(node, "the visual has no geometry", "add <geometry>")) };
        let size = |key: &str| match self.numbers::<1>(shape, key)? {
            Some([x]) if x > 0.0 => Ok(x),
            _ => Err(self.at(shape, format!("{key} should be a number above 0"), "correct the size")),
        };
        let mut scale = DVec3::ONE;
        let geometry = match shape.tag_name().name() {
            "mesh" => {
                let name = self.text(shape, "filename")?;
                let name = name.rsplit_once("://").map_or(name.as_str(), |(_, rest)| rest);
                scale = self.numbers::<3>(shape, "scale")?.map_or(DVec3::ONE, DVec3::from);
                library.load_obj(&folder.join(name), material)?
            }
            "box" => {
                let half = DVec3::from(self.numbers::<3>(shape, "size")?.unwrap_or([0.0; 3])) * 0.5;
                super::shapes::cuboid(half, material)
            }
            "sphere" => super::shapes::ellipsoid(DVec3::splat(size("radius")?), material),
            "cylinder" => super::shapes::cylinder(size("radius")?, 0.5 * size("length")?, material),
            other => {
                let hint = "use mesh, box, sphere or cylinder";
                return Err(self.at(shape, format!("geometry <{other}> is not supported"), hint));
            }
        };
        Ok((geometry, self.origin(node)?, scale))
    }
}
