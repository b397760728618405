//! Meshes in and out: PLY (vertex colours), OBJ (vertex colours after the position, as MeshLab
//! writes them), binary STL.

use crate::TriMesh;
use crate::ply::{self, PlyError};
use crate::staging::write_whole;
use glam::Vec3;
use std::fmt::Write as _;
use std::path::Path;

impl TriMesh {
    /// Binary PLY with positions, optional uchar colours, triangles.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write_ply(&self, path: &Path) -> Result<(), PlyError> {
        let mut out = format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n",
            self.vertices.len()
        );
        if !self.colors.is_empty() {
            out += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
        }
        let _ = write!(out, "element face {}\nproperty list uchar int vertex_indices\nend_header\n", self.faces.len());
        let mut out = out.into_bytes();
        for (i, v) in self.vertices.iter().enumerate() {
            for x in v.to_array() {
                out.extend(x.to_le_bytes());
            }
            if let Some(c) = self.colors.get(i) {
                out.extend(c);
            }
        }
        for f in &self.faces {
            out.push(3);
            for i in f {
                out.extend(i.to_le_bytes());
            }
        }
        write_whole(path, &out).map_err(|source| PlyError::Io { path: path.to_path_buf(), source })
    }

    /// Reads positions, triangles, and colours named red green blue if there are any.
    ///
    /// # Errors
    /// The file cannot be read, is no PLY, or has no properties x, y and z.
    pub fn read_ply(path: &Path) -> Result<Self, PlyError> {
        let table = ply::read_vertices(path)?;
        let xyz = [table.column(path, "x")?, table.column(path, "y")?, table.column(path, "z")?];
        let rgb = ["red", "green", "blue"].map(|n| table.names.iter().position(|m| m == n));
        let mut mesh = TriMesh { faces: table.faces.clone(), ..Default::default() };
        for row in 0..table.rows() {
            let at = |c: usize| table.data[row * table.names.len() + c];
            mesh.vertices.push(Vec3::new(at(xyz[0]), at(xyz[1]), at(xyz[2])));
            if let [Some(r), Some(g), Some(b)] = rgb {
                mesh.colors.push([at(r) as u8, at(g) as u8, at(b) as u8]);
            }
        }
        Ok(mesh)
    }

    /// OBJ text with `v x y z r g b` lines (colours in [0, 1]) and triangles.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write_obj(&self, path: &Path) -> std::io::Result<()> {
        let mut out = String::new();
        for (i, v) in self.vertices.iter().enumerate() {
            let _ = match self.colors.get(i).map(|c| c.map(|x| x as f32 / 255.0)) {
                Some([r, g, b]) => writeln!(out, "v {} {} {} {r:.4} {g:.4} {b:.4}", v.x, v.y, v.z),
                None => writeln!(out, "v {} {} {}", v.x, v.y, v.z),
            };
        }
        for f in &self.faces {
            let _ = writeln!(out, "f {} {} {}", f[0] + 1, f[1] + 1, f[2] + 1);
        }
        write_whole(path, out.as_bytes())
    }

    /// Binary STL, which MuJoCo and every URDF loader reads.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write_stl(&self, path: &Path) -> std::io::Result<()> {
        let mut out = vec![0u8; 80];
        out.extend((self.faces.len() as u32).to_le_bytes());
        for f in &self.faces {
            let [a, b, c] = f.map(|i| self.vertices[i as usize]);
            let n = (b - a).cross(c - a).normalize_or_zero();
            for v in [n, a, b, c] {
                for x in v.to_array() {
                    out.extend(x.to_le_bytes());
                }
            }
            out.extend([0, 0]);
        }
        write_whole(path, &out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ply_round_trips_with_colours() {
        let mut mesh = TriMesh::cuboid(Vec3::ZERO, Vec3::ONE);
        mesh.colors = (0..8).map(|i| [i * 30, 255 - i * 30, 7]).collect();
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("m.ply");
        mesh.write_ply(&path).unwrap();
        assert_eq!(TriMesh::read_ply(&path).unwrap(), mesh);
    }

    #[test]
    fn truncated_ply_is_refused_by_name() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("m.ply");
        TriMesh::cuboid(Vec3::ZERO, Vec3::ONE).write_ply(&path).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() - 20]).unwrap();
        let message = TriMesh::read_ply(&path).unwrap_err().to_string();
        assert!(message.contains("m.ply") && message.contains("face"), "{message}");
    }
}
