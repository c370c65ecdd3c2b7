//! OBJ: Wavefront's text format.
//!
//! Own reader instead of a crate's: messages with line numbers, concave polygons cut rightly, and vertices that
//! stay one where normals or texture coordinates differ.

use crate::mapped::patch_name;
use crate::polygon::{Polygons, checked};
use crate::text::{Lines, Words, real, shown, whole};
use crate::{MappedMesh, Place, ReadError, WriteError};
use glam::DVec3;
use planish::mesh::{Attribute, TriMesh};
use std::io::Write;

/// Reads a mesh: all `f` of all groups and objects as one. `v` may carry a colour (0..1, or 0..255 if any
/// number is above 1), which is kept as `"color"` if every vertex has one. `vn` and `vt` are kept as
/// `"normal"` and `"uv"` if each vertex has one value in all its faces. Faces may stand before the vertices
/// that they name by positive numbers.
pub(crate) fn read(bytes: &[u8]) -> Result<TriMesh, ReadError> {
    let mut file = Parsed::default();
    let mut lines = Lines::new(bytes, 0, 1);
    let mut joined = Vec::new();
    while let Some(mut line) = lines.next_line() {
        let number = lines.number();
        // A backslash at the end carries the statement on to the next line.
        if line.ends_with(b"\\") && !line.trim_ascii_start().starts_with(b"#") {
            joined.clear();
            while let Some(start) = line.strip_suffix(b"\\") {
                joined.extend_from_slice(start);
                joined.push(b' ');
                line = lines.next_line().unwrap_or_default();
            }
            joined.extend_from_slice(line);
            line = &joined;
        }
        file.statement(line, number)?;
    }
    file.finish()
}

/// No normal or texture coordinate.
const NONE: u32 = u32::MAX;

#[derive(Default)]
struct Parsed {
    points: Vec<DVec3>,
    colors: Vec<[f32; 4]>,
    color_width: usize,
    normals: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
    polygons: Polygons,
    /// Line of each face.
    face_lines: Vec<u32>,
    /// For each corner of the faces its texture coordinate and its normal; empty while no face names any.
    extras: Vec<[u32; 2]>,
}

impl Parsed {
    fn statement(&mut self, line: &[u8], number: usize) -> Result<(), ReadError> {
        let place = || Place::Line(number);
        let mut words = Words::new(line);
        let Some(keyword) = words.next() else { return Ok(()) };
        match keyword {
            b"v" => {
                let mut x = [0.0; 8];
                let n = numbers(words, &mut x, 3, place)?;
                if self.points.len() >= NONE as usize - 1 {
                    let (count, limit) = (NONE as u64, NONE as u64 - 1);
                    return Err(ReadError::TooLarge { what: "vertices", count, limit, place: place() });
                }
                // 6 numbers: x y z r g b; 7: a fourth for the colour; 4: a weight, of no use to a mesh.
                let width = if n >= 6 { (n - 3).min(4) } else { 0 };
                if self.points.is_empty() {
                    self.color_width = width;
                }
                self.color_width = self.color_width.min(width);
                if self.color_width > 0 {
                    self.colors.push([3, 4, 5, 6].map(|k| x[k] as f32));
                }
                self.points.push(DVec3::new(x[0], x[1], x[2]));
            }
            b"vn" => {
                let mut x = [0.0; 3];
                numbers(words, &mut x, 3, place)?;
                self.normals.push(x.map(|x| x as f32));
            }
            b"vt" => {
                let mut x = [0.0; 3];
                numbers(words, &mut x, 1, place)?;
                self.uvs.push([x[0] as f32, x[1] as f32]);
            }
            b"f" | b"fo" => self.face(words, number)?,
            _ if keyword.starts_with(b"#") || keyword.iter().all(|c| c.is_ascii_alphanumeric() || *c == b'_') => {}
            _ => {
                let what = format!("\"{}\" is no word of an OBJ file", shown(keyword));
                return Err(ReadError::Syntax { what, place: place() });
            }
        }
        Ok(())
    }

    fn face(&mut self, words: Words, number: usize) -> Result<(), ReadError> {
        let place = || Place::Line(number);
        let start = self.polygons.corners.len();
        for word in words.take_while(|w| !w.starts_with(b"#")) {
            let mut parts = word.split(|&b| b == b'/');
            let v = resolve(parts.next().unwrap_or_default(), self.points.len(), place)?;
            let mut extra = [NONE; 2];
            for (k, count) in [self.uvs.len(), self.normals.len()].into_iter().enumerate() {
                if let Some(part) = parts.next().filter(|part| !part.is_empty()) {
                    extra[k] = resolve(part, count, place)?;
                }
            }
            if extra != [NONE; 2] && self.extras.is_empty() {
                self.extras.resize(self.polygons.corners.len(), [NONE; 2]);
            }
            self.polygons.corners.push(v);
            if extra != [NONE; 2] || !self.extras.is_empty() {
                self.extras.push(extra);
            }
        }
        let corners = self.polygons.corners.len() - start;
        if corners < 3 {
            return Err(ReadError::SmallFace { corners, place: place() });
        }
        self.polygons.close();
        self.face_lines.push(number.min(u32::MAX as usize) as u32);
        Ok(())
    }

    fn finish(self) -> Result<TriMesh, ReadError> {
        let place = |f: usize| Place::Line(self.face_lines[f] as usize);
        let triangles = self.polygons.triangulate(&self.points, place)?;
        let mut attributes = Vec::new();
        attributes.extend(self.per_vertex("normal", 1, &self.normals));
        if self.color_width >= 3 && self.colors.len() == self.points.len() {
            let width = self.color_width;
            let mut values: Vec<f32> = self.colors.iter().flat_map(|c| c[..width].to_vec()).collect();
            if values.iter().any(|&x| x > 1.0) {
                values.iter_mut().for_each(|x| *x /= 255.0);
            }
            attributes.push(Attribute { name: "color".into(), width, values });
        }
        attributes.extend(self.per_vertex("uv", 0, &self.uvs));
        let faces = self.polygons.count();
        checked(TriMesh { points: self.points, triangles, attributes }, faces)
    }

    /// Values that corners name, if all corners of a vertex name the same value.
    fn per_vertex<const N: usize>(&self, name: &str, which: usize, values: &[[f32; N]]) -> Option<Attribute> {
        if values.is_empty() || self.extras.len() != self.polygons.corners.len() {
            return None;
        }
        let mut found: Vec<Option<[f32; N]>> = vec![None; self.points.len()];
        for (&v, extra) in self.polygons.corners.iter().zip(&self.extras) {
            let value = *values.get(extra[which] as usize)?;
            let slot = found.get_mut(v as usize)?;
            if slot.is_some_and(|old| old != value) {
                return None;
            }
            *slot = Some(value);
        }
        let values = found.into_iter().flat_map(|value| value.unwrap_or([0.0; N])).collect();
        Some(Attribute { name: name.into(), width: N, values })
    }
}

/// Reads numbers into `x` as far as there are any; returns how many, at least `least`.
fn numbers(words: Words, x: &mut [f64], least: usize, place: impl Fn() -> Place) -> Result<usize, ReadError> {
    let mut n = 0;
    for word in words.take_while(|w| !w.starts_with(b"#")).take(x.len()) {
        x[n] = real(word, &place)?;
        n += 1;
    }
    if n < least {
        return Err(ReadError::Syntax { what: format!("{n} numbers stand where {least} are needed"), place: place() });
    }
    Ok(n)
}

/// An index from 1, or from -1 backwards, as an index from 0. Those too large are found out at the end.
fn resolve(word: &[u8], count: usize, place: impl Fn() -> Place) -> Result<u32, ReadError> {
    let index = whole(word, &place)?;
    let from_zero = if index < 0 { index.saturating_add(count as i64) } else { index - 1 };
    match u32::try_from(from_zero) {
        Ok(v) if v != NONE => Ok(v),
        _ => Err(ReadError::Index { index, vertices: count, place: place() }),
    }
}

/// Writes positions, `"color"` (behind the coordinates), `"normal"` and `"uv"`; the format has no place for
/// other attributes. Numbers in the shortest form that reads back the same.
pub(crate) fn write<W: Write>(out: &mut W, mesh: &TriMesh, generator: &str) -> Result<(), WriteError> {
    let find = |name: &str, widths: &[usize]| {
        mesh.attributes
            .iter()
            .find(|a| a.name == name && widths.contains(&a.width) && a.values.len() == a.width * mesh.points.len())
    };
    let (color, normal, uv) = (find("color", &[3, 4]), find("normal", &[3]), find("uv", &[2]));
    writeln!(out, "# {generator}")?;
    for (v, p) in mesh.points.iter().enumerate() {
        write!(out, "v {} {} {}", p.x, p.y, p.z)?;
        if let Some(color) = color {
            color.values[v * color.width..(v + 1) * color.width].iter().try_for_each(|x| write!(out, " {x}"))?;
        }
        writeln!(out)?;
    }
    for (keyword, attribute) in [("vt", uv), ("vn", normal)] {
        for value in attribute.iter().flat_map(|a| a.values.chunks_exact(a.width)) {
            write!(out, "{keyword}")?;
            value.iter().try_for_each(|x| write!(out, " {x}"))?;
            writeln!(out)?;
        }
    }
    for triangle in &mesh.triangles {
        write!(out, "f")?;
        for v in triangle.map(|v| v as u64 + 1) {
            match (uv.is_some(), normal.is_some()) {
                (false, false) => write!(out, " {v}")?,
                (true, false) => write!(out, " {v}/{v}")?,
                (false, true) => write!(out, " {v}//{v}")?,
                (true, true) => write!(out, " {v}/{v}/{v}")?,
            }
        }
        writeln!(out)?;
    }
    Ok(())
}

/// Writes a mesh of patches: shared vertices, and for each patch a group with texture coordinates and normals of its own.
pub(crate) fn write_patches<W: Write>(out: &mut W, mesh: &MappedMesh, generator: &str) -> Result<(), WriteError> {
    writeln!(out, "# {generator}")?;
    for p in &mesh.patched.mesh.points {
        writeln!(out, "v {} {} {}", p.x, p.y, p.z)?;
    }
    for [u, v] in mesh.uvs.iter().flatten() {
        writeln!(out, "vt {u} {v}")?;
    }
    for n in mesh.normals.iter().flatten().map(|n| n.as_vec3()) {
        writeln!(out, "vn {} {} {}", n.x, n.y, n.z)?;
    }
    let mut first = 1;
    for (p, nodes) in mesh.patched.patches.iter().enumerate() {
        writeln!(out, "g {}", patch_name(p))?;
        for triangle in &nodes.triangles {
            write!(out, "f")?;
            for n in triangle.map(|n| n as usize) {
                let own = first + n;
                write!(out, " {}/{own}/{own}", nodes.vertices[n] as u64 + 1)?;
            }
            writeln!(out)?;
        }
        first += nodes.vertices.len();
    }
    Ok(())
}
