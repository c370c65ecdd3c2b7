//! A mesh as one `.glb`: one node, one mesh, one binary chunk.

use crate::mapped::patch_name;
use crate::mesh_file::{Up, WriteOptions};
use crate::{MappedMesh, Place, WriteError};
use glam::Vec3;
use planish::mesh::TriMesh;
use serde_json::{Value, json};
use std::io::Write;

const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// Writes positions, normals (`"normal"`, or the mesh's own vertex normals), `"color"` and `"uv"`.
///
/// The numbers of the positions are those of the mesh, rounded to `f32`; the node's scale takes them to metres
/// and, if Z is up in the mesh, its rotation to the Y that glTF has up.
pub(crate) fn write<W: Write>(out: &mut W, mesh: &TriMesh, options: &WriteOptions) -> Result<(), WriteError> {
    let mut file = Chunk::default();
    let points: Vec<f32> = mesh.points.iter().flat_map(|p| p.as_vec3().to_array()).collect();
    let mut attributes = json!({ "POSITION": file.positions(&points)? });
    attributes["NORMAL"] = json!(file.floats(&normals(mesh), 3)?);
    for (name, semantic, widths) in [("color", "COLOR_0", 3..=4), ("uv", "TEXCOORD_0", 2..=2)] {
        let fits = |a: &&planish::mesh::Attribute| {
            a.name == name && widths.contains(&a.width) && a.values.len() == a.width * mesh.points.len()
        };
        if let Some(attribute) = mesh.attributes.iter().find(fits) {
            let values: Vec<f32> = attribute.values.iter().map(|&x| if x.is_finite() { x } else { 0.0 }).collect();
            attributes[semantic] = json!(file.floats(&values, attribute.width)?);
        }
    }
    let indices = file.indices(&mesh.triangles)?;
    let primitive = json!({ "attributes": attributes, "indices": indices, "mode": 4 });
    file.finish(out, json!([primitive]), Value::Null, options)
}

/// Writes a mesh of patches: a primitive with vertices of its own and a material for each, named after its displacement map.
///
/// Texture coordinates count from the upper left corner of an image in this format.
pub(crate) fn write_patches<W: Write>(
    out: &mut W,
    mesh: &MappedMesh,
    options: &WriteOptions,
) -> Result<(), WriteError> {
    let mut file = Chunk::default();
    let (mut primitives, mut materials) = (Vec::new(), Vec::new());
    for (p, nodes) in mesh.patched.patches.iter().enumerate() {
        let point = |&v: &u32| mesh.patched.mesh.points[v as usize].as_vec3().to_array();
        let points: Vec<f32> = nodes.vertices.iter().flat_map(point).collect();
        let normals: Vec<f32> = mesh.normals[p].iter().flat_map(|n| n.as_vec3().to_array()).collect();
        let uvs: Vec<f32> = mesh.uvs[p].iter().flat_map(|&[u, v]| [u, 1.0 - v]).collect();
        let attributes = json!({
            "POSITION": file.positions(&points)?, "NORMAL": file.floats(&normals, 3)?, "TEXCOORD_0": file.floats(&uvs, 2)?
        });
        let indices = file.indices(&nodes.triangles)?;
        primitives.push(json!({ "attributes": attributes, "indices": indices, "mode": 4, "material": p }));
        // Without these factors a material is dark metal.
        let look = json!({ "metallicFactor": 0.0, "roughnessFactor": 0.6 });
        materials.push(json!({ "name": patch_name(p), "pbrMetallicRoughness": look }));
    }
    file.finish(out, Value::from(primitives), Value::from(materials), options)
}

/// Unit normals; where there is none (no triangle around the vertex) some unit vector, as the format wants.
fn normals(mesh: &TriMesh) -> Vec<f32> {
    let fits =
        |a: &&planish::mesh::Attribute| a.name == "normal" && a.width == 3 && a.values.len() == 3 * mesh.points.len();
    let given: Vec<Vec3> = match mesh.attributes.iter().find(fits) {
        Some(attribute) => attribute.values.chunks_exact(3).map(Vec3::from_slice).collect(),
        None => mesh.vertex_normals().iter().map(|n| n.as_vec3()).collect(),
    };
    given.into_iter().flat_map(|n| n.try_normalize().unwrap_or(Vec3::Z).to_array()).collect()
}

/// Sizes of a GLB are 32-bit numbers.
fn size(n: usize) -> Result<u32, WriteError> {
    u32::try_from(n).map_err(|_| WriteError::Value {
        value: format!("a GLB of {n} bytes"),
        place: Place::Byte(8),
        hint: "it holds at most 4 GiB; write PLY",
    })
}

/// The binary chunk with its views and accessors.
#[derive(Default)]
struct Chunk {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Chunk {
    /// Positions; the format wants their box.
    fn positions(&mut self, points: &[f32]) -> Result<usize, WriteError> {
        let bound = |pick: fn(f32, f32) -> f32| -> Vec<f32> {
            (0..3).map(|k| points.chunks_exact(3).map(|p| p[k]).reduce(pick).unwrap_or(0.0)).collect()
        };
        let (low, high) = (bound(f32::min), bound(f32::max));
        let position = self.floats(points, 3)?;
        self.accessors[position]["min"] = json!(low);
        self.accessors[position]["max"] = json!(high);
        Ok(position)
    }

    fn indices(&mut self, triangles: &[[u32; 3]]) -> Result<usize, WriteError> {
        let corners: Vec<u8> = triangles.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        self.add(&corners, 3 * triangles.len(), UNSIGNED_INT, "SCALAR", ELEMENT_ARRAY_BUFFER)
    }

    /// Writes the file of one mesh.
    fn finish<W: Write>(
        self,
        out: &mut W,
        primitives: Value,
        materials: Value,
        options: &WriteOptions,
    ) -> Result<(), WriteError> {
        let scale = options.units.metres();
        let mut node = json!({ "mesh": 0, "name": options.name });
        if scale != 1.0 {
            node["scale"] = json!([scale, scale, scale]);
        }
        if options.up == Up::Z {
            // A quarter turn about X from Z to Y.
            let half = std::f64::consts::FRAC_1_SQRT_2;
            node["rotation"] = json!([-half, 0.0, 0.0, half]);
        }
        let mut document = json!({
            "asset": { "version": "2.0", "generator": options.generator() },
            "scene": 0,
            "scenes": [{ "nodes": [0] }],
            "nodes": [node],
            "meshes": [{ "name": options.name, "primitives": primitives }],
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{ "byteLength": self.bytes.len() }],
        });
        if !materials.is_null() {
            document["materials"] = materials;
        }
        let mut text = document.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let length = 12 + 8 + text.len() + 8 + self.bytes.len();
        out.write_all(b"glTF")?;
        for word in [2, size(length)?, size(text.len())?, 0x4E4F_534A] {
            out.write_all(&word.to_le_bytes())?;
        }
        out.write_all(&text)?;
        for word in [size(self.bytes.len())?, 0x004E_4942] {
            out.write_all(&word.to_le_bytes())?;
        }
        out.write_all(&self.bytes)?;
        Ok(())
    }

    fn floats(&mut self, values: &[f32], width: usize) -> Result<usize, WriteError> {
        let bytes: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
        let shape = ["SCALAR", "VEC2", "VEC3", "VEC4"][width - 1];
        self.add(&bytes, values.len() / width, FLOAT, shape, ARRAY_BUFFER)
    }

    /// Adds an array of 4-byte numbers; returns its accessor.
    fn add(&mut self, bytes: &[u8], count: usize, kind: u32, shape: &str, target: u32) -> Result<usize, WriteError> {
        size(self.bytes.len() + bytes.len())?;
        let view = json!({
            "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len(), "target": target
        });
        self.accessors.push(json!({
            "bufferView": self.views.len(), "componentType": kind, "count": count, "type": shape
        }));
        self.views.push(view);
        self.bytes.extend_from_slice(bytes);
        Ok(self.accessors.len() - 1)
    }
}
