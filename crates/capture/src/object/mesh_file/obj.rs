//! OBJ meshes with their MTL materials.
//!
//! Lines are tidied before the library reads them: it takes "map_Kd -s 1 1 1 a.png" for the name of
//! a file, and gives up on a whole file for a line of no consequence.

use super::{GREY, Library, beside};
use crate::object::{Material, PartGeometry};
use glam::{Vec2, Vec3};
use std::cell::RefCell;
use std::path::Path;

/// A material's index, and the scale and offset of its texture.
struct Looks {
    id: u32,
    scale: Vec2,
    offset: Vec2,
}

pub(super) fn load(library: &mut Library, path: &Path, bytes: &[u8], default: u32) -> Result<PartGeometry, String> {
    let options = tobj::LoadOptions { triangulate: true, single_index: true, ignore_points: true, ignore_lines: true };
    let text = tidy_obj(&String::from_utf8_lossy(bytes));
    let missing = RefCell::new(Vec::new());
    let (models, materials) = tobj::load_obj_buf(&mut text.as_bytes(), &options, |name| {
        let name = name.to_string_lossy();
        // One name with spaces, or several names.
        let read = |name: &str| std::fs::read(beside(path, name)).ok();
        let files = read(&name).map_or_else(|| name.split_whitespace().filter_map(read).collect(), |one| vec![one]);
        if files.is_empty() {
            let file = beside(path, &name);
            missing
                .borrow_mut()
                .push(format!("the material file {} is not there: its colours are lost", file.display()));
        }
        let text: String = files.iter().map(|bytes| tidy_mtl(&String::from_utf8_lossy(bytes))).collect();
        tobj::load_mtl_buf(&mut text.as_bytes())
    })
    .map_err(|e| e.to_string())?;
    missing.into_inner().into_iter().for_each(|sentence| library.note(sentence));
    let looks: Vec<Looks> = materials.unwrap_or_default().iter().map(|m| looks(library, path, m)).collect();

    let mut out = PartGeometry::default();
    for model in models {
        let mesh = model.mesh;
        let base = out.vertices.len() as u32;
        let n = mesh.positions.len() / 3;
        let three = |data: &[f32], i: usize| Vec3::new(data[3 * i], data[3 * i + 1], data[3 * i + 2]);
        out.vertices.extend((0..n).map(|i| three(&mesh.positions, i)));
        let has_normals = mesh.normals.len() == 3 * n;
        out.normals
            .extend((0..n).map(|i| if has_normals { three(&mesh.normals, i).normalize_or_zero() } else { Vec3::ZERO }));
        let look = mesh.material_id.and_then(|i| looks.get(i));
        let (scale, offset) = look.map_or((Vec2::ONE, Vec2::ZERO), |l| (l.scale, l.offset));
        let has_uvs = mesh.texcoords.len() == 2 * n;
        out.uvs.extend((0..n).map(|i| {
            let uv = if has_uvs { Vec2::from_slice(&mesh.texcoords[2 * i..]) } else { Vec2::ZERO };
            uv * scale + offset
        }));
        out.faces.extend(mesh.indices.as_chunks::<3>().0.iter().map(|f| f.map(|i| i + base)));
        out.materials.resize(out.faces.len(), look.map_or(default, |l| l.id));
    }
    Ok(out)
}

fn looks(library: &mut Library, path: &Path, m: &tobj::Material) -> Looks {
    let map = m.diffuse_texture.as_deref().map(texture_options);
    let (file, scale, offset) = map.unwrap_or((None, Vec2::ONE, Vec2::ZERO));
    let texture = file.and_then(|name| library.texture_if_there(&beside(path, name)));
    // Exporters write Kd 0 beside a texture and mean the texture.
    let color = match (m.diffuse, texture) {
        (Some([0.0, 0.0, 0.0]), Some(_)) | (None, Some(_)) => [1.0; 3],
        (Some([0.0, 0.0, 0.0]), None) if file.is_some() => GREY,
        (Some(color), _) => color,
        (None, None) => GREY,
    };
    Looks { id: library.material(Material { color, texture }), scale, offset }
}

/// The file name, scale (-s) and offset (-o) in the value of `map_Kd`; other options are passed
/// over. The name is what is left, spaces included.
fn texture_options(value: &str) -> (Option<&str>, Vec2, Vec2) {
    let (mut scale, mut offset) = (Vec2::ONE, Vec2::ZERO);
    let mut rest = value.trim();
    let word = |text: &'_ str| text.split_whitespace().next().map(str::len);
    while let Some(length) = word(rest).filter(|_| rest.starts_with('-')) {
        let (option, mut after) = rest.split_at(length);
        after = after.trim_start();
        let (most, numbers) = match option {
            "-o" | "-s" | "-t" => (3, true),
            "-mm" => (2, true),
            "-blendu" | "-blendv" | "-cc" | "-clamp" | "-imfchan" | "-type" | "-colorspace" => (1, false),
            "-boost" | "-bm" | "-texres" => (1, true),
            // No option: a file whose name begins with "-".
            _ => break,
        };
        let mut values = Vec::new();
        while let Some(length) = word(after).filter(|_| values.len() < most) {
            let parsed = after[..length].parse::<f32>();
            if numbers && parsed.is_err() {
                break;
            }
            values.push(parsed.unwrap_or_default());
            after = after[length..].trim_start();
        }
        let pair = |missing: f32| Vec2::new(*values.first().unwrap_or(&missing), *values.get(1).unwrap_or(&missing));
        match option {
            "-s" => scale = pair(1.0),
            "-o" => offset = pair(0.0),
            _ => {}
        }
        rest = after;
    }
    (Some(rest).filter(|name| !name.is_empty()), scale, offset)
}

/// The keyword of a line and the rest.
fn split(line: &str) -> (&str, &str) {
    let line = line.trim();
    let (key, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
    (key, rest.trim())
}

fn tidy_obj(text: &str) -> String {
    let text = text.trim_start_matches('\u{feff}');
    let mut out = String::with_capacity(text.len());
    // A backslash at the end of a line carries it on.
    for line in text.replace("\\\r\n", " ").replace("\\\n", " ").lines() {
        match split(line) {
            ("usemtl" | "mtllib", "") => continue,
            ("usemtl", name) => out.extend(["usemtl ", name]),
            ("mtllib", name) => out.extend(["mtllib ", name]),
            _ => out.push_str(line),
        }
        out.push('\n');
    }
    out
}

/// Names, diffuse colours and textures; the rest is of no use here and may be odd.
fn tidy_mtl(text: &str) -> String {
    let mut out = String::new();
    for line in text.trim_start_matches('\u{feff}').lines() {
        let (key, value) = split(line);
        match key.to_ascii_lowercase().as_str() {
            "newmtl" if !value.is_empty() => out.extend(["newmtl ", value, "\n"]),
            "kd" => {
                let numbers: Vec<f32> = value.split_whitespace().map_while(|w| w.parse().ok()).collect();
                let color = match numbers[..] {
                    [r, g, b, ..] => [r, g, b],
                    [grey] => [grey; 3],
                    _ => continue,
                };
                let [r, g, b] = color.map(|c| if c.is_finite() { c } else { 0.7 });
                out.push_str(&format!("Kd {r} {g} {b}\n"));
            }
            "map_kd" if !value.is_empty() => out.extend(["map_Kd ", value, "\n"]),
            _ => {}
        }
    }
    out
}
