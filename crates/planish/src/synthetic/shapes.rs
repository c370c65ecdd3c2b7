//! Meshes of known shape, for closed-form checks.
//!
//! All are oriented manifolds with triangles counter-clockwise seen from outside.

use super::rings::{add_ring, close, girth_count, grow, grow_disk, join, steps};
use crate::mesh::TriMesh;
use glam::DVec3;
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

/// A sphere around the origin: an icosahedron cut `level` times, `20 * 4^level` triangles.
pub fn sphere(radius: f64, level: usize) -> TriMesh {
    let g = (1.0 + 5f64.sqrt()) / 2.0;
    let mut points: Vec<DVec3> = [
        [-1.0, g, 0.0],
        [1.0, g, 0.0],
        [-1.0, -g, 0.0],
        [1.0, -g, 0.0],
        [0.0, -1.0, g],
        [0.0, 1.0, g],
        [0.0, -1.0, -g],
        [0.0, 1.0, -g],
        [g, 0.0, -1.0],
        [g, 0.0, 1.0],
        [-g, 0.0, -1.0],
        [-g, 0.0, 1.0],
    ]
    .iter()
    .map(|&p| DVec3::from_array(p).normalize())
    .collect();
    #[rustfmt::skip]
    let mut triangles: Vec<[u32; 3]> = vec![
        [0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11], [1, 5, 9], [5, 11, 4], [11, 10, 2], [10, 7, 6],
        [7, 1, 8], [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8], [3, 8, 9], [4, 9, 5], [2, 4, 11], [6, 2, 10],
        [8, 6, 7], [9, 8, 1],
    ];
    for _ in 0..level {
        let mut middle: BTreeMap<(u32, u32), u32> = BTreeMap::new();
        let mut finer = Vec::with_capacity(4 * triangles.len());
        for [a, b, c] in triangles {
            let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(p, q)| {
                *middle.entry((p.min(q), p.max(q))).or_insert_with(|| {
                    points.push((points[p as usize] + points[q as usize]).normalize());
                    points.len() as u32 - 1
                })
            });
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    TriMesh::new(points.into_iter().map(|p| p * radius).collect(), triangles)
}

/// A torus around the z axis with `around x across` vertices.
pub fn torus(major: f64, minor: f64, around: usize, across: usize) -> TriMesh {
    sheet(around, across, true, true, |u, v| {
        let r = major + minor * (TAU * v).cos();
        DVec3::new(r * (TAU * u).cos(), r * (TAU * u).sin(), minor * (TAU * v).sin())
    })
}

/// A closed cylinder around the z axis from `z = 0` to `height`; both rims are sharp and their vertices lie on
/// the exact circles. `around` vertices per rim, edges of even length everywhere.
pub fn cylinder(radius: f64, height: f64, around: usize) -> TriMesh {
    let mut mesh = TriMesh::default();
    let step = TAU * radius / around as f64;
    let on = |r: f64, a: f64, z: f64| DVec3::new(r * a.cos(), r * a.sin(), z);
    let bottom = add_ring(&mut mesh, around, false, |a| on(radius, a, 0.0));
    let top = grow(&mut mesh, (bottom.clone(), None), step, height, |_| TAU * radius, |s, a| on(radius, a, s * height));
    grow_disk(&mut mesh, top, step, radius, DVec3::new(0.0, 0.0, height), |a| on(radius, a, height));
    let wall = mesh.triangles.len();
    grow_disk(&mut mesh, bottom, step, radius, DVec3::ZERO, |a| on(radius, a, 0.0));
    // The bottom was grown as seen from above: turn it.
    for t in wall..mesh.triangles.len() {
        mesh.triangles[t].swap(1, 2);
    }
    mesh
}

/// The same cylinder as programs for CAD write it: vertices on its rims only, `around` on each, two needles of the wall
/// between neighbours, and caps of needles from side to side.
pub fn faceted_cylinder(radius: f64, height: f64, around: usize) -> TriMesh {
    let n = around as u32;
    let on = |i: u32, z: f64| {
        let (sin, cos) = (TAU * f64::from(i) / f64::from(n)).sin_cos();
        DVec3::new(radius * cos, radius * sin, z)
    };
    let points = [0.0, height].iter().flat_map(|&z| (0..n).map(move |i| on(i, z))).collect();
    let wall = (0..n).flat_map(|i| {
        let j = (i + 1) % n;
        [[i, j, n + j], [i, n + j, n + i]]
    });
    // From the first vertex to and fro: its neighbours, theirs, and so on.
    let cap = (0..n - 2).map(|t| {
        let (low, high) = (t.div_ceil(2), n - 1 - t / 2);
        if t % 2 == 0 { [low, low + 1, high] } else { [low, high - 1, high] }
    });
    let bottom = cap.clone().map(|[a, b, c]| [a, c, b]);
    let top = cap.map(|t| t.map(|v| n + v));
    TriMesh::new(points, wall.chain(bottom).chain(top).collect())
}

/// A box centred at the origin; each face a grid of `n x n` squares, cut into two triangles each.
pub fn cuboid(size: DVec3, n: usize) -> TriMesh {
    let cells = [(0, 0, 0)];
    let mut mesh = voxels(&cells, n);
    for p in &mut mesh.points {
        *p = (*p - DVec3::splat(0.5)) * size;
    }
    mesh
}

/// A wedge with two walls of length 1 on both sides of an edge of some degrees and of length 1, and flat ends. `n` edges of
/// the mesh along each edge of the wedge.
pub fn wedge(degrees: f64, n: usize) -> TriMesh {
    let step =
        |sign: f64| DVec3::new((degrees.to_radians() / 2.0).cos(), sign * (degrees.to_radians() / 2.0).sin(), 0.0);
    let [lower, upper] = [step(-1.0), step(1.0)];
    let mut mesh = TriMesh::default();
    let mut ids: BTreeMap<[usize; 3], u32> = BTreeMap::new();
    // Steps along both walls, away from the edge, and along the edge.
    let mut face = |corners: [[usize; 3]; 3]| {
        let triangle = corners.map(|[i, j, k]| {
            *ids.entry([i, j, k]).or_insert_with(|| {
                mesh.points.push((lower * i as f64 + upper * j as f64 + DVec3::Z * k as f64) / n as f64);
                mesh.points.len() as u32 - 1
            })
        });
        mesh.triangles.push(triangle);
    };
    for (i, j) in (0..n).flat_map(|i| (0..n - i).map(move |j| (i, j))) {
        let upright = [[i, j], [i + 1, j], [i, j + 1]];
        let turned = [[i + 1, j], [i + 1, j + 1], [i, j + 1]];
        for [a, b, c] in [upright, turned].into_iter().take(if i + j + 1 < n { 2 } else { 1 }) {
            face([a, b, c].map(|[i, j]| [i, j, n]));
            face([a, c, b].map(|[i, j]| [i, j, 0]));
        }
    }
    // Counter-clockwise around the ends.
    let around = (0..n).map(|i| [[i, 0], [i + 1, 0]]);
    let around = around.chain((0..n).map(|i| [[n - i, i], [n - i - 1, i + 1]]));
    let around = around.chain((0..n).map(|i| [[0, n - i], [0, n - i - 1]]));
    for ([p, q], k) in around.flat_map(|side| (0..n).map(move |k| (side, k))) {
        let at = |[i, j]: [usize; 2], k| [i, j, k];
        face([at(p, k), at(q, k), at(q, k + 1)]);
        face([at(p, k), at(q, k + 1), at(p, k + 1)]);
    }
    mesh
}

/// An open saddle sheet `z = height * x y` over `[-1, 1]²`, `(n + 1)²` vertices.
pub fn saddle(height: f64, n: usize) -> TriMesh {
    sheet(n, n, false, false, |u, v| {
        let (x, y) = (2.0 * u - 1.0, 2.0 * v - 1.0);
        DVec3::new(x, y, height * x * y)
    })
}

/// An open flat rectangle in the xy plane from the origin, `cols x rows` squares.
pub fn rectangle(width: f64, depth: f64, cols: usize, rows: usize) -> TriMesh {
    sheet(cols, rows, false, false, |u, v| DVec3::new(u * width, v * depth, 0.0))
}

/// An open flat ring in the xy plane between two circles; `around` vertices on the outer one.
pub fn annulus(inner: f64, outer: f64, around: usize) -> TriMesh {
    let mut mesh = TriMesh::default();
    let step = TAU * outer / around as f64;
    let at = |r: f64, a: f64| DVec3::new(r * a.cos(), r * a.sin(), 0.0);
    let radius = |s: f64| outer + (inner - outer) * s;
    let rim = add_ring(&mut mesh, around, false, |a| at(outer, a));
    grow(&mut mesh, (rim, None), step, outer - inner, |s| TAU * radius(s), |s, a| at(radius(s), a));
    mesh
}

/// A rounded closed surface of genus 2 (a plate with two holes), each unit square cut `n x n` times.
pub fn double_torus(n: usize) -> TriMesh {
    let cells: Vec<(i32, i32, i32)> = (0..5)
        .flat_map(|x| (0..3).map(move |y| (x, y, 0)))
        .filter(|&(x, y, _)| (x, y) != (1, 1) && (x, y) != (3, 1))
        .collect();
    let mut mesh = voxels(&cells, n);
    // Diffusion over a fixed share of a square: its number of sweeps grows with the square of the resolution.
    let sweeps = (n * n).div_ceil(6).max(1);
    for _ in 0..sweeps {
        smooth_once(&mut mesh);
    }
    mesh
}

/// Two separate spheres of radius 1 and 0.5.
pub fn two_spheres(level: usize) -> TriMesh {
    let mut mesh = sphere(1.0, level);
    let other = sphere(0.5, level);
    let base = mesh.points.len() as u32;
    mesh.points.extend(other.points.iter().map(|p| *p + DVec3::new(2.0, 0.0, 0.0)));
    mesh.triangles.extend(other.triangles.iter().map(|t| t.map(|v| v + base)));
    mesh
}

/// An open disk with a finger that stands out of its middle: a cylinder of radius 1 with a rounded tip,
/// `height` above the sheet, blended into the sheet by a fillet; about `vertices` vertices.
pub fn snout(height: f64, vertices: usize) -> TriMesh {
    let mut step = 0.2;
    loop {
        let mesh = snout_with(height, step);
        let off = mesh.points.len() as f64 / vertices.max(20) as f64;
        // Within 2 % of the wish, or as near as whole rings allow.
        if (off - 1.0).abs() < 0.02 || !(1e-4..2.0).contains(&step) {
            return mesh;
        }
        let better = step * off.sqrt();
        if (better / step - 1.0).abs() < 1e-3 {
            return mesh;
        }
        step = better;
    }
}

/// Radius of the sheet of [`snout`], in finger radii.
const SNOUT_SHEET: f64 = 3.5;
/// Radius of the fillet between sheet and finger, in finger radii.
const SNOUT_FILLET: f64 = 0.35;

fn snout_with(height: f64, step: f64) -> TriMesh {
    // Profile (r, z) by arc length: sheet, fillet, wall, tip.
    let flat = SNOUT_SHEET - 1.0 - SNOUT_FILLET;
    let fillet = SNOUT_FILLET * PI / 2.0;
    let wall = (height - 1.0 - SNOUT_FILLET).max(0.0);
    let tip = PI / 2.0;
    let total = flat + fillet + wall + tip;
    let profile = |s: f64| {
        let mut l = s * total;
        if l <= flat {
            return (SNOUT_SHEET - l, 0.0);
        }
        l -= flat;
        if l <= fillet {
            let a = l / SNOUT_FILLET;
            return (1.0 + SNOUT_FILLET - SNOUT_FILLET * a.sin(), SNOUT_FILLET * (1.0 - a.cos()));
        }
        l -= fillet;
        if l <= wall {
            return (1.0, SNOUT_FILLET + l);
        }
        l -= wall;
        (l.cos().max(0.0), SNOUT_FILLET + wall + l.sin())
    };
    let at = |s: f64, a: f64| {
        let (r, z) = profile(s);
        DVec3::new(r * a.cos(), r * a.sin(), z)
    };
    let mut mesh = TriMesh::default();
    let rows = steps(total, step * super::rings::ROW);
    let mut ring = add_ring(&mut mesh, girth_count(TAU * SNOUT_SHEET, step), false, |a| at(0.0, a));
    for row in 1..rows {
        let s = row as f64 / rows as f64;
        let upper = add_ring(&mut mesh, girth_count(TAU * profile(s).0, step), row % 2 == 1, |a| at(s, a));
        join(&mut mesh, &ring, &upper);
        ring = upper;
    }
    close(&mut mesh, &ring, at(1.0, 0.0).with_x(0.0).with_y(0.0));
    mesh
}

/// A grid of `cols x rows` squares over `[0, 1]²`, closed in either direction if asked; diagonals alternate.
pub fn sheet(cols: usize, rows: usize, wrap_u: bool, wrap_v: bool, at: impl Fn(f64, f64) -> DVec3) -> TriMesh {
    let (nu, nv) = (cols + !wrap_u as usize, rows + !wrap_v as usize);
    let mut mesh = TriMesh::default();
    for j in 0..nv {
        for i in 0..nu {
            mesh.points.push(at(i as f64 / cols as f64, j as f64 / rows as f64));
        }
    }
    let id = |i: usize, j: usize| ((j % nv) * nu + i % nu) as u32;
    for j in 0..rows {
        for i in 0..cols {
            let [a, b, c, d] = [id(i, j), id(i + 1, j), id(i + 1, j + 1), id(i, j + 1)];
            if (i + j) % 2 == 0 {
                mesh.triangles.extend([[a, b, c], [a, c, d]]);
            } else {
                mesh.triangles.extend([[a, b, d], [b, c, d]]);
            }
        }
    }
    mesh
}

/// The outside of a union of unit cubes that share whole faces or nothing, each square cut `n x n` times.
fn voxels(cells: &[(i32, i32, i32)], n: usize) -> TriMesh {
    let n = n.max(1) as i32;
    let mut mesh = TriMesh::default();
    let mut ids: BTreeMap<[i32; 3], u32> = BTreeMap::new();
    for &(x, y, z) in cells {
        for axis in 0..3 {
            for side in 0..2 {
                let mut beyond = [x, y, z];
                beyond[axis] += 2 * side - 1;
                if cells.contains(&(beyond[0], beyond[1], beyond[2])) {
                    continue;
                }
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                for j in 0..n {
                    for i in 0..n {
                        let mut corner = |di: i32, dj: i32| {
                            let mut key = [x * n, y * n, z * n];
                            key[axis] += side * n;
                            key[u] += i + di;
                            key[v] += j + dj;
                            *ids.entry(key).or_insert_with(|| {
                                mesh.points.push(DVec3::from_array(key.map(f64::from)) / n as f64);
                                mesh.points.len() as u32 - 1
                            })
                        };
                        let [a, b, c, d] = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
                        let two = if (i + j) % 2 == 0 { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] };
                        let turned = two.map(|[p, q, r]| if side == 1 { [p, q, r] } else { [p, r, q] });
                        mesh.triangles.extend(turned);
                    }
                }
            }
        }
    }
    mesh
}

/// Moves every vertex half-way to the mean of its neighbours.
fn smooth_once(mesh: &mut TriMesh) {
    let mut sum = vec![DVec3::ZERO; mesh.points.len()];
    let mut count = vec![0.0; mesh.points.len()];
    for t in &mesh.triangles {
        for k in 0..3 {
            let (a, b) = (t[k] as usize, t[(k + 1) % 3] as usize);
            sum[a] += mesh.points[b];
            count[a] += 1.0;
        }
    }
    for (v, p) in mesh.points.iter_mut().enumerate() {
        *p = p.lerp(sum[v] / count[v], 0.5);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Adjacency, NONE};

    /// Euler number, open edges, and whether every open edge is a real one (no edge of three triangles).
    fn count(mesh: &TriMesh) -> (i64, usize) {
        let adjacency = Adjacency::new(mesh);
        let open = adjacency.opposite.iter().filter(|&&h| h == NONE).count();
        let edges = (adjacency.opposite.len() + open) / 2;
        assert!(adjacency.outgoing.iter().all(|&h| h != NONE), "a vertex without triangle");
        (mesh.points.len() as i64 - edges as i64 + mesh.triangles.len() as i64, open)
    }

    fn volume(mesh: &TriMesh) -> f64 {
        (0..mesh.triangles.len()).map(|t| mesh.corners(t)).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
    }

    fn area(mesh: &TriMesh) -> f64 {
        (0..mesh.triangles.len()).map(|t| mesh.area(t)).sum()
    }

    #[test]
    fn closed_shapes_have_their_euler_number_and_a_volume_within_2_percent_of_the_formula() {
        for (mesh, euler, exact) in [
            (sphere(2.0, 5), 2, 4.0 / 3.0 * PI * 8.0),
            (torus(2.0, 0.5, 96, 48), 0, 2.0 * PI * PI * 2.0 * 0.25),
            (cylinder(0.5, 3.0, 64), 2, PI * 0.25 * 3.0),
            (cuboid(DVec3::new(1.0, 2.0, 3.0), 4), 2, 6.0),
            (wedge(15.0, 6), 2, 15_f64.to_radians().sin() / 2.0),
        ] {
            assert_eq!(count(&mesh), (euler, 0));
            assert!((volume(&mesh) / exact - 1.0).abs() < 0.02, "{} of {exact}", volume(&mesh));
        }
        assert_eq!(count(&faceted_cylinder(2.0, 3.0, 64)), (2, 0));
        let exact = 3.0 * 32.0 * 4.0 * (TAU / 64.0).sin();
        assert!((volume(&faceted_cylinder(2.0, 3.0, 64)) / exact - 1.0).abs() < 1e-12);
        assert_eq!(count(&double_torus(8)), (-2, 0));
        assert!(volume(&double_torus(8)) > 1.0);
        assert_eq!(count(&two_spheres(3)), (4, 0));
    }

    #[test]
    fn open_shapes_have_their_euler_number_and_area() {
        assert_eq!(count(&saddle(0.3, 10)), (1, 40));
        assert_eq!(count(&rectangle(2.0, 1.0, 8, 4)), (1, 24));
        assert!((area(&rectangle(2.0, 1.0, 8, 4)) - 2.0).abs() < 1e-12);
        let ring = annulus(1.0, 2.0, 96);
        assert_eq!(count(&ring).0, 0);
        assert!((area(&ring) / (3.0 * PI) - 1.0).abs() < 0.01, "{}", area(&ring));
    }

    #[test]
    fn snout_is_a_disk_of_the_wanted_size_with_its_tip_at_the_wanted_height() {
        for vertices in [500, 4000] {
            let mesh = snout(3.0, vertices);
            assert_eq!(count(&mesh).0, 1);
            assert!((mesh.points.len() as f64 / vertices as f64 - 1.0).abs() < 0.1, "{}", mesh.points.len());
            assert!((mesh.bounds().max.z - 3.0).abs() < 1e-9);
        }
    }
}
