//! A textured surface on the disk: OBJ, MTL and PNG side by side.

use super::Texture;
use hingecast_geom::TriMesh;
use hingecast_geom::staging::write_whole;
use std::fmt::Write as _;
use std::path::Path;

/// Writes `path` (OBJ), the material beside it (`.mtl`) and the picture (`.png`). The material is
/// called like the file.
///
/// # Errors
/// A file cannot be written.
pub fn write(mesh: &TriMesh, texture: &Texture, path: &Path) -> std::io::Result<()> {
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let mut obj = format!("mtllib {name}.mtl\n");
    for v in &mesh.vertices {
        let _ = writeln!(obj, "v {} {} {}", v.x, v.y, v.z);
    }
    for [u, v] in &texture.corners {
        let _ = writeln!(obj, "vt {u:.6} {v:.6}");
    }
    let _ = writeln!(obj, "usemtl {name}");
    for face in &texture.faces {
        let [a, b, c] = face.map(|k| format!("{}/{}", texture.vertices[k as usize] + 1, k + 1));
        let _ = writeln!(obj, "f {a} {b} {c}");
    }
    write_whole(path, obj.as_bytes())?;
    // White, dull: the light of the room is in the photographs already.
    let mtl = format!("newmtl {name}\nKa 1 1 1\nKd 1 1 1\nKs 0 0 0\nillum 1\nmap_Kd {name}.png\n");
    write_whole(&path.with_extension("mtl"), mtl.as_bytes())?;
    write_whole(&path.with_extension("png"), &png(texture)?)
}

/// The picture as a PNG file.
///
/// # Errors
/// It has no texel, or more than a PNG can hold.
pub fn png(texture: &Texture) -> std::io::Result<Vec<u8>> {
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, texture.width as u32, texture.height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    encoder.write_header()?.write_image_data(&texture.rgb)?;
    Ok(out)
}
