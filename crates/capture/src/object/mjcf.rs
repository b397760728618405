//! A subset of MJCF, enough for sample objects, where MuJoCo is not built in: bodies, one hinge or slide joint each, visual
//! geoms, materials, textures, OBJ meshes, defaults. Planes, and geoms of group 3 and above
//! (collision by MuJoCo's custom), are not seen.
//!
//! Bodies without a joint belong to their parent's part; free joints are ignored: the object stands
//! where it is modelled.

use super::mesh_file::Library;
use super::xml::{Reader, children};
use super::{ArticulatedObject, Material, PartGeometry, shapes};
use crate::CaptureError;
use glam::{DMat3, DQuat, DVec3};
use hingecast_geom::{Joint, JointKind, Pose, Screw};
use roxmltree::{Document, Node};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

struct Loader<'a, 'i> {
    reader: Reader<'a>,
    /// Radians per unit of the file's angles.
    angle: f64,
    meshes: PathBuf,
    textures: PathBuf,
    root: Node<'a, 'i>,
    /// Class name -> (parent class, the `<default>` element).
    classes: BTreeMap<String, (Option<String>, Node<'a, 'i>)>,
    /// Material name -> its index and repetition of the texture.
    materials: BTreeMap<String, (Material, [f64; 2])>,
    library: Library,
    object: ArticulatedObject,
    /// Materials that nobody sees.
    ghosts: BTreeSet<String>,
    /// Bodies with geometry.
    seen: BTreeSet<String>,
}

pub(super) fn load(file: &Path, xml: &Document) -> Result<ArticulatedObject, CaptureError> {
    let root = xml.root_element();
    super::mjcf_known::check(&Reader { file }, xml)?;
    let compiler = |key: &str| children(root, "compiler").filter_map(|c| c.attribute(key)).last();
    let folder = file.parent().unwrap_or(Path::new("."));
    let sub = |key: &str| folder.join(compiler(key).or(compiler("assetdir")).unwrap_or(""));
    let mut loader = Loader {
        reader: Reader { file },
        angle: if compiler("angle") == Some("radian") { 1.0 } else { 1f64.to_radians() },
        meshes: sub("meshdir"),
        textures: sub("texturedir"),
        root,
        classes: BTreeMap::new(),
        materials: BTreeMap::new(),
        library: Library::default(),
        object: ArticulatedObject {
            name: root.attribute("model").unwrap_or("object").to_string(),
            source: file.to_path_buf(),
            metric: true,
            parts: vec![PartGeometry { links: vec!["world".into()], ..Default::default() }],
            ..Default::default()
        },
        ghosts: BTreeSet::new(),
        seen: BTreeSet::new(),
    };
    for d in children(root, "default") {
        loader.collect_classes(d, None)?;
    }
    loader.read_materials()?;
    for world in children(root, "worldbody") {
        loader.content(world, 0, "world", Pose::IDENTITY, "main")?;
    }
    let Loader { reader, library, object, seen, .. } = loader;
    object
        .finish(library, &BTreeMap::new(), |link| seen.contains(link))
        .map_err(|e| reader.error(e, "correct the bodies and joints"))
}

impl<'a, 'i> Loader<'a, 'i> {
    fn collect_classes(&mut self, node: Node<'a, 'i>, parent: Option<String>) -> Result<(), CaptureError> {
        let name = node.attribute("class").unwrap_or("main").to_string();
        // A class inside itself would be asked for its parent for ever. Several top-level elements
        // of one name are usual.
        if parent.is_some() && self.classes.contains_key(&name) {
            let what = format!("the default class '{name}' is there already");
            return Err(self.reader.at(node, what, "give every nested <default> a class of its own"));
        }
        self.classes.insert(name.clone(), (parent, node));
        children(node, "default").try_for_each(|child| self.collect_classes(child, Some(name.clone())))
    }

    /// The attribute of an element, or of its default class, or of that class's parents.
    fn attribute(&self, node: Node<'a, 'i>, key: &str, childclass: &str) -> Option<&'a str> {
        if let Some(own) = node.attribute(key) {
            return Some(own);
        }
        let mut class = Some(node.attribute("class").unwrap_or(childclass).to_string());
        while let Some((parent, defaults)) = class.as_ref().and_then(|c| self.classes.get(c)) {
            let found = defaults.children().find(|n| n.tag_name() == node.tag_name()).and_then(|n| n.attribute(key));
            if found.is_some() {
                return found;
            }
            class = parent.clone();
        }
        None
    }

    fn numbers<const N: usize>(
        &self,
        node: Node<'a, 'i>,
        key: &str,
        class: &str,
    ) -> Result<Option<[f64; N]>, CaptureError> {
        self.attribute(node, key, class).map(|text| self.reader.exactly(node, key, text)).transpose()
    }

    fn asset(&self, kind: &'static str) -> Vec<Node<'a, 'i>> {
        children(self.root, "asset").flat_map(|a| children(a, kind)).collect()
    }

    fn read_materials(&mut self) -> Result<(), CaptureError> {
        let mut textures: BTreeMap<String, Material> = BTreeMap::new();
        for t in self.asset("texture") {
            let file = t.attribute("file");
            let name =
                t.attribute("name").or(file.and_then(|f| Path::new(f).file_stem()?.to_str())).unwrap_or_default();
            let material = match file {
                Some(file) => {
                    Material { color: [1.0; 3], texture: Some(self.library.texture(&self.textures.join(file))?) }
                }
                // Built-in patterns are drawn in their first colour.
                None => {
                    let [r, g, b] = self.reader.numbers::<3>(t, "rgb1")?.unwrap_or([0.8; 3]);
                    Material { color: [r as f32, g as f32, b as f32], texture: None }
                }
            };
            textures.insert(name.to_string(), material);
        }
        for m in self.asset("material") {
            let name = self.reader.text(m, "name")?;
            let [r, g, b, alpha] = self.numbers::<4>(m, "rgba", "main")?.unwrap_or([1.0; 4]);
            if alpha == 0.0 {
                self.ghosts.insert(name.clone());
            }
            let mut material = Material { color: [r as f32, g as f32, b as f32], texture: None };
            if let Some(texture) = self.attribute(m, "texture", "main") {
                let hint = "add it to <asset>";
                let known = textures.get(texture);
                let known = known.ok_or_else(|| self.reader.at(m, format!("there is no texture {texture}"), hint))?;
                material.texture = known.texture;
                material.color = [0, 1, 2].map(|k| material.color[k] * known.color[k]);
            }
            let repeat = self.numbers::<2>(m, "texrepeat", "main")?.unwrap_or([1.0; 2]);
            self.materials.insert(name, (material, repeat));
        }
        Ok(())
    }

    /// Geoms and child bodies of a body that belongs to `part`.
    fn content(
        &mut self,
        body: Node<'a, 'i>,
        part: usize,
        name: &str,
        world_from_body: Pose,
        class: &str,
    ) -> Result<(), CaptureError> {
        for geom in children(body, "geom") {
            if let Some((shape, body_from_shape)) = self.geom(geom, class)? {
                self.object.parts[part].append(&shape, &(world_from_body * body_from_shape), DVec3::ONE);
                self.seen.insert(name.to_string());
            }
        }
        for child in children(body, "body") {
            self.body(child, part, world_from_body, class)?;
        }
        Ok(())
    }

    fn body(
        &mut self,
        node: Node<'a, 'i>,
        parent: usize,
        world_from_parent: Pose,
        class: &str,
    ) -> Result<(), CaptureError> {
        let class = node.attribute("childclass").unwrap_or(class);
        let world_from_body = world_from_parent * self.frame(node, class)?;
        let name = node.attribute("name").map_or_else(|| format!("body_{}", self.object.parts.len()), String::from);
        let joints: Vec<_> =
            children(node, "joint").filter(|j| self.attribute(*j, "type", class) != Some("free")).collect();
        let part = match joints[..] {
            [] => {
                self.object.parts[parent].links.push(name.clone());
                parent
            }
            [joint] => {
                self.object.parts.push(PartGeometry { links: vec![name.clone()], ..Default::default() });
                let child = self.object.parts.len() - 1;
                let joint = self.joint(joint, &name, parent, child, &world_from_body, class)?;
                self.object.tree.joints.push(joint);
                child
            }
            [_, second, ..] => {
                let hint = "put each joint into a body of its own";
                return Err(self.reader.at(second, "a body with several joints is not supported", hint));
            }
        };
        self.content(node, part, &name, world_from_body, class)
    }

    fn joint(
        &self,
        node: Node<'a, 'i>,
        body: &str,
        parent: usize,
        child: usize,
        world_from_body: &Pose,
        class: &str,
    ) -> Result<Joint, CaptureError> {
        let range = self.numbers::<2>(node, "range", class)?;
        let (kind, unit) = match self.attribute(node, "type", class).unwrap_or("hinge") {
            "hinge" if range.is_some() => (JointKind::Revolute, self.angle),
            "hinge" => (JointKind::Continuous, 1.0),
            "slide" => (JointKind::Prismatic, 1.0),
            other => {
                return Err(self.reader.at(
                    node,
                    format!("joints of type {other} are not supported"),
                    "use hinge or slide",
                ));
            }
        };
        let limits = match (range, kind) {
            (Some(range), _) => range.map(|x| x * unit),
            (None, JointKind::Prismatic) => {
                return Err(self.reader.at(node, "a slide joint needs a range", "add range=\"0 0.3\""));
            }
            (None, _) => [-std::f64::consts::PI, std::f64::consts::PI],
        };
        let axis = DVec3::from(self.numbers::<3>(node, "axis", class)?.unwrap_or([0.0, 0.0, 1.0]));
        let Some(axis) = axis.try_normalize() else {
            return Err(self.reader.at(node, "the joint's axis is zero", "give a direction"));
        };
        if limits[0] >= limits[1] {
            return Err(self.reader.at(
                node,
                format!("the joint's range {limits:?} is empty"),
                "the lower end comes first",
            ));
        }
        let pivot = DVec3::from(self.numbers::<3>(node, "pos", class)?.unwrap_or_default());
        let screw = Screw { kind, axis, pivot }.transformed(world_from_body);
        let name = node.attribute("name").map_or_else(|| format!("{body}_joint"), String::from);
        Ok(Joint { name, parent, child, screw, values: Vec::new(), limits })
    }

    /// A geom's triangles in its own frame, and body_from_geom; `None` when it is not meant to be
    /// seen.
    fn geom(&mut self, node: Node<'a, 'i>, class: &str) -> Result<Option<(PartGeometry, Pose)>, CaptureError> {
        let group = self.numbers::<1>(node, "group", class)?.map_or(0.0, |g| g[0]);
        let kind = self.attribute(node, "type", class).unwrap_or("sphere");
        let kind = if node.attribute("mesh").is_some() { "mesh" } else { kind };
        let ghost = self.attribute(node, "material", class).is_some_and(|m| self.ghosts.contains(m))
            || self.numbers::<4>(node, "rgba", class)?.is_some_and(|rgba| rgba[3] == 0.0);
        if kind == "plane" || group >= 3.0 || ghost {
            return Ok(None);
        }
        let (material, repeat) = self.material(node, class)?;
        let size = match self.attribute(node, "size", class) {
            Some(text) => self.reader.list(node, "size", text)?,
            None => Vec::new(),
        };
        let hint = "sizes are half lengths and radii above 0";
        let at = |k: usize| {
            let x = size.get(k).copied().filter(|&x| x > 0.0);
            x.ok_or_else(|| self.reader.at(node, format!("size[{k}] of a {kind} is missing or not above 0"), hint))
        };
        let mut pose = self.frame(node, class)?;
        let mut half_length = None;
        if let Some([a, b, c, d, e, f]) = self.numbers::<6>(node, "fromto", class)? {
            let (from, to) = (DVec3::new(a, b, c), DVec3::new(d, e, f));
            let along = (to - from).try_normalize().unwrap_or(DVec3::Z);
            pose = Pose::new(DQuat::from_rotation_arc(DVec3::Z, along), 0.5 * (from + to));
            half_length = Some(0.5 * from.distance(to));
        }
        let half = |k: usize| half_length.map_or_else(|| at(k), Ok);
        let mut shape = match kind {
            "box" => match half_length {
                Some(h) => shapes::cuboid(DVec3::new(at(0)?, at(0)?, h), material),
                None => shapes::cuboid(DVec3::new(at(0)?, at(1)?, at(2)?), material),
            },
            "sphere" => shapes::ellipsoid(DVec3::splat(at(0)?), material),
            "ellipsoid" => shapes::ellipsoid(DVec3::new(at(0)?, at(1)?, at(2)?), material),
            "cylinder" => shapes::cylinder(at(0)?, half(1)?, material),
            "capsule" => shapes::capsule(at(0)?, half(1)?, material),
            "mesh" => self.mesh(node, class, material)?,
            other => {
                let hint = "use box, sphere, ellipsoid, cylinder, capsule or mesh";
                return Err(self.reader.at(node, format!("geoms of type {other} are not supported"), hint));
            }
        };
        for uv in &mut shape.uvs {
            *uv *= glam::Vec2::new(repeat[0] as f32, repeat[1] as f32);
        }
        Ok(Some((shape, pose)))
    }

    fn mesh(&mut self, geom: Node<'a, 'i>, class: &str, material: u32) -> Result<PartGeometry, CaptureError> {
        let name = self.attribute(geom, "mesh", class).unwrap_or_default();
        let stem = |n: &Node<'a, 'i>| {
            let own = n.attribute("name").or_else(|| Path::new(n.attribute("file")?).file_stem()?.to_str());
            own.map(String::from)
        };
        let asset = self.asset("mesh").into_iter().find(|n| stem(n).as_deref() == Some(name));
        let asset =
            asset.ok_or_else(|| self.reader.at(geom, format!("there is no mesh {name}"), "add it to <asset>"))?;
        let file = self.meshes.join(self.reader.text(asset, "file")?);
        let scale = self.numbers::<3>(asset, "scale", "main")?.map_or(DVec3::ONE, DVec3::from);
        let loaded = self.library.load(&file, material)?;
        let mut out = PartGeometry::default();
        out.append(&loaded, &Pose::IDENTITY, scale);
        // MuJoCo gives a mesh one material, that of the geom.
        out.materials.fill(material);
        Ok(out)
    }

    /// Material index and texture repetition of a geom; its own rgba replaces the material's
    /// colour.
    fn material(&mut self, node: Node<'a, 'i>, class: &str) -> Result<(u32, [f64; 2]), CaptureError> {
        let (mut material, repeat) = match self.attribute(node, "material", class) {
            Some(name) => {
                let known = self.materials.get(name).copied();
                let hint = "add it to <asset>";
                known.ok_or_else(|| self.reader.at(node, format!("there is no material {name}"), hint))?
            }
            None => (Material { color: [0.5; 3], texture: None }, [1.0; 2]),
        };
        if let Some([r, g, b, _]) = self.numbers::<4>(node, "rgba", class)? {
            material.color = [r as f32, g as f32, b as f32];
        }
        Ok((self.library.material(material), repeat))
    }

    /// pos with quat (w x y z), euler (intrinsic x, y, z), axisangle, xyaxes or zaxis.
    fn frame(&self, node: Node<'a, 'i>, class: &str) -> Result<Pose, CaptureError> {
        let trans = DVec3::from(self.numbers::<3>(node, "pos", class)?.unwrap_or_default());
        let rot = if let Some([w, x, y, z]) = self.numbers::<4>(node, "quat", class)? {
            DQuat::from_xyzw(x, y, z, w)
        } else if let Some([x, y, z]) = self.numbers::<3>(node, "euler", class)? {
            let a = self.angle;
            DQuat::from_rotation_x(x * a) * DQuat::from_rotation_y(y * a) * DQuat::from_rotation_z(z * a)
        } else if let Some([x, y, z, angle]) = self.numbers::<4>(node, "axisangle", class)? {
            DQuat::from_axis_angle(DVec3::new(x, y, z).normalize_or(DVec3::Z), angle * self.angle)
        } else if let Some([a, b, c, d, e, f]) = self.numbers::<6>(node, "xyaxes", class)? {
            let x = DVec3::new(a, b, c).normalize_or(DVec3::X);
            let y = DVec3::new(d, e, f).reject_from_normalized(x).normalize_or(DVec3::Y);
            DQuat::from_mat3(&DMat3::from_cols(x, y, x.cross(y)))
        } else if let Some(z) = self.numbers::<3>(node, "zaxis", class)? {
            DQuat::from_rotation_arc(DVec3::Z, DVec3::from(z).normalize_or(DVec3::Z))
        } else {
            DQuat::IDENTITY
        };
        if rot.length() < 1e-9 {
            return Err(self.reader.at(node, "the orientation is zero", "give a unit quaternion w x y z"));
        }
        Ok(Pose::new(rot.normalize(), trans))
    }
}
