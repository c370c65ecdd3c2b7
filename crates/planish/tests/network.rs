//! The network stage: layouts on shapes of known topology, and imprinting.

mod common;

use planish::geom::{polyline, random};
use planish::layout::{Known, LayoutError, LayoutParams, Method, layout};
use planish::mend::close_holes;
use planish::mesh::{Adjacency, FacePoint, FeatureTags, TriMesh, diagnose, sharp_edges};
use planish::network::{Corner, Curve, CurveKind, ImprintError, Network, Patch, Side, imprint};
use planish::pipeline::{self, Input, RunParams};
use planish::synthetic::{self, shapes};
use planish::{DVec3, Silent};

/// Shapes with the Euler number of each.
fn surfaces() -> Vec<(&'static str, TriMesh, i64)> {
    vec![
        ("sphere", shapes::sphere(1.0, 4), 2),
        ("torus", shapes::torus(1.0, 0.4, 60, 30), 0),
        ("cylinder with sharp rims", shapes::cylinder(1.0, 2.0, 48), 2),
        ("box", shapes::cuboid(DVec3::new(1.0, 2.0, 3.0), 8), 2),
        ("saddle", shapes::saddle(0.4, 24), 1),
        ("annulus", shapes::annulus(0.5, 1.0, 48), 0),
        ("double torus", shapes::double_torus(6), -2),
        ("two spheres", shapes::two_spheres(3), 4),
    ]
}

fn params(patches: usize) -> LayoutParams {
    LayoutParams { patches, ..LayoutParams::default() }
}

fn length(mesh: &TriMesh, network: &Network, kind: CurveKind) -> f64 {
    let of = |c: &Curve| c.points.windows(2).map(|w| w[0].position(mesh).distance(w[1].position(mesh))).sum::<f64>();
    network.curves.iter().filter(|c| c.kind == kind).map(of).sum()
}

#[test]
fn every_layout_is_disks_that_cover_the_mesh_to_1e_9_of_its_area() {
    for (name, mesh, euler) in surfaces() {
        let network = layout(&mesh, Known::default(), &params(24), None, &Silent)
            .unwrap_or_else(|e| panic!("{name}: {e}"))
            .network;
        let patches = imprint(&mesh, &network, &Silent).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(patches.len(), network.patches.len());
        let area = |m: &TriMesh| (0..m.triangles.len()).map(|t| m.area(t)).sum::<f64>();
        let parts: Vec<f64> = patches.iter().map(|p| area(&p.mesh)).collect();
        let (sum, whole) = (parts.iter().sum::<f64>(), area(&mesh));
        assert!((sum - whole).abs() < 1e-9 * whole, "{name}: {sum} of {whole}");
        let mean = whole / parts.len() as f64;
        let largest = parts.iter().cloned().fold(0.0, f64::max);
        assert!(largest < 8.0 * mean, "{name}: largest patch {:.1} times the mean", largest / mean);
        let count = network.corners.len() as i64 - network.curves.len() as i64 + network.patches.len() as i64;
        assert_eq!(count, euler, "{name}: corners - curves + patches");
    }
}

#[test]
fn sharp_edges_and_boundaries_are_curves_to_1e_9_of_their_length() {
    // The plate with rounded rims is out: where its rims are sharp at all, they come and go.
    for (name, mesh, _) in surfaces().into_iter().filter(|s| s.0 != "double torus") {
        let adjacency = Adjacency::new(&mesh);
        let sharp = sharp_edges(&mesh, &adjacency, 40.0);
        let (mut edges, mut rim) = (0.0, 0.0);
        for h in 0..sharp.len() as u32 {
            let (a, b) = (mesh.origin(h), mesh.origin(planish::mesh::next(h)));
            let d = mesh.points[a as usize].distance(mesh.points[b as usize]);
            if adjacency.opposite[h as usize] == planish::mesh::NONE {
                rim += d;
            } else if sharp[h as usize] {
                edges += d / 2.0;
            }
        }
        let network = layout(&mesh, Known::default(), &params(24), None, &Silent)
            .unwrap_or_else(|e| panic!("{name}: {e}"))
            .network;
        for (kind, want) in [(CurveKind::Feature, edges), (CurveKind::Boundary, rim)] {
            let got = length(&mesh, &network, kind);
            assert!((got - want).abs() <= 1e-9 * want.max(1.0), "{name}: {kind:?} {got} of {want}");
        }
    }
}

#[test]
fn corners_of_a_torus_of_60_patches_are_square_within_20_degrees_in_the_mean() {
    let mesh = shapes::torus(1.0, 0.4, 90, 45);
    let network = layout(&mesh, Known::default(), &params(60), None, &Silent).expect("a torus has a layout").network;
    assert!(network.patches.len().abs_diff(60) <= 12, "{} patches", network.patches.len());
    let mut off = Vec::new();
    for patch in imprint(&mesh, &network, &Silent).expect("disks") {
        for k in 0..4 {
            let (out, back) = (&patch.sides[k], &patch.sides[(k + 3) % 4]);
            let at = |v: u32| patch.mesh.points[v as usize];
            let (i, j) = (out.len() / 4, back.len() - 1 - back.len() / 4);
            let angle = (at(out[i.max(1)]) - at(out[0])).angle_between(at(back[j.min(back.len() - 2)]) - at(out[0]));
            off.push((angle.to_degrees() - 90.0).abs());
        }
    }
    let mean = off.iter().sum::<f64>() / off.len() as f64;
    assert!(mean < 20.0, "{mean} degrees");
}

/// Angles of the corners of patches a twentieth of their sides away, degrees.
fn near_corners(mesh: &TriMesh, network: &Network) -> Vec<f64> {
    let mut angles = Vec::new();
    for patch in imprint(mesh, network, &Silent).expect("disks") {
        for k in 0..4 {
            let points = |side: &[u32]| side.iter().map(|&v| patch.mesh.points[v as usize]).collect::<Vec<DVec3>>();
            let (out, mut back) = (points(&patch.sides[k]), points(&patch.sides[(k + 3) % 4]));
            back.reverse();
            let at = |line: &[DVec3]| {
                let length: f64 = line.windows(2).map(|w| w[0].distance(w[1])).sum();
                let mut left = length / 20.0;
                for w in line.windows(2) {
                    let step = w[0].distance(w[1]);
                    if step >= left {
                        return w[0].lerp(w[1], left / step);
                    }
                    left -= step;
                }
                line[line.len() - 1]
            };
            angles.push((at(&out) - out[0]).angle_between(at(&back) - out[0]).to_degrees());
        }
    }
    angles
}

#[test]
fn near_their_nodes_the_curves_of_a_torus_meet_at_90_degrees_within_12_in_the_mean_and_none_below_40() {
    let mesh = shapes::torus(1.0, 0.4, 180, 90);
    let network = layout(&mesh, Known::default(), &params(60), None, &Silent).expect("a torus has a layout").network;
    let angles = near_corners(&mesh, &network);
    let off = angles.iter().map(|a| (a - 90.0).abs()).sum::<f64>() / angles.len() as f64;
    let least = angles.iter().fold(f64::INFINITY, |a, &b| a.min(b));
    assert!(off < 12.0 && least > 40.0, "{off} degrees off, least {least}");
}

/// A flat square of 2 x 60 x 60 triangles whose inner vertices are moved by up to .45 of a side, each by its own.
fn jittered_sheet() -> TriMesh {
    const CELLS: usize = 60;
    shapes::sheet(CELLS, CELLS, false, false, |u, v| {
        let (i, j) = ((u * CELLS as f64).round(), (v * CELLS as f64).round());
        let is_inner = [i, j].iter().all(|&k| k > 0.0 && k < CELLS as f64);
        let off = |axis: u64| 0.9 * (random::unit(axis, (j as usize * (CELLS + 1) + i as usize) as u64) - 0.5);
        let moved = if is_inner { DVec3::new(off(1), off(2), 0.0) } else { DVec3::ZERO };
        DVec3::new(i, j, 0.0) + moved
    })
}

#[test]
fn curves_on_a_flat_sheet_of_poor_triangles_turn_by_less_than_30_degrees_in_the_mean_over_16_steps() {
    let mesh = jittered_sheet();
    let network = layout(&mesh, Known::default(), &params(16), None, &Silent).expect("a sheet has a layout").network;
    let turn = |curve: &Curve| {
        let points: Vec<DVec3> = curve.points.iter().map(|p| p.position(&mesh)).collect();
        let length = polyline::length(points.iter().copied());
        let places: Vec<DVec3> = (0..=16).map(|k| polyline::at_length(&points, length * f64::from(k) / 16.0)).collect();
        let steps: Vec<DVec3> = places.windows(2).map(|w| w[1] - w[0]).collect();
        steps.windows(2).map(|w| w[0].angle_between(w[1]).to_degrees()).sum::<f64>()
    };
    let turns: Vec<f64> = network.curves.iter().filter(|c| c.kind.is_smooth()).map(turn).collect();
    let mean = turns.iter().sum::<f64>() / turns.len() as f64;
    assert!(turns.len() >= 16 && mean < 30.0, "{} curves turn by {mean} degrees", turns.len());
}

#[test]
fn a_pinhole_in_a_sphere_of_24_patches_adds_at_most_16() {
    let mut mesh = shapes::sphere(1.0, 5);
    let whole = layout(&mesh, Known::default(), &params(24), None, &Silent).unwrap().network.patches.len();
    mesh.triangles.remove(7);
    let pierced = layout(&mesh, Known::default(), &params(24), None, &Silent).unwrap().network.patches.len();
    assert!(pierced <= whole + 16, "{pierced} patches, {whole} without the hole");
}

#[test]
fn a_sheet_of_24_patches_with_36_pinholes_has_at_most_8_more_once_they_are_closed_and_16_for_each_before() {
    let whole = shapes::rectangle(6.0, 6.0, 60, 60);
    let sheet = layout(&whole, Known::default(), &params(24), None, &Silent).unwrap().network.patches.len();
    let low = whole.bounds().min;
    let mut mesh = whole.clone();
    // Two triangles around the middle of each of 36 squares of side 1.
    mesh.triangles.retain(|t| {
        let p = t.iter().map(|&v| whole.points[v as usize]).sum::<DVec3>() / 3.0 - low;
        let off = |x: f64| (x.fract() - 0.45).abs();
        off(p.x) > 0.05 || off(p.y) > 0.05
    });
    assert_eq!(whole.triangles.len() - mesh.triangles.len(), 72);
    let pierced = layout(&mesh, Known::default(), &params(24), None, &Silent).unwrap().network.patches.len();
    assert!(pierced <= sheet + 16 * 36, "{pierced} patches, {sheet} without holes");
    let mut tags = FeatureTags::from_edges(mesh.points.len(), []);
    assert_eq!(close_holes(&mut mesh, &mut tags, 1.0, &Silent), Ok(36));
    assert_eq!(diagnose(&mesh).boundary_loops, 1);
    let closed = layout(&mesh, Known::default(), &params(24), None, &Silent).unwrap().network.patches.len();
    assert!(closed <= sheet + 8, "{closed} patches, {sheet} without holes");
}

#[test]
fn layouts_are_equal_on_1_and_4_threads() {
    let mesh = synthetic::demo(7, 6000);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| layout(&mesh, Known::default(), &params(40), None, &Silent))
            .expect("the demo has a layout")
            .network
    };
    assert_eq!(on(1), on(4));
}

#[test]
fn a_mesh_of_two_triangles_has_a_layout_of_one_patch() {
    let square = [DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y];
    let mesh = TriMesh::new(square.to_vec(), vec![[0, 1, 2], [0, 2, 3]]);
    let network = layout(&mesh, Known::default(), &params(1), None, &Silent).expect("a square has a layout").network;
    let patches = imprint(&mesh, &network, &Silent).expect("disks");
    assert!((1..=4).contains(&patches.len()), "{} patches", patches.len());
}

#[test]
fn a_cylinder_of_2044_needles_has_a_network_along_its_form_of_30_patches_at_most() {
    let mesh = shapes::faceted_cylinder(3.0, 10.0, 512);
    let laid = layout(&mesh, Known::default(), &LayoutParams::default(), None, &Silent).unwrap();
    assert!(matches!(laid.pieces[..], [(_, Method::Field { .. })]), "{:?}", laid.pieces);
    assert!(laid.network.patches.len() <= 30, "{}", laid.network.patches.len());
    let rims = 2.0 * 512.0 * 6.0 * (std::f64::consts::PI / 512.0).sin();
    assert!((length(&mesh, &laid.network, CurveKind::Feature) / rims - 1.0).abs() < 1e-9);
}

#[test]
fn regress_a_wedge_of_15_degrees_has_6_patches_whose_grids_and_seams_are_not_folded() {
    let mesh = shapes::wedge(15.0, 40);
    let made = pipeline::run(Input::from(&mesh), &RunParams::default(), &Silent).unwrap();
    let figure = |key: &str| made.fitted.quality[key].value();
    assert_eq!(["patches.count", "grid.folds", "seam.folded"].map(figure), [6.0, 0.0, 0.0]);
    assert!(figure("seam.angle_max_deg") < 1e-3, "{}", figure("seam.angle_max_deg"));
}

#[test]
fn meshes_without_faces_with_three_faces_on_an_edge_or_of_loose_triangles_are_refused() {
    assert_eq!(layout(&TriMesh::default(), Known::default(), &params(10), None, &Silent), Err(LayoutError::Empty));
    let points = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, -DVec3::Y];
    let mesh = TriMesh::new(points, vec![[0, 1, 2], [1, 0, 3], [0, 1, 4]]);
    assert_eq!(layout(&mesh, Known::default(), &params(10), None, &Silent), Err(LayoutError::NotManifold { edges: 1 }));
    let points = (0..9).map(|k| DVec3::new(f64::from(k / 3) + 0.4 * f64::from(k % 3), f64::from(k % 3 / 2), 0.0));
    let mesh = TriMesh::new(points.collect(), vec![[0, 1, 2], [3, 4, 5], [6, 7, 8]]);
    let loose = Err(LayoutError::Loose { pieces: 3, triangles: 3 });
    assert_eq!(layout(&mesh, Known::default(), &params(10), None, &Silent), loose);
}

/// A unit square of two triangles as one patch, with `extra` curves.
fn square_with(extra: Vec<Curve>) -> (TriMesh, Network) {
    let square = [DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y];
    let mesh = TriMesh::new(square.to_vec(), vec![[0, 1, 2], [0, 2, 3]]);
    let corner = |face, k| Corner { place: FacePoint::corner(face, k) };
    let corners = vec![corner(0, 0), corner(0, 1), corner(0, 2), corner(1, 2)];
    let side = |corners: [u32; 2], face, a, b| Curve {
        corners,
        kind: CurveKind::Boundary,
        points: vec![FacePoint::corner(face, a), FacePoint::corner(face, b)],
    };
    let mut curves = vec![side([0, 1], 0, 0, 1), side([1, 2], 0, 1, 2), side([2, 3], 1, 1, 2), side([3, 0], 1, 2, 0)];
    curves.extend(extra);
    let sides = std::array::from_fn(|k| Side { curve: k as u32, reversed: false });
    (mesh, Network { corners, curves, patches: vec![Patch { sides }] })
}

#[test]
fn an_imprinted_square_is_the_square() {
    let (mesh, network) = square_with(Vec::new());
    let patches = imprint(&mesh, &network, &Silent).expect("one disk");
    assert_eq!(patches[0].mesh.triangles.len(), 2);
    assert!(patches[0].sides.iter().all(|s| s.len() == 2));
}

#[test]
fn curves_that_cross_are_named_with_the_place() {
    let inside = |a: [f64; 3], b: [f64; 3]| Curve {
        corners: [0, 0],
        kind: CurveKind::Smooth,
        points: vec![FacePoint { face: 0, bary: a }, FacePoint { face: 0, bary: b }],
    };
    let crossed = vec![
        inside([0.6, 0.2, 0.2], [0.2, 0.2, 0.6]),
        inside([0.6, 0.1, 0.3], [0.1, 0.6, 0.3]),
        inside([0.5, 0.3, 0.2], [0.2, 0.1, 0.7]),
    ];
    let (mesh, network) = square_with(crossed);
    match imprint(&mesh, &network, &Silent) {
        Err(ImprintError::Crossing { curves, .. }) => assert!(curves.len() >= 2, "{curves:?}"),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_part_that_no_patch_covers_is_refused() {
    let (mut mesh, network) = square_with(Vec::new());
    let first = mesh.points.len() as u32;
    mesh.points.extend([DVec3::Z, DVec3::Z + DVec3::X, DVec3::Z + DVec3::Y]);
    mesh.triangles.push([first, first + 1, first + 2]);
    assert!(matches!(imprint(&mesh, &network, &Silent), Err(ImprintError::Uncovered { faces: 1, .. })));
}

#[test]
fn real_meshes_have_layouts_of_disks_with_no_patch_above_8_times_the_mean() {
    for name in ["fandisk", "goathead", "casting"] {
        let Some(mesh) = common::data_mesh(&format!("{name}.ply")) else { continue };
        let network = layout(&mesh, Known::default(), &params(100), None, &Silent)
            .unwrap_or_else(|e| panic!("{name}: {e}"))
            .network;
        let areas: Vec<f64> = imprint(&mesh, &network, &Silent)
            .unwrap_or_else(|e| panic!("{name}: {e}"))
            .iter()
            .map(|p| (0..p.mesh.triangles.len()).map(|t| p.mesh.area(t)).sum())
            .collect();
        let mean = areas.iter().sum::<f64>() / areas.len() as f64;
        let largest = areas.iter().cloned().fold(0.0, f64::max);
        assert!(largest <= 8.0 * mean, "{name}: {:.1}", largest / mean);
    }
}
