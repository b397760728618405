//! COLLADA (.dae): the geometries of the scene, placed by their nodes, in metres.
//!
//! Read from the XML tree directly: of the crates, mesh-loader 0.1 keeps one placing and one
//! material a geometry, dae-parser 0.11 brings a second XML reader and a calendar, and both panic
//! on damaged files.
//!
//! `<unit>` counts, `<up_axis>` does not: RViz, MoveIt's geometric_shapes and Tesseract read meshes
//! of a URDF so (they undo the turn that assimp adds), and URDF files are written to look right
//! there.

use super::collada_looks::Looks;
use super::{Corners, Library, damaged};
use crate::CaptureError;
use crate::object::xml::{self, Reader, children};
use crate::object::{MOST_LEVELS, PartGeometry, text};
use glam::{DMat4, DVec3, Vec2, Vec3};
use roxmltree::{Document, Node, NodeId};
use std::collections::HashMap;
use std::path::Path;

/// Most nodes of a scene, each counted as often as it is named: a few that name each other twice
/// would otherwise be walked for ever.
const MOST_NODES: usize = 100_000;

/// Number of the set of primitives, indices of position, normal and texture coordinates.
type Key = (usize, [usize; 3]);

struct Loader<'a, 'i> {
    reader: Reader<'a>,
    by_id: HashMap<&'a str, Node<'a, 'i>>,
    looks: Looks<'a, 'i>,
    sources: HashMap<NodeId, Source>,
    library: &'a mut Library,
    default: u32,
    nodes: usize,
    sets: usize,
    out: Corners<Key>,
}

/// Rows of numbers.
struct Source {
    numbers: Vec<f32>,
    stride: usize,
    offset: usize,
}

impl Source {
    fn row<const N: usize>(&self, i: usize) -> Option<[f32; N]> {
        let start = i.checked_mul(self.stride)?.checked_add(self.offset)?;
        self.numbers.get(start..start.checked_add(N)?)?.try_into().ok()
    }
}

pub(super) fn load(
    library: &mut Library,
    path: &Path,
    bytes: Vec<u8>,
    default: u32,
) -> Result<PartGeometry, CaptureError> {
    let content = text::decode(bytes, path)?;
    let xml = Document::parse(&content).map_err(|e| damaged(path, "COLLADA", &e))?;
    let levels = xml::levels(&xml);
    if levels > MOST_LEVELS {
        return Err(damaged(path, "COLLADA", &format!("elements are nested {levels} levels deep")));
    }
    let by_id: HashMap<&str, Node> = xml.descendants().filter_map(|n| Some((n.attribute("id")?, n))).collect();
    let root = xml.root_element();
    let meter = metres_per_unit(root, library);
    let looks = Looks::new(path, &by_id);
    let reader = Reader { file: path };
    let (sources, out) = (HashMap::new(), Corners::new());
    let mut loader = Loader { reader, by_id, looks, sources, library, default, nodes: 0, sets: 0, out };

    let asked = children(root, "scene").flat_map(|s| children(s, "instance_visual_scene")).next();
    let scene = asked.and_then(|s| loader.target(s, "url"));
    let scene = scene.or_else(|| root.descendants().find(|n| n.has_tag_name("visual_scene") || is(n, "visual_scene")));
    let world = DMat4::from_scale(DVec3::splat(meter));
    match scene {
        Some(scene) => children(scene, "node").try_for_each(|n| loader.node(n, world, 0))?,
        None => {
            let meshes = root.descendants().filter(|n| is(n, "geometry"));
            meshes.collect::<Vec<_>>().into_iter().try_for_each(|g| loader.geometry(g, None, world))?;
        }
    }
    Ok(loader.out.mesh)
}

fn is(node: &Node, name: &str) -> bool {
    node.is_element() && node.tag_name().name() == name
}

fn metres_per_unit(root: Node, library: &mut Library) -> f64 {
    let asset = |name| children(root, "asset").flat_map(move |a| children(a, name)).next();
    let up = asset("up_axis").and_then(|n| n.text()).map(str::trim);
    if let Some(axis @ ("X_UP" | "Y_UP")) = up {
        library.note(format!("COLLADA meshes that say {axis} are not turned: URDF viewers take them as they are"));
    }
    let meter = asset("unit").and_then(|n| n.attribute("meter")).and_then(|m| m.trim().parse().ok());
    let meter = meter.filter(|m: &f64| m.is_finite() && *m > 0.0).unwrap_or(1.0);
    if meter != 1.0 {
        library.note(format!("COLLADA meshes in units of {meter} m became metres, as their <unit> says"));
    }
    meter
}

impl<'a, 'i> Loader<'a, 'i> {
    /// The element that an attribute like `url="#id"` names.
    fn target(&self, node: Node<'a, 'i>, key: &str) -> Option<Node<'a, 'i>> {
        self.by_id.get(node.attribute(key)?.trim_start_matches('#')).copied()
    }

    /// The same, first among the children of `near`: trimesh gives the sources of all geometries
    /// the same ids.
    fn target_near(&self, near: Option<Node<'a, 'i>>, node: Node<'a, 'i>, key: &str) -> Option<Node<'a, 'i>> {
        let id = node.attribute(key)?.trim_start_matches('#');
        let here = near.and_then(|n| n.children().find(|c| c.attribute("id") == Some(id)));
        here.or_else(|| self.target(node, key))
    }

    fn node(&mut self, node: Node<'a, 'i>, world_from_parent: DMat4, depth: usize) -> Result<(), CaptureError> {
        self.nodes += 1;
        if self.nodes > MOST_NODES || depth > MOST_LEVELS {
            let what = format!("nodes hold themselves, or there are more than {MOST_NODES}");
            return Err(self.reader.at(node, what, "export the mesh again"));
        }
        let mut world = world_from_parent;
        for step in node.children().filter(Node::is_element) {
            if let Some(matrix) = self.transform(step)? {
                world *= matrix;
            }
        }
        for instance in children(node, "instance_geometry") {
            let geometry = self.target(instance, "url");
            let hint = "export the mesh again, with all that it refers to in one file";
            let geometry = geometry.ok_or_else(|| self.reader.at(instance, "the geometry is not in the file", hint))?;
            self.geometry(geometry, Some(instance), world)?;
        }
        let named: Vec<_> = children(node, "instance_node").filter_map(|n| self.target(n, "url")).collect();
        children(node, "node").chain(named).try_for_each(|n| self.node(n, world, depth + 1))
    }

    fn transform(&self, step: Node<'a, 'i>) -> Result<Option<DMat4>, CaptureError> {
        let name = step.tag_name().name();
        let text = step.text().unwrap_or_default();
        Ok(Some(match name {
            "matrix" => DMat4::from_cols_array(&self.reader.exactly(step, name, text)?).transpose(),
            "translate" => DMat4::from_translation(self.reader.exactly::<3>(step, name, text)?.into()),
            "scale" => DMat4::from_scale(self.reader.exactly::<3>(step, name, text)?.into()),
            "rotate" => {
                let [x, y, z, degrees] = self.reader.exactly(step, name, text)?;
                let axis = DVec3::new(x, y, z).try_normalize();
                axis.map_or(DMat4::IDENTITY, |axis| DMat4::from_axis_angle(axis, degrees.to_radians()))
            }
            "skew" | "lookat" => {
                let hint = "export the mesh again with matrices, or with all transforms applied";
                return Err(self.reader.at(step, format!("<{name}> is not read"), hint));
            }
            _ => return Ok(None),
        }))
    }

    fn geometry(
        &mut self,
        geometry: Node<'a, 'i>,
        instance: Option<Node<'a, 'i>>,
        world: DMat4,
    ) -> Result<(), CaptureError> {
        for mesh in children(geometry, "mesh") {
            for primitives in mesh.children().filter(Node::is_element) {
                let kind = primitives.tag_name().name();
                if ["triangles", "polylist", "polygons", "tristrips", "trifans"].contains(&kind) {
                    let looks = self.looks.material(self.library, primitives.attribute("material"), instance);
                    let material = looks.unwrap_or(self.default);
                    self.primitives(primitives, kind, material, world)?;
                }
            }
        }
        Ok(())
    }

    fn primitives(&mut self, node: Node<'a, 'i>, kind: &str, material: u32, world: DMat4) -> Result<(), CaptureError> {
        let [mut position, mut normal, mut uv] = [None; 3];
        let mut stride = 1;
        let mesh = node.parent();
        for input in children(node, "input") {
            let offset: usize = input.attribute("offset").and_then(|o| o.trim().parse().ok()).unwrap_or(0);
            stride = stride.max(offset.saturating_add(1));
            let semantic = input.attribute("semantic");
            let vertices = self.target_near(mesh, input, "source").filter(|_| semantic == Some("VERTEX"));
            let own = [input].into_iter().filter(|_| vertices.is_none());
            for i in vertices.into_iter().flat_map(|v| children(v, "input")).chain(own) {
                let slot = match i.attribute("semantic") {
                    Some("POSITION") => &mut position,
                    Some("NORMAL") => &mut normal,
                    Some("TEXCOORD") => &mut uv,
                    _ => continue,
                };
                // The first set of texture coordinates is that of the colours.
                if slot.is_none() {
                    *slot = Some((self.source(mesh, i)?, offset));
                }
            }
        }
        let hint = "export the mesh again";
        if position.is_none() {
            return Err(self.reader.at(node, "there are no positions", hint));
        }
        self.sets += 1;
        let normal_matrix = world.inverse().transpose();
        let mirrored = world.determinant() < 0.0;
        let (indices, polygons) = self.polygons(node, kind, stride)?;
        for polygon in polygons {
            let mut corners = Vec::with_capacity(polygon.len());
            for corner in polygon {
                let index = |of: Option<(NodeId, usize)>| Some((of?.0, indices[corner * stride + of?.1]));
                let [at, n, st] = [position, normal, uv].map(index);
                let key = [at, n, st].map(|of| of.map_or(usize::MAX, |(_, i)| i));
                let Some(x) = at.and_then(|(id, i)| self.sources[&id].row::<3>(i)) else {
                    return Err(self.reader.at(node, format!("there is no vertex {}", key[0]), hint));
                };
                let x = world.transform_point3(Vec3::from(x).as_dvec3()).as_vec3();
                let n = n.and_then(|(id, i)| self.sources[&id].row::<3>(i)).map_or(Vec3::ZERO, Vec3::from);
                let n = normal_matrix.transform_vector3(n.as_dvec3()).as_vec3().normalize_or_zero();
                let st = st.and_then(|(id, i)| self.sources[&id].row::<2>(i)).map_or(Vec2::ZERO, Vec2::from);
                corners.push(self.out.corner((self.sets, key), x, n, st));
            }
            for k in 2..corners.len() {
                let (b, c) = if mirrored { (corners[k], corners[k - 1]) } else { (corners[k - 1], corners[k]) };
                self.out.face([corners[0], b, c], material);
            }
        }
        Ok(())
    }

    /// Reads the source of an `<input>`, once; returns its key.
    fn source(&mut self, mesh: Option<Node<'a, 'i>>, input: Node<'a, 'i>) -> Result<NodeId, CaptureError> {
        let hint = "export the mesh again";
        let source = self.target_near(mesh, input, "source");
        let source = source.ok_or_else(|| self.reader.at(input, "the source is not in the file", hint))?;
        let id = source.id();
        if self.sources.contains_key(&id) {
            return Ok(id);
        }
        let accessor = children(source, "technique_common").flat_map(|t| children(t, "accessor")).next();
        let array = accessor
            .and_then(|a| self.target_near(Some(source), a, "source"))
            .or_else(|| children(source, "float_array").next());
        let array = array.ok_or_else(|| self.reader.at(source, "there are no numbers", hint))?;
        let numbers = numbers(array).ok_or_else(|| self.reader.at(array, "this should be numbers", hint))?;
        let value = |key: &str| accessor.and_then(|a| a.attribute(key)).and_then(|v| v.trim().parse().ok());
        let stride = value("stride").unwrap_or(1);
        self.sources.insert(id, Source { numbers, stride, offset: value("offset").unwrap_or(0) });
        Ok(id)
    }

    /// Indices, `stride` a corner, and polygons as lists of corners.
    fn polygons(&self, node: Node, kind: &str, stride: usize) -> Result<(Vec<usize>, Vec<Vec<usize>>), CaptureError> {
        let bad = |n: Node| self.reader.at(n, "this should be indices", "the file is damaged: export the mesh again");
        // <ph> is a polygon with holes; the holes are closed.
        let lists = children(node, "p").chain(children(node, "ph").flat_map(|ph| children(ph, "p").take(1)));
        let (mut indices, mut out) = (Vec::new(), Vec::new());
        for p in lists {
            let first = indices.len() / stride;
            indices.extend(numbers::<usize>(p).ok_or_else(|| bad(p))?);
            indices.truncate(indices.len() / stride * stride);
            let corners: Vec<usize> = (first..indices.len() / stride).collect();
            match kind {
                "triangles" => out.extend(corners.chunks_exact(3).map(<[_]>::to_vec)),
                "polylist" => {
                    let counts = children(node, "vcount").next().map_or(Some(Vec::new()), numbers);
                    let mut rest = &corners[..];
                    for n in counts.ok_or_else(|| bad(node))? {
                        let (polygon, after) = rest.split_at_checked(n).ok_or_else(|| bad(p))?;
                        out.push(polygon.to_vec());
                        rest = after;
                    }
                }
                // Every second triangle of a strip is turned over.
                "tristrips" => out.extend(corners.windows(3).enumerate().map(|(i, w)| match i % 2 {
                    0 => w.to_vec(),
                    _ => vec![w[1], w[0], w[2]],
                })),
                // Polygons and fans are cut from their first corner alike.
                _ => out.push(corners),
            }
        }
        Ok((indices, out))
    }
}

/// The numbers in an element; `None` when something else is there.
fn numbers<T: std::str::FromStr>(node: Node) -> Option<Vec<T>> {
    let texts = node.children().filter_map(|n| n.text());
    texts.flat_map(str::split_whitespace).map(|w| w.parse().ok()).collect()
}
