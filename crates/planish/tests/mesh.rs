//! Meshes: adjacency, diagnosis, repair, walking, paths, closest places, comparison.

#![allow(clippy::print_stdout)] // figures and skipped tests are told to who runs them

mod common;

use planish::geom::{Bvh, random};
use planish::mend::*;
use planish::mesh::*;
use planish::sharp::*;
use planish::synthetic::shapes;
use planish::{DVec3, Silent};
use proptest::prelude::*;

// ------------------------------------------------------------------ adjacency

#[test]
fn fan_turns_counter_clockwise_through_all_triangles_of_every_vertex() {
    let closed = common::closed_meshes().into_iter().map(|(name, mesh, _)| (name, mesh));
    let open = common::open_meshes().into_iter().map(|(name, mesh, _)| (name, mesh));
    for (name, mesh) in closed.chain(open) {
        let adjacency = Adjacency::new(&mesh);
        let mut uses = vec![0; mesh.points.len()];
        mesh.triangles.iter().flatten().for_each(|&v| uses[v as usize] += 1);
        for v in 0..mesh.points.len() as u32 {
            let fan: Vec<u32> = adjacency.fan(v).collect();
            assert_eq!(fan.len(), uses[v as usize], "{name} vertex {v}");
            assert!(fan.iter().all(|&h| mesh.origin(h) == v));
            for pair in fan.windows(2) {
                assert_eq!(mesh.origin(previous(pair[0])), mesh.origin(next(pair[1])), "{name} vertex {v}");
            }
            if adjacency.is_boundary_vertex(v) {
                assert_eq!(adjacency.opposite[fan[0] as usize], NONE);
                assert_eq!(adjacency.opposite[previous(fan[fan.len() - 1]) as usize], NONE);
            }
        }
    }
}

#[test]
fn opposite_half_edges_run_against_each_other() {
    let mesh = shapes::torus(2.0, 0.5, 12, 8);
    let adjacency = Adjacency::new(&mesh);
    for h in 0..adjacency.opposite.len() as u32 {
        let g = adjacency.opposite[h as usize];
        assert_eq!(adjacency.opposite[g as usize], h);
        assert_eq!((mesh.origin(h), mesh.origin(next(h))), (mesh.origin(next(g)), mesh.origin(g)));
    }
}

// ------------------------------------------------------------------ diagnosis and repair

#[test]
fn diagnosis_of_made_meshes_gives_their_genus_and_loops() {
    for (name, mesh, genus) in common::closed_meshes() {
        let d = diagnose(&mesh);
        assert_eq!((d.watertight, d.manifold, d.genus, d.boundary_loops), (true, true, Some(genus), 0), "{name}");
        assert_eq!((d.components, d.flipped_faces, d.degenerate_faces, d.inverted_components), (1, 0, 0, 0), "{name}");
    }
    for (name, mesh, loops) in common::open_meshes() {
        let d = diagnose(&mesh);
        assert_eq!((d.watertight, d.manifold, d.genus, d.boundary_loops), (false, true, Some(0), loops), "{name}");
    }
    let box_ = diagnose(&shapes::cuboid(DVec3::new(1.0, 2.0, 3.0), 3));
    assert!((box_.area - 22.0).abs() < 1e-12 && (box_.volume.unwrap() - 6.0).abs() < 1e-12);
}

/// The table of the data set: triangles, vertices, watertight, Euler number, loops, degenerate faces.
#[test]
fn diagnosis_agrees_with_the_table_of_the_data_set() {
    for (name, triangles, vertices, watertight, euler, loops, degenerate) in [
        ("armadillo.ply", 86_482, 43_243, true, 2, 0, 0),
        ("bunny.ply", 69_451, 35_947, false, -3, 5, 0),
        ("dragon.ply", 871_414, 437_645, false, -197, 407, 367),
        ("fandisk.ply", 12_946, 6_475, true, 2, 0, 0),
        ("rocker_arm.ply", 20_088, 10_044, true, 0, 0, 0),
        ("joint.ply", 41_808, 20_902, true, -2, 0, 0),
        ("casting.ply", 10_224, 5_096, true, -16, 0, 0),
        ("sharp_sphere.ply", 20_882, 10_443, true, 2, 0, 0),
        ("turbine_blade.ply", 199_034, 99_519, true, 2, 0, 0),
        ("horse.ply", 96_966, 48_485, true, 2, 0, 0),
        ("gargoyle.ply", 96_676, 48_340, true, 2, 0, 0),
        ("goathead.ply", 5_522, 2_763, true, 2, 0, 0),
        ("sword.ply", 44_582, 22_293, true, 2, 0, 0),
        ("acute_wedge_15.ply", 8_192, 4_098, true, 2, 0, 0),
        ("thin_sheet.ply", 62_464, 31_234, true, 2, 0, 0),
    ] {
        let Some(mesh) = common::data_mesh(name) else { continue };
        let d = diagnose(&mesh);
        assert_eq!((d.triangles, d.vertices, d.watertight), (triangles, vertices, watertight), "{name}");
        assert_eq!((d.euler, d.boundary_loops, d.degenerate_faces), (euler, loops, degenerate), "{name}");
        assert_eq!((d.non_manifold_edges, d.non_manifold_vertices, d.duplicate_faces), (0, 0, 0), "{name}");
        assert_eq!(d.unreferenced_vertices, if name == "bunny.ply" { 1_113 } else { 0 }, "{name}");
        let (mended, repairs) = repair(&mesh, &Silent).unwrap();
        assert_sound(&mended, name);
        if watertight {
            assert!(!repairs.any(), "{name}: {repairs:?}");
            assert_eq!(mended, mesh, "{name}");
        }
        if name == "dragon.ply" {
            let after = diagnose(&mended);
            println!("dragon: {repairs:?}\n{after:?}");
            assert!(repairs.welded_vertices > 1_500 && after.boundary_loops < 407 && after.components < 151);
        }
    }
}

fn assert_sound(mesh: &TriMesh, name: &str) {
    let d = diagnose(mesh);
    assert!(d.manifold && d.flipped_faces == 0 && d.genus.is_some(), "{name}: {d:?}");
    assert_eq!((d.duplicate_faces, d.unreferenced_vertices), (0, 0), "{name}");
    let adjacency = Adjacency::new(mesh);
    let open = adjacency.opposite.iter().filter(|&&h| h == NONE).count();
    assert_eq!(open, d.boundary_edges, "{name}: adjacency and diagnosis see the same boundary");
}

#[test]
fn repair_leaves_sound_meshes_as_they_are() {
    let closed = common::closed_meshes().into_iter().map(|(name, mesh, _)| (name, mesh));
    let open = common::open_meshes().into_iter().map(|(name, mesh, _)| (name, mesh));
    for (name, mesh) in closed.chain(open) {
        let (mended, repairs) = repair(&mesh, &Silent).unwrap();
        assert_eq!(mended, mesh, "{name}");
        assert!(!repairs.any(), "{name}");
    }
}

#[test]
fn repair_makes_a_sphere_of_a_soup_with_flips_duplicates_and_stray_vertices_and_carries_colours() {
    let sphere = shapes::sphere(1.0, 2);
    let mut soup = TriMesh::default();
    soup.points.push(DVec3::splat(9.0));
    for (t, tri) in sphere.triangles.iter().enumerate() {
        let base = soup.points.len() as u32;
        soup.points.extend(tri.map(|v| sphere.points[v as usize]));
        soup.triangles.push(if t % 3 == 0 { [base, base + 2, base + 1] } else { [base, base + 1, base + 2] });
    }
    soup.triangles.push([1, 2, 2]);
    soup.triangles.push(soup.triangles[5]);
    let values = soup.points.iter().flat_map(|p| p.to_array().map(|x| x as f32)).collect();
    soup.attributes.push(Attribute { name: "color".into(), width: 3, values });
    let (mended, repairs) = repair(&soup, &Silent).unwrap();
    let d = diagnose(&mended);
    assert_eq!((d.watertight, d.vertices, d.triangles, d.genus), (true, 162, 320, Some(0)));
    assert!(d.volume.unwrap() > 3.9, "{:?}", d.volume);
    assert_eq!((repairs.repeated_faces, repairs.duplicate_faces, repairs.unreferenced_vertices), (1, 1, 1));
    for (v, p) in mended.points.iter().enumerate() {
        assert_eq!(mended.attributes[0].values[3 * v..3 * v + 3], p.to_array().map(|x| x as f32));
    }
}

#[test]
fn repair_turns_a_closed_piece_that_is_inside_out_but_keeps_a_void() {
    let mut mesh = shapes::sphere(1.0, 2);
    let n = mesh.points.len() as u32;
    let inner = shapes::sphere(0.5, 2);
    mesh.points.extend(&inner.points);
    mesh.triangles.extend(inner.triangles.iter().map(|t| [t[0] + n, t[2] + n, t[1] + n]));
    let (kept, repairs) = repair(&mesh, &Silent).unwrap();
    assert_eq!((kept, repairs.turned_components), (mesh.clone(), 0));
    for p in &mut mesh.points[n as usize..] {
        p.x += 3.0;
    }
    let (turned, repairs) = repair(&mesh, &Silent).unwrap();
    assert_eq!(repairs.turned_components, 1);
    assert_eq!(diagnose(&turned).inverted_components, 0);
}

#[test]
fn repair_cuts_three_sheets_at_one_edge_a_moebius_band_and_two_cones_at_one_apex() {
    let book = TriMesh::new(
        [[0., 0., 0.], [0., 0., 1.], [1., 0., 0.], [-1., 0.2, 0.], [0., 1., 0.]].map(DVec3::from_array).to_vec(),
        vec![[0, 1, 2], [0, 1, 3], [1, 0, 4]],
    );
    let (mended, repairs) = repair(&book, &Silent).unwrap();
    assert_eq!((repairs.cut_edges, mended.points.len()), (1, 9));
    assert_sound(&mended, "book");

    let n = 24;
    let mut band = shapes::sheet(n, 2, false, false, |u, v| {
        let (a, w) = (std::f64::consts::TAU * u, v - 0.5);
        let r = 2.0 + w * (a / 2.0).cos();
        DVec3::new(r * a.cos(), r * a.sin(), w * (a / 2.0).sin())
    });
    for t in &mut band.triangles {
        for v in t {
            if *v % (n as u32 + 1) == n as u32 {
                *v = (2 - *v / (n as u32 + 1)) * (n as u32 + 1);
            }
        }
    }
    assert_eq!(diagnose(&band).genus, None);
    let (mended, repairs) = repair(&band, &Silent).unwrap();
    assert!(repairs.one_sided_edges >= 2);
    assert_sound(&mended, "band");
    assert_eq!(mended.triangles.len(), band.triangles.len());

    let cones = TriMesh::new(
        [[0., 0., 0.], [1., 0., 1.], [0., 1., 1.], [-1., -1., 1.], [1., 0., -1.], [0., 1., -1.]]
            .map(DVec3::from_array)
            .to_vec(),
        vec![[0, 1, 2], [0, 2, 3], [0, 5, 4]],
    );
    let (mended, repairs) = repair(&cones, &Silent).unwrap();
    assert_eq!((repairs.split_vertices, mended.points.len()), (1, 7));
    assert_sound(&mended, "cones");
}

#[test]
fn repair_removes_triangles_without_height_and_leaves_no_hole() {
    // A box with a vertex put on an edge of one triangle only (a cap), and a doubled vertex (needles).
    let mut mesh = shapes::cuboid(DVec3::ONE, 3);
    let [a, b, c] = mesh.triangles[20];
    let m = mesh.points.len() as u32;
    mesh.points.push((mesh.points[a as usize] + mesh.points[b as usize]) / 2.0);
    mesh.triangles[20] = [m, b, c];
    mesh.triangles.extend([[a, m, c], [a, b, m]]);
    assert_eq!((diagnose(&mesh).watertight, diagnose(&mesh).degenerate_faces), (true, 1));
    let (mended, repairs) = repair(&mesh, &Silent).unwrap();
    let d = diagnose(&mended);
    assert_eq!((d.watertight, d.degenerate_faces, repairs.degenerate_left), (true, 0, 0), "{repairs:?}");
    assert_eq!(repairs.flipped_edges, 1);
    assert!((d.volume.unwrap() - 1.0).abs() < 1e-12);

    let mut mesh = shapes::sphere(1.0, 2);
    // Split an edge into a doubled one: its two triangles become four, two of them needles.
    let adjacency = Adjacency::new(&mesh);
    let (h, g) = (0, adjacency.opposite[0]);
    let (a, b) = (mesh.origin(h), mesh.origin(g));
    let (c, d) = (mesh.origin(previous(h)), mesh.origin(previous(g)));
    let twin = mesh.points.len() as u32;
    mesh.points.push(mesh.points[a as usize]);
    mesh.triangles[h as usize / 3] = [twin, b, c];
    mesh.triangles[g as usize / 3] = [b, twin, d];
    mesh.triangles.extend([[a, twin, c], [twin, a, d]]);
    assert!(diagnose(&mesh).watertight);
    let (mended, repairs) = repair(&mesh, &Silent).unwrap();
    assert_eq!((repairs.collapsed_edges, repairs.degenerate_left), (1, 0));
    assert_eq!((mended.triangles.len(), diagnose(&mended).genus), (320, Some(0)));
}

#[test]
fn repair_leaves_a_two_sided_sheet_open() {
    let front = shapes::rectangle(1.0, 1.0, 3, 3);
    let mut both = front.clone();
    let n = both.points.len() as u32;
    both.points.extend(&front.points);
    both.triangles.extend(front.triangles.iter().map(|t| [t[0] + n, t[2] + n, t[1] + n]));
    let (mended, repairs) = repair(&both, &Silent).unwrap();
    assert_eq!((repairs.welded_vertices, diagnose(&mended).components), (0, 2));
}

#[test]
fn repair_welds_a_crack_whose_triangles_are_slivers() {
    // Two halves of a square; beside the crack each has a triangle a thousandth as high as long, and with its third
    // corner beyond the end of the edge both seem to lie on the same side of it.
    let mut sheet = TriMesh::new(
        [[0., 0.], [0., 1.], [1., 1.002], [-1., 1.], [0.0002, 1.001], [0.0001, 1.0005]]
            .map(|[x, y]: [f64; 2]| DVec3::new(x, y, 0.0))
            .to_vec(),
        vec![[0, 4, 1], [0, 2, 4], [0, 1, 5], [0, 5, 3]],
    );
    sheet.points[5].x = -1e-7;
    sheet.points[4].z = 1e-3;
    sheet.points[5].z = 1e-3;
    let whole = repair(&sheet, &Silent).unwrap().0;
    let n = sheet.points.len() as u32;
    let ends = [sheet.points[0], sheet.points[1]];
    sheet.points.extend(ends);
    sheet.triangles[2] = [n, n + 1, 5];
    sheet.triangles[3] = [n, 5, 3];
    let (mended, repairs) = repair(&sheet, &Silent).unwrap();
    assert_eq!((repairs.welded_vertices, mended.triangles.len()), (2, whole.triangles.len()));
    assert_eq!(diagnose(&mended).boundary_loops, 1);
}

#[test]
fn repair_closes_holes_that_are_less_than_a_hundredth_of_the_diagonal_around() {
    let mut mesh = shapes::sphere(1.0, 4);
    mesh.triangles.pop();
    let edge = mesh.points[0].distance(mesh.points[mesh.triangles[0][1] as usize]);
    let around = 3.0 * edge / mesh.bounds().diagonal();
    assert!(around > 0.05);
    let (mended, repairs) = repair(&mesh, &Silent).unwrap();
    assert_eq!((repairs.closed_holes, diagnose(&mended).boundary_loops), (0, 1));
    // The same beside something large.
    let n = mesh.points.len() as u32;
    let large = shapes::sphere(30.0, 2);
    mesh.points.extend(large.points.iter().map(|&p| p + DVec3::X * 40.0));
    mesh.triangles.extend(large.triangles.iter().map(|t| t.map(|v| v + n)));
    let (mended, repairs) = repair(&mesh, &Silent).unwrap();
    assert_eq!((repairs.closed_holes, diagnose(&mended).boundary_loops), (1, 0));
    assert_eq!(mended.triangles.len(), mesh.triangles.len() + 1);
}

#[test]
fn repair_tells_missing_vertices_infinite_ones_and_nothing() {
    let mut mesh = shapes::sphere(1.0, 0);
    mesh.triangles[3][1] = 99;
    assert_eq!(repair(&mesh, &Silent).unwrap_err(), MeshError::BadIndex { triangle: 3, vertex: 99, count: 12 });
    assert_eq!(diagnose(&mesh).bad_indices, 1);
    let mut mesh = shapes::sphere(1.0, 0);
    mesh.points[4].y = f64::NAN;
    assert_eq!(repair(&mesh, &Silent).unwrap_err(), MeshError::NotFinite { vertex: 4 });
    assert_eq!(diagnose(&mesh).non_finite_vertices, 1);
    assert_eq!(repair(&TriMesh::default(), &Silent).unwrap_err(), MeshError::Empty);
    assert_eq!(diagnose(&TriMesh::default()).components, 0);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]
    #[test]
    fn repair_makes_a_manifold_of_any_soup_of_up_to_30_triangles(
        triangles in prop::collection::vec(prop::array::uniform3(0u32..9), 1..30)
    ) {
        let points = (0..9).map(|k| DVec3::new(random::unit(1, 3 * k), random::unit(1, 3 * k + 1), random::unit(1, 3 * k + 2)));
        let soup = TriMesh::new(points.collect(), triangles);
        diagnose(&soup);
        if let Ok((mended, _)) = repair(&soup, &Silent) {
            assert_sound(&mended, "soup");
            assert_sound(&repair(&mended, &Silent).unwrap().0, "soup again");
        }
    }
}

// ------------------------------------------------------------------ walking

fn assert_valid(place: FacePoint) {
    assert!(place.bary.iter().all(|&b| b >= 0.0), "{place:?}");
    assert!((place.bary.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{place:?}");
}

fn any_place(mesh: &TriMesh, seed: u64, kind: u64) -> FacePoint {
    let face = random::bits(seed, 0) % mesh.triangles.len() as u64;
    let (u, v) = (random::unit(seed, 1), random::unit(seed, 2));
    let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
    let bary = match kind % 4 {
        0 => [1.0, 0.0, 0.0],
        1 => [0.0, u, 1.0 - u],
        _ => [u, v, 1.0 - u - v],
    };
    FacePoint { face: face as u32, bary }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn walk_stays_a_place_of_the_mesh_and_never_goes_further_than_the_vector(
        seed in 0u64..1_000_000, kind in 0u64..4, shape in 0usize..10, size in -3.0..1.0f64
    ) {
        thread_local!(static MESHES: Vec<(TriMesh, Adjacency)> = {
            let closed = common::closed_meshes().into_iter().map(|m| m.1);
            closed.chain(common::open_meshes().into_iter().map(|m| m.1)).map(|m| { let a = Adjacency::new(&m); (m, a) }).collect()
        });
        MESHES.with(|meshes| {
            let (mesh, adjacency) = &meshes[shape];
            let start = any_place(mesh, seed, kind);
            let v = (DVec3::new(random::unit(seed, 5), random::unit(seed, 6), random::unit(seed, 7)) - 0.5) * 10f64.powf(size);
            let end = move_point_on_surface(mesh, adjacency, start, v);
            assert_valid(end);
            let moved = end.position(mesh).distance(start.position(mesh));
            assert!(moved <= v.length() * (1.0 + 1e-9) + 1e-12, "{moved} of {}", v.length());
        });
    }

    #[test]
    fn walk_on_a_plane_equals_p_plus_v_within_1e_12(seed in 0u64..1_000_000, kind in 0u64..4) {
        let mesh = shapes::rectangle(4.0, 4.0, 16, 16);
        let adjacency = Adjacency::new(&mesh);
        let start = any_place(&mesh, seed, kind);
        let p = start.position(&mesh);
        let goal = DVec3::new(4.0 * random::unit(seed, 8), 4.0 * random::unit(seed, 9), 0.0);
        let up = DVec3::new(0.0, 0.0, random::unit(seed, 10));
        let end = move_point_on_surface(&mesh, &adjacency, start, goal - p + up);
        assert_valid(end);
        prop_assert!(end.position(&mesh).distance(goal) < 1e-12, "{:?} {goal}", end.position(&mesh));
    }
}

#[test]
fn walk_on_a_fine_cylinder_is_straight_when_unrolled_within_half_a_percent() {
    let mesh = shapes::sheet(720, 200, true, false, |u, v| {
        let a = std::f64::consts::TAU * u;
        DVec3::new(a.cos(), a.sin(), 4.0 * v)
    });
    let adjacency = Adjacency::new(&mesh);
    let bvh = Bvh::new(&mesh);
    for (turn, rise) in [(1.0, 0.0), (1.5, 1.0), (0.3, 2.0), (-2.0, 0.7)] {
        let start = bvh.closest(DVec3::new(1.0, 0.001, 1.0)).place;
        let end = move_point_on_surface(&mesh, &adjacency, start, DVec3::new(0.0, turn, rise)).position(&mesh);
        let angle = end.y.atan2(end.x) - 0.001;
        assert!((angle - turn).abs() < 0.01 && (end.z - 1.0 - rise).abs() < 0.01, "{angle} {}", end.z - 1.0);
    }
}

#[test]
fn walk_slides_along_a_straight_boundary_and_stops_at_the_corner() {
    let mesh = shapes::rectangle(2.0, 1.0, 8, 4);
    let adjacency = Adjacency::new(&mesh);
    let start = Bvh::new(&mesh).closest(DVec3::new(0.55, 0.3, 0.0)).place;
    let end = move_point_on_surface(&mesh, &adjacency, start, DVec3::new(0.7, -0.9, 0.0)).position(&mesh);
    assert!(end.distance(DVec3::new(1.25, 0.0, 0.0)) < 1e-12, "{end}");
    let end = move_point_on_surface(&mesh, &adjacency, start, DVec3::new(9.0, -9.0, 0.0)).position(&mesh);
    assert!(end.distance(DVec3::new(2.0, 0.0, 0.0)) < 1e-12, "{end}");
}

#[test]
fn walk_goes_through_triangles_without_area_and_ends_among_nothing_else() {
    // A strip with a cap and a needle in the middle of the way.
    let p = [[0., 0., 0.], [1., 0., 0.], [2., 0., 0.], [0., 1., 0.], [1., 1., 0.], [2., 1., 0.], [1., 0.5, 0.]];
    let points: Vec<DVec3> = p.map(DVec3::from_array).to_vec();
    let mesh = TriMesh::new(points, vec![[0, 1, 3], [1, 6, 3], [6, 4, 3], [1, 4, 6], [1, 2, 4], [2, 5, 4]]);
    let adjacency = Adjacency::new(&mesh);
    let start = FacePoint { face: 0, bary: [0.5, 0.2, 0.3] };
    let goal = DVec3::new(1.6, 0.7, 0.0);
    let end = move_point_on_surface(&mesh, &adjacency, start, goal - start.position(&mesh));
    assert!(end.position(&mesh).distance(goal) < 1e-12, "{:?}", end.position(&mesh));
    let from_inside = FacePoint { face: 3, bary: [0.3, 0.3, 0.4] };
    let end = move_point_on_surface(&mesh, &adjacency, from_inside, goal - from_inside.position(&mesh));
    assert!(end.position(&mesh).distance(goal) < 1e-12, "{:?}", end.position(&mesh));

    // Nothing but degenerate triangles, in all ways, and vectors that are no numbers.
    for corners in
        [[[0.0; 3]; 3], [[0., 0., 0.], [1., 0., 0.], [2., 0., 0.]], [[0., 0., 0.], [1., 0., 0.], [1., 0., 0.]]]
    {
        let flat = TriMesh::new(corners.map(DVec3::from_array).to_vec(), vec![[0, 1, 2], [2, 1, 0]]);
        let adjacency = Adjacency::new(&flat);
        for kind in 0..4 {
            for v in [DVec3::X, DVec3::new(-1.0, 2.0, 1e-9), DVec3::NAN, DVec3::INFINITY, DVec3::splat(1e300)] {
                assert_valid(move_point_on_surface(&flat, &adjacency, any_place(&flat, 3, kind), v));
            }
        }
    }
}

#[test]
fn walk_pulled_towards_a_point_arrives_at_the_distance_of_the_closest_place_within_1e_4() {
    let mesh = shapes::sphere(1.0, 5);
    let adjacency = Adjacency::new(&mesh);
    let goal = DVec3::new(0.3, -0.4, 1.2);
    let mut place = FacePoint::corner(17, 0);
    for _ in 0..60 {
        place = move_point_on_surface(&mesh, &adjacency, place, goal - place.position(&mesh));
    }
    let best = Bvh::new(&mesh).closest(goal).distance;
    assert!(place.position(&mesh).distance(goal) - best < 1e-4, "{} {best}", place.position(&mesh).distance(goal));
}

#[test]
fn walk_on_a_curve_keeps_arc_length_and_stops_or_goes_round() {
    let square = [[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.]].map(DVec3::from_array);
    let start = CurvePlace { segment: 0, share: 0.5 };
    let at = |closed, s| move_point_on_curve(&square, closed, start, s).position(&square);
    assert!(at(false, 1.0).distance(DVec3::new(1.0, 0.5, 0.0)) < 1e-15);
    assert!(at(false, 9.0).distance(square[3]) < 1e-15);
    assert!(at(false, -9.0).distance(square[0]) < 1e-15);
    assert!(at(true, 3.0).distance(DVec3::new(0.0, 0.5, 0.0)) < 1e-15);
    assert!(at(true, -1.0).distance(DVec3::new(0.0, 0.5, 0.0)) < 1e-15);
    assert!(at(true, 42.0).distance(at(true, 2.0)) < 1e-12);
}

// ------------------------------------------------------------------ paths

#[test]
fn shortest_path_equals_dijkstra_and_greedy_arrives_on_all_meshes() {
    for (name, mesh, _) in common::closed_meshes() {
        let adjacency = Adjacency::new(&mesh);
        let n = mesh.points.len() as u32;
        let field = path::distances(&mesh, &adjacency, &[(0, 0.0)], |_| 1.0, f64::INFINITY);
        for to in [1, n / 3, n / 2, n - 1] {
            let length = |chain: &[u32]| -> f64 {
                chain.windows(2).map(|w| mesh.points[w[0] as usize].distance(mesh.points[w[1] as usize])).sum()
            };
            let best = path::shortest(&mesh, &adjacency, 0, to, |_| 1.0, 1.0).unwrap();
            assert!((length(&best) - field.distance[to as usize]).abs() < 1e-9, "{name}");
            let greedy = path::greedy(&mesh, &adjacency, 0, to).unwrap();
            assert!(greedy[0] == 0 && greedy[greedy.len() - 1] == to);
            assert!(length(&greedy) >= length(&best) - 1e-9, "{name}");
            let places = path::places(&mesh, &adjacency, &greedy);
            assert_eq!(places.len(), greedy.len());
            for (k, place) in places.iter().enumerate() {
                assert_eq!(place.position(&mesh), mesh.points[greedy[k] as usize]);
                if k + 1 < greedy.len() {
                    assert!(mesh.triangles[place.face as usize].contains(&greedy[k + 1]));
                }
            }
        }
    }
}

#[test]
fn there_is_no_path_between_two_spheres() {
    let mesh = shapes::two_spheres(2);
    let adjacency = Adjacency::new(&mesh);
    let last = mesh.points.len() as u32 - 1;
    assert_eq!(path::greedy(&mesh, &adjacency, 0, last), None);
    assert_eq!(path::shortest(&mesh, &adjacency, 0, last, |_| 1.0, 1.0), None);
}

// ------------------------------------------------------------------ closest places and rays

#[test]
fn closest_place_agrees_with_brute_force_within_1e_12() {
    for (name, mesh, _) in common::closed_meshes() {
        let bvh = Bvh::new(&mesh);
        for k in 0..60 {
            let p =
                DVec3::new(random::unit(5, 3 * k), random::unit(5, 3 * k + 1), random::unit(5, 3 * k + 2)) * 4.0 - 2.0;
            let hit = bvh.closest(p);
            let brute =
                (0..mesh.triangles.len()).map(|t| triangle_distance(mesh.corners(t), p)).fold(f64::INFINITY, f64::min);
            assert!((hit.distance - brute).abs() < 1e-12, "{name}: {} {brute}", hit.distance);
            assert!(hit.place.position(&mesh).distance(hit.position) < 1e-12, "{name}");
            assert_valid(hit.place);
        }
    }
}

/// Distance to a triangle by trying its plane, its edges and its corners.
fn triangle_distance([a, b, c]: [DVec3; 3], p: DVec3) -> f64 {
    let segment = |a: DVec3, b: DVec3| {
        let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
        p.distance(a.lerp(b, t))
    };
    let mut best = segment(a, b).min(segment(b, c)).min(segment(c, a));
    let n = (b - a).cross(c - a).normalize();
    let q = p - n * (p - a).dot(n);
    let inside = |a: DVec3, b: DVec3| (b - a).cross(q - a).dot(n) >= 0.0;
    if inside(a, b) && inside(b, c) && inside(c, a) {
        best = best.min(p.distance(q));
    }
    best
}

#[test]
fn no_ray_slips_through_vertices_edge_midpoints_or_faces_of_closed_meshes() {
    for (name, mesh, _) in common::closed_meshes() {
        let bvh = Bvh::new(&mesh);
        let center = mesh.bounds().center();
        let reach = 4.0 * mesh.bounds().diagonal();
        let adjacency = Adjacency::new(&mesh);
        // Targets, and the triangles around each.
        let mut targets: Vec<(DVec3, Vec<usize>)> = (0..mesh.points.len())
            .map(|v| (mesh.points[v], adjacency.fan(v as u32).map(|h| h as usize / 3).collect()))
            .collect();
        for h in 0..adjacency.opposite.len() {
            let [a, b, c] = mesh.corners(h / 3);
            let middle = [(a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0][h % 3];
            targets.push((middle, vec![h / 3, adjacency.opposite[h] as usize / 3]));
            targets.push(((a + b + c) / 3.0, vec![h / 3]));
        }
        let mut tried = 0;
        for (k, (target, around)) in targets.iter().enumerate() {
            // Where the surface turns away from the ray, the ray may pass it by.
            let toward = (*target - center).normalize_or(DVec3::X);
            let facing: Vec<f64> = around.iter().map(|&t| mesh.normal(t).dot(toward)).collect();
            if !(facing.iter().all(|&f| f > 0.01) || facing.iter().all(|&f| f < -0.01)) {
                continue;
            }
            tried += 1;
            // From outside, aimed beyond the target from far away along the line from the middle.
            let away = (*target - center).normalize_or(DVec3::X);
            let origin = *target + away * mesh.bounds().diagonal();
            let hit = bvh.first_hit(origin, -away, reach);
            let hit = hit.unwrap_or_else(|| panic!("{name}: ray {k} slips through"));
            assert!(hit.distance <= origin.distance(*target) + 1e-9, "{name}: ray {k}");
            let n = mesh.area_vector(hit.face as usize);
            let d = (origin - away * hit.distance - mesh.corners(hit.face as usize)[0]).dot(n.normalize());
            assert!(d.abs() < 1e-9, "{name}: the face is not where the ray ends");
        }
        assert!(tried > targets.len() / 2, "{name}: {tried} of {}", targets.len());
    }
}

// ------------------------------------------------------------------ comparison

#[test]
fn comparison_of_spheres_of_radius_1_and_1_01_gives_a_distance_of_0_01_within_2_percent() {
    let (a, b) = (shapes::sphere(1.0, 5), shapes::sphere(1.01, 5));
    let params = CompareParams { samples: 20_000, seed: 3 };
    let c = compare(&a, &b, &params, &Silent).unwrap();
    for s in [c.a_to_b, c.b_to_a, c.both] {
        assert!((s.mean / 0.01 - 1.0).abs() < 0.02 && (s.max / 0.01 - 1.0).abs() < 0.05, "{s:?}");
    }
    assert!(c.normal_deg.mean < 0.5 && c.flipped_share == 0.0);
    assert!((c.both_rel.rms - c.both.rms / c.diagonal).abs() < 1e-15);
    let same = compare(&a, &a, &params, &Silent).unwrap();
    assert!(same.both.max < 1e-12);
}

#[test]
fn comparison_sees_flipped_faces_and_one_sided_differences() {
    let a = shapes::rectangle(1.0, 1.0, 4, 4);
    let mut b = shapes::rectangle(2.0, 1.0, 8, 4);
    b.triangles.iter_mut().for_each(|t| t.swap(0, 1));
    let c = compare(&a, &b, &CompareParams { samples: 40_000, seed: 0 }, &Silent).unwrap();
    assert!(c.a_to_b.max < 1e-12 && c.flipped_share == 1.0);
    // Half of b lies beside a, at distances spread evenly over 0 to 1: mean 1/4, rms sqrt(1/6), p95 0.9.
    assert!((c.b_to_a.mean - 0.25).abs() < 0.005 && (c.b_to_a.rms - (1f64 / 6.0).sqrt()).abs() < 0.005);
    assert!((c.b_to_a.p95 - 0.9).abs() < 0.01, "{:?}", c.b_to_a);
}

#[test]
fn comparison_is_bitwise_equal_on_1_and_4_threads() {
    let (a, b) = (planish::synthetic::demo(1, 4_000), shapes::sphere(1.0, 3));
    let run = |n| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        pool.install(|| compare(&a, &b, &CompareParams { samples: 30_000, seed: 1 }, &Silent).unwrap())
    };
    assert_eq!(run(1), run(4));
}

#[test]
fn comparison_tells_empty_meshes_and_no_samples() {
    let (good, empty) = (shapes::sphere(1.0, 1), TriMesh::default());
    let run = |a, b, samples| compare(a, b, &CompareParams { samples, seed: 0 }, &Silent).unwrap_err();
    assert_eq!(run(&good, &empty, 10), CompareError::NoArea { which: 'b', triangles: 0 });
    assert_eq!(run(&good, &good, 0), CompareError::NoSamples);
}

#[test]
fn two_triangles_that_touch_in_a_point_come_apart_with_their_attributes() {
    let points = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]];
    let mut mesh = TriMesh::new(points.map(|[x, y]| DVec3::new(x, y, 0.0)).to_vec(), vec![[0, 1, 2], [0, 3, 4]]);
    let values = vec![5.0, 1.0, 2.0, 3.0, 4.0];
    mesh.attributes.push(Attribute { name: "heat".into(), width: 1, values });
    let (parted, source) = part_fans(&mesh);
    assert_eq!(source, [0, 1, 2, 3, 4, 0]);
    assert_eq!(parted.triangles, [[0, 1, 2], [5, 3, 4]]);
    assert_eq!(parted.attributes[0].values[5], 5.0);
    assert!(!diagnose(&mesh).manifold && diagnose(&parted).manifold);
    assert_eq!(part_fans(&shapes::sphere(1.0, 2)).0.points.len(), shapes::sphere(1.0, 2).points.len());
}

/// A cube of side 1 with cells of 1/32, as a scan with noise of half a cell leaves it: the faces wavy by a tenth of the noise,
/// leaning outwards by some degrees within two cells of the edges, and the edges off by a third of it.
fn scanned_cube() -> (TriMesh, FeatureTags, ScanScale) {
    let n = 32;
    let mut mesh = shapes::cuboid(DVec3::ONE, n);
    let adjacency = Adjacency::new(&mesh);
    let sharp = sharp_edges(&mesh, &adjacency, 40.0);
    let ends = |h: usize| [mesh.origin(h as u32), mesh.origin(next(h as u32))];
    let tags = FeatureTags::from_edges(mesh.points.len(), (0..sharp.len()).filter(|&h| sharp[h]).map(ends));
    let scale = ScanScale { noise: 0.5 / n as f64, spacing: 0.6 / n as f64, cell: 1.0 / n as f64 };
    for (v, p) in mesh.points.iter_mut().enumerate() {
        let r = |k: u64| random::normal(random::unit(5, 6 * v as u64 + k), random::unit(5, 6 * v as u64 + k + 1));
        let on = p.abs().cmpge(DVec3::splat(0.5 - 1e-9));
        let outwards = DVec3::select(on, p.signum(), DVec3::ZERO);
        if tags.vertices[v] != FeatureKind::None {
            *p += outwards * DVec3::new(r(0), r(2), r(4)) * (0.3 * scale.noise);
        } else {
            let rim = 0.5 - DVec3::select(on, DVec3::ZERO, p.abs()).max_element();
            let lean = 0.1 * (1.0 - rim / (2.0 * scale.cell)).max(0.0) * scale.cell;
            *p += outwards * (0.1 * scale.noise * r(0) + lean);
        }
    }
    (mesh, tags, scale)
}

/// Root mean squares of how far the vertices of lines are from the edges of the unit cube, and how far the angles across its
/// edges, between the mean normals up to two cells away, are from 90 degrees.
fn line_errors(mesh: &TriMesh, tags: &FeatureTags) -> (f64, f64) {
    let rms = |errors: &[f64]| (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
    let on_line = |v: &usize| tags.vertices[*v] == FeatureKind::Edge;
    let off = |p: DVec3| {
        let mut d = (p.abs() - 0.5).to_array();
        d.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
        d[0].hypot(d[1])
    };
    let offs: Vec<f64> = (0..mesh.points.len()).filter(on_line).map(|v| off(mesh.points[v])).collect();
    let centers: Vec<DVec3> =
        (0..mesh.triangles.len()).map(|t| mesh.corners(t).into_iter().sum::<DVec3>() / 3.0).collect();
    let mut angles = Vec::new();
    for k in 2..30 {
        // Along the edge at x = y = 1/2.
        let z = k as f64 / 32.0 - 0.5;
        let side = |axis: usize| {
            let other = 1 - axis;
            let near = |t: &usize| {
                let c = centers[*t];
                let n = mesh.normal(*t);
                (c.z - z).abs() < 1.0 / 32.0 && c[other] > 0.5 - 2.0 / 32.0 && c[axis] > 0.3 && n[axis] > 0.7
            };
            (0..centers.len()).filter(near).map(|t| mesh.area_vector(t)).sum::<DVec3>()
        };
        angles.push(side(0).angle_between(side(1)).to_degrees() - 90.0);
    }
    (rms(&offs), rms(&angles))
}

#[test]
fn lines_of_a_scanned_cube_come_three_times_as_near_and_their_angles_within_a_third() {
    let (mut mesh, mut tags, scale) = scanned_cube();
    let before = line_errors(&mesh, &tags);
    let moved = fair_lines(&mut mesh, &mut tags, &scale, &Silent).unwrap();
    let after = line_errors(&mesh, &tags);
    assert!(moved > 1000, "{moved} moved");
    assert!(after.0 < before.0 / 3.0, "lines off by {before:?} before, {after:?} after");
    assert!(after.1 < before.1 / 3.0, "angles off by {before:?} before, {after:?} after");
    assert!(self_intersections(&mesh).is_empty());
    assert!(diagnose(&mesh).watertight);
}

#[test]
fn lines_of_an_exact_cube_stay_where_they_are_within_1e_9() {
    let (_, mut tags, scale) = scanned_cube();
    let exact = shapes::cuboid(DVec3::ONE, 32);
    let mut mesh = exact.clone();
    fair_lines(&mut mesh, &mut tags, &scale, &Silent).unwrap();
    let most = exact.points.iter().zip(&mesh.points).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    assert!(most < 1e-9, "{most:e}");
    // Nothing is known of a mesh that was not scanned.
    assert_eq!(fair_lines(&mut mesh, &mut tags, &ScanScale { noise: 0.0, ..scale }, &Silent).unwrap(), 0);
}

/// The cube with the edge at x = y = 1/2 rounded by two cells, off by a third of the noise as the other edges are; the tags are
/// those of before. And the distance of a point from the rounding, if it is on it.
fn rounded_cube() -> (TriMesh, FeatureTags, ScanScale, impl Fn(DVec3) -> Option<f64>) {
    let (mut mesh, tags, scale) = scanned_cube();
    let radius = 2.0 * scale.cell;
    let off = move |p: DVec3| {
        let from = DVec3::new(p.x - 0.5 + radius, p.y - 0.5 + radius, 0.0);
        (from.min_element() >= 0.0 && from.max_element() > 0.5 * radius).then(|| (from, from.length() - radius))
    };
    for (v, p) in mesh.points.iter_mut().enumerate() {
        if let Some((from, far)) = off(*p) {
            let noise = random::normal(random::unit(6, 2 * v as u64), random::unit(6, 2 * v as u64 + 1));
            *p += from.normalize() * (0.3 * scale.noise * noise - far);
        }
    }
    (mesh, tags, scale, move |p| off(p).filter(|_| p.z.abs() < 0.4).map(|o| o.1))
}

#[test]
fn a_rounded_edge_is_no_line_and_becomes_smooth_while_the_other_eleven_stay() {
    let (mut mesh, mut tags, scale, off) = rounded_cube();
    let rms = |mesh: &TriMesh| {
        let squares: Vec<f64> = mesh.points.iter().filter_map(|p| off(*p)).map(|d| d * d).collect();
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    };
    let (before, was) = (rms(&mesh), tags.edges.len());
    fair_lines(&mut mesh, &mut tags, &scale, &Silent).unwrap();
    let on_rounding = |e: &&[u32; 2]| e.iter().all(|&v| off(mesh.points[v as usize]).is_some());
    assert_eq!(tags.edges.iter().filter(on_rounding).count(), 0);
    assert!(tags.edges.len() > was * 10 / 12, "{} of {was} edges", tags.edges.len());
    assert!(rms(&mesh) < 0.4 * before, "off by {before} before, {} after", rms(&mesh));
}

#[test]
fn lines_are_faired_to_the_bit_on_1_and_4_threads() {
    let run = |threads| {
        let (mut mesh, mut tags, scale) = scanned_cube();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| fair_lines(&mut mesh, &mut tags, &scale, &Silent).unwrap());
        mesh
    };
    assert_eq!(run(1), run(4));
}
