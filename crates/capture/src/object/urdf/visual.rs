//! Visuals of a URDF: geometry, and materials by name.

use super::places::Places;
use crate::CaptureError;
use crate::object::mesh_file::{GREY, Library};
use crate::object::xml::{Reader, children};
use crate::object::{Material, PartGeometry, shapes};
use glam::DVec3;
use hingecast_geom::Pose;
use roxmltree::Node;
use std::collections::BTreeMap;

/// What a `<material>` says.
#[derive(Clone, Default)]
pub(super) struct Looks {
    color: Option<[f32; 3]>,
    texture: Option<String>,
}

/// What visuals are read with.
pub(super) struct Visuals<'a> {
    pub reader: &'a Reader<'a>,
    pub places: &'a Places,
    pub materials: BTreeMap<String, Looks>,
    pub library: Library,
    /// PartNet-Mobility names meshes that were never part of it: they are left out.
    pub may_lack_meshes: bool,
    /// Names of those.
    pub missing: Vec<String>,
}

impl Reader<'_> {
    /// Materials by name, wherever they are defined: at the top, or in any visual, before or after
    /// they are named. The first that says anything counts, those at the top before others.
    pub(super) fn materials(&self, robot: Node) -> Result<BTreeMap<String, Looks>, CaptureError> {
        let mut out: BTreeMap<String, Looks> = BTreeMap::new();
        let in_links =
            children(robot, "link").flat_map(|l| children(l, "visual")).flat_map(|v| children(v, "material"));
        for m in children(robot, "material").chain(in_links) {
            if let (Some(looks), Some(name)) = (self.looks(m)?, m.attribute("name")) {
                out.entry(name.to_string()).or_insert(looks);
            }
        }
        Ok(out)
    }

    fn looks(&self, material: Node) -> Result<Option<Looks>, CaptureError> {
        let color = match children(material, "color").next() {
            Some(c) => self.numbers::<4>(c, "rgba")?.map(|[r, g, b, _]| [r as f32, g as f32, b as f32]),
            None => None,
        };
        let texture = children(material, "texture").next().and_then(|t| t.attribute("filename")).map(String::from);
        Ok((color.is_some() || texture.is_some()).then_some(Looks { color, texture }))
    }
}

impl Visuals<'_> {
    /// Geometry in its own frame, link_from_geometry, and scale; `None` for a mesh that is left
    /// out.
    pub fn read(&mut self, node: Node) -> Result<Option<(PartGeometry, Pose, DVec3)>, CaptureError> {
        let material = self.material(node)?;
        let reader = self.reader;
        let shape = children(node, "geometry").next().and_then(|g| g.first_element_child());
        let Some(shape) = shape else { return Err(reader.at(node, "the visual has no geometry", "add <geometry>")) };
        let size = |key: &str| match reader.numbers::<1>(shape, key)? {
            Some([x]) if x > 0.0 => Ok(x),
            _ => Err(reader.at(shape, format!("{key} should be a number above 0"), "correct the size")),
        };
        let mut scale = DVec3::ONE;
        let geometry = match shape.tag_name().name() {
            "mesh" => {
                scale = reader.numbers::<3>(shape, "scale")?.map_or(DVec3::ONE, DVec3::from);
                match self.mesh(shape, material)? {
                    Some(mesh) => mesh,
                    None => return Ok(None),
                }
            }
            "box" => {
                let half = DVec3::from(reader.numbers::<3>(shape, "size")?.unwrap_or([0.0; 3])) * 0.5;
                shapes::cuboid(half, material)
            }
            "sphere" => shapes::ellipsoid(DVec3::splat(size("radius")?), material),
            "cylinder" => shapes::cylinder(size("radius")?, 0.5 * size("length")?, material),
            // The length is that between the centres of the two half spheres.
            "capsule" => shapes::capsule(size("radius")?, 0.5 * size("length")?, material),
            other => {
                let hint = "use mesh, box, sphere, cylinder or capsule";
                return Err(reader.at(shape, format!("geometry <{other}> is not supported"), hint));
            }
        };
        Ok(Some((geometry, reader.origin(node)?, scale)))
    }

    fn mesh(&mut self, shape: Node, material: u32) -> Result<Option<PartGeometry>, CaptureError> {
        let name = self.reader.text(shape, "filename")?;
        let path = self.places.find(&name);
        if path.is_file() {
            return self.library.load(&path, material).map(Some);
        }
        if self.may_lack_meshes {
            self.missing.push(name);
            return Ok(None);
        }
        let hint = match name.split_once("://") {
            Some(("http" | "https", _)) => "fetch the file, and name it by its path",
            Some(("package" | "model", _)) => {
                "the package is looked for above the URDF, in ROS_PACKAGE_PATH and in AMENT_PREFIX_PATH/share: \
                 set one of them, or correct the path"
            }
            _ => "correct the path, or copy the file there",
        };
        Err(self.reader.at(shape, format!("the mesh file is not there: {}", path.display()), hint))
    }

    fn material(&mut self, visual: Node) -> Result<u32, CaptureError> {
        let Some(material) = children(visual, "material").next() else { return Ok(self.library.plain(GREY)) };
        let name = material.attribute("name").unwrap_or_default();
        let looks = self.reader.looks(material)?.or_else(|| self.materials.get(name).cloned());
        if looks.is_none() && !name.is_empty() {
            self.library.note(format!("the material {name} is defined nowhere: drawn in grey"));
        }
        let looks = looks.unwrap_or_default();
        let texture = looks.texture.and_then(|file| self.library.texture_if_there(&self.places.find(&file)));
        let color = looks.color.unwrap_or(if texture.is_some() { [1.0; 3] } else { GREY });
        Ok(self.library.material(Material { color, texture }))
    }
}
