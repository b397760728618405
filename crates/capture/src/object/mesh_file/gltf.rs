//! glTF 2.0 (.gltf with its buffers, .glb): the meshes of the scene, placed by their nodes.
//!
//! glTF is y-up. Nothing is turned: who loads a URDF (yourdfpy, RViz) takes the numbers as they
//! are, and the URDF's `<origin>` does the turning. Skins and morph targets stand at rest.
//!
//! The library checks what refers to what; sizes and types of the numbers are checked here, before
//! it reads them.

use super::{Library, beside};
use crate::object::texture::srgb_from_linear;
use crate::object::{MOST_LEVELS, Material, PartGeometry};
use glam::{Mat4, Vec2, Vec3};
use gltf::Document;
use gltf::accessor::{Accessor, DataType, Dimensions};
use gltf::json::validation::Checked;
use gltf::mesh::{Mode, Primitive, Semantic};
use std::path::Path;

/// Bytes of every buffer of the file.
type Buffers = Vec<Vec<u8>>;
/// Most vertices of a mesh whose numbers are sparse.
const MOST_SPARSE: usize = 1 << 24;

pub(super) fn load(library: &mut Library, path: &Path, bytes: &[u8], default: u32) -> Result<PartGeometry, String> {
    let (file, blob) = open(bytes)?;
    let buffers = buffers(&file, blob, path)?;
    let mut loader = Loader { library, path, buffers, default, seen: Vec::new(), out: PartGeometry::default() };
    let scene = file.default_scene().or_else(|| file.scenes().next());
    match scene {
        Some(scene) => scene.nodes().try_for_each(|n| loader.node(&n, Mat4::IDENTITY, 0))?,
        None => file.meshes().try_for_each(|m| loader.mesh(&m, Mat4::IDENTITY))?,
    }
    Ok(loader.out)
}

/// Parses and checks. Before the library's checks some things are seen to: they panic at positions
/// that point nowhere, and refuse positions without their bounds, which nobody needs.
fn open(bytes: &[u8]) -> Result<(Document, Option<Vec<u8>>), String> {
    let gltf::Gltf { document, blob } = gltf::Gltf::from_slice_without_validation(bytes).map_err(|e| e.to_string())?;
    let mut json = document.into_json();
    let primitives = json.meshes.iter().flat_map(|m| &m.primitives);
    let positions = primitives.filter_map(|p| p.attributes.get(&Checked::Valid(Semantic::Positions)));
    for index in positions.map(|i| i.value()).collect::<Vec<_>>() {
        let accessor = json.accessors.get_mut(index).ok_or_else(|| format!("there is no accessor {index}"))?;
        for bound in [&mut accessor.min, &mut accessor.max] {
            bound.get_or_insert_with(|| serde_json::json!([0.0, 0.0, 0.0]));
        }
    }
    // The library unwraps what says where an image is. Its type is seen by its content.
    for image in &mut json.images {
        image.mime_type.get_or_insert_with(|| gltf::json::image::MimeType("image/png".into()));
        image.uri.get_or_insert_default();
    }
    Ok((Document::from_json(json).map_err(|e| named(&e))?, blob))
}

/// Extensions that a file cannot do without are the likeliest trouble.
fn named(error: &gltf::Error) -> String {
    let text = error.to_string();
    if text.contains("extensionsRequired") {
        return format!("it needs an extension that is not read (compressed meshes, for instance): {text}");
    }
    text
}

fn buffers(file: &Document, blob: Option<Vec<u8>>, path: &Path) -> Result<Buffers, String> {
    let mut out = Vec::new();
    for buffer in file.buffers() {
        let data = match buffer.source() {
            gltf::buffer::Source::Bin => blob.clone().ok_or("its binary chunk is missing")?,
            gltf::buffer::Source::Uri(uri) => content(uri, path)?,
        };
        if data.len() < buffer.length() {
            let n = buffer.index();
            return Err(format!("buffer {n} is cut short: {} of {} bytes", data.len(), buffer.length()));
        }
        out.push(data);
    }
    Ok(out)
}

/// What a URI stands for: the bytes in a data: URI, or a file.
fn content(uri: &str, path: &Path) -> Result<Vec<u8>, String> {
    if uri.starts_with("data:") {
        let data = gltf::buffer::Data::from_source(gltf::buffer::Source::Uri(uri), None);
        return data.map(|d| d.0).map_err(|e| format!("is a damaged data: URI ({e})"));
    }
    let file = beside(path, uri);
    std::fs::read(&file).map_err(|e| format!("its file {} {}", file.display(), super::reason(&e)))
}

struct Loader<'a> {
    library: &'a mut Library,
    path: &'a Path,
    buffers: Buffers,
    default: u32,
    /// Nodes that were visited: a node has one parent.
    seen: Vec<usize>,
    out: PartGeometry,
}

impl Loader<'_> {
    fn node(&mut self, node: &gltf::Node, world_from_parent: Mat4, depth: usize) -> Result<(), String> {
        if self.seen.contains(&node.index()) || depth > MOST_LEVELS {
            return Err(format!("node {} is met twice, or nested too deep", node.index()));
        }
        self.seen.push(node.index());
        let world = world_from_parent * Mat4::from_cols_array_2d(&node.transform().matrix());
        if let Some(mesh) = node.mesh() {
            self.mesh(&mesh, world)?;
        }
        node.children().try_for_each(|child| self.node(&child, world, depth + 1))
    }

    fn mesh(&mut self, mesh: &gltf::Mesh, world: Mat4) -> Result<(), String> {
        mesh.primitives().try_for_each(|p| self.primitive(&p, world))
    }

    fn primitive(&mut self, primitive: &Primitive, world: Mat4) -> Result<(), String> {
        if !matches!(primitive.mode(), Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            return Ok(());
        }
        let positions = primitive.get(&Semantic::Positions).ok_or("a mesh has no positions")?;
        self.fits(&positions, Dimensions::Vec3, &[DataType::F32])?;
        let reader = primitive.reader(|buffer| self.buffers.get(buffer.index()).map(Vec::as_slice));
        let positions: Vec<Vec3> = reader.read_positions().ok_or("positions are missing")?.map(Vec3::from).collect();
        let n = positions.len();

        let mut normals = vec![Vec3::ZERO; n];
        if let Some(accessor) = primitive.get(&Semantic::Normals) {
            self.fits(&accessor, Dimensions::Vec3, &[DataType::F32])?;
            let matrix = world.inverse().transpose();
            let turned = reader.read_normals().into_iter().flatten().map(|v| matrix.transform_vector3(v.into()));
            normals.iter_mut().zip(turned).for_each(|(to, v)| *to = v.normalize_or_zero());
        }
        let indices: Vec<u32> = match primitive.indices() {
            Some(accessor) => {
                self.fits(&accessor, Dimensions::Scalar, &[DataType::U8, DataType::U16, DataType::U32])?;
                reader.read_indices().ok_or("indices are missing")?.into_u32().collect()
            }
            None => (0..n as u32).collect(),
        };
        if let Some(wrong) = indices.iter().find(|i| **i as usize >= n) {
            return Err(format!("there is no vertex {wrong}"));
        }
        let set = primitive.material().pbr_metallic_roughness().base_color_texture().map_or(0, |t| t.tex_coord());
        let mut uvs = vec![Vec2::ZERO; n];
        if let Some(accessor) = primitive.get(&Semantic::TexCoords(set)) {
            self.fits(&accessor, Dimensions::Vec2, &[DataType::U8, DataType::U16, DataType::F32])?;
            let read = reader.read_tex_coords(set).into_iter().flat_map(|t| t.into_f32());
            // glTF counts v from the top.
            uvs.iter_mut().zip(read).for_each(|(to, [u, v])| *to = Vec2::new(u, 1.0 - v));
        }
        let base = self.out.vertices.len() as u32;
        self.out.vertices.extend(positions.iter().map(|v| world.transform_point3(*v)));
        self.out.normals.extend(normals);
        self.out.uvs.extend(uvs);
        let mirrored = world.determinant() < 0.0;
        for [a, b, c] in triangles(primitive.mode(), &indices) {
            self.out.faces.push((if mirrored { [a, c, b] } else { [a, b, c] }).map(|i| i + base));
        }
        let material = self.material(&primitive.material());
        self.out.materials.resize(self.out.faces.len(), material);
        Ok(())
    }

    /// Whether the numbers are of the type that the reader takes them for, and in their buffer.
    fn fits(&self, accessor: &Accessor, shape: Dimensions, types: &[DataType]) -> Result<(), String> {
        let n = accessor.index();
        if accessor.dimensions() != shape || !types.contains(&accessor.data_type()) || accessor.count() == 0 {
            return Err(format!("accessor {n} is empty or of another type than its use"));
        }
        let sparse = accessor.sparse();
        let strides = [accessor.view(), sparse.as_ref().map(|s| s.values().view())];
        if strides.iter().flatten().any(|v| v.stride().is_some_and(|stride| stride < accessor.size())) {
            return Err(format!("the numbers of accessor {n} overlap"));
        }
        if let Some(sparse) = sparse {
            let index = sparse.indices();
            let short = index.view().stride().is_some_and(|s| s < index.index_type().size());
            // Without numbers under them, sparse ones make room for as many zeros as they say.
            if short || sparse.count() == 0 || accessor.count() > MOST_SPARSE {
                return Err(format!("the sparse numbers of accessor {n} are damaged"));
            }
        }
        // Ends are added up in the library without a look at their size.
        let most = self.buffers.iter().map(Vec::len).max().unwrap_or(0);
        let ends = accessor.view().map_or([0; 3], |v| [v.offset(), v.length(), accessor.count()]);
        let inside = ends.iter().chain([&accessor.offset()]).all(|end| *end <= most);
        if inside { Ok(()) } else { Err(format!("accessor {n} leaves its buffer")) }
    }

    /// Base colour (linear in the file) and its texture.
    fn material(&mut self, material: &gltf::Material) -> u32 {
        if material.index().is_none() {
            return self.default;
        }
        let base = material.pbr_metallic_roughness();
        let [r, g, b, _] = base.base_color_factor();
        let color = [r, g, b].map(|c| srgb_from_linear(c.clamp(0.0, 1.0)));
        let image = base.base_color_texture().and_then(|t| t.texture().source());
        let texture = image.and_then(|image| match image.source() {
            gltf::image::Source::Uri { uri, .. } if uri.starts_with("data:") => {
                self.embedded(&image, content(uri, self.path))
            }
            gltf::image::Source::Uri { uri, .. } => self.library.texture_if_there(&beside(self.path, uri)),
            gltf::image::Source::View { view, .. } => {
                let data = self.buffers.get(view.buffer().index());
                let end = view.offset().checked_add(view.length());
                let bytes = data.zip(end).and_then(|(d, end)| d.get(view.offset()..end));
                let bytes = bytes.map(<[u8]>::to_vec).ok_or_else(|| "leaves its buffer".to_string());
                self.embedded(&image, bytes)
            }
        });
        self.library.material(Material { color, texture })
    }

    fn embedded(&mut self, image: &gltf::Image, bytes: Result<Vec<u8>, String>) -> Option<usize> {
        let name = self.path.join(format!("image {}", image.index()));
        self.library.texture_or_note(&name, bytes)
    }
}

fn triangles(mode: Mode, indices: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        Mode::Triangles => indices.as_chunks::<3>().0.to_vec(),
        Mode::TriangleStrip => {
            let turned = |(i, w): (usize, &[u32])| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] };
            indices.windows(3).enumerate().map(turned).collect()
        }
        _ => indices.windows(2).skip(1).map(|w| [indices[0], w[0], w[1]]).collect(),
    }
}
