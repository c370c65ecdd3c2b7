//! Extraction: exact cases, convergence, the certificate on made and measured meshes.

mod common;
#[path = "common/zone.rs"]
mod zone;

use planish::contour::{self, ContourParams, Meshed, Sampling};
use planish::field::{GridParams as VolumeParams, Milling, Move, Part, ScalarGrid, Solid, Spacing, Tool};
use planish::geom::{Aabb, Bvh, random};
use planish::mesh::{Diagnosis, FeatureKind, TriMesh, diagnose, self_intersections};
use planish::{DVec3, Silent};
use std::sync::Arc;

fn at(n: usize) -> Sampling {
    Sampling { spacing: Spacing::Resolution(n), memory: 4 << 30 }
}

fn of_solid(solid: &Solid, n: usize) -> Meshed {
    contour::from_part(&Part::Solid(solid.clone()), at(n), &ContourParams::default(), &Silent).unwrap()
}

fn of_mesh(mesh: &TriMesh, n: usize) -> Meshed {
    contour::from_mesh(mesh, at(n), &ContourParams::default(), &Silent).unwrap()
}

/// Closed, manifold, oriented, and no two triangles meet.
fn certified(name: &str, mesh: &TriMesh) -> Diagnosis {
    let d = diagnose(mesh);
    assert!(d.watertight && d.manifold && d.flipped_faces == 0, "{name}: {d:?}");
    assert_eq!(self_intersections(mesh).len(), 0, "{name}");
    d
}

fn box_of(size: DVec3) -> Solid {
    Solid::Cuboid { size, round: 0.0 }
}

/// Corners and ends of tagged edges of an extracted box, in the frame of the box: how far corners are off, and how many
/// ends of tagged edges lie off the box's edges.
fn box_features(made: &Meshed, size: DVec3, turned: glam::DQuat) -> (Vec<f64>, usize) {
    let (mesh, tags) = (&made.extracted.mesh, &made.extracted.tags);
    let off = |v: usize| ((turned.inverse() * mesh.points[v]).abs() - size / 2.0).abs();
    let corners = (0..mesh.points.len()).filter(|&v| tags.vertices[v] == FeatureKind::Corner);
    let beside = |v: u32| off(v as usize).to_array().iter().filter(|x| **x < 2e-9).count() < 2;
    let ends: std::collections::BTreeSet<u32> = tags.edges.iter().flatten().copied().collect();
    (corners.map(|v| off(v).max_element()).collect(), ends.into_iter().filter(|&v| beside(v)).count())
}

#[test]
fn straight_box_has_its_8_corners_and_all_feature_vertices_to_1e_9_of_the_size() {
    let size = DVec3::new(2.0, 1.5, 1.0);
    for n in [17, 40, 65] {
        let made = of_solid(&box_of(size), n);
        certified("straight", &made.extracted.mesh);
        let (corners, beside) = box_features(&made, size, glam::DQuat::IDENTITY);
        assert_eq!((corners.len(), beside), (8, 0), "{n}");
        assert!(corners.iter().all(|o| *o < 2e-9), "{n}: corners off by {corners:?}");
    }
}

#[test]
fn boxes_turned_40_ways_have_98_percent_of_their_corners_to_1e_9_of_the_size_and_99_percent_of_their_edge_vertices() {
    let size = DVec3::new(2.0, 1.5, 1.0);
    let (mut exact, mut beside, mut ends) = (0, 0, 0);
    for k in 0..40 {
        let r = |a: u64| random::unit(11, 4 * k + a) - 0.5;
        let (axis, deg) = (DVec3::new(r(0), r(1), r(2)).normalize(), 180.0 * r(3));
        let made = of_solid(&box_of(size).turned(axis, deg), 40);
        certified("turned", &made.extracted.mesh);
        let turned = glam::DQuat::from_axis_angle(axis, deg.to_radians());
        let (corners, off) = box_features(&made, size, turned);
        exact += corners.iter().filter(|o| **o < 2e-9).count();
        beside += off;
        ends += made.extracted.tags.vertices.iter().filter(|k| **k != FeatureKind::None).count();
        assert!(corners.iter().all(|o| *o < 0.5 * made.lattice.step.x), "corners off by {corners:?}");
    }
    assert!(exact * 100 >= 98 * 320, "{exact} of 320 corners are exact");
    assert!(beside * 100 <= ends, "{beside} of {ends} feature vertices lie off the edges");
}

#[test]
fn sphere_converges_with_second_order_and_its_normals_with_first() {
    let sphere = Solid::Sphere { radius: 1.0 };
    let errors: Vec<[f64; 2]> = [16, 32, 64]
        .map(|n| {
            let mesh = of_solid(&sphere, n).extracted.mesh;
            certified("sphere", &mesh);
            let mut off = [0.0f64; 2];
            for t in 0..mesh.triangles.len() {
                let [a, b, c] = mesh.corners(t);
                let m = (a + b + c) / 3.0;
                off[0] = off[0].max((m.length() - 1.0).abs());
                // Slivers have any normal; their area counts.
                off[1] += mesh.area_vector(t).cross(m.normalize()).length();
            }
            off
        })
        .to_vec();
    for k in 0..2 {
        for (power, order) in [(0, 1.7), (1, 0.85)] {
            let rate = (errors[k][power] / errors[k + 1][power]).log2();
            assert!(rate > order, "{power}: rate {rate} of {errors:?}");
        }
    }
}

#[test]
fn rim_of_a_cylinder_converges_to_the_circle_and_is_tagged_all_around() {
    let cylinder = Solid::Cylinder { radius: 1.0, height: 1.3 }.turned(DVec3::new(1.0, 0.3, 0.2), 33.0);
    let turn = glam::DQuat::from_axis_angle(DVec3::new(1.0, 0.3, 0.2).normalize(), 33f64.to_radians());
    for n in [24, 48] {
        let made = of_solid(&cylinder, n);
        let (mesh, tags) = (&made.extracted.mesh, &made.extracted.tags);
        certified("cylinder", mesh);
        let mut length = 0.0;
        for e in &tags.edges {
            let [a, b] = e.map(|v| mesh.points[v as usize]);
            length += a.distance(b);
            let q = turn.inverse() * a;
            let near = 0.75 * made.lattice.step.x;
            assert!((q.truncate().length() - 1.0).abs() < near && (q.z.abs() - 0.65).abs() < near, "{q}");
        }
        let wanted = 4.0 * std::f64::consts::PI;
        assert!((length / wanted - 1.0).abs() < 0.08, "{n}: {length} of {wanted}");
    }
}

/// Edges of the convex body of all `p` with `n . p <= d` for its planes `(n, d)`: their ends and the numbers of the planes.
fn edges_of(planes: &[(DVec3, f64)]) -> Vec<([DVec3; 2], [usize; 2])> {
    let mut edges = Vec::new();
    for i in 0..planes.len() {
        for j in 0..i {
            let (a, b) = (planes[j], planes[i]);
            let way = a.0.cross(b.0);
            if way.length() < 1e-9 {
                continue;
            }
            let way = way.normalize();
            let p = glam::DMat3::from_cols(a.0, b.0, way).transpose().inverse() * DVec3::new(a.1, b.1, 0.0);
            let (mut from, mut to) = (f64::NEG_INFINITY, f64::INFINITY);
            for (_, c) in planes.iter().enumerate().filter(|(k, _)| *k != i && *k != j) {
                let (slope, room) = (c.0.dot(way), c.1 - c.0.dot(p));
                match slope {
                    s if s > 1e-12 => to = to.min(room / s),
                    s if s < -1e-12 => from = from.max(room / s),
                    _ if room < 0.0 => to = f64::NEG_INFINITY,
                    _ => {}
                }
            }
            if to > from {
                edges.push(([p + way * from, p + way * to], [j, i]));
            }
        }
    }
    edges
}

fn off_segment(p: DVec3, [a, b]: [DVec3; 2]) -> f64 {
    let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
    p.distance(a.lerp(b, t))
}

/// Length of a segment, and how much of it is nearer than `near` to one of `by`.
fn covered(segment: [DVec3; 2], by: &[[DVec3; 2]], near: f64) -> [f64; 2] {
    let length = segment[0].distance(segment[1]);
    let steps = (length / near).ceil().max(1.0) as usize;
    let place = |s: usize| segment[0].lerp(segment[1], (s as f64 + 0.5) / steps as f64);
    let hit = (0..steps).filter(|&s| by.iter().any(|&e| off_segment(place(s), e) < near)).count();
    [length, length * hit as f64 / steps as f64]
}

/// A roof whose sides turn by `deg`, on a box, turned any way: length of the ridge and how much of it is tagged, length
/// of tagged edges and how much of it is true.
fn roof(deg: f64, seed: u64) -> [f64; 4] {
    let r = |k: u64| random::unit(deg as u64, 8 * seed + k) - 0.5;
    let turn = glam::DQuat::from_axis_angle(DVec3::new(r(0), r(1), r(2)).normalize(), std::f64::consts::TAU * r(3));
    let half = (deg / 2.0).to_radians();
    let side = |s: f64, k: u64| (DVec3::new(s * half.sin(), 0.0, half.cos()), 0.1 + 0.1 * r(k));
    let mut planes = vec![side(1.0, 4), side(-1.0, 5)];
    for (n, d) in [(DVec3::X, 0.8), (DVec3::Y, 0.85), (DVec3::Z, 0.95)] {
        planes.extend([(n, d), (-n, d)]);
    }
    for (n, d) in &mut planes {
        *n = turn * *n;
        *d += n.dot(DVec3::new(r(6), r(7), r(0)) * 0.1);
    }
    let mut parts: Vec<Solid> = planes.iter().map(|&(normal, offset)| Solid::Plane { normal, offset }).collect();
    parts.push(box_of(DVec3::splat(4.0)));
    let params = ContourParams { sharp: 12f64.to_radians().cos(), ..Default::default() };
    let sampling = Sampling { spacing: Spacing::Voxel(2.0 / 48.0), memory: 4 << 30 };
    let made = contour::from_part(&Part::Solid(Solid::Intersection(parts)), sampling, &params, &Silent).unwrap();
    let mesh = &made.extracted.mesh;
    certified("roof", mesh);
    let near = 0.1 * made.lattice.step.x;
    let tagged: Vec<[DVec3; 2]> =
        made.extracted.tags.edges.iter().map(|e| e.map(|v| mesh.points[v as usize])).collect();
    let edges = edges_of(&planes);
    let ridge = edges.iter().find(|e| e.1 == [0, 1]).expect("the sides of the roof meet").0;
    let edges: Vec<[DVec3; 2]> = edges.into_iter().map(|e| e.0).collect();
    let [length, found] = covered(ridge, &tagged, near);
    let [all, good] =
        tagged.iter().map(|&e| covered(e, &edges, near)).fold([0.0; 2], |sum, x| [sum[0] + x[0], sum[1] + x[1]]);
    [length, found, all, good]
}

#[test]
fn creases_of_15_to_90_degrees_turned_any_way_are_found_with_99_5_percent_recall_and_precision() {
    let mut sum = [0.0; 4];
    for deg in [15.0, 30.0, 60.0, 90.0] {
        for seed in 0..8 {
            roof(deg, seed).into_iter().zip(&mut sum).for_each(|(x, s)| *s += x);
        }
    }
    let [length, found, all, good] = sum;
    assert!(found > 0.995 * length, "{found} of {length} of the ridges are tagged");
    assert!(good > 0.995 * all, "{good} of {all} of the tagged edges are true");
}

#[test]
fn volumes_of_turned_boxes_have_their_edges_to_a_tenth_of_a_cell_with_97_percent_recall_and_precision() {
    let (half, n) = (DVec3::new(0.7, 0.5, 0.6), 48);
    let mut sum = [0.0; 4];
    for seed in 0..8 {
        let r = |k: u64| random::unit(17, 8 * seed + k) - 0.5;
        let turn = glam::DQuat::from_axis_angle(DVec3::new(r(0), r(1), r(2)).normalize(), std::f64::consts::TAU * r(3));
        let shift = DVec3::new(r(4), r(5), r(6)) * 0.1;
        let step = 2.4 / n as f64;
        let at =
            |v: usize| DVec3::splat(-1.2) + step * DVec3::new((v % n) as f64, (v / n % n) as f64, (v / n / n) as f64);
        // Up to its edges the greatest of the distances from the planes is the distance from the box.
        let value = |v: usize| ((turn.inverse() * (at(v) - shift)).abs() - half).max_element() as f32;
        let values = Arc::new((0..n * n * n).map(value).collect());
        let grid = ScalarGrid { size: [n; 3], origin: DVec3::splat(-1.2), spacing: DVec3::splat(step), values };
        let made =
            contour::from_grid(&grid, &VolumeParams::default(), 1 << 30, &ContourParams::default(), &Silent).unwrap();
        let mesh = &made.extracted.mesh;
        certified("volume", mesh);
        let planes: Vec<(DVec3, f64)> = [DVec3::X, DVec3::Y, DVec3::Z]
            .into_iter()
            .flat_map(|a| [a, -a].map(|n| (turn * n, half.dot(a) + (turn * n).dot(shift))))
            .collect();
        let edges: Vec<[DVec3; 2]> = edges_of(&planes).into_iter().map(|e| e.0).collect();
        assert_eq!(edges.len(), 12);
        let tagged: Vec<[DVec3; 2]> =
            made.extracted.tags.edges.iter().map(|e| e.map(|v| mesh.points[v as usize])).collect();
        for (of, by, k) in [(&edges, &tagged, 0), (&tagged, &edges, 2)] {
            for &e in of {
                let [all, good] = covered(e, by, 0.1 * step);
                sum[k] += all;
                sum[k + 1] += good;
            }
        }
    }
    let [length, found, all, good] = sum;
    assert!(found > 0.97 * length, "{found} of {length} of the edges are tagged");
    assert!(good > 0.97 * all, "{good} of {all} of the tagged edges are true");
}

/// A bar of length 1 with a square section of 1, one edge of which is cut off `width` from it, turned.
fn chamfered(width: f64, turn: glam::DQuat) -> (TriMesh, Vec<[DVec3; 2]>) {
    let section = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0 - width], [1.0 - width, 1.0], [0.0, 1.0]];
    let points: Vec<DVec3> =
        [0.0, 1.0].iter().flat_map(|z| section.iter().map(move |p| turn * DVec3::new(p[0], p[1], *z))).collect();
    let mut triangles = Vec::new();
    for k in 0..5u32 {
        let next = (k + 1) % 5;
        triangles.extend([[k, next, next + 5], [k, next + 5, k + 5]]);
    }
    for k in 1..4 {
        triangles.extend([[0, k + 1, k], [5, k + 5, k + 6]]);
    }
    let lines = [2, 3].map(|k| [points[k], points[k + 5]]);
    (TriMesh::new(points, triangles), lines.to_vec())
}

#[test]
fn two_lines_half_a_cell_apart_are_both_met_within_a_fifth_of_a_cell_over_95_percent_of_their_length() {
    let (mut near, mut all) = (0, 0);
    for seed in 0..8 {
        let r = |k: u64| random::unit(29, 8 * seed + k) - 0.5;
        let turn = glam::DQuat::from_axis_angle(DVec3::new(r(0), r(1), r(2)).normalize(), std::f64::consts::TAU * r(3));
        let (mesh, lines) = chamfered(0.5 / 40.0, turn);
        let made = of_mesh(&mesh, 40);
        certified("chamfer", &made.extracted.mesh);
        let tree = Bvh::new(&made.extracted.mesh);
        for [a, b] in lines {
            for k in 0..500 {
                let p = a.lerp(b, (k as f64 + 0.5) / 500.0);
                near += (tree.closest(p).distance < 0.2 * made.lattice.step.x) as usize;
                all += 1;
            }
        }
    }
    assert!(near * 100 > all * 95, "{near} of {all}");
}

#[test]
fn corners_of_3_to_6_faces_turned_any_way_are_hit_within_2_hundredths_of_a_cell_and_tagged() {
    let (mut hit, mut count) = (0, 0);
    for valence in 3..=6 {
        for seed in 0..10 {
            let r = |k: u64| random::unit(40 + valence, 8 * seed + k) - 0.5;
            let turn =
                glam::DQuat::from_axis_angle(DVec3::new(r(0), r(1), r(2)).normalize(), std::f64::consts::TAU * r(3));
            let tip = DVec3::new(r(4), r(5), r(6)) * 0.1 + turn * DVec3::new(0.0, 0.0, 0.6);
            let mut parts: Vec<Solid> = (0..valence)
                .map(|k| {
                    let a = std::f64::consts::TAU * (k as f64 + 0.3) / valence as f64;
                    let normal = turn * DVec3::new(a.cos(), a.sin(), 0.8).normalize();
                    Solid::Plane { normal, offset: normal.dot(tip) }
                })
                .collect();
            parts.push(box_of(DVec3::splat(1.8)));
            let made = of_solid(&Solid::Intersection(parts), 40);
            let mesh = &made.extracted.mesh;
            certified("pyramid", mesh);
            let kinds = &made.extracted.tags.vertices;
            let is_tip =
                |v: usize| mesh.points[v].distance(tip) < 0.02 * made.lattice.step.x && kinds[v] == FeatureKind::Corner;
            hit += (0..mesh.points.len()).any(is_tip) as usize;
            count += 1;
        }
    }
    assert!(hit >= count - 1, "{hit} of {count} corners");
}

#[test]
fn closed_meshes_come_back_certified_with_their_genus_and_volume() {
    for (name, mesh, genus) in common::closed_meshes() {
        for n in [24, 65] {
            let made = of_mesh(&mesh, n);
            let d = certified(name, &made.extracted.mesh);
            assert_eq!(d.genus, Some(genus), "{name} at {n}");
            let (a, b) = (d.volume.unwrap(), diagnose(&mesh).volume.unwrap());
            assert!((a / b - 1.0).abs() < 0.02, "{name} at {n}: {a} {b}");
            assert_eq!(made.mended, 0, "{name}: the three axes agree");
        }
    }
}

#[test]
fn lattices_through_the_vertices_of_a_cube_are_decided_without_a_gap() {
    // Every face, edge and corner of the cube lies on planes of nodes.
    let mesh = planish::synthetic::shapes::cuboid(DVec3::splat(8.0), 4);
    let lattice = planish::field::Lattice { origin: mesh.bounds().min - 2.0, step: DVec3::ONE, cells: [12; 3] };
    let field = planish::field::MeshField::new(&mesh).unwrap();
    let directed = field.sample(&lattice, &Silent).unwrap();
    assert_eq!(directed.mended, 0);
    let found = contour::extract(&directed, None, &ContourParams::default(), &Silent).unwrap();
    let d = certified("cube on nodes", &found.mesh);
    assert!((d.volume.unwrap() / 512.0 - 1.0).abs() < 1e-6, "{:?}", d.volume);
}

#[test]
fn meshes_with_holes_and_intersections_are_closed() {
    let mut open = planish::synthetic::shapes::sphere(1.0, 4);
    open.triangles.retain(|t| !t.iter().all(|&v| open.points[v as usize].z > 0.9));
    let d = certified("open sphere", &of_mesh(&open, 40).extracted.mesh);
    assert_eq!(d.genus, Some(0));
    assert!((d.volume.unwrap() / 4.18 - 1.0).abs() < 0.05, "{:?}", d.volume);
    let mut two = planish::synthetic::shapes::sphere(1.0, 4);
    let n = two.points.len() as u32;
    two.points.extend_from_within(..);
    two.points[n as usize..].iter_mut().for_each(|p| p.x += 0.9);
    two.triangles.extend_from_within(..);
    let half = two.triangles.len() / 2;
    two.triangles[half..].iter_mut().for_each(|t| *t = t.map(|v| v + n));
    let d = certified("two spheres", &of_mesh(&two, 40).extracted.mesh);
    assert_eq!((d.genus, d.components), (Some(0), 1));
}

#[test]
fn measured_meshes_are_certified_at_65_cells() {
    for name in ["fandisk", "joint", "casting", "rocker_arm", "sharp_sphere", "goathead", "armadillo", "thin_sheet"] {
        let Some(mesh) = common::data_mesh(&format!("{name}.ply")) else { continue };
        let made = of_mesh(&mesh, 65);
        let d = certified(name, &made.extracted.mesh);
        assert_eq!(made.mended, 0, "{name}");
        if ["fandisk", "joint", "rocker_arm"].contains(&name) {
            assert_eq!(d.genus, diagnose(&mesh).genus, "{name}");
        }
        assert_eq!(d.degenerate_faces, 0, "{name}");
        if name == "fandisk" {
            let zone = zone::measure(&mesh, &made.extracted.mesh, made.lattice.step.x);
            assert!(zone.normal_deg < 0.3 && zone.edge_rms < 0.01 && zone.rms < 0.005, "{zone:?}");
        }
    }
}

/// A random tree of solids in a cube.
fn random_tree(seed: u64) -> Solid {
    let r = |k: u64| random::unit(seed, k);
    let leaf = |k: u64| {
        let size = DVec3::new(r(k), r(k + 1), r(k + 2)) * 0.7 + 0.3;
        let solid = match (r(k + 3) * 5.0) as u32 {
            0 => Solid::Sphere { radius: size.x / 1.5 },
            1 => box_of(size * 1.2),
            2 => Solid::Cylinder { radius: size.x / 2.0, height: size.y * 1.5 },
            3 => Solid::Cone { bottom: size.x / 1.5, top: size.y / 4.0, height: size.z },
            _ => Solid::Torus { major: 0.5, minor: size.x / 5.0 },
        };
        let axis = DVec3::new(r(k + 4) - 0.5, r(k + 5) - 0.5, r(k + 6) - 0.4);
        solid.turned(axis, 360.0 * r(k + 7)).moved(DVec3::new(r(k + 8), r(k + 9), r(k + 10)) - 0.5)
    };
    let mut tree = leaf(0);
    for n in 1..2 + (r(900) * 5.0) as u64 {
        let next = leaf(20 * n);
        tree = match (r(20 * n + 15) * 3.0) as u32 {
            0 => tree.union(next),
            1 => tree.difference(next),
            _ => tree.union(next.offset(0.05)),
        };
    }
    tree
}

#[test]
fn five_hundred_random_trees_of_solids_are_certified() {
    for seed in 0..500 {
        let tree = Part::Solid(random_tree(seed));
        let n = 12 + (seed % 14) as usize;
        match contour::from_part(&tree, at(n), &ContourParams::default(), &Silent) {
            Ok(made) => {
                certified(&format!("tree {seed}"), &made.extracted.mesh);
            }
            Err(e) => assert!(e.to_string().contains("passes none"), "{seed}: {e}"),
        }
    }
}

#[test]
fn meshes_are_bitwise_equal_on_1_2_and_5_threads() {
    let tree = Part::Solid(random_tree(7));
    let mesh = planish::synthetic::demo(1, 8_000);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let a = contour::from_part(&tree, at(40), &ContourParams::default(), &Silent).unwrap().extracted;
            let b = of_mesh(&mesh, 50).extracted;
            (a.mesh, a.tags, b.mesh, b.tags)
        })
    };
    let one = run(1);
    assert!(one == run(2) && one == run(5));
}

#[test]
fn adaptive_meshes_are_certified_within_their_tolerance_and_smaller_by_far() {
    let tolerance = 0.004;
    let adaptive = ContourParams { adaptive: Some(tolerance), ..Default::default() };
    for seed in 0..40 {
        let tree = Part::Solid(random_tree(seed));
        if let Ok(made) = contour::from_part(&tree, at(24), &adaptive, &Silent) {
            certified(&format!("adaptive tree {seed}"), &made.extracted.mesh);
        }
    }
    let part = Part::Solid(box_of(DVec3::new(2.0, 1.4, 0.9)).difference(Solid::Cylinder { radius: 0.3, height: 2.0 }));
    let coarse = contour::from_part(&part, at(64), &adaptive, &Silent).unwrap();
    let fine = contour::from_part(&part, at(64), &ContourParams::default(), &Silent).unwrap();
    let (a, b) = (&coarse.extracted.mesh, &fine.extracted.mesh);
    let d = certified("adaptive part", a);
    assert_eq!(d.genus, Some(1));
    assert!(a.triangles.len() * 3 < b.triangles.len(), "{} of {}", a.triangles.len(), b.triangles.len());
    let volume = |m: &TriMesh| diagnose(m).volume.unwrap();
    assert!((volume(a) / volume(b) - 1.0).abs() < 1e-3);
    let bvh = planish::geom::Bvh::new(a);
    for p in &b.points {
        assert!(bvh.closest(*p).distance < 1.5 * tolerance, "{p}");
    }
}

#[test]
fn decimating_and_smoothing_keep_the_feature_lines_of_an_extracted_part() {
    let part = Part::Solid(box_of(DVec3::new(2.0, 1.4, 0.9)).difference(Solid::Cylinder { radius: 0.3, height: 2.0 }));
    let made = contour::from_part(&part, at(64), &ContourParams::default(), &Silent).unwrap().extracted;
    let on_edges = |p: DVec3, tolerance: f64| {
        let q = (p.abs() - DVec3::new(1.0, 0.7, 0.45)).abs();
        let flat = [q.x, q.y, q.z].iter().filter(|d| **d < tolerance).count();
        flat >= 2 || (q.z < tolerance && (p.truncate().length() - 0.3).abs() < tolerance)
    };
    let target = planish::mesh::DecimateTarget::Ratio(0.05);
    let params = planish::mesh::DecimateParams { target, ..Default::default() };
    let less = planish::mesh::decimate(&made.mesh, Some(&made.tags), &params, &Silent).unwrap();
    let d = certified("decimated", &less.mesh);
    assert_eq!(d.genus, Some(1));
    assert!(d.triangles <= made.mesh.triangles.len() / 19);
    for e in &less.tags.edges {
        let [a, b] = e.map(|v| less.mesh.points[v as usize]);
        assert!(on_edges(a, 2e-3) && on_edges((a + b) / 2.0, 0.02), "{a} {b}");
    }
    let params = planish::mesh::SmoothParams { noise: Some(0.002), strength: 1.0 };
    let smooth = planish::mesh::smooth(&made.mesh, Some(&made.tags), &params, &Silent).unwrap();
    certified("smoothed", &smooth.mesh);
    for v in (0..smooth.mesh.points.len()).filter(|&v| made.tags.vertices[v] != FeatureKind::None) {
        assert!(on_edges(smooth.mesh.points[v], 0.01), "{}", smooth.mesh.points[v]);
    }
}

#[test]
fn a_milled_slot_has_the_volume_of_its_formula_and_its_sharp_rim() {
    let stock = Aabb { min: DVec3::new(-2.0, -1.0, -1.0), max: DVec3::new(2.0, 1.0, 0.0) };
    let (r, depth, run) = (0.3, 0.4, 2.0);
    let path = [DVec3::new(-1.0, 0.0, 1.0), DVec3::new(-1.0, 0.0, -depth), DVec3::new(1.0, 0.0, -depth)];
    let slot = |tool: Tool, n: usize| {
        let moves = path.windows(2).map(|w| Move { from: w[0], to: w[1], tool: 0 }).collect();
        let milling = Milling::new(stock, vec![tool], moves);
        contour::from_field(&milling, at(n), &ContourParams::default(), &Silent).unwrap()
    };
    let pi = std::f64::consts::PI;
    let flat = (run * 2.0 * r + pi * r * r) * depth;
    let ball = (run * 2.0 * r + pi * r * r) * (depth - r) + run * pi * r * r / 2.0 + 2.0 / 3.0 * pi * r * r * r;
    for (tool, removed) in [(Tool::Flat { radius: r }, flat), (Tool::Ball { radius: r }, ball)] {
        let made = slot(tool, 120);
        let d = certified("slot", &made.extracted.mesh);
        let left = 8.0 - d.volume.unwrap();
        assert!((left / removed - 1.0).abs() < 0.003, "{tool:?}: {left} of {removed}");
        // The rim: two straight sides and two half circles, all in the top plane.
        let mesh = &made.extracted.mesh;
        let rim: f64 = made
            .extracted
            .tags
            .edges
            .iter()
            .map(|e| e.map(|v| mesh.points[v as usize]))
            .filter(|e| e.iter().all(|p| p.z.abs() < 1e-6 && p.x.abs() < 1.5 && p.y.abs() < 0.5))
            .map(|[a, b]| a.distance(b))
            .sum();
        let wanted = 2.0 * run + 2.0 * pi * r;
        assert!((rim / wanted - 1.0).abs() < 0.01, "{tool:?}: {rim} of {wanted}");
    }
}

/// The prism over a convex outline in the xy-plane, counter-clockwise, turned any way.
fn prism(outline: &[[f64; 2]], height: f64, seed: u64) -> TriMesh {
    let r = |k: u64| random::unit(17, 8 * seed + k) - 0.5;
    let turn = glam::DQuat::from_axis_angle(DVec3::new(r(0), r(1), r(2)).normalize(), std::f64::consts::TAU * r(3));
    let n = outline.len() as u32;
    let floor = |z: f64| outline.iter().map(move |&[x, y]| turn * DVec3::new(x, y, z));
    let mut triangles: Vec<[u32; 3]> = (1..n - 1).flat_map(|k| [[0, k + 1, k], [n, n + k, n + k + 1]]).collect();
    triangles.extend((0..n).flat_map(|k| {
        let next = (k + 1) % n;
        [[k, next, n + k], [next, n + next, n + k]]
    }));
    TriMesh::new(floor(0.0).chain(floor(height)).collect(), triangles)
}

/// Checks that a thin body comes back as one piece without handles, with this part of its volume at least, its edges within so many
/// cells and its normals beside them within so many degrees in the mean.
fn thin_body(name: &str, source: &TriMesh, n: usize, [part, cells, degrees]: [f64; 3]) {
    let made = of_mesh(source, n);
    let (mesh, cell) = (&made.extracted.mesh, made.lattice.step.x);
    let d = certified(name, mesh);
    assert_eq!((d.components, d.genus), (1, Some(0)), "{name} at {n}");
    let volume = d.volume.unwrap() / diagnose(source).volume.unwrap();
    let zone = zone::measure(source, mesh, cell);
    let edge = zone.edge_max / 100.0 * source.bounds().diagonal() / cell;
    assert!(volume > part && volume < 1.001, "{name} at {n}: volume {volume}");
    assert!(edge < cells && zone.normal_deg < degrees, "{name} at {n}: {edge} cells, {zone:?}");
}

#[test]
fn knives_and_plates_thinner_than_a_cell_stay_in_one_piece_with_their_volume_edges_and_normals() {
    for (seed, n) in (0..3).flat_map(|seed| [33, 65, 129].map(|n| (seed, n))) {
        for deg in [10.0_f64, 35.0] {
            let half = (deg / 2.0).to_radians().tan();
            let knife = prism(&[[0.0, 0.0], [1.0, -half], [1.0, half]], 0.8, seed);
            thin_body("a knife", &knife, n, [0.999, 0.6, 1.0]);
        }
        for width in [0.004, 0.015] {
            let plate = prism(&[[0.0, 0.0], [1.0, 0.0], [1.0, width], [0.0, width]], 0.7, seed);
            thin_body("a plate", &plate, n, [0.95, 1.0, 12.0]);
        }
    }
}

#[test]
fn fins_a_third_of_a_cell_thick_stand_on_their_base_in_one_piece() {
    let cuboid = |low: DVec3, high: DVec3| {
        let planes = [DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(|n| {
            [(n, n.dot(high)), (-n, -n.dot(low))].map(|(normal, offset)| Solid::Plane { normal, offset })
        });
        Solid::Intersection(planes.chain([box_of(DVec3::splat(4.0))]).collect())
    };
    let width = 0.01;
    let mut parts = vec![cuboid(DVec3::ZERO, DVec3::new(1.0, 0.6, 0.1))];
    for k in 0..8 {
        let x = 0.05 + 0.123 * k as f64;
        parts.push(cuboid(DVec3::new(x, 0.0, 0.05), DVec3::new(x + width, 0.6, 0.5)));
    }
    let fine = of_solid(&Solid::Union(parts), 257).extracted.mesh;
    let made = of_mesh(&fine, 33);
    let d = certified("fins", &made.extracted.mesh);
    assert_eq!((d.components, d.genus), (1, Some(0)));
    let volume = d.volume.unwrap() / diagnose(&fine).volume.unwrap();
    assert!((volume - 1.0).abs() < 0.04, "{volume}");
}

#[test]
fn walls_thinner_than_a_cell_are_counted_with_their_width() {
    // A plate of a tenth of a cell that lies between two planes of nodes.
    let mut plate = planish::synthetic::shapes::cuboid(DVec3::new(8.0, 8.0, 0.1), 4);
    plate.points.iter_mut().for_each(|p| *p += DVec3::splat(0.45));
    let lattice = planish::field::Lattice { origin: plate.bounds().min - 2.03, step: DVec3::ONE, cells: [12; 3] };
    let directed = planish::field::MeshField::new(&plate).unwrap().sample(&lattice, &Silent).unwrap();
    assert_eq!(directed.hit_count(), 0);
    assert_eq!(directed.thin.edges, 64, "one edge along z for each node above the plate");
    assert!((directed.thin.width - 0.1).abs() < 1e-9 && directed.thin.lost == 0, "{:?}", directed.thin);
    assert_eq!(directed.twice_count(), 128, "two hits on each");
    // Without a face the sides are told by winding numbers, and nothing is known between two nodes.
    plate.triangles.pop();
    let directed = planish::field::MeshField::new(&plate).unwrap().sample(&lattice, &Silent).unwrap();
    assert!(directed.twice_count() == 0 && directed.thin.lost > 60 && directed.thin.lost_share > 0.9);
    let thick = planish::synthetic::shapes::cuboid(DVec3::splat(8.3), 4);
    let directed = planish::field::MeshField::new(&thick).unwrap().sample(&lattice, &Silent).unwrap();
    assert_eq!(directed.thin.edges, 0);
}

#[test]
fn facets_larger_than_a_cell_keep_their_edges_without_being_features() {
    // A prism of 24 sides: 15 degrees from one to the next, below the threshold of 26.
    let prism = planish::synthetic::shapes::cylinder(1.0, 2.0, 24);
    let made = of_mesh(&prism, 40);
    certified("prism", &made.extracted.mesh);
    let bvh = planish::geom::Bvh::new(&prism);
    let (mesh, tags) = (&made.extracted.mesh, &made.extracted.tags);
    let (mut sum, mut area) = (0.0, 0.0);
    for t in 0..mesh.triangles.len() {
        let middle = mesh.corners(t).iter().sum::<DVec3>() / 3.0;
        let true_normal = prism.normal(bvh.closest(middle).place.face as usize);
        sum += mesh.area(t) * true_normal.dot(mesh.normal(t)).clamp(-1.0, 1.0).acos().to_degrees();
        area += mesh.area(t);
    }
    assert!(sum / area < 0.6, "normals are off by {} degrees", sum / area);
    // Only the two rims are features.
    let z = prism.bounds().size().z / 2.0;
    let center = prism.bounds().center().z;
    let off = tags.edges.iter().flatten().filter(|&&v| ((mesh.points[v as usize].z - center).abs() - z).abs() > 1e-6);
    assert_eq!(off.count(), 0);
}

#[test]
fn too_little_memory_and_no_surface_are_told() {
    let sphere = Part::Solid(Solid::Sphere { radius: 1.0 });
    let small = Sampling { spacing: Spacing::Resolution(500), memory: 1 << 20 };
    let told = contour::from_part(&sphere, small, &ContourParams::default(), &Silent).unwrap_err().to_string();
    assert!(told.contains("MB") && told.contains("larger voxel"), "{told}");
    let nothing = Part::Solid(Solid::Sphere { radius: 1.0 }.difference(Solid::Sphere { radius: 1.0 }));
    let told = contour::from_part(&nothing, at(20), &ContourParams::default(), &Silent).unwrap_err().to_string();
    assert!(told.contains("passes none"), "{told}");
}
