//! A mesh as binary little-endian PLY.

use crate::{Place, WriteError};
use glam::DVec3;
use planish::mesh::{Attribute, TriMesh};
use std::io::{self, Write};

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
    let mut rows = Rows::new(mesh.attributes.iter().map(|a| (&a.name[..], a.width)));
    rows.see(&mesh.points, &mesh.attributes)?;
    rows.begin(out, mesh.points.len(), generator)?;
    if !mesh.triangles.is_empty() {
        writeln!(out, "element face {}\nproperty list uchar int vertex_indices", mesh.triangles.len())?;
    }
    if !edges.is_empty() {
        writeln!(out, "element edge {}\nproperty int vertex1\nproperty int vertex2", edges.len())?;
    }
    writeln!(out, "end_header")?;
    rows.write(out, &mesh.points, &mesh.attributes)?;
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

/// How vertices are written: all the same, so all are seen before the first is.
pub(crate) struct Rows {
    /// Whether `float` holds all coordinates.
    exact: bool,
    columns: Vec<Column>,
}

impl Rows {
    /// Vertices with attributes of these names and widths.
    pub fn new<'a>(attributes: impl Iterator<Item = (&'a str, usize)>) -> Rows {
        Rows { exact: true, columns: attributes.map(|(name, width)| Column::new(name, width)).collect() }
    }

    /// The same with all numbers as they are: nothing has to be seen.
    pub fn wide<'a>(attributes: impl Iterator<Item = (&'a str, usize)>) -> Rows {
        let mut rows = Rows { exact: false, ..Rows::new(attributes) };
        rows.columns.iter_mut().for_each(|c| c.bytes = false);
        rows
    }

    /// Looks at vertices that are to be written.
    /// # Errors
    /// [`WriteError::Inconsistent`] for an attribute with other than its numbers for each.
    pub fn see(&mut self, points: &[DVec3], attributes: &[Attribute]) -> Result<(), WriteError> {
        self.exact &= points.iter().all(|p| p.to_array().iter().all(|&x| x as f32 as f64 == x));
        for (k, (column, attribute)) in self.columns.iter_mut().zip(attributes).enumerate() {
            if attribute.values.len() != attribute.width * points.len() {
                return Err(WriteError::Inconsistent {
                    what: format!(
                        "attribute \"{}\" does not have {} numbers per vertex",
                        attribute.name, attribute.width
                    ),
                    place: Place::Item("attribute", k),
                });
            }
            column.see(&attribute.values);
        }
        Ok(())
    }

    /// Writes the header up to the vertices.
    pub fn begin<W: Write>(&self, out: &mut W, count: usize, generator: &str) -> io::Result<()> {
        let coordinate = if self.exact { "float" } else { "double" };
        writeln!(out, "ply\nformat binary_little_endian 1.0\ncomment {generator}\nelement vertex {count}")?;
        for axis in ["x", "y", "z"] {
            writeln!(out, "property {coordinate} {axis}")?;
        }
        for column in &self.columns {
            for name in &column.names {
                writeln!(out, "property {} {name}", if column.bytes { "uchar" } else { "float" })?;
            }
        }
        Ok(())
    }

    /// Writes vertices.
    pub fn write<W: Write>(&self, out: &mut W, points: &[DVec3], attributes: &[Attribute]) -> io::Result<()> {
        for (v, p) in points.iter().enumerate() {
            for x in p.to_array() {
                if self.exact {
                    out.write_all(&(x as f32).to_le_bytes())?;
                } else {
                    out.write_all(&x.to_le_bytes())?;
                }
            }
            for (attribute, column) in attributes.iter().zip(&self.columns) {
                for &x in &attribute.values[v * attribute.width..(v + 1) * attribute.width] {
                    if column.bytes {
                        out.write_all(&[(x * column.scale).round() as u8])?;
                    } else {
                        out.write_all(&x.to_le_bytes())?;
                    }
                }
            }
        }
        Ok(())
    }
}

/// How one attribute is written.
struct Column {
    names: Vec<String>,
    bytes: bool,
    /// What a byte is of a whole.
    scale: f32,
}

impl Column {
    fn new(name: &str, width: usize) -> Column {
        // A name is one word of the header; blanks in it would end it early.
        let name: String = name.chars().map(|c| if c.is_whitespace() || c.is_control() { '_' } else { c }).collect();
        let members: &[&str] = match (name.as_str(), width) {
            ("normal", 3) => &["nx", "ny", "nz"],
            ("color", 3) => &["red", "green", "blue"],
            ("color", 4) => &["red", "green", "blue", "alpha"],
            _ => &[],
        };
        let whole = name == planish::mesh::FEATURE && width == 1;
        let bytes = whole || (name == "color" && !members.is_empty());
        let names = match (members.is_empty(), width) {
            (false, _) => members.iter().map(|m| m.to_string()).collect(),
            (_, 1) => vec![name],
            (_, width) => (0..width).map(|k| format!("{name}_{k}")).collect(),
        };
        Column { names, bytes, scale: if whole { 1.0 } else { 255.0 } }
    }

    /// Bytes hold steps of what a byte is, up to 255 of them.
    fn see(&mut self, values: &[f32]) {
        let scale = self.scale;
        let holds = |&x: &f32| (x * scale).round() / scale == x && (0.0..=255.0 / scale).contains(&x);
        self.bytes = self.bytes && values.iter().all(holds);
    }
}
