//! Shared by the stage tests: real meshes when they are there, and groups of made ones.
#![allow(dead_code, clippy::print_stdout)]

use planish::DVec3;
use planish::mesh::TriMesh;
use planish::synthetic::{self, shapes};
use std::path::PathBuf;

/// A mesh of the developers' data set (`PLANISH_DATA`, or `../shared/data` beside the repository); `None`, with
/// a line that says so, where it is absent.
pub fn data_mesh(name: &str) -> Option<TriMesh> {
    let beside = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let folder = std::env::var_os("PLANISH_DATA").map_or(beside, PathBuf::from);
    match std::fs::read(folder.join(name)) {
        Ok(bytes) => Some(read_ply(&bytes)),
        Err(_) => {
            println!("skipped: {name} is not there (set PLANISH_DATA)");
            None
        }
    }
}

/// Reads a binary little-endian PLY whose vertices are only x, y, z and whose faces are only triangles.
fn read_ply(bytes: &[u8]) -> TriMesh {
    let end = bytes.windows(11).position(|w| w == b"end_header\n").expect("a PLY header") + 11;
    let header = std::str::from_utf8(&bytes[..end]).expect("a text header");
    let count = |what: &str| -> usize {
        let line = header.lines().find(|l| l.starts_with(&format!("element {what} "))).expect("a count");
        line.rsplit(' ').next().and_then(|n| n.parse().ok()).expect("a number")
    };
    let double = header.contains("property double x") || header.contains("property float64 x");
    let (vertices, faces) = (count("vertex"), count("face"));
    let width = if double { 8 } else { 4 };
    let number = |at: usize| match double {
        true => f64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()),
        false => f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as f64,
    };
    let index = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    let points = (0..vertices).map(|v| {
        let at = end + v * 3 * width;
        DVec3::new(number(at), number(at + width), number(at + 2 * width))
    });
    let start = end + vertices * 3 * width;
    let triangles = (0..faces).map(|f| {
        let at = start + f * 13;
        assert_eq!(bytes[at], 3, "only triangles");
        [index(at + 1), index(at + 5), index(at + 9)]
    });
    TriMesh::new(points.collect(), triangles.collect())
}

/// Closed meshes, with their genus.
pub fn closed_meshes() -> Vec<(&'static str, TriMesh, i64)> {
    vec![
        ("sphere", shapes::sphere(1.0, 3), 0),
        ("torus", shapes::torus(2.0, 0.7, 48, 24), 1),
        ("cylinder", shapes::cylinder(1.0, 3.0, 48), 0),
        ("cuboid", shapes::cuboid(DVec3::new(1.0, 2.0, 3.0), 6), 0),
        ("double torus", shapes::double_torus(5), 2),
        ("demo", synthetic::demo(1, 8_000), 1),
    ]
}

/// Open meshes, with their boundary loops.
pub fn open_meshes() -> Vec<(&'static str, TriMesh, usize)> {
    vec![
        ("saddle", shapes::saddle(0.5, 12), 1),
        ("rectangle", shapes::rectangle(2.0, 1.0, 12, 6), 1),
        ("annulus", shapes::annulus(1.0, 2.0, 48), 2),
        ("snout", shapes::snout(2.5, 1500), 1),
    ]
}
