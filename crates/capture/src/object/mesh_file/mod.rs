//! Meshes of parts: OBJ, STL, COLLADA (.dae) and glTF (.gltf, .glb), each loaded in its own frame.
//!
//! The reader goes by what the file holds, then by its name. Whatever the format: a file from which
//! no triangle came, or with a vertex that is nowhere, is refused.

mod collada;
mod collada_looks;
mod gltf;
mod obj;
mod stl;
#[cfg(test)]
mod tests;

use super::{Material, PartGeometry, Texture};
use crate::CaptureError;
use glam::Vec3;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Coordinates beyond this are damage, not a size: no object is a thousand kilometres long.
pub(super) const FARTHEST: f32 = 1e6;
/// Colour of what has none.
pub(super) const GREY: [f32; 3] = [0.7; 3];
const NOT_READ: &str = "OBJ, STL, COLLADA (.dae) and glTF (.gltf, .glb) are read: convert it, for instance with \
     Blender (File > Export) or `assimp export IN OUT.obj`";

/// Materials and textures met so far; a texture file is read once.
#[derive(Default)]
pub(crate) struct Library {
    pub materials: Vec<Material>,
    pub textures: Vec<Texture>,
    /// What was left out or assumed, one sentence each.
    pub notes: Vec<String>,
    texture_of: BTreeMap<PathBuf, Option<usize>>,
}

impl Library {
    pub fn plain(&mut self, color: [f32; 3]) -> u32 {
        self.material(Material { color, texture: None })
    }

    pub fn material(&mut self, material: Material) -> u32 {
        let known = self.materials.iter().position(|m| *m == material);
        known.unwrap_or_else(|| {
            self.materials.push(material);
            self.materials.len() - 1
        }) as u32
    }

    /// The texture at `path`.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn texture(&mut self, path: &Path) -> Result<usize, CaptureError> {
        if let Some(&Some(known)) = self.texture_of.get(path) {
            return Ok(known);
        }
        let texture = Texture::read(path)?;
        Ok(self.keep(path, texture))
    }

    /// The texture at `path`; one that cannot be read costs the colours, and is named in a note.
    pub fn texture_if_there(&mut self, path: &Path) -> Option<usize> {
        let path = normalized(path);
        if let Some(known) = self.texture_of.get(&path) {
            return *known;
        }
        self.texture_or_note(&path, std::fs::read(&path).map_err(|e| reason(&e)))
    }

    /// A texture from the bytes of its file, kept under the name `path`.
    fn texture_or_note(&mut self, path: &Path, bytes: Result<Vec<u8>, String>) -> Option<usize> {
        if let Some(known) = self.texture_of.get(path) {
            return *known;
        }
        match bytes.and_then(|b| Texture::decode(&b)) {
            Ok(texture) => Some(self.keep(path, texture)),
            Err(reason) => {
                self.note(format!("the texture {} {reason}: drawn in plain colour", path.display()));
                self.texture_of.insert(path.to_path_buf(), None);
                None
            }
        }
    }

    fn keep(&mut self, path: &Path, texture: Texture) -> usize {
        self.textures.push(texture);
        self.texture_of.insert(path.to_path_buf(), Some(self.textures.len() - 1));
        self.textures.len() - 1
    }

    /// Says a sentence once.
    pub fn note(&mut self, sentence: String) {
        if !self.notes.contains(&sentence) {
            self.notes.push(sentence);
        }
    }

    /// A mesh file in its own frame. Faces without material get `default`.
    ///
    /// # Errors
    /// When the file is missing, of a format that is not read, damaged or without a surface.
    pub fn load(&mut self, path: &Path, default: u32) -> Result<PartGeometry, CaptureError> {
        let place = path.display().to_string();
        let bytes = std::fs::read(path).map_err(|e| {
            let missing = e.kind() == std::io::ErrorKind::NotFound;
            let what = if missing { "the mesh file is not there".into() } else { format!("cannot read the mesh: {e}") };
            CaptureError::new(what, &place, "correct the path in the object file, or copy the file there")
        })?;
        let format = Format::of(path, &bytes);
        let mesh = match format {
            Format::Stl => stl::load(&bytes, default).map_err(|e| damaged(path, "STL", &e)),
            Format::Obj => obj::load(self, path, &bytes, default).map_err(|e| damaged(path, "OBJ", &e)),
            Format::Gltf => gltf::load(self, path, &bytes, default).map_err(|e| damaged(path, "glTF", &e)),
            Format::Collada => collada::load(self, path, bytes, default),
            Format::Other(name) => {
                Err(CaptureError::new(format!("meshes in the format {name} are not read"), &place, NOT_READ))
            }
        }?;
        checked(mesh, path)
    }
}

fn reason(error: &std::io::Error) -> String {
    if error.kind() == std::io::ErrorKind::NotFound {
        "is not there".into()
    } else {
        format!("cannot be read ({error})")
    }
}

fn damaged(path: &Path, format: &str, what: &dyn std::fmt::Display) -> CaptureError {
    let hint = "copy or export the file again; it may be cut short, or of another format than its name says";
    CaptureError::new(format!("cannot read the mesh as {format}: {what}"), path.display().to_string(), hint)
}

fn checked(mesh: PartGeometry, path: &Path) -> Result<PartGeometry, CaptureError> {
    let refused = |what: String, hint: &str| Err(CaptureError::new(what, path.display().to_string(), hint.to_string()));
    if mesh.faces.is_empty() {
        return refused(
            "no triangle came from the mesh file".into(),
            "export it again, with faces and not only points",
        );
    }
    if let Some(v) = mesh.vertices.iter().find(|v| !(v.abs().max_element() <= FARTHEST)) {
        let what = format!("a vertex lies at {v}; numbers up to {FARTHEST:e} are expected");
        return refused(what, "the file is damaged, or was exported with a wrong scale: export it again");
    }
    Ok(mesh)
}

/// Which reader a file goes to.
#[derive(Debug, PartialEq)]
enum Format {
    Obj,
    Stl,
    Collada,
    Gltf,
    /// By its name or its first bytes.
    Other(String),
}

impl Format {
    /// By content where a format has a mark of its own, otherwise by extension.
    fn of(path: &Path, bytes: &[u8]) -> Self {
        let head = String::from_utf8_lossy(&bytes[..bytes.len().min(1024)]).into_owned();
        let marks = [
            ("ply\n", "PLY"),
            ("ply\r", "PLY"),
            ("Kaydara FBX", "FBX"),
            ("; FBX", "FBX"),
            ("PK\u{3}\u{4}", "ZIP (3MF or USDZ)"),
            ("PXR-USDC", "USD"),
            ("#usda", "USD"),
            ("OFF\n", "OFF"),
            ("#VRML", "VRML"),
            ("BLENDER", "Blender"),
            ("xof ", "DirectX"),
            ("version https://git-lfs", "Git LFS pointer (run `git lfs pull`)"),
        ];
        if bytes.starts_with(b"glTF") {
            return Self::Gltf;
        }
        if let Some((_, name)) = marks.iter().find(|(mark, _)| head.starts_with(mark)) {
            return Self::Other((*name).to_string());
        }
        if head.contains("<COLLADA") {
            return Self::Collada;
        }
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
        match extension.as_deref() {
            Some("stl" | "stla" | "stlb") => Self::Stl,
            Some("dae") => Self::Collada,
            Some("gltf" | "glb") => Self::Gltf,
            Some("obj") if stl::is(bytes) => Self::Stl,
            Some("obj") => Self::Obj,
            _ if stl::is(bytes) => Self::Stl,
            _ if head.lines().any(|l| l.starts_with("v ") || l.starts_with("mtllib ")) => Self::Obj,
            Some(other) => Self::Other(other.to_string()),
            None => Self::Other("of a file without extension".into()),
        }
    }
}

/// Adds corners to a mesh, one vertex for each different `key`.
struct Corners<K> {
    mesh: PartGeometry,
    seen: std::collections::HashMap<K, u32>,
}

impl<K: std::hash::Hash + Eq> Corners<K> {
    fn new() -> Self {
        Self { mesh: PartGeometry::default(), seen: std::collections::HashMap::new() }
    }

    /// Index of the corner: position, normal (zero if there is none), texture coordinates.
    fn corner(&mut self, key: K, position: Vec3, normal: Vec3, uv: glam::Vec2) -> u32 {
        *self.seen.entry(key).or_insert_with(|| {
            self.mesh.vertices.push(position);
            self.mesh.normals.push(normal);
            self.mesh.uvs.push(uv);
            self.mesh.vertices.len() as u32 - 1
        })
    }

    fn face(&mut self, corners: [u32; 3], material: u32) {
        self.mesh.faces.push(corners);
        self.mesh.materials.push(material);
    }
}

/// Resolves ".." by name so that one texture has one path.
fn normalized(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for part in path.components() {
        match part {
            std::path::Component::ParentDir if out.file_name().is_some() => {
                out.pop();
            }
            other => out.push(other),
        }
    }
    out
}

/// `name`, as a file writes it, beside `file`: quotes, backslashes, `file://` and %20 are
/// understood.
fn beside(file: &Path, name: &str) -> PathBuf {
    let name = name.trim().trim_matches('"').trim().replace('\\', "/");
    let name = name.strip_prefix("file://").unwrap_or(&name);
    let folder = file.parent().unwrap_or(Path::new("."));
    let plain = folder.join(name);
    if !plain.exists()
        && let Some(decoded) = unescaped(name)
    {
        return folder.join(decoded);
    }
    plain
}

/// `%20` and its like as the bytes they stand for; `None` when nothing is to be done or it is no
/// text.
pub(super) fn unescaped(uri: &str) -> Option<String> {
    let mut out = Vec::new();
    let mut rest = uri.as_bytes();
    while let [first, tail @ ..] = rest {
        let hex = |b: u8| (b as char).to_digit(16);
        match (first, tail) {
            (b'%', [a, b, after @ ..]) if hex(*a).is_some() && hex(*b).is_some() => {
                out.push((hex(*a)? * 16 + hex(*b)?) as u8);
                rest = after;
            }
            _ => {
                out.push(*first);
                rest = tail;
            }
        }
    }
    String::from_utf8(out).ok().filter(|text| text != uri)
}
