//! A mesh as binary little-endian PLY.

use crate::{Place, WriteError};
use planish::mesh::{Attribute, TriMesh};
use std::io::Write;

/// Writes a mesh with all its attributes.
///
/// Coordinates are `float` where that holds every one of them exactly, `double` for all of them otherwise, so
/// that reading gives the same mesh. `"normal"` is written as `nx ny nz`, `"color"` as `uchar` red, green, blue
/// (and alpha) where steps of 1/255 hold it exactly and as `float` otherwise, other attributes as `float`s
/// named `name` (width 1) or `name_0 .. name_k`.
/// * `edges` - feature edges, written as an element `edge` if there are any; the attribute `"feature"` is `uchar`
pub(crate) fn write<W: Write>(
    out: &mut W,
    mesh: &TriMesh,
    edges: &[[u32; 2]],
    generator: &str,
) -> Result<(), WriteError> {
    let exact = mesh.points.iter().all(|p| p.to_array().iter().all(|&x| x as f32 as f64 == x));
    let coordinate = if exact { "float" } else { "double" };
    writeln!(out, "ply\nformat binary_little_endian 1.0\ncomment {generator}\nelement vertex {}", mesh.points.len())?;
    for axis in ["x", "y", "z"] {
        writeln!(out, "property {coordinate} {axis}")?;
    }
    let mut columns = Vec::new();
    for (k, attribute) in mesh.attributes.iter().enumerate() {
        if attribute.values.len() != attribute.width * mesh.points.len() {
            return Err(WriteError::Inconsistent {
                what: format!("attribute \"{}\" does not have {} numbers per vertex", attribute.name, attribute.width),
                place: Place::Item("attribute", k),
            });
        }
        let column = Column::of(attribute);
        for name in &column.names {
            writeln!(out, "property {} {name}", if column.bytes { "uchar" } else { "float" })?;
        }
        columns.push(column);
    }
    if !mesh.triangles.is_empty() {
        writeln!(out, "element face {}\nproperty list uchar int vertex_indices", mesh.triangles.len())?;
    }
    if !edges.is_empty() {
        writeln!(out, "element edge {}\nproperty int vertex1\nproperty int vertex2", edges.len())?;
    }
    writeln!(out, "end_header")?;
    for (v, p) in mesh.points.iter().enumerate() {
        for x in p.to_array() {
            if exact {
                out.write_all(&(x as f32).to_le_bytes())?;
            } else {
                out.write_all(&x.to_le_bytes())?;
            }
        }
        for (attribute, column) in mesh.attributes.iter().zip(&columns) {
            for &x in &attribute.values[v * attribute.width..(v + 1) * attribute.width] {
                if column.bytes {
                    out.write_all(&[(x * column.scale).round() as u8])?;
                } else {
                    out.write_all(&x.to_le_bytes())?;
                }
            }
        }
    }
    let mut record = [3u8; 13];
    for triangle in &mesh.triangles {
        for (k, v) in triangle.iter().enumerate() {
            record[1 + 4 * k..5 + 4 * k].copy_from_slice(&v.to_le_bytes());
        }
        out.write_all(&record)?;
    }
    for v in edges.iter().flatten() {
        out.write_all(&v.to_le_bytes())?;
    }
    Ok(())
}

/// Writes points with attributes and no faces.
pub(crate) fn write_points<W: Write>(
    out: &mut W,
    points: &[glam::DVec3],
    attributes: &[Attribute],
    generator: &str,
) -> Result<(), WriteError> {
    let mesh = TriMesh { points: points.to_vec(), triangles: Vec::new(), attributes: attributes.to_vec() };
    write(out, &mesh, &[], generator)
}

/// How one attribute is written.
struct Column {
    names: Vec<String>,
    bytes: bool,
    /// What a byte is of a whole.
    scale: f32,
}

impl Column {
    fn of(attribute: &Attribute) -> Column {
        // A name is one word of the header; blanks in it would end it early.
        let name: String =
            attribute.name.chars().map(|c| if c.is_whitespace() || c.is_control() { '_' } else { c }).collect();
        let members: &[&str] = match (name.as_str(), attribute.width) {
            ("normal", 3) => &["nx", "ny", "nz"],
            ("color", 3) => &["red", "green", "blue"],
            ("color", 4) => &["red", "green", "blue", "alpha"],
            _ => &[],
        };
        let names = match (members.is_empty(), attribute.width) {
            (false, _) => members.iter().map(|m| m.to_string()).collect(),
            (_, 1) => vec![name],
            (_, width) => (0..width).map(|k| format!("{name}_{k}")).collect(),
        };
        let steps = |&x: &f32| ((x * 255.0).round() / 255.0) == x && (0.0..=1.0).contains(&x);
        let bytes = members.len() >= 3 && attribute.name == "color" && attribute.values.iter().all(steps);
        let whole = attribute.name == planish::mesh::FEATURE
            && attribute.width == 1
            && attribute.values.iter().all(|&x| x == x.round() && (0.0..=255.0).contains(&x));
        Column { names, bytes: bytes || whole, scale: if whole { 1.0 } else { 255.0 } }
    }
}
