//! STL, binary and ASCII.
//!
//! Triangles are joined at corners that lie at one place: STL repeats every corner, and whoever
//! asks what hangs together would see loose triangles. Its facet normals go: faces have their own.

use super::Corners;
use crate::object::PartGeometry;
use glam::{Vec2, Vec3};

/// Bytes before the number of triangles of a binary file.
const HEADER: usize = 80;
/// Bytes of a binary triangle: normal, three corners, two bytes of attributes.
const TRIANGLE: usize = 50;

/// Whether the content is STL. A binary file has exactly the size that its number of triangles
/// asks for, whatever its first bytes are: many programs write "solid" there.
pub(super) fn is(bytes: &[u8]) -> bool {
    binary_size(bytes) == Some(bytes.len()) || is_ascii(bytes)
}

fn is_ascii(bytes: &[u8]) -> bool {
    let text = bytes.trim_ascii_start();
    let solid = text.get(..5).is_some_and(|w| w.eq_ignore_ascii_case(b"solid"));
    solid && !text.contains(&0) && text.get(5).is_none_or(u8::is_ascii_whitespace)
}

/// Size in bytes that a binary file says it has.
fn binary_size(bytes: &[u8]) -> Option<usize> {
    let count: [u8; 4] = bytes.get(HEADER..HEADER + 4)?.try_into().ok()?;
    (u32::from_le_bytes(count) as usize).checked_mul(TRIANGLE)?.checked_add(HEADER + 4)
}

pub(super) fn load(bytes: &[u8], material: u32) -> Result<PartGeometry, String> {
    let scene = match binary_size(bytes) {
        Some(size) if size == bytes.len() || !is_ascii(bytes) => {
            let Some(whole) = bytes.get(..size) else {
                let (has, says) = ((bytes.len() - HEADER - 4) / TRIANGLE, (size - HEADER - 4) / TRIANGLE);
                return Err(format!("it is cut short: it says {says} triangles and has {has}"));
            };
            // The library takes a file that begins with "solid" for ASCII.
            let mut whole = whole.to_vec();
            whole[..HEADER].fill(0);
            mesh_loader::stl::from_slice(&whole)
        }
        _ if is_ascii(bytes) => mesh_loader::stl::from_slice(as_expected(bytes).as_bytes()),
        _ => return Err("it is neither binary STL nor ASCII STL".into()),
    };
    let mut out = Corners::new();
    for mesh in scene.map_err(|e| e.to_string())?.meshes {
        for face in &mesh.faces {
            let corners = face.map(|i| {
                // Adding 0 makes -0 and 0 one.
                let v = Vec3::from(mesh.vertices[i as usize]) + Vec3::ZERO;
                out.corner(v.to_array().map(f32::to_bits), v, Vec3::ZERO, Vec2::ZERO)
            });
            out.face(corners, material);
        }
    }
    Ok(out.mesh)
}

/// ASCII as the library expects it: small letters, no others, and a name after "solid".
fn as_expected(bytes: &[u8]) -> String {
    let mut out = String::with_capacity(bytes.len() + 16);
    for line in bytes.split(|b| *b == b'\n') {
        let line: String =
            line.iter().map(|b| if b.is_ascii() { b.to_ascii_lowercase() as char } else { '_' }).collect();
        out.push_str(if line.trim() == "solid" { "solid part" } else { line.trim_end() });
        out.push('\n');
    }
    out
}
