//! Meshes, networks and folders that the tests of this crate share.
#![allow(dead_code, missing_docs)]

use planish::DVec3;
use planish::mesh::{Attribute, TriMesh};
use std::path::PathBuf;

/// A folder that goes away with the test.
pub fn folder() -> tempfile::TempDir {
    tempfile::tempdir().unwrap()
}

/// A file of that name and content in `folder`.
pub fn file(folder: &tempfile::TempDir, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
    let path = folder.path().join(name);
    std::fs::write(&path, content).unwrap();
    path
}

/// The unit cube, 8 vertices and 12 triangles, outward.
pub fn cube() -> TriMesh {
    let points = (0..8).map(|k| DVec3::new((k & 1) as f64, (k >> 1 & 1) as f64, (k >> 2) as f64)).collect();
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    TriMesh::new(points, triangles)
}

/// The cube with normals, colours in steps of 1/255 and one scalar.
pub fn coloured_cube() -> TriMesh {
    let mut mesh = cube();
    let normals = mesh.vertex_normals();
    let attribute = |name: &str, width: usize, values: Vec<f32>| Attribute { name: name.into(), width, values };
    mesh.attributes = vec![
        attribute("normal", 3, normals.iter().flat_map(|n| n.as_vec3().to_array()).collect()),
        attribute("color", 3, (0..24).map(|k| (k * 11) as f32 / 255.0).collect()),
        attribute("confidence", 1, (0..8).map(|k| k as f32 / 7.0).collect()),
    ];
    mesh
}

/// Six times the signed volume of a closed mesh.
pub fn volume6(mesh: &TriMesh) -> f64 {
    (0..mesh.triangles.len()).map(|t| mesh.corners(t)).map(|[a, b, c]| a.dot(b.cross(c))).sum()
}

/// Folder of the real meshes, if it is there.
pub fn data() -> Option<PathBuf> {
    let path = match std::env::var_os("PLANISH_DATA") {
        Some(path) => PathBuf::from(path),
        None => PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
    };
    path.is_dir().then_some(path)
}
