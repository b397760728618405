//! A twin as one glTF 2.0 binary file: what browsers, Blender and game engines open. A node for each
//! link, nested as the joints nest them; photographs or vertex colours; an animation for each joint.
//!
//! glTF is y-up, in metres; the root node turns the twin's up to y. Link frames are those of
//! [`crate::export`]: a joint turns its node about the node's origin, or slides it.

use crate::color::linear;
use crate::link::{drawn, link_origin};
use crate::{PartModel, Twin};
use glam::{DQuat, DVec3, Vec3};
use hingecast_geom::JointKind;
use serde_json::{Value, json};

/// An animation goes from 0 to the upper limit, to the lower and back, in so many seconds and steps.
const SECONDS: f32 = 4.0;
const STEPS: usize = 48;

const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const VERTICES: u32 = 34962;
const INDICES: u32 = 34963;

/// The bytes of a `.glb` file.
///
/// # Errors
/// A texture cannot be written as PNG.
pub fn to_bytes(twin: &Twin) -> std::io::Result<Vec<u8>> {
    let mut file = File::default();
    let n = twin.parts.len();
    let mut nodes = Vec::new();
    for (part, model) in twin.parts.iter().enumerate() {
        let joint = twin.tree.joint_of(part);
        let origin = link_origin(twin, part);
        let carrier = joint.map_or(DVec3::ZERO, |j| link_origin(twin, j.parent));
        let children: Vec<usize> = twin.tree.joints.iter().filter(|j| j.parent == part).map(|j| j.child).collect();
        let mut node = json!({ "name": model.name, "translation": (origin - carrier).to_array() });
        if !children.is_empty() {
            node["children"] = json!(children);
        }
        if !model.mesh.is_empty() {
            node["mesh"] = json!(file.mesh(model, origin)?);
        }
        if let Some(j) = joint {
            let screw = &j.screw;
            node["extras"] = json!({ "joint": j.name, "type": screw.kind, "axis": screw.axis, "limits": j.limits });
        }
        nodes.push(node);
    }
    let roots: Vec<usize> = (0..n).filter(|&part| twin.tree.joint_of(part).is_none()).collect();
    let upright = DQuat::from_rotation_arc(twin.up.normalize_or(DVec3::Z), DVec3::Y);
    nodes.push(json!({
        "name": twin.name,
        "rotation": upright.to_array(),
        "children": roots,
        "extras": { "metric": twin.metric },
    }));
    let animations: Vec<Value> = (0..twin.tree.joints.len()).filter_map(|j| file.animation(twin, j)).collect();
    Ok(file.finish(&json!(nodes), n, animations))
}

/// A file that grows: its binary chunk, and what describes that.
#[derive(Default)]
struct File {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    meshes: Vec<Value>,
    materials: Vec<Value>,
    images: Vec<Value>,
}

impl File {
    fn view(&mut self, data: &[u8], target: Option<u32>) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let mut view = json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": data.len() });
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.bytes.extend_from_slice(data);
        self.views.push(view);
        self.views.len() - 1
    }

    /// Rows of N numbers; bounds are written for all, which glTF asks of positions and times.
    fn floats<const N: usize>(&mut self, rows: &[[f32; N]], target: Option<u32>) -> usize {
        let data: Vec<u8> = rows.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
        let view = self.view(&data, target);
        let bound = |least: f32, pick: fn(f32, f32) -> f32| {
            rows.iter().fold([least; N], |a, row| std::array::from_fn(|k| pick(a[k], row[k])))
        };
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1];
        self.accessors.push(json!({
            "bufferView": view, "componentType": FLOAT, "count": rows.len(), "type": kind,
            "min": bound(f32::INFINITY, f32::min).to_vec(), "max": bound(f32::NEG_INFINITY, f32::max).to_vec(),
        }));
        self.accessors.len() - 1
    }

    /// The mesh of a part, relative to `origin`.
    fn mesh(&mut self, model: &PartModel, origin: DVec3) -> std::io::Result<usize> {
        let mesh = &model.mesh;
        let (positions, faces) = drawn(model, origin);
        let positions: Vec<[f32; 3]> = positions.iter().map(Vec3::to_array).collect();
        let mut attributes = json!({ "POSITION": self.floats(&positions, Some(VERTICES)) });
        let mut look = json!({ "metallicFactor": 0.0, "roughnessFactor": 1.0 });
        if let Some(texture) = &model.texture {
            // glTF counts rows downwards.
            let corners: Vec<[f32; 2]> = texture.corners.iter().map(|[u, v]| [*u, 1.0 - v]).collect();
            attributes["TEXCOORD_0"] = json!(self.floats(&corners, Some(VERTICES)));
            let view = self.view(&crate::texture::files::png(texture)?, None);
            look["baseColorTexture"] = json!({ "index": self.images.len() });
            self.images.push(json!({ "name": model.name, "bufferView": view, "mimeType": "image/png" }));
        } else if mesh.colors.len() == mesh.vertices.len() {
            let colors: Vec<[f32; 3]> = mesh.colors.iter().map(|c| c.map(linear)).collect();
            attributes["COLOR_0"] = json!(self.floats(&colors, Some(VERTICES)));
        }
        // The light of the room is in the photographs: a viewer that knows the extension adds none.
        self.materials.push(json!({
            "name": model.name, "pbrMetallicRoughness": look, "doubleSided": true,
            "extensions": { "KHR_materials_unlit": {} },
        }));
        let indices: Vec<u8> = faces.iter().flatten().flat_map(|k| k.to_le_bytes()).collect();
        let view = self.view(&indices, Some(INDICES));
        self.accessors.push(json!({
            "bufferView": view, "componentType": UNSIGNED_INT, "count": 3 * faces.len(), "type": "SCALAR",
        }));
        self.meshes.push(json!({ "name": model.name, "primitives": [{
            "attributes": attributes, "indices": self.accessors.len() - 1, "material": self.materials.len() - 1,
        }] }));
        Ok(self.meshes.len() - 1)
    }

    /// Joint `j` through its range, and the joints that follow it; nothing for one that follows or
    /// cannot move.
    fn animation(&mut self, twin: &Twin, j: usize) -> Option<Value> {
        let tree = &twin.tree;
        let [lo, hi] = tree.joints[j].limits;
        if tree.coupling_of(j).is_some() || !(hi > lo) || !(hi - lo).is_finite() {
            return None;
        }
        // 0, up, down, and back to 0, at even speed.
        let way = [hi.max(0.0), hi.max(0.0) - lo.min(0.0), -lo.min(0.0)];
        let at = |share: f64| {
            let gone = share * way.iter().sum::<f64>();
            if gone < way[0] { gone } else { (2.0 * way[0] - gone).max(gone - way.iter().sum::<f64>()) }
        };
        let values: Vec<Vec<f64>> = (0..=STEPS)
            .map(|step| {
                let mut q = vec![0.0; tree.joints.len()];
                q[j] = at(step as f64 / STEPS as f64);
                tree.follow(&mut q);
                q
            })
            .collect();
        let times: Vec<[f32; 1]> = (0..=STEPS).map(|step| [SECONDS * step as f32 / STEPS as f32]).collect();
        let input = self.floats(&times, None);
        let (mut channels, mut samplers) = (Vec::new(), Vec::new());
        for (k, joint) in tree.joints.iter().enumerate() {
            if joint.screw.kind == JointKind::Fixed || values.iter().all(|q| q[k] == 0.0) {
                continue;
            }
            let (path, output) = if joint.screw.kind.turns() {
                let turn = |q: &Vec<f64>| DQuat::from_axis_angle(joint.screw.axis, q[k]).as_quat().to_array();
                ("rotation", self.floats(&values.iter().map(turn).collect::<Vec<_>>(), None))
            } else {
                let rest = link_origin(twin, joint.child) - link_origin(twin, joint.parent);
                let slide = |q: &Vec<f64>| (rest + q[k] * joint.screw.axis).as_vec3().to_array();
                ("translation", self.floats(&values.iter().map(slide).collect::<Vec<_>>(), None))
            };
            channels.push(json!({ "sampler": samplers.len(), "target": { "node": joint.child, "path": path } }));
            samplers.push(json!({ "input": input, "output": output, "interpolation": "LINEAR" }));
        }
        let name = &tree.joints[j].name;
        (!channels.is_empty()).then(|| json!({ "name": name, "channels": channels, "samplers": samplers }))
    }

    fn finish(mut self, nodes: &Value, root: usize, animations: Vec<Value>) -> Vec<u8> {
        let textures: Vec<Value> = (0..self.images.len()).map(|k| json!({ "source": k, "sampler": 0 })).collect();
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let mut out = json!({
            "asset": { "version": "2.0", "generator": concat!("hingecast ", env!("CARGO_PKG_VERSION")) },
            "scene": 0,
            "scenes": [{ "nodes": [root] }],
            "nodes": nodes,
        });
        // glTF has no empty lists.
        let mut list = |name: &str, values: Vec<Value>| {
            if !values.is_empty() {
                out[name] = json!(values);
            }
        };
        if !self.images.is_empty() {
            // Linear, with mipmaps; the gaps of the atlas are filled as far as these reach.
            list("samplers", vec![json!({ "magFilter": 9729, "minFilter": 9987, "wrapS": 33071, "wrapT": 33071 })]);
        }
        if !self.materials.is_empty() {
            list("extensionsUsed", vec![json!("KHR_materials_unlit")]);
        }
        if !self.bytes.is_empty() {
            list("buffers", vec![json!({ "byteLength": self.bytes.len() })]);
        }
        list("bufferViews", self.views);
        list("accessors", self.accessors);
        list("meshes", self.meshes);
        list("materials", self.materials);
        list("images", self.images);
        list("textures", textures);
        list("animations", animations);
        let mut text = out.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        container(&text, &self.bytes)
    }
}

/// Header, JSON chunk and binary chunk.
fn container(text: &[u8], bytes: &[u8]) -> Vec<u8> {
    let length = 12 + 8 + text.len() + if bytes.is_empty() { 0 } else { 8 + bytes.len() };
    let mut out = Vec::with_capacity(length);
    out.extend_from_slice(b"glTF");
    out.extend_from_slice(&2u32.to_le_bytes());
    out.extend_from_slice(&(length as u32).to_le_bytes());
    for (kind, data) in [(b"JSON", text), (b"BIN\0", bytes)] {
        if !data.is_empty() {
            out.extend_from_slice(&(data.len() as u32).to_le_bytes());
            out.extend_from_slice(kind);
            out.extend_from_slice(data);
        }
    }
    out
}
