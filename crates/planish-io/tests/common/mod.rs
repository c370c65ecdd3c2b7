//! Meshes, networks and folders that the tests of this crate share.
#![allow(dead_code, missing_docs)]

pub mod step_text;

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

use planish::mesh::FacePoint;
use planish::network::{Corner, Curve, CurveKind, Network, Patch, Side};
use planish::relief::Relief;
use planish::surface::Surface;

/// Clamped uniform cubic knots for `n` control points.
pub fn knots(n: usize) -> Vec<f64> {
    let spans = (n - 3) as f64;
    (0..n + 4).map(|k| (k.clamp(3, n) - 3) as f64 / spans).collect()
}

/// A surface whose control point `(i, j)` is `at(i, j)`.
pub fn surface(cols: usize, rows: usize, at: impl Fn(usize, usize) -> DVec3) -> Surface {
    let control = (0..rows).flat_map(|j| (0..cols).map(move |i| (i, j))).map(|(i, j)| at(i, j)).collect();
    Surface { rows, cols, control, knots_u: knots(cols), knots_v: knots(rows) }
}

/// A network of patches over corners, each given by its four corners counter-clockwise; a curve for each pair.
pub fn network(corners: usize, patches: &[[u32; 4]]) -> Network {
    let corners = vec![Corner { place: FacePoint::corner(0, 0) }; corners];
    let mut network = Network { corners, ..Default::default() };
    for ring in patches {
        let sides = [0, 1, 2, 3].map(|k| {
            let (a, b) = (ring[k], ring[(k + 1) % 4]);
            let known = network.curves.iter().position(|c| c.corners == [a, b] || c.corners == [b, a]);
            let curve = known.unwrap_or_else(|| {
                network.curves.push(curve(a, b));
                network.curves.len() - 1
            });
            Side { curve: curve as u32, reversed: network.curves[curve].corners != [a, b] }
        });
        network.patches.push(Patch { sides });
    }
    network
}

pub fn curve(a: u32, b: u32) -> Curve {
    let points = vec![FacePoint::corner(0, 0), FacePoint { face: 1, bary: [0.25, 0.25, 0.5] }];
    Curve { corners: [a, b], kind: CurveKind::Smooth, points }
}

/// A cube blown up to a ball: 6 patches of `n x n` control points around `centre`.
pub fn ball(n: usize, centre: DVec3) -> (Network, Vec<Surface>) {
    let rings = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let corner = |k: u32| DVec3::new((k & 1) as f64, (k >> 1 & 1) as f64, (k >> 2) as f64) * 2.0 - DVec3::ONE;
    let surfaces = rings
        .iter()
        .map(|&[a, b, _, d]| {
            surface(n, n, |i, j| {
                let (o, u, v) = (corner(a), corner(b) - corner(a), corner(d) - corner(a));
                // Whole numbers over n - 1, so that both sides of a seam round alike.
                let cube = (o * (n - 1) as f64 + u * i as f64 + v * j as f64) / (n - 1) as f64;
                centre + cube.normalize()
            })
        })
        .collect();
    (network(8, &rings), surfaces)
}

/// The cube of edge 2 around `centre`: 6 flat patches of `n x n` control points, the corners of [`ball`].
pub fn flat_cube(n: usize, centre: DVec3) -> (Network, Vec<Surface>) {
    let (network, mut surfaces) = ball(n, DVec3::ZERO);
    // Blown up along rays: each point goes back to its face.
    surfaces.iter_mut().flat_map(|s| &mut s.control).for_each(|p| *p = centre + *p / p.abs().max_element());
    (network, surfaces)
}

/// Displacement maps for surfaces, with that many nodes along `v` and `u`, all of them zero.
pub fn flat_maps(surfaces: &[Surface], rows: usize, cols: usize) -> Vec<Relief> {
    surfaces.iter().map(|_| Relief { rows, cols, vectors: vec![DVec3::ZERO; rows * cols] }).collect()
}

/// A torus of 4 x 4 patches of `n x n` control points, radii 3 and 1.
pub fn torus(n: usize) -> (Network, Vec<Surface>) {
    let id = |a: u32, b: u32| a % 4 + 4 * (b % 4);
    let mut rings = Vec::new();
    let mut surfaces = Vec::new();
    let steps = 4 * (n - 1);
    let angle = |k: usize| std::f64::consts::TAU * (k % steps) as f64 / steps as f64;
    for b in 0..4 {
        for a in 0..4 {
            rings.push([id(a, b), id(a + 1, b), id(a + 1, b + 1), id(a, b + 1)]);
            surfaces.push(surface(n, n, |i, j| {
                let (phi, psi) = (angle(a as usize * (n - 1) + i), angle(b as usize * (n - 1) + j));
                let r = 3.0 + psi.cos();
                DVec3::new(r * phi.cos(), r * phi.sin(), psi.sin())
            }));
        }
    }
    (network(16, &rings), surfaces)
}

/// An open sheet of 2 x 1 patches.
pub fn sheet() -> (Network, Vec<Surface>) {
    let at = |x: usize| {
        move |i: usize, j: usize| {
            let (u, v) = ((6 * x + i) as f64 / 6.0, j as f64 / 4.0);
            DVec3::new(u, v, 0.3 * (3.0 * u).sin() * (2.0 * v).cos())
        }
    };
    (network(6, &[[0, 1, 4, 3], [1, 2, 5, 4]]), vec![surface(7, 5, at(0)), surface(7, 5, at(1))])
}

/// The network of one patch whose long sides are one curve.
fn rolled() -> Network {
    let mut network = network(2, &[]);
    network.curves = vec![curve(0, 0), curve(0, 1), curve(1, 1)];
    let side = |curve: u32, reversed: bool| Side { curve, reversed };
    network.patches = vec![Patch { sides: [side(0, false), side(1, false), side(2, true), side(1, true)] }];
    network
}

/// A tube of one patch: both its long sides are the same curve, its rings are closed.
pub fn tube() -> (Network, Vec<Surface>) {
    let n = 13;
    let at = |i: usize, j: usize| {
        let phi = std::f64::consts::TAU * (i % (n - 1)) as f64 / (n - 1) as f64;
        DVec3::new(phi.cos(), phi.sin(), j as f64)
    };
    (rolled(), vec![surface(n, 5, at)])
}

/// A torus of one patch: both pairs of its sides are one curve each, with one corner.
pub fn ring() -> (Network, Vec<Surface>) {
    let n = 13;
    let mut network = network(1, &[]);
    network.curves = vec![curve(0, 0), curve(0, 0)];
    let side = |curve: u32, reversed: bool| Side { curve, reversed };
    network.patches = vec![Patch { sides: [side(0, false), side(1, false), side(0, true), side(1, true)] }];
    let angle = |k: usize| std::f64::consts::TAU * (k % (n - 1)) as f64 / (n - 1) as f64;
    let at = |i: usize, j: usize| {
        let r = 3.0 + angle(j).cos();
        DVec3::new(r * angle(i).cos(), r * angle(i).sin(), angle(j).sin())
    };
    (network, vec![surface(n, n, at)])
}

/// A globe of one patch: both its long sides are one curve, its short ones are the poles.
pub fn globe() -> (Network, Vec<Surface>) {
    let n = 13;
    let at = |i: usize, j: usize| {
        let phi = std::f64::consts::TAU * (i % (n - 1)) as f64 / (n - 1) as f64;
        let theta = std::f64::consts::PI * (j as f64 / 8.0 - 0.5);
        let r = if j == 0 || j == 8 { 0.0 } else { theta.cos() };
        DVec3::new(r * phi.cos(), r * phi.sin(), theta.sin())
    };
    (rolled(), vec![surface(n, 9, at)])
}

/// Two models as one.
pub fn both(a: (Network, Vec<Surface>), b: (Network, Vec<Surface>)) -> (Network, Vec<Surface>) {
    let (mut network, mut surfaces) = a;
    let (corners, curves) = (network.corners.len() as u32, network.curves.len() as u32);
    network.corners.extend(b.0.corners);
    network.curves.extend(b.0.curves.into_iter().map(|mut c| {
        c.corners = c.corners.map(|k| k + corners);
        c
    }));
    network.patches.extend(b.0.patches.into_iter().map(|mut p| {
        p.sides.iter_mut().for_each(|side| side.curve += curves);
        p
    }));
    surfaces.extend(b.1);
    (network, surfaces)
}
