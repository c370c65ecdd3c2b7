//! Triangles of all nodes of a glTF scene.

use super::document::{Data, Document, Node, Primitive, buffers, parse, syntax};
use crate::polygon::{Polygons, checked};
use crate::weld::weld;
use crate::{Place, ReadError};
use glam::{DMat3, DMat4, DQuat, DVec3};
use planish::mesh::{Attribute, TriMesh};
use std::path::Path;

/// Most vertices and most corners of a scene. A small file can show one mesh any number of times, so the size
/// of the file does not bound the scene.
const LARGEST: u64 = 1 << 27;

/// Reads the default scene (all root nodes if there is none) as one mesh.
///
/// Vertices of one glTF mesh at exactly the same place become one, because the format has to split vertices
/// wherever a normal or a texture coordinate jumps. `COLOR_0` is kept as `"color"` and `NORMAL` as `"normal"`
/// if all parts have them; a welded vertex has the colour of its first copy and the mean normal.
/// * `folder` - where the files that it refers to are
pub(crate) fn read(bytes: &[u8], folder: &Path) -> Result<TriMesh, ReadError> {
    let (document, binary) = parse(bytes)?;
    let buffers = buffers(&document, binary, folder)?;
    let source = Source { document: &document, buffers: &buffers };
    let mut scene = Parts::default();
    for (node, world_from_node) in placed(&document)? {
        let Some(m) = document.nodes[node].mesh else { continue };
        let Some(mesh) = document.meshes.get(m) else {
            return Err(syntax(format!("there is no mesh {m}"), Place::Item("node", node)));
        };
        let mut parts = Parts::default();
        for primitive in &mesh.primitives {
            source.primitive(primitive, m, &mut parts, scene.points.len() as u64)?;
        }
        scene.append(parts.welded(), world_from_node);
    }
    scene.finish()
}

/// The nodes of the scene with their transforms, parents first.
fn placed(document: &Document) -> Result<Vec<(usize, DMat4)>, ReadError> {
    let mut roots = match document.scenes.get(document.scene.unwrap_or(0)) {
        Some(scene) => scene.nodes.clone(),
        None => {
            let mut is_child = vec![false; document.nodes.len()];
            for &child in document.nodes.iter().flat_map(|n| &n.children) {
                if let Some(slot) = is_child.get_mut(child) {
                    *slot = true;
                }
            }
            (0..document.nodes.len()).filter(|&n| !is_child[n]).collect()
        }
    };
    roots.reverse();
    let mut open: Vec<(usize, DMat4)> = roots.into_iter().map(|n| (n, DMat4::IDENTITY)).collect();
    let mut seen = vec![false; document.nodes.len()];
    let mut found = Vec::new();
    while let Some((n, world_from_parent)) = open.pop() {
        let Some(node) = document.nodes.get(n) else {
            return Err(syntax(format!("there is no node {n}"), Place::Item("node", n)));
        };
        if std::mem::replace(&mut seen[n], true) {
            return Err(syntax("the node has two parents".into(), Place::Item("node", n)));
        }
        let world_from_node = world_from_parent * transform(node);
        found.push((n, world_from_node));
        open.extend(node.children.iter().rev().map(|&child| (child, world_from_node)));
    }
    Ok(found)
}

fn transform(node: &Node) -> DMat4 {
    if let Some(matrix) = &node.matrix {
        return DMat4::from_cols_array(matrix);
    }
    let rotation = node.rotation.map_or(DQuat::IDENTITY, DQuat::from_array);
    // A rotation of length zero would turn everything into NaN.
    let rotation = if rotation.length_squared() > 0.0 { rotation.normalize() } else { DQuat::IDENTITY };
    DMat4::from_scale_rotation_translation(
        node.scale.map_or(DVec3::ONE, DVec3::from_array),
        rotation,
        node.translation.map_or(DVec3::ZERO, DVec3::from_array),
    )
}

/// Triangles gathered so far.
#[derive(Default)]
struct Parts {
    points: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    /// One per point while every part had them.
    normals: Vec<DVec3>,
    colors: Vec<[f32; 4]>,
    alpha: bool,
    /// Faces read, those without area too.
    faces: usize,
}

impl Parts {
    fn welded(self) -> Parts {
        let (merged, source) = weld(&self.points);
        let mut normals = Vec::new();
        if self.normals.len() == self.points.len() {
            normals = vec![DVec3::ZERO; source.len()];
            for (&v, &n) in merged.iter().zip(&self.normals) {
                normals[v as usize] += n;
            }
        }
        let triangle = |t: &[u32; 3]| t.map(|v| merged[v as usize]);
        Parts {
            points: source.iter().map(|&v| self.points[v as usize]).collect(),
            triangles: self.triangles.iter().map(triangle).filter(|[a, b, c]| a != b && b != c && c != a).collect(),
            normals,
            colors: source.iter().filter_map(|&v| self.colors.get(v as usize).copied()).collect(),
            alpha: self.alpha,
            faces: self.faces,
        }
    }

    fn append(&mut self, part: Parts, world_from_part: DMat4) {
        let start = self.points.len() as u32;
        if self.normals.len() == self.points.len() && part.normals.len() == part.points.len() {
            // Normals go with the inverse transposed; the cofactors are that but for a factor, and always exist.
            let m = DMat3::from_mat4(world_from_part);
            let cofactor =
                DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis));
            // A mirror turns the cofactors' normals inwards.
            let sign = m.determinant().signum();
            self.normals.extend(part.normals.iter().map(|&n| (sign * (cofactor * n)).normalize_or_zero()));
        }
        if self.colors.len() == self.points.len() {
            self.colors.extend(part.colors);
        }
        self.alpha |= part.alpha;
        self.faces += part.faces;
        self.points.extend(part.points.iter().map(|&p| world_from_part.transform_point3(p)));
        let mirrored = world_from_part.determinant() < 0.0;
        self.triangles.extend(part.triangles.iter().map(|&[a, b, c]| {
            let [a, b, c] = if mirrored { [a, c, b] } else { [a, b, c] };
            [a + start, b + start, c + start]
        }));
    }

    fn finish(self) -> Result<TriMesh, ReadError> {
        let mut attributes = Vec::new();
        if !self.normals.is_empty() && self.normals.len() == self.points.len() {
            let values = self.normals.iter().flat_map(|n| n.as_vec3().to_array()).collect();
            attributes.push(Attribute { name: "normal".into(), width: 3, values });
        }
        if !self.colors.is_empty() && self.colors.len() == self.points.len() {
            let width = if self.alpha { 4 } else { 3 };
            let values = self.colors.iter().flat_map(|c| c[..width].to_vec()).collect();
            attributes.push(Attribute { name: "color".into(), width, values });
        }
        let mesh = TriMesh { points: self.points, triangles: self.triangles, attributes };
        checked(mesh, self.faces)
    }
}

struct Source<'a> {
    document: &'a Document,
    buffers: &'a [Data<'a>],
}

impl Source<'_> {
    /// Adds the triangles of one primitive. * `before` - vertices of the scene so far
    fn primitive(&self, p: &Primitive, mesh: usize, parts: &mut Parts, before: u64) -> Result<(), ReadError> {
        let mode = p.mode.unwrap_or(4);
        let Some(&position) = p.attributes.get("POSITION") else { return Ok(()) };
        if !(4..=6).contains(&mode) {
            return Ok(());
        }
        let place = || Place::Item("mesh", mesh);
        let count = |a: usize| self.document.accessors.get(a).map_or(0, |a| a.count as u64);
        for total in [count(position), p.indices.map_or(0, count)] {
            let count = before + parts.points.len().max(3 * parts.triangles.len()) as u64 + total;
            if total > LARGEST || count > LARGEST {
                return Err(ReadError::TooLarge { what: "vertices", count, limit: LARGEST, place: place() });
            }
        }
        let start = parts.points.len();
        let (points, _) = self.numbers(position, &[3])?;
        let n = points.len() / 3;
        parts.points.extend(points.chunks_exact(3).map(|p| DVec3::new(p[0], p[1], p[2])));
        let attribute = |name: &str, widths: &[usize]| match p.attributes.get(name) {
            Some(&a) => {
                let (values, width) = self.numbers(a, widths)?;
                if values.len() != n * width {
                    return Err(syntax(format!("{name} has not as many values as POSITION"), place()));
                }
                Ok(Some((values, width)))
            }
            None => Ok(None),
        };
        if let Some((values, _)) = attribute("NORMAL", &[3])?
            && parts.normals.len() == start
        {
            parts.normals.extend(values.chunks_exact(3).map(|n| DVec3::new(n[0], n[1], n[2])));
        }
        if let Some((values, width)) = attribute("COLOR_0", &[3, 4])?
            && parts.colors.len() == start
        {
            parts.alpha |= width == 4;
            let alpha = |c: &[f64]| c.get(3).map_or(1.0, |&a| a as f32);
            parts.colors.extend(values.chunks_exact(width).map(|c| [c[0] as f32, c[1] as f32, c[2] as f32, alpha(c)]));
        }
        let indices = match p.indices {
            None => (0..n as u32).collect(),
            Some(a) => {
                let (values, _) = self.numbers(a, &[1])?;
                if let Some(&bad) = values.iter().find(|&&v| v >= n as f64 || v < 0.0 || v.fract() != 0.0) {
                    return Err(ReadError::Index { index: bad as i64, vertices: n, place: Place::Item("accessor", a) });
                }
                values.iter().map(|&v| v as u32).collect::<Vec<_>>()
            }
        };
        let mut polygons = Polygons::with_capacity(indices.len() / 3);
        let mut push = |triangle: [u32; 3]| {
            polygons.corners.extend(triangle);
            polygons.close();
        };
        match mode {
            4 => indices.chunks_exact(3).for_each(|t| push([t[0], t[1], t[2]])),
            5 => indices.windows(3).enumerate().for_each(|(k, t)| {
                push(if k % 2 == 0 { [t[0], t[1], t[2]] } else { [t[1], t[0], t[2]] });
            }),
            _ => indices.windows(2).skip(1).for_each(|t| push([indices[0], t[0], t[1]])),
        }
        parts.faces += polygons.count();
        let triangles = polygons.triangulate(&parts.points[start..], Place::Face)?;
        parts.triangles.extend(triangles.into_iter().map(|t| t.map(|v| v + start as u32)));
        Ok(())
    }

    /// All numbers of an accessor and how many there are to an item, which must be one of `widths`.
    fn numbers(&self, a: usize, widths: &[usize]) -> Result<(Vec<f64>, usize), ReadError> {
        let place = || Place::Item("accessor", a);
        let wrong = |what: String| Err(syntax(what, place()));
        let Some(accessor) = self.document.accessors.get(a) else { return wrong(format!("there is no accessor {a}")) };
        let width = match accessor.shape.as_str() {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 0,
        };
        if !widths.contains(&width) {
            return wrong(format!(
                "the type \"{}\" does not fit its use",
                crate::text::shown(accessor.shape.as_bytes())
            ));
        }
        let size = match accessor.component_type {
            5120 | 5121 => 1,
            5122 | 5123 => 2,
            5125 | 5126 => 4,
            other => return wrong(format!("unknown component type {other}")),
        };
        if accessor.sparse.is_some() || accessor.buffer_view.is_none() {
            return Err(ReadError::Unsupported {
                what: "a sparse accessor".into(),
                place: place(),
                hint: "export it without sparse accessors and without compression",
            });
        }
        let view = accessor.buffer_view.and_then(|v| self.document.buffer_views.get(v));
        let data = view.and_then(|v| self.buffers.get(v.buffer));
        let (Some(view), Some(data)) = (view, data) else { return wrong("its buffer is missing".into()) };
        let stride = view.byte_stride.unwrap_or(width * size);
        if stride < width * size {
            return wrong(format!("the stride {stride} is shorter than an item"));
        }
        let bytes =
            view.byte_offset.checked_add(view.byte_length).and_then(|end| data.bytes().get(view.byte_offset..end));
        let needed = match accessor.count {
            0 => Some(0),
            n => stride.checked_mul(n - 1).and_then(|x| x.checked_add(width * size)),
        };
        let end = needed.and_then(|needed| needed.checked_add(accessor.byte_offset));
        let Some(bytes) = bytes.zip(end).and_then(|(bytes, end)| bytes.get(accessor.byte_offset..end)) else {
            let left = data.bytes().len().saturating_sub(view.byte_offset).min(view.byte_length);
            return Err(ReadError::Truncated {
                what: format!("{} items", accessor.count),
                needed: end.unwrap_or(usize::MAX) as u64,
                left: left as u64,
                place: place(),
            });
        };
        let mut values = Vec::with_capacity(width * accessor.count);
        for k in 0..accessor.count {
            for c in 0..width {
                let b = &bytes[k * stride + c * size..];
                let scaled = |value: f64, most: f64| if accessor.normalized { (value / most).max(-1.0) } else { value };
                values.push(match accessor.component_type {
                    5120 => scaled(b[0] as i8 as f64, 127.0),
                    5121 => scaled(b[0] as f64, 255.0),
                    5122 => scaled(i16::from_le_bytes([b[0], b[1]]) as f64, 32767.0),
                    5123 => scaled(u16::from_le_bytes([b[0], b[1]]) as f64, 65535.0),
                    5125 => u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as f64,
                    _ => f32::from_le_bytes([b[0], b[1], b[2], b[3]]) as f64,
                });
            }
        }
        Ok((values, width))
    }
}
