//! OBJ meshes with their MTL materials, loaded once each.

use super::{Material, PartGeometry, Texture};
use crate::CaptureError;
use glam::{Vec2, Vec3};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Materials and textures met so far; a texture file is read once.
#[derive(Default)]
pub(crate) struct Library {
    pub materials: Vec<Material>,
    pub textures: Vec<Texture>,
    texture_of: BTreeMap<PathBuf, usize>,
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

    pub fn texture(&mut self, path: &Path) -> Result<usize, CaptureError> {
        if let Some(&known) = self.texture_of.get(path) {
            return Ok(known);
        }
        self.textures.push(Texture::read(path)?);
        self.texture_of.insert(path.to_path_buf(), self.textures.len() - 1);
        Ok(self.textures.len() - 1)
    }

    /// An OBJ file in its own frame. Faces without material get `default`.
    pub fn load_obj(&mut self, path: &Path, default: u32) -> Result<PartGeometry, CaptureError> {
        let bad = |e: &dyn std::fmt::Display| {
            let hint = "check that the file is an OBJ and complete; other formats: convert to OBJ first";
            CaptureError::new(format!("cannot read the mesh: {e}"), path.display().to_string(), hint)
        };
        let options = tobj::LoadOptions { triangulate: true, single_index: true, ..Default::default() };
        let (models, materials) = tobj::load_obj(path, &options).map_err(|e| bad(&e))?;
        // A missing MTL only costs the colours.
        let mut ids = Vec::new();
        for m in materials.unwrap_or_default() {
            let folder = path.parent().unwrap_or(Path::new("."));
            let texture = match &m.diffuse_texture {
                Some(name) => Some(self.texture(&normalized(&folder.join(name)))?),
                None => None,
            };
            // Exporters write Kd 0 beside a texture and mean the texture.
            let color = match (m.diffuse, texture) {
                (Some([0.0, 0.0, 0.0]), Some(_)) | (None, Some(_)) => [1.0; 3],
                (Some(color), _) => color,
                (None, None) => [0.7; 3],
            };
            ids.push(self.material(Material { color, texture }));
        }
        let mut out = PartGeometry::default();
        for model in models {
            let mesh = model.mesh;
            let base = out.vertices.len() as u32;
            let n = mesh.positions.len() / 3;
            let three = |data: &[f32], i: usize| Vec3::new(data[3 * i], data[3 * i + 1], data[3 * i + 2]);
            out.vertices.extend((0..n).map(|i| three(&mesh.positions, i)));
            let has_normals = mesh.normals.len() == 3 * n;
            out.normals.extend(
                (0..n).map(|i| if has_normals { three(&mesh.normals, i).normalize_or_zero() } else { Vec3::ZERO }),
            );
            let has_uvs = mesh.texcoords.len() == 2 * n;
            out.uvs.extend((0..n).map(|i| {
                if has_uvs { Vec2::new(mesh.texcoords[2 * i], mesh.texcoords[2 * i + 1]) } else { Vec2::ZERO }
            }));
            let material = mesh.material_id.and_then(|i| ids.get(i).copied()).unwrap_or(default);
            out.faces.extend(mesh.indices.as_chunks::<3>().0.iter().map(|f| f.map(|i| i + base)));
            out.materials.resize(out.faces.len(), material);
        }
        if let Some(v) = out.vertices.iter().find(|v| !v.is_finite()) {
            return Err(bad(&format!("a vertex is not finite: {v}")));
        }
        Ok(out)
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
