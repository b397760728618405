//! Just enough PLY: a table of scalar vertex properties in, float tables and coloured meshes out.
//! Binary little-endian and ascii are read; binary little-endian is written.

use crate::staging::write_whole;
use std::path::{Path, PathBuf};

/// Why a PLY file could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum PlyError {
    /// The operating system refused to read or write.
    #[error("cannot read or write {path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file is there, but not what was looked for.
    #[error("{path} is not a usable PLY: {what}")]
    Format {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        what: String,
    },
}

fn io_error(path: &Path) -> impl FnOnce(std::io::Error) -> PlyError {
    let path = path.to_path_buf();
    move |source| PlyError::Io { path, source }
}

fn bad(path: &Path, what: impl Into<String>) -> PlyError {
    PlyError::Format { path: path.to_path_buf(), what: what.into() }
}

/// The scalar vertex properties as f32, row-major (rows, names.len()), and triangle indices if
/// there are faces.
#[derive(Debug, Default)]
pub struct VertexTable {
    /// Names of the properties, in file order: the columns of `data`.
    pub names: Vec<String>,
    /// Row-major values, one row a vertex. (rows, names.len())
    pub data: Vec<f32>,
    /// Triangles, as indices of rows; polygons arrive as fans.
    pub faces: Vec<[u32; 3]>,
}

impl VertexTable {
    /// How many vertices there are.
    pub fn rows(&self) -> usize {
        if self.names.is_empty() { 0 } else { self.data.len() / self.names.len() }
    }

    /// Index of a property; the error names the file and what it has instead.
    ///
    /// # Errors
    /// No property has this name; `path` is only named in the message.
    pub fn column(&self, path: &Path, name: &str) -> Result<usize, PlyError> {
        self.names
            .iter()
            .position(|n| n == name)
            .ok_or_else(|| bad(path, format!("no vertex property '{name}' (it has {})", self.names.join(" "))))
    }
}

#[derive(Clone, Copy)]
enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn parse(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Scalar::I8,
            "uchar" | "uint8" => Scalar::U8,
            "short" | "int16" => Scalar::I16,
            "ushort" | "uint16" => Scalar::U16,
            "int" | "int32" => Scalar::I32,
            "uint" | "uint32" => Scalar::U32,
            "float" | "float32" => Scalar::F32,
            "double" | "float64" => Scalar::F64,
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Scalar::I8 | Scalar::U8 => 1,
            Scalar::I16 | Scalar::U16 => 2,
            Scalar::I32 | Scalar::U32 | Scalar::F32 => 4,
            Scalar::F64 => 8,
        }
    }

    fn read(self, b: &[u8]) -> f64 {
        match self {
            Scalar::I8 => b[0] as i8 as f64,
            Scalar::U8 => b[0] as f64,
            Scalar::I16 => i16::from_le_bytes([b[0], b[1]]) as f64,
            Scalar::U16 => u16::from_le_bytes([b[0], b[1]]) as f64,
            Scalar::I32 => i32::from_le_bytes([b[0], b[1], b[2], b[3]]) as f64,
            Scalar::U32 => u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as f64,
            Scalar::F32 => f32::from_le_bytes([b[0], b[1], b[2], b[3]]) as f64,
            Scalar::F64 => f64::from_le_bytes(b[..8].try_into().expect("8 bytes")),
        }
    }
}

enum Property {
    Scalar(String, Scalar),
    List(Scalar, Scalar),
}

struct Element {
    name: String,
    count: usize,
    properties: Vec<Property>,
}

/// A cursor over the body that answers one scalar at a time, ascii or binary.
enum Body<'a> {
    Ascii(std::str::SplitAsciiWhitespace<'a>),
    Binary(&'a [u8]),
}

impl Body<'_> {
    fn next(&mut self, ty: Scalar) -> Option<f64> {
        match self {
            Body::Ascii(words) => words.next()?.parse().ok(),
            Body::Binary(bytes) => {
                let (head, tail) = bytes.split_at_checked(ty.size())?;
                *bytes = tail;
                Some(ty.read(head))
            }
        }
    }
}

/// Reads every scalar vertex property and triangulates the faces as fans.
///
/// # Errors
/// When the file is missing, truncated, big-endian, or not a PLY.
pub fn read_vertices(path: &Path) -> Result<VertexTable, PlyError> {
    let bytes = std::fs::read(path).map_err(io_error(path))?;
    let mut binary = false;
    let mut elements: Vec<Element> = Vec::new();
    let mut at = 0;
    let mut line_number = 0;
    loop {
        let end =
            bytes[at..].iter().position(|&b| b == b'\n').ok_or_else(|| bad(path, "the header has no end_header"))?;
        let line = std::str::from_utf8(&bytes[at..at + end]).map_err(|_| bad(path, "the header is not text"))?.trim();
        at += end + 1;
        line_number += 1;
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        match words.as_slice() {
            ["ply"] if line_number == 1 => {}
            _ if line_number == 1 => return Err(bad(path, "it does not start with 'ply'")),
            ["format", "binary_little_endian", ..] => binary = true,
            ["format", "ascii", ..] => binary = false,
            ["format", other, ..] => {
                return Err(bad(path, format!("format '{other}' is not read")));
            }
            ["element", name, count] => {
                let count = count.parse().map_err(|_| bad(path, format!("bad count in '{line}'")))?;
                elements.push(Element { name: name.to_string(), count, properties: Vec::new() });
            }
            ["property", "list", count, item, _] => {
                let (Some(c), Some(i)) = (Scalar::parse(count), Scalar::parse(item)) else {
                    return Err(bad(path, format!("unknown type in '{line}'")));
                };
                elements
                    .last_mut()
                    .ok_or_else(|| bad(path, "property before element"))?
                    .properties
                    .push(Property::List(c, i));
            }
            ["property", ty, name] => {
                let ty = Scalar::parse(ty).ok_or_else(|| bad(path, format!("unknown type in '{line}'")))?;
                let element = elements.last_mut().ok_or_else(|| bad(path, "property before element"))?;
                element.properties.push(Property::Scalar(name.to_string(), ty));
            }
            ["end_header"] => break,
            _ => {}
        }
    }
    let mut body = if binary {
        Body::Binary(&bytes[at..])
    } else {
        let text = std::str::from_utf8(&bytes[at..]).map_err(|_| bad(path, "ascii body is not text"))?;
        Body::Ascii(text.split_ascii_whitespace())
    };
    let mut table = VertexTable::default();
    for element in &elements {
        if element.properties.is_empty() && element.count > 0 {
            return Err(bad(path, format!("its {} '{}' have no properties", element.count, element.name)));
        }
        let is_vertex = element.name == "vertex";
        if is_vertex {
            table.names = element
                .properties
                .iter()
                .filter_map(|p| if let Property::Scalar(n, _) = p { Some(n.clone()) } else { None })
                .collect();
        }
        for row in 0..element.count {
            let short = || bad(path, format!("the file ends in {} {row} of {}", element.name, element.count));
            for property in &element.properties {
                match property {
                    Property::Scalar(_, ty) => {
                        let value = body.next(*ty).ok_or_else(short)?;
                        if is_vertex {
                            table.data.push(value as f32);
                        }
                    }
                    Property::List(count, item) => {
                        let n = body.next(*count).ok_or_else(short)? as usize;
                        let mut fan = [0u32; 2];
                        for k in 0..n {
                            let i = body.next(*item).ok_or_else(short)? as u32;
                            if element.name == "face" {
                                if k >= 2 {
                                    table.faces.push([fan[0], fan[1], i]);
                                }
                                fan[if k == 0 { 0 } else { 1 }] = i;
                            }
                        }
                    }
                }
            }
        }
    }
    let rows = table.rows() as u32;
    if table.faces.iter().flatten().any(|&i| i >= rows) {
        return Err(bad(path, "a face names a vertex that is not there"));
    }
    Ok(table)
}

/// Writes a binary PLY whose vertices have the float properties `names`; `data` is row-major.
///
/// # Errors
/// The file cannot be written.
pub fn write_float_vertices(path: &Path, names: &[String], data: &[f32]) -> Result<(), PlyError> {
    let rows = data.len() / names.len().max(1);
    let mut out = format!("ply\nformat binary_little_endian 1.0\nelement vertex {rows}\n").into_bytes();
    for name in names {
        out.extend(format!("property float {name}\n").bytes());
    }
    out.extend(b"end_header\n");
    for value in data {
        out.extend(value.to_le_bytes());
    }
    write_whole(path, &out).map_err(io_error(path))
}
