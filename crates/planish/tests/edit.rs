//! Editing networks, feature curves in grids, and the history of edits.

mod common;

use planish::curve::{SnakeParams, SurfaceCurve, section};
use planish::edit::network::{EditError, Editor, Holds};
use planish::edit::{ApplyError, Carry, Edit, Ground, apply, preview};
use planish::geom::Bvh;
use planish::grid::{self, Family, FeatureCurve, FeatureError, GridParams, Sections, relax_with_features};
use planish::layout::{Known, LayoutParams, layout};
use planish::mesh::{Adjacency, FacePoint, TriMesh};
use planish::model::{Drawing, HistoryEntry, Model};
use planish::network::{CurveKind, Fault, Network, imprint};
use planish::pipeline::{self, PipelineParams};
use planish::synthetic::shapes;
use planish::{DVec3, Silent};

fn near(bvh: &Bvh, p: DVec3) -> FacePoint {
    bvh.closest(p).place
}

fn json(text: &str) -> Edit {
    serde_json::from_str(text).unwrap_or_else(|e| panic!("{e}: {text}"))
}

/// Applies edits written as JSON, one per line.
fn run(mesh: &TriMesh, start: Drawing, edits: &[&str]) -> Drawing {
    let ground = Ground::new(mesh);
    let mut drawing = start;
    for edit in edits {
        apply(&mut drawing, &json(edit), &ground, &|_| Err("no other".into()), &Silent)
            .unwrap_or_else(|e| panic!("{e}: {edit}"));
    }
    drawing
}

/// A sheet in one patch: its four sides.
fn one_patch(mesh: &TriMesh) -> Network {
    let b = mesh.bounds();
    let corner = |x: f64, y: f64| {
        format!(
            "{{\"edit\":\"add_corner\",\"at\":[{},{},0],\"snap\":0}}",
            b.min.x + x * (b.max.x - b.min.x),
            b.min.y + y * (b.max.y - b.min.y)
        )
    };
    let edits =
        [corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0), "{\"edit\":\"boundaries\"}".into()];
    run(mesh, Drawing::default(), &edits.iter().map(|s| s.as_str()).collect::<Vec<_>>()).network
}

#[test]
fn the_boundary_of_a_sheet_with_four_corners_is_one_patch_and_without_corners_none() {
    let mesh = shapes::rectangle(2.0, 1.0, 20, 10);
    let network = one_patch(&mesh);
    assert_eq!((network.corners.len(), network.curves.len(), network.patches.len()), (4, 4, 1));
    assert!(imprint(&mesh, &network, &Silent).is_ok());
    let bare = run(&mesh, Drawing::default(), &["{\"edit\":\"boundaries\"}"]).network;
    let adjacency = Adjacency::new(&mesh);
    let mut editor = Editor::new(&mesh, &adjacency, bare);
    let found = editor.diagnose();
    assert!(matches!(&found.faults[..], [Fault::NotFourSided { sides, .. }] if sides.len() == 1), "{found:?}");
}

#[test]
fn two_planes_cut_a_sphere_into_patches_and_faults_are_told_on_the_way() {
    let mesh = shapes::sphere(1.0, 4);
    let adjacency = Adjacency::new(&mesh);
    let bvh = Bvh::new(&mesh);
    let mut editor = Editor::new(&mesh, &adjacency, Network::default());
    assert!(matches!(editor.diagnose().faults[..], [Fault::Bare { .. }]));
    let ring = |axis: DVec3, at: f64| {
        let start = near(&bvh, axis * at + axis.any_orthonormal_vector() * (1.0 - at * at).sqrt());
        section::cut_plane(&mesh, &adjacency, axis * (at + 1e-4), axis, start.face).unwrap()
    };
    // Two parallel rings: a cap, a band with two loops, a cap.
    editor.add_curve(&ring(DVec3::Z, 0.6), CurveKind::Smooth, 0.0).unwrap();
    editor.add_curve(&ring(DVec3::Z, -0.6), CurveKind::Smooth, 0.0).unwrap();
    let found = editor.diagnose();
    assert_eq!(found.faults.iter().filter(|f| matches!(f, Fault::Holes { loops: 2, .. })).count(), 1, "{found:?}");
    let one_sided = |f: &&Fault| matches!(f, Fault::NotFourSided { sides, .. } if sides.len() == 1);
    assert_eq!(found.faults.iter().filter(one_sided).count(), 2);
    // At a glance the same loops, without telling the band from two disks.
    assert_eq!(editor.glance().regions.len(), 4);
    // Corners and rungs: four patches around, and caps of four sides.
    for c in 0..2u32 {
        editor.split_curve(c, 0.5).unwrap();
    }
    for c in 0..4u32 {
        editor.split_curve(c, 0.5).unwrap();
    }
    let tops: Vec<DVec3> = editor.network.corners.iter().map(|c| c.place.position(&mesh)).collect();
    for (k, p) in tops.iter().enumerate().filter(|(_, p)| p.z > 0.0) {
        let low = (0..tops.len())
            .filter(|&j| tops[j].z < 0.0)
            .min_by(|&i, &j| tops[i].distance(*p).total_cmp(&tops[j].distance(*p)))
            .unwrap();
        let ends = [editor.network.corners[k].place, editor.network.corners[low].place];
        let points = planish::curve::connect(&mesh, &adjacency, ends[0], ends[1]).unwrap();
        editor.add_curve(&SurfaceCurve::open(points), CurveKind::Smooth, 1e-9).unwrap();
    }
    let found = editor.diagnose();
    assert!(found.is_finished() && found.patches.len() == 6, "{found:?}");
    assert_eq!(editor.glance().patches, found.patches);
    assert!(imprint(&mesh, &editor.network, &Silent).is_ok());
}

#[test]
fn crossing_and_dangling_curves_are_told_with_their_place() {
    let mesh = shapes::rectangle(2.0, 1.0, 21, 11);
    let adjacency = Adjacency::new(&mesh);
    let bvh = Bvh::new(&mesh);
    let b = mesh.bounds();
    let at = |x: f64, y: f64| near(&bvh, DVec3::new(b.min.x + 2.0 * x, b.min.y + y, 0.0));
    let mut editor = Editor::new(&mesh, &adjacency, one_patch(&mesh));
    let line = |p, q| SurfaceCurve::open(vec![p, q]);
    editor.add_curve(&line(at(0.1, 0.52), at(0.9, 0.47)), CurveKind::Smooth, 0.0).unwrap();
    let found = editor.diagnose();
    let dangling = found.faults.iter().filter(|f| matches!(f, Fault::Dangling { .. })).count();
    assert_eq!(dangling, 2, "{found:?}");
    editor.add_curve(&line(at(0.5, 0.1), at(0.52, 0.9)), CurveKind::Smooth, 0.0).unwrap();
    for found in [editor.diagnose(), editor.glance()] {
        let told = found.faults.iter().map(|f| f.to_string()).find(|t| t.contains("cross at")).expect("a crossing");
        assert!(told.contains("hint: move one of them apart"), "{told}");
    }
}

#[test]
fn a_stroke_that_is_drawn_to_a_corner_beyond_a_curve_divides_the_curve_on_its_way() {
    let mesh = shapes::rectangle(2.0, 1.0, 21, 11);
    let adjacency = Adjacency::new(&mesh);
    let bvh = Bvh::new(&mesh);
    let b = mesh.bounds();
    let at = |x: f64, y: f64| near(&bvh, DVec3::new(b.min.x + 2.0 * x, b.min.y + y, 0.0));
    let line = |p, q| SurfaceCurve::open(vec![p, q]);
    for (from, to) in [((0.3, 0.5), (0.7, 0.47)), ((0.3, 0.5), (0.503, 0.5))] {
        let mut editor = Editor::new(&mesh, &adjacency, one_patch(&mesh));
        editor.draw_curve(&line(at(0.5, 0.2), at(0.501, 0.8)), CurveKind::Smooth, 0.0).unwrap();
        // Its end, .016 behind that line, is the corner next to where the stroke meets the line.
        editor.draw_curve(&line(at(0.508, 0.49), at(0.8, 0.52)), CurveKind::Smooth, 0.0).unwrap();
        let before = editor.network.curves.len();
        editor.draw_curve(&line(at(from.0, from.1), at(to.0, to.1)), CurveKind::Smooth, 0.04).unwrap();
        let told: Vec<String> = editor.diagnose().faults.iter().map(|f| f.to_string()).collect();
        assert!(!told.iter().any(|t| t.contains("cross at")), "{told:?}");
        assert!(editor.network.curves.len() >= before + 3, "one curve in two, and the stroke on both sides of it");
    }
}

#[test]
fn split_and_join_give_the_curve_back_and_deleting_takes_its_free_corners() {
    let mesh = shapes::sphere(1.0, 3);
    let adjacency = Adjacency::new(&mesh);
    let network =
        layout(&mesh, Known::default(), &LayoutParams { patches: 8, ..LayoutParams::default() }, None, &Silent)
            .unwrap()
            .network;
    let mut editor = Editor::new(&mesh, &adjacency, network.clone());
    let before = editor.network.curves[3].points.iter().map(|p| p.position(&mesh)).collect::<Vec<_>>();
    let length = |p: &[DVec3]| p.windows(2).map(|w| w[0].distance(w[1])).sum::<f64>();
    let corner = editor.split_curve(3, 0.37).unwrap();
    let part = editor.network.curves[3].points.iter().map(|p| p.position(&mesh)).collect::<Vec<_>>();
    assert!((length(&part) / length(&before) - 0.37).abs() < 1e-9);
    assert!(matches!(editor.join(network.curves[0].corners[0]), Err(EditError::NotBetweenTwo { .. })));
    assert_eq!(editor.join(corner).unwrap(), 3);
    let after = editor.network.curves[3].points.iter().map(|p| p.position(&mesh)).collect::<Vec<_>>();
    assert!((length(&after) - length(&before)).abs() < 1e-12);
    assert_eq!(editor.network.corners.len(), network.corners.len());
    let count = editor.network.curves.len();
    editor.delete_curve(0).unwrap();
    assert_eq!(editor.network.curves.len(), count - 1);
    assert!(matches!(editor.delete_curve(999), Err(EditError::NoSuchPart { what: "curve", index: 999, .. })));
    // The two patches beside it are one region of six sides now.
    let found = editor.diagnose();
    assert!(
        found.faults.iter().any(|f| matches!(f, Fault::NotFourSided { sides, .. } if sides.len() == 6)),
        "{:?}",
        found.faults
    );
}

#[test]
fn dragging_a_corner_or_a_curve_of_a_layout_leaves_a_finished_network_and_the_rest_bit_for_bit() {
    let mesh = shapes::sphere(1.0, 4);
    let adjacency = Adjacency::new(&mesh);
    let bvh = Bvh::new(&mesh);
    let network =
        layout(&mesh, Known::default(), &LayoutParams { patches: 12, ..LayoutParams::default() }, None, &Silent)
            .unwrap()
            .network;
    let mut editor = Editor::new(&mesh, &adjacency, network.clone());
    let params = SnakeParams { fairness: 0.1, curvature: 1.0, ..SnakeParams::default() };
    let p = network.corners[2].place.position(&mesh);
    let to = near(&bvh, p + p.any_orthonormal_vector() * 0.12);
    editor.drag_corner(2, to, 0.6, &params, &Silent).unwrap();
    let touched: Vec<usize> = (0..network.curves.len()).filter(|&c| network.curves[c].corners.contains(&2)).collect();
    for c in 0..network.curves.len() {
        assert_eq!(editor.network.curves[c] != network.curves[c], touched.contains(&c), "{c}");
    }
    assert!(editor.diagnose().is_finished());
    let before = editor.network.clone();
    let middle = before.curves[5].points[before.curves[5].points.len() / 2].position(&mesh);
    let holds = Holds { section: Some((0.5, 0.5)), ..Holds::default() };
    editor.drag_curve(5, (0.5, middle.any_orthonormal_vector() * 0.05), &holds, &params, &Silent).unwrap();
    let (old, new) = (&before.curves[5].points, &editor.network.curves[5].points);
    assert!(old != new && old[0] == new[0] && old[old.len() - 1] == new[new.len() - 1]);
    // Outside the half in the middle nothing changed.
    let same = old.iter().zip(new).take_while(|(a, b)| a == b).count();
    assert!(same >= old.len() / 5, "{same} of {}", old.len());
    assert!(editor.diagnose().is_finished());
}

#[test]
fn regions_of_3_5_and_6_sides_are_split_into_four_sided_patches_and_neighbours_follow() {
    let mesh = shapes::sphere(1.0, 4);
    let adjacency = Adjacency::new(&mesh);
    let bvh = Bvh::new(&mesh);
    // An octahedron: eight regions of three sides.
    let mut editor = Editor::new(&mesh, &adjacency, Network::default());
    let tips =
        [DVec3::X, DVec3::Y, DVec3::Z, -DVec3::X, -DVec3::Y, -DVec3::Z].map(|p| p + DVec3::new(0.011, 0.017, 0.013));
    for p in tips {
        editor.add_corner(near(&bvh, p), 0.0).unwrap();
    }
    for (a, b) in [(0, 1), (1, 3), (3, 4), (4, 0), (0, 2), (1, 2), (3, 2), (4, 2), (0, 5), (1, 5), (3, 5), (4, 5)] {
        let ends = [a, b].map(|k| editor.network.corners[k].place);
        let points = planish::curve::connect(&mesh, &adjacency, ends[0], ends[1]).unwrap();
        editor.add_curve(&SurfaceCurve::open(points), CurveKind::Smooth, 1e-9).unwrap();
    }
    let found = editor.diagnose();
    assert_eq!(found.faults.len(), 8);
    assert!(found.faults[0].to_string().contains("hint: split it into three patches around its middle"));
    let mut guard = 0;
    while let Some(region) = editor.diagnose().regions.iter().position(|r| r.loops[0].len() == 3) {
        editor.split_region(region as u32, None).unwrap();
        guard += 1;
        assert!(guard <= 8);
    }
    // Sides with two corners of their neighbours in them are left for more splits: 4, 5 and 6 sides.
    while let Some(region) = editor.diagnose().regions.iter().position(|r| matches!(r.loops[0].len(), 5 | 6)) {
        editor.split_region(region as u32, None).unwrap();
        guard += 1;
        assert!(guard < 60);
    }
    let found = editor.diagnose();
    assert!(found.is_finished(), "{:?}", found.faults);
    assert!(imprint(&mesh, &editor.network, &Silent).is_ok());
    assert!(matches!(editor.split_region(0, None), Err(EditError::NoSplit { sides: 4, .. })));
}

#[test]
fn the_rest_of_a_network_is_completed_around_curves_that_stay_within_a_millionth() {
    let mesh = shapes::torus(2.0, 0.7, 96, 48);
    let adjacency = Adjacency::new(&mesh);
    let bvh = Bvh::new(&mesh);
    let mut editor = Editor::new(&mesh, &adjacency, Network::default());
    // A ring around the tube and a slanted open curve.
    let start = near(&bvh, DVec3::new(2.7, 0.03, 0.02));
    let ring = section::cut_plane(&mesh, &adjacency, DVec3::new(0.0, 0.03, 0.0), DVec3::Y, start.face).unwrap();
    editor.add_curve(&ring, CurveKind::Smooth, 0.0).unwrap();
    let ends = [near(&bvh, DVec3::new(-2.6, 0.5, 0.3)), near(&bvh, DVec3::new(-0.8, -2.3, 0.6))];
    let points = planish::curve::connect(&mesh, &adjacency, ends[0], ends[1]).unwrap();
    editor.add_curve(&SurfaceCurve::open(points), CurveKind::Smooth, 0.0).unwrap();
    let drawn: Vec<Vec<DVec3>> =
        editor.network.curves.iter().map(|c| c.points.iter().map(|p| p.position(&mesh)).collect()).collect();
    let corners: Vec<DVec3> = editor.network.corners.iter().map(|c| c.place.position(&mesh)).collect();
    editor.complete(&LayoutParams { patches: 40, ..LayoutParams::default() }, &Silent).unwrap();
    let found = editor.diagnose();
    assert!(found.is_finished(), "{:?}", found.faults);
    assert!(imprint(&mesh, &editor.network, &Silent).is_ok());
    let all: Vec<DVec3> = editor.network.curves.iter().flat_map(|c| &c.points).map(|p| p.position(&mesh)).collect();
    for p in drawn.iter().flatten() {
        let away = all.iter().map(|q| q.distance(*p)).fold(f64::INFINITY, f64::min);
        assert!(away < 1e-6, "{p} is {away} off");
    }
    for p in corners {
        assert!(editor.network.corners.iter().any(|c| c.place.position(&mesh).distance(p) < 1e-6), "{p}");
    }
    assert!(editor.network.curves.iter().all(|c| c.kind.is_smooth()));
}

#[test]
fn a_mesh_of_few_triangles_is_not_completed_to_more_patches_than_it_has_room_for() {
    let mesh = shapes::cuboid(DVec3::ONE, 3);
    let adjacency = Adjacency::new(&mesh);
    let mut editor = Editor::new(&mesh, &adjacency, Network::default());
    editor.complete(&LayoutParams { patches: 1000, ..LayoutParams::default() }, &Silent).unwrap();
    let patches = editor.diagnose().patches.len();
    assert!(patches <= mesh.triangles.len(), "{patches} patches on {} triangles", mesh.triangles.len());
}

/// Edits of a session: cuts by planes through places of the mesh, strokes between places, and the rest completed.
fn cuts_and_strokes(mesh: &TriMesh, seed: u64, boundaries: bool) -> Vec<String> {
    let used: Vec<u32> = mesh.triangles.iter().flatten().copied().collect();
    let pick = |k: u64| {
        let k = (seed + 1).wrapping_mul(k).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 20;
        mesh.points[used[k as usize % used.len()] as usize]
    };
    let text = |p: DVec3| format!("[{},{},{}]", p.x, p.y, p.z);
    let mut edits: Vec<String> = if boundaries { vec![r#"{"edit":"boundaries"}"#.into()] } else { Vec::new() };
    for (k, normal) in [(1, [1.0, 0.2, 0.1]), (2, [0.0, 0.3, 1.0])] {
        let c = mesh.bounds();
        let middle = (c.min + c.max) / 2.0;
        // Near the middle, so that the cut is a long one.
        let n = DVec3::from_array(normal);
        let near = |p: &DVec3| (*p - middle).dot(n).abs();
        let through = (0..40).map(|i| pick(100 * k + i)).min_by(|a, b| near(a).total_cmp(&near(b))).unwrap();
        edits.push(format!(r#"{{"edit":"cut","through":{},"normal":{normal:?}}}"#, text(through)));
    }
    for (k, mode) in [(7, "geodesic"), (11, "magnetic")] {
        let (a, b) = (pick(k), pick(k + 1));
        edits.push(format!(r#"{{"edit":"paint","mode":"{mode}","picks":[{},{}]}}"#, text(a), text(b)));
    }
    edits.push(r#"{"edit":"complete","patches":50}"#.into());
    edits
}

#[test]
fn networks_completed_around_two_cuts_and_two_strokes_on_rough_meshes_are_finished_without_crossings() {
    let mut rough = shapes::torus(2.0, 0.8, 90, 45);
    for (k, p) in rough.points.iter_mut().enumerate() {
        *p += DVec3::new(0.7, 0.4, 0.6) * 0.03 * ((k as f64 * 12.9898).sin() * 43_758.545_3).fract();
    }
    let mut meshes = vec![("torus", rough)];
    meshes.extend(
        ["bunny", "rocker_arm"].map(|n| Some((n, common::data_mesh(&format!("{n}.ply"))?))).into_iter().flatten(),
    );
    for (name, mesh) in &meshes {
        for seed in 0..if *name == "torus" { 2 } else { 1 } {
            let edits = cuts_and_strokes(mesh, seed, *name == "bunny");
            let drawn = run(mesh, Drawing::default(), &edits.iter().map(|e| e.as_str()).collect::<Vec<_>>());
            let adjacency = Adjacency::new(mesh);
            let found = Editor::new(mesh, &adjacency, drawn.network.clone()).diagnose();
            assert!(found.is_finished(), "{name} {seed}: {:?}", found.faults);
            assert!(imprint(mesh, &drawn.network, &Silent).is_ok(), "{name} {seed}");
        }
    }
}

/// A patch with a bump, and curves across it: `u` and `v` of each family.
fn bumpy(u: usize, v: usize) -> (TriMesh, Network, Vec<FeatureCurve>) {
    let at =
        |s: f64, t: f64| DVec3::new(2.0 * s, t, 0.3 * (-(9.0 * (s - 0.5).powi(2) + 12.0 * (t - 0.5).powi(2))).exp());
    let mesh = shapes::sheet(60, 50, false, false, at);
    let on_sheet = at;
    let network = one_patch(&mesh);
    let bvh = Bvh::new(&mesh);
    let wave = |x: f64, k: usize| 0.06 * (6.0 * x + k as f64).sin();
    let mut features = Vec::new();
    for k in 0..v {
        let at = (k + 1) as f64 / (v + 1) as f64;
        let points = (1..40).map(|i| i as f64 / 40.0).map(|t| near(&bvh, on_sheet(at + wave(t, k) * 0.5, t)));
        features.push(FeatureCurve { patch: 0, family: Family::V, points: points.collect() });
    }
    for k in 0..u {
        let at = (k + 1) as f64 / (u + 1) as f64;
        let points = (1..40).map(|i| i as f64 / 40.0).map(|s| near(&bvh, on_sheet(s, at + wave(s, k) * 0.7)));
        // Against the direction of the grid: curves may be painted either way.
        let mut points: Vec<FacePoint> = points.collect();
        points.reverse();
        features.push(FeatureCurve { patch: 0, family: Family::U, points });
    }
    (mesh, network, features)
}

fn distance_to(curve: &[DVec3], p: DVec3) -> f64 {
    curve
        .windows(2)
        .map(|w| {
            let d = w[1] - w[0];
            let s =
                if d.length_squared() > 0.0 { ((p - w[0]).dot(d) / d.length_squared()).clamp(0.0, 1.0) } else { 0.0 };
            p.distance(w[0] + d * s)
        })
        .fold(f64::INFINITY, f64::min)
}

#[test]
fn grids_follow_1_to_4_feature_curves_of_both_families_exactly_without_a_fold() {
    for (u, v) in [(1, 0), (0, 1), (1, 1), (2, 2), (3, 2), (4, 4)] {
        let (mesh, network, features) = bumpy(u, v);
        let patches = imprint(&mesh, &network, &Silent).unwrap();
        let made = relax_with_features(
            (&mesh, &patches[0]),
            &features,
            (81, 61),
            &Sections::default(),
            &GridParams::default(),
            &Silent,
        )
        .unwrap_or_else(|e| panic!("{u} {v}: {e}"));
        let grid = &made.grid;
        assert_eq!((grid.cols, grid.rows, made.anchors.len()), (81, 61, u * v));
        for (k, feature) in features.iter().enumerate() {
            let line: Vec<DVec3> = match feature.family {
                Family::V => (0..grid.rows).map(|j| grid.points[j * grid.cols + made.lines[k]]).collect(),
                Family::U => (0..grid.cols).map(|i| grid.points[made.lines[k] * grid.cols + i]).collect(),
            };
            for p in line {
                assert!(distance_to(&made.curves[k], p) < 1e-9, "{u} {v} {k}: {}", distance_to(&made.curves[k], p));
            }
            // What it follows is what was painted.
            for p in feature.points.iter().map(|p| p.position(&mesh)) {
                assert!(distance_to(&made.curves[k], p) < 1e-9);
            }
        }
        for (j, i, p) in &made.anchors {
            assert_eq!(grid.points[j * grid.cols + i], *p);
        }
        let quality = grid::measure(grid, &patches[0]);
        let at = |i: usize, j: usize| grid.points[j * grid.cols + i];
        let down: Vec<(usize, usize, DVec3)> = (0..grid.rows - 1)
            .flat_map(|j| (0..grid.cols - 1).map(move |i| (i, j)))
            .filter(|&(i, j)| {
                let q = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                (0..4).any(|k| (q[(k + 1) % 4] - q[k]).cross(q[(k + 3) % 4] - q[k]).z <= 0.0)
            })
            .map(|(i, j)| (i, j, at(i, j)))
            .collect();
        assert!(quality.folds == 0 && down.is_empty(), "{u} {v}: {} {down:?} lines {:?}", quality.folds, made.lines);
        for (p, place) in grid.points.iter().zip(&grid.places) {
            assert!(place.position(&mesh).distance(*p) < 1e-9);
        }
    }
}

#[test]
fn a_section_is_refined_alone_and_curves_of_one_family_that_cross_are_refused_with_the_place() {
    let (mesh, network, mut features) = bumpy(1, 2);
    let patches = imprint(&mesh, &network, &Silent).unwrap();
    let run = |features: &[FeatureCurve], sections: &Sections| {
        relax_with_features((&mesh, &patches[0]), features, (41, 31), sections, &GridParams::default(), &Silent)
    };
    let coarse = run(&features, &Sections { u: vec![10, 10, 10], v: vec![12, 12] }).unwrap();
    let fine = run(&features, &Sections { u: vec![10, 30, 10], v: vec![12, 12] }).unwrap();
    assert_eq!((fine.grid.cols, fine.grid.rows), (51, 25));
    for j in 0..25 {
        for i in 0..=10 {
            assert_eq!(coarse.grid.points[j * 31 + i], fine.grid.points[j * 51 + i], "first section");
            assert_eq!(coarse.grid.points[j * 31 + 20 + i], fine.grid.points[j * 51 + 40 + i], "last section");
        }
    }
    assert!(matches!(
        run(&features, &Sections { u: vec![10, 10], v: vec![] }),
        Err(FeatureError::SectionCount { needed: 3, .. })
    ));
    // The second v curve leant over the first.
    let bvh = Bvh::new(&mesh);
    features[1].points =
        (1..40).map(|i| i as f64 / 40.0).map(|t| near(&bvh, DVec3::new(1.5 - 1.1 * t, t, 0.2))).collect();
    let told = run(&features, &Sections::default()).unwrap_err();
    let FeatureError::Cross { a, b, place } = told else { panic!("{told}") };
    assert!((a, b) == (0, 1) && place.distance(near(&bvh, place).position(&mesh)) < 1e-9, "{place}");
    features[1].points.truncate(1);
    features[1].points[0] = FacePoint::corner(0, 0);
    assert!(run(&features, &Sections::default()).is_err());
}

#[test]
fn patches_beside_a_feature_curve_share_its_nodes_and_the_model_has_no_gaps() {
    let mesh = shapes::torus(2.0, 0.7, 72, 36);
    let params = PipelineParams { layout: LayoutParams { patches: 16, ..Default::default() }, ..Default::default() };
    let fitted = pipeline::fit(&mesh, None, None, &params, &Silent).unwrap();
    let mut model: Model = fitted.model;
    let bvh = Bvh::new(&model.mesh);
    let patches = imprint(&model.mesh, &model.network, &Silent).unwrap();
    // Across the first patch, at a third of one side and a half of the other.
    let at = |k: usize, share: f64| {
        let chain = &patches[0].sides[k];
        patches[0].mesh.points[chain[((chain.len() - 1) as f64 * share) as usize] as usize]
    };
    let (p, q) = (at(0, 0.33), at(2, 0.5));
    let points: Vec<FacePoint> = (1..20).map(|i| near(&bvh, p.lerp(q, i as f64 / 20.0))).collect();
    let mut edited = model.drawing();
    edited.sketch.features.push(FeatureCurve { patch: 0, family: Family::V, points });
    model.record(HistoryEntry { command: "feature".into(), parameters: "{}".into() }, edited);
    let told = pipeline::rework(&mut model, None, &params, &Silent).unwrap();
    assert_eq!(grid::measure(&model.grids[0], &patches[0]).folds, 0);
    let uses = model.network.uses();
    let side = |p: u32, k: u8| -> Vec<DVec3> {
        let g = &model.grids[p as usize];
        match k {
            0 => (0..g.cols).map(|i| g.points[i]).collect(),
            1 => (0..g.rows).map(|j| g.points[j * g.cols + g.cols - 1]).collect(),
            2 => (0..g.cols).rev().map(|i| g.points[(g.rows - 1) * g.cols + i]).collect(),
            _ => (0..g.rows).rev().map(|j| g.points[j * g.cols]).collect(),
        }
    };
    for (c, list) in uses.iter().enumerate() {
        let [(a, i), (b, j)] = list[..] else { panic!("curve {c}") };
        let mut other = side(b, j);
        if model.network.patches[a as usize].sides[i as usize].reversed
            != model.network.patches[b as usize].sides[j as usize].reversed
        {
            other.reverse();
        }
        assert_eq!(side(a, i), other, "curve {c}");
    }
    assert!(told.quality["seam.gap_max"].value() < 1e-9 * model.mesh.bounds().diagonal());
    // Taken back it is the model without, made again the model with.
    let with = model.clone();
    assert!(model.undo() && model.sketch.features.is_empty() && model.grids.is_empty());
    assert!(model.redo());
    pipeline::rework(&mut model, None, &params, &Silent).unwrap();
    assert_eq!(model, with);
}

#[test]
fn slanted_feature_curves_of_both_families_on_a_torus_leave_no_fold_in_their_patch() {
    let mesh = shapes::torus(2.0, 0.7, 72, 36);
    let network = layout(&mesh, Known::default(), &LayoutParams { patches: 16, ..Default::default() }, None, &Silent)
        .unwrap()
        .network;
    let bvh = Bvh::new(&mesh);
    let patches = imprint(&mesh, &network, &Silent).unwrap();
    for patch in [0, 5] {
        for (family, sides) in [(Family::V, [0, 2]), (Family::U, [3, 1])] {
            for shares in [[0.33, 0.5], [0.25, 0.4], [0.7, 0.6]] {
                let at = |k: usize, share: f64| {
                    let chain = &patches[patch].sides[k];
                    patches[patch].mesh.points[chain[((chain.len() - 1) as f64 * share) as usize] as usize]
                };
                let (p, q) = (at(sides[0], shares[0]), at(sides[1], shares[1]));
                let points: Vec<FacePoint> = (1..20).map(|i| near(&bvh, p.lerp(q, i as f64 / 20.0))).collect();
                let features = [FeatureCurve { patch: patch as u32, family, points }];
                let drawn = (&features[..], &[][..]);
                let params = GridParams::default();
                let grids = grid::resample(&mesh, &network, &patches, drawn, &params, &Silent).unwrap();
                let folds: Vec<usize> = grids.iter().zip(&patches).map(|(g, p)| grid::measure(g, p).folds).collect();
                assert_eq!(folds[patch], 0, "{patch} {family:?} {shares:?} {folds:?}");
            }
        }
    }
}

#[test]
fn points_slide_along_feature_curves_so_that_iso_curves_cross_them_with_half_the_bend() {
    // A flat patch whose middle v curve leans: nodes at even distances on it would bend the rows.
    let mesh = shapes::rectangle(2.0, 1.0, 60, 30);
    let network = one_patch(&mesh);
    let patches = imprint(&mesh, &network, &Silent).unwrap();
    let bvh = Bvh::new(&mesh);
    let low = mesh.bounds().min;
    // An S: dense to one side below, to the other above.
    let on = |t: f64| low + DVec3::new(1.0 + 0.3 * (std::f64::consts::TAU * t).sin(), t, 0.0);
    let points: Vec<FacePoint> = (1..60).map(|i| near(&bvh, on(i as f64 / 60.0))).collect();
    let features = [FeatureCurve { patch: 0, family: Family::V, points }];
    let params = GridParams::default();
    let made =
        relax_with_features((&mesh, &patches[0]), &features, (81, 41), &Sections::default(), &params, &Silent).unwrap();
    let (grid, column) = (&made.grid, made.lines[0]);
    let at = |i: usize, j: usize| grid.points[j * grid.cols + i];
    // Nodes on the curve, by its length: even ones would all be this far apart.
    let line: Vec<DVec3> = (0..grid.rows).map(|j| at(column, j)).collect();
    let gaps: Vec<f64> = line.windows(2).map(|w| w[0].distance(w[1])).collect();
    let mean = gaps.iter().sum::<f64>() / gaps.len() as f64;
    assert!(gaps.iter().all(|g| *g > 0.3 * mean), "{gaps:?}");
    // The mean bend of rows over four cells at the curve, against that of rows joined to even nodes.
    let curve = &made.curves[0];
    let even = planish::curve::attract::sample_polyline(curve, grid.rows);
    let bend = |p: DVec3, j: usize| {
        let (a, b) = (at(column - 4, j), at(column + 4, j));
        (p - a).angle_between(b - p).to_degrees()
    };
    let inner = 2..grid.rows - 2;
    let (mut slid, mut unslid) = (0.0, 0.0);
    for j in inner {
        slid += bend(line[j], j);
        unslid += bend(even[j], j);
    }
    assert!(slid < 0.5 * unslid, "{slid} {unslid}");
}

#[test]
fn fits_on_both_sides_of_a_plane_of_symmetry_are_exact_mirror_images_and_bend_no_more_in_it_than_free_ones() {
    // An ellipsoid with a bulge, symmetric in x as a shape but not in its triangles.
    let mut mesh = shapes::sphere(1.0, 4);
    for p in &mut mesh.points {
        let q = turned(*p);
        *p = DVec3::new(1.2 * q.x, q.y + 0.2 * q.x * q.x, 0.9 * q.z * (1.0 + 0.3 * q.y));
    }
    let start = run(
        &mesh,
        Drawing::default(),
        &[
            r#"{"edit":"symmetry","plane":{"point":[0,0,0],"normal":[1,0,0]}}"#,
            r#"{"edit":"cut","through":[0,1,0],"normal":[1,0,0]}"#,
            r#"{"edit":"complete","patches":24}"#,
            r#"{"edit":"mirror"}"#,
        ],
    );
    let plane = start.sketch.symmetry.unwrap();
    let mut model = Model { mesh: mesh.clone(), network: start.network, sketch: start.sketch, ..Model::default() };
    let told = pipeline::rework(&mut model, None, &PipelineParams::default(), &Silent).unwrap();
    let count = model.surfaces.len();
    assert!(count >= 12 && count.is_multiple_of(2), "{count}");
    // Every set of control points is the image of another, to the last bits.
    let key = |p: DVec3| p.to_array().map(|x| (x * 1e9).round() as i64);
    let sorted = |points: &mut dyn Iterator<Item = DVec3>| {
        let mut all: Vec<[i64; 3]> = points.map(key).collect();
        all.sort_unstable();
        all
    };
    let sets: Vec<_> = model.surfaces.iter().map(|s| sorted(&mut s.control.iter().copied())).collect();
    for s in &model.surfaces {
        let image = sorted(&mut s.control.iter().map(|c| plane.mirror(*c)));
        assert!(sets.contains(&image));
    }
    assert!(told.quality["seam.gap_max"].value() < 1e-9 * mesh.bounds().diagonal());
    // Displaced, the model is still the mesh.
    assert!(told.quality["relief.rounding_max_rel"].value() < 1e-12);
    // Seams in the plane bend no more than those of free fits and half a degree.
    let mut free = Model { sketch: Default::default(), ..model.clone() };
    let unmirrored = pipeline::rework(&mut free, None, &PipelineParams::default(), &Silent).unwrap();
    let in_plane = |c: u32| {
        model.network.curves[c as usize].points.iter().all(|p| plane.height(p.position(&mesh)).abs() < 2e-3 * 2.0)
    };
    let bends = |seams: &[planish::surface::SeamQuality]| -> Vec<f64> {
        seams.iter().filter(|s| in_plane(s.curve)).map(|s| s.angle_mean_deg).collect()
    };
    let (mirrored, unmirrored) = (bends(&told.seams), bends(&unmirrored.seams));
    assert!(mirrored.len() >= 4);
    let mean = |list: &[f64]| list.iter().sum::<f64>() / list.len() as f64;
    assert!(mean(&mirrored) < mean(&unmirrored) + 0.5, "{mirrored:?} {unmirrored:?}");
}

/// A turn that takes the triangles out of symmetry.
fn turned(p: DVec3) -> DVec3 {
    let (s, c) = 0.37f64.sin_cos();
    let q = DVec3::new(c * p.x - s * p.y, s * p.x + c * p.y, p.z);
    DVec3::new(q.x, c * q.y - s * q.z, s * q.y + c * q.z)
}

#[test]
fn a_half_drawn_network_is_mirrored_across_the_plane_of_symmetry() {
    let mesh = shapes::sphere(1.0, 4);
    // A cap on one side, joined to the plane x = 0 by two curves.
    let drawing = run(
        &mesh,
        Drawing::default(),
        &[
            r#"{"edit":"symmetry","plane":{"point":[0,0,0],"normal":[1,0,0]}}"#,
            r#"{"edit":"paint","picks":[[0.7,0.5,0.1],[0.7,-0.5,0.1]],"mode":"geodesic","snap":0}"#,
            r#"{"edit":"paint","picks":[{"corner":0},[0,0.9,0.4]],"mode":"geodesic","snap":0.001}"#,
            r#"{"edit":"paint","picks":[{"corner":1},[0,-0.9,0.4]],"mode":"geodesic","snap":0.001}"#,
            r#"{"edit":"mirror"}"#,
        ],
    );
    let network = &drawing.network;
    assert_eq!((network.curves.len(), network.corners.len()), (6, 6));
    let positions: Vec<DVec3> = network.corners.iter().map(|c| c.place.position(&mesh)).collect();
    for p in &positions {
        let image = DVec3::new(-p.x, p.y, p.z);
        assert!(positions.iter().any(|q| q.distance(image) < 1e-2), "{p}");
    }
    assert_eq!(positions.iter().filter(|p| p.x.abs() < 1e-3).count(), 2);
}

#[test]
fn a_network_is_carried_to_another_shape_of_its_class_and_stays_finished() {
    let from = shapes::sphere(1.0, 4);
    let network =
        layout(&from, Known::default(), &LayoutParams { patches: 10, ..LayoutParams::default() }, None, &Silent)
            .unwrap()
            .network;
    let mut to = shapes::sphere(1.0, 5);
    let bend = |p: DVec3| DVec3::new(1.4 * p.x, 0.9 * p.y, p.z + 0.25 * p.x * p.x);
    to.points.iter_mut().for_each(|p| *p = bend(*p));
    let marks: Vec<[[f64; 3]; 2]> = (0..14)
        .map(|k| {
            let z = 1.0 - 2.0 * (k as f64 + 0.5) / 14.0;
            let (a, r) = (2.4 * k as f64, (1.0 - z * z).sqrt());
            let p = DVec3::new(r * a.cos(), r * a.sin(), z);
            [p.to_array(), bend(p).to_array()]
        })
        .collect();
    let ground = Ground::new(&to);
    let mut drawing = Drawing::default();
    let edit = Edit::Carry(Carry { from: "template".into(), landmarks: marks });
    let others = |name: &str| match name {
        "template" => Ok((from.clone(), Drawing { network: network.clone(), ..Drawing::default() })),
        _ => Err("is not there".to_string()),
    };
    apply(&mut drawing, &edit, &ground, &others, &Silent).unwrap();
    assert_eq!(drawing.network.patches.len(), network.patches.len());
    assert!(imprint(&to, &drawing.network, &Silent).is_ok());
    let missing = Edit::Carry(Carry { from: "nothing".into(), landmarks: Vec::new() });
    let before = drawing.clone();
    assert!(apply(&mut drawing, &missing, &ground, &others, &Silent).unwrap_err().to_string().contains("nothing"));
    assert_eq!(drawing, before);
}

#[test]
fn edits_come_back_from_json_and_a_wrong_one_leaves_the_drawing_as_it_was() {
    let texts = [
        r#"{"edit":"paint","picks":[[0.0,1.0,2.0],{"corner":3}],"mode":"magnetic","closed":true,"magnet":{"sharp":30.0},"snap":0.02}"#,
        r#"{"edit":"drag_curve","curve":2,"at":0.5,"by":[0.0,0.1,0.0],"width":0.4}"#,
        r#"{"edit":"relax","curve":1,"pull":{"scalar":"luminance","weight":4.0},"section":[0.5,0.3]}"#,
        r#"{"edit":"spline","curve":1,"control":8,"moves":[{"vertex":3,"by":[0.0,0.0,1.0]},{"at":0.5,"by":[1.0,0.0,0.0]}]}"#,
        r#"{"edit":"undo"}"#,
    ];
    for text in texts {
        let edit = json(text);
        let again: Edit = serde_json::from_str(&serde_json::to_string(&edit).unwrap()).unwrap();
        assert_eq!(edit, again);
        assert!(text.contains(&format!("\"edit\":\"{}\"", edit.name())) && !edit.parameters().contains("\"edit\""));
    }
    let mesh = shapes::sphere(1.0, 3);
    let ground = Ground::new(&mesh);
    let mut drawing = Drawing::default();
    for wrong in [
        r#"{"edit":"split_curve","curve":7,"at":0.5}"#,
        r#"{"edit":"paint","picks":[{"corner":9},[0,0,1]]}"#,
        r#"{"edit":"mirror"}"#,
        r#"{"edit":"relax","curve":0,"pull":{"scalar":"luminance"}}"#,
        r#"{"edit":"feature","picks":[[1,0,0],[0,1,0]],"family":"u"}"#,
        r#"{"edit":"cut","through":[1,0,0],"normal":[0,0,0]}"#,
    ] {
        let told = apply(&mut drawing, &json(wrong), &ground, &|_| Err("none".into()), &Silent);
        assert!(told.is_err(), "{wrong}");
        assert_eq!(drawing, Drawing::default());
    }
}

#[test]
fn a_seam_over_a_crease_of_23_degrees_is_sharp_or_smooth_as_it_is_told() {
    // A roof: z = -.2 |x| over a sheet, with a cut along its ridge.
    let mut mesh = shapes::rectangle(2.0, 1.0, 40, 20);
    let middle = mesh.bounds().center();
    mesh.points.iter_mut().for_each(|p| p.z = -0.2 * (p.x - middle.x).abs());
    let ridge = format!("[{},{},0]", middle.x, middle.y);
    let network = one_patch(&mesh);
    let cut = format!(r#"{{"edit":"cut","through":{ridge},"normal":[1,0,0]}}"#);
    let told = |seam: &str| format!(r#"{{"edit":"continuity","curves":[{{"near":{ridge}}}],"seam":"{seam}"}}"#);
    let start = Drawing { network, ..Drawing::default() };
    let smooth = run(&mesh, start.clone(), &[&cut]);
    let sharp = run(&mesh, smooth.clone(), &[&told("sharp")]);
    assert_eq!(smooth.network.patches, sharp.network.patches);
    let rounded = run(&mesh, sharp.clone(), &[&told("smooth")]);
    assert_eq!(run(&mesh, smooth.clone(), &[&told("smooth")]), rounded);
    assert_eq!(run(&mesh, rounded.clone(), &[&told("sharp")]), sharp);
    let angle = |drawing: &Drawing| {
        let (mesh, network) = (mesh.clone(), drawing.network.clone());
        let mut model = Model { mesh, network, ..Model::default() };
        let made = pipeline::rework(&mut model, None, &PipelineParams::default(), &Silent).unwrap();
        assert_eq!(made.seams.len(), 1);
        (made.seams[0].kind, made.seams[0].angle_mean_deg)
    };
    let crease = 2.0 * 0.2f64.atan().to_degrees();
    let (smooth, sharp) = (angle(&rounded), angle(&sharp));
    assert!(smooth.0 == CurveKind::Rounded && smooth.1 < 0.05, "{smooth:?}");
    assert!(sharp.0 == CurveKind::Feature && (sharp.1 - crease).abs() < 0.5, "{sharp:?} for {crease}");
    // The boundary has no seam.
    let ground = Ground::new(&mesh);
    let rim =
        format!(r#"{{"edit":"continuity","curves":[{{"near":[{},0,-0.2]}}],"seam":"smooth"}}"#, mesh.bounds().min.x);
    let wrong = apply(&mut start.clone(), &json(&rim), &ground, &|_| Err("no other".into()), &Silent).unwrap_err();
    assert!(matches!(wrong, ApplyError::NoSeam { .. }), "{wrong}");
}

#[test]
fn a_preview_is_what_the_edit_makes_then_and_leaves_the_drawing_as_it_is() {
    let mesh = shapes::rectangle(2.0, 1.0, 20, 10);
    let ground = Ground::new(&mesh);
    let others = |_: &str| Err("no other".into());
    let start = Drawing { network: one_patch(&mesh), ..Drawing::default() };
    let b = mesh.bounds();
    let (x, y) = (b.center().x, b.center().y);
    let cut = json(&format!(r#"{{"edit":"cut","through":[{x},{y},0],"normal":[1,0,0]}}"#));
    let before = start.clone();
    let (tried, told) = preview(&start, &cut, &ground, &others, &Silent).unwrap();
    assert_eq!(start, before);
    let mut drawing = start.clone();
    let made = apply(&mut drawing, &cut, &ground, &others, &Silent).unwrap();
    assert_eq!((tried.network.corners, tried.network.curves), (drawing.network.corners, drawing.network.curves));
    assert_eq!((told.corners, told.curves, told.faults), (made.corners, made.curves, None));
    assert!(made.faults.is_some());
    let wrong = json(r#"{"edit":"split_curve","curve":99,"at":0.5}"#);
    assert!(preview(&start, &wrong, &ground, &others, &Silent).is_err());
}
