//! Small edits of a finished network: patches cut anew alone, grids that follow, surfaces fitted on the seams around
//! them.

mod common;

use planish::curve::SnakeParams;
use planish::edit::network::{Editor, Holds};
use planish::edit::{Ground, apply};
use planish::grid::{self, Grid, GridParams};
use planish::layout::{Known, LayoutParams, layout};
use planish::mesh::{Adjacency, TriMesh};
use planish::model::{Drawing, Model};
use planish::network::{Network, PatchMesh, changed_patches, imprint, reimprint};
use planish::pipeline::{self, Earlier, PipelineParams};
use planish::surface::{self, FitParams};
use planish::synthetic::shapes;
use planish::{DVec3, Silent};

/// A wavy ball with a network of about 24 patches, and the same network with one curve dragged by a share of its
/// length.
fn edited(share: f64) -> (TriMesh, Adjacency, Network, Network, u32) {
    let mut mesh = shapes::sphere(1.0, 5);
    for p in &mut mesh.points {
        *p *= 1.0 + 0.05 * (5.0 * p.x).sin() * (4.0 * p.y).cos() + 0.01 * (23.0 * p.z + 11.0 * p.x).sin();
    }
    let adjacency = Adjacency::new(&mesh);
    let before =
        layout(&mesh, Known::default(), &LayoutParams { patches: 24, ..LayoutParams::default() }, None, &Silent)
            .unwrap()
            .network;
    let length = |c: usize| {
        let at: Vec<DVec3> = before.curves[c].points.iter().map(|p| p.position(&mesh)).collect();
        at.windows(2).map(|w| w[0].distance(w[1])).sum::<f64>()
    };
    let curve = (0..before.curves.len()).max_by(|&a, &b| length(a).total_cmp(&length(b))).unwrap();
    let points = &before.curves[curve].points;
    let (a, b) = (points[0].position(&mesh), points[points.len() - 1].position(&mesh));
    let aside = (b - a).cross(points[points.len() / 2].position(&mesh)).normalize() * (share * length(curve));
    let mut editor = Editor::new(&mesh, &adjacency, before.clone());
    let params = SnakeParams { fairness: 0.1, curvature: 1.0, ..SnakeParams::default() };
    let holds = Holds { section: Some((0.5, 0.7)), ..Holds::default() };
    editor.drag_curve(curve as u32, (0.5, aside), &holds, &params, &Silent).unwrap();
    let after = editor.network.clone();
    (mesh, adjacency, before, after, curve as u32)
}

#[test]
fn patches_cut_anew_beside_a_dragged_curve_are_those_of_the_whole_mesh_bit_for_bit() {
    let (mesh, adjacency, before, after, curve) = edited(0.08);
    let old = imprint(&mesh, &before, &Silent).unwrap();
    let which = changed_patches(&before, &after).expect("the same network");
    assert_eq!(which.len(), 2);
    assert!(which.iter().all(|&p| after.patches[p].sides.iter().any(|s| s.curve == curve)));
    let near: Vec<&PatchMesh> = which.iter().map(|&p| &old[p]).collect();
    let made = reimprint(&mesh, &adjacency, &after, &near, &which, &Silent).unwrap();
    let whole = imprint(&mesh, &after, &Silent).unwrap();
    for (&p, one) in which.iter().zip(&made) {
        assert_eq!(one.mesh, whole[p].mesh);
        assert_eq!(
            (&one.origin, &one.face_origin, &one.sides),
            (&whole[p].origin, &whole[p].face_origin, &whole[p].sides)
        );
    }
    // Told patches that do not hold the new curve, it cuts the whole mesh and says the same.
    let far = (0..old.len()).find(|p| !which.contains(p)).unwrap();
    let made = reimprint(&mesh, &adjacency, &after, &[&old[far]], &which, &Silent).unwrap();
    assert!(which.iter().zip(&made).all(|(&p, one)| one.mesh == whole[p].mesh));
    // Another curve more is another network.
    let mut split = Editor::new(&mesh, &adjacency, after.clone());
    split.split_curve(curve, 0.5).unwrap();
    assert_eq!(changed_patches(&before, &split.network), None);
    assert_eq!(changed_patches(&after, &after), Some(Vec::new()));
}

/// Grids before an edit, and after it made from nothing and by following.
fn both(share: f64, threads: usize) -> (TriMesh, Vec<PatchMesh>, Vec<Grid>, Vec<Grid>) {
    let (mesh, _, before, after, _) = edited(share);
    let old = imprint(&mesh, &before, &Silent).unwrap();
    let params = GridParams::default();
    let sizes = grid::choose_sizes(&before, &old, &params);
    let which = changed_patches(&before, &after).unwrap();
    let whole = imprint(&mesh, &after, &Silent).unwrap();
    let pick = |list: &[PatchMesh]| -> Vec<PatchMesh> { which.iter().map(|&p| list[p].clone()).collect() };
    let (old, new) = (pick(&old), pick(&whole));
    let sizes: Vec<_> = which.iter().map(|&p| sizes[p]).collect();
    let start = grid::relax(&mesh, &old, &sizes, &params, &Silent).unwrap();
    let cold = grid::relax(&mesh, &new, &sizes, &params, &Silent).unwrap();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let warm = pool.install(|| grid::follow(&mesh, &new, &start, &params, &Silent)).unwrap();
    (mesh, new, cold, warm)
}

#[test]
fn grids_that_follow_edits_of_2_and_8_percent_are_as_even_square_and_near_as_those_from_nothing() {
    for share in [0.02, 0.08] {
        let (mesh, patches, cold, warm) = both(share, 2);
        for ((patch, cold), warm) in patches.iter().zip(&cold).zip(&warm) {
            let (a, b) = (grid::measure(cold, patch), grid::measure(warm, patch));
            assert_eq!(b.folds, 0);
            assert!(b.spacing_cv < a.spacing_cv + 0.01, "{share}: {b:?} {a:?}");
            assert!(b.angle_p95_deg < a.angle_p95_deg + 2.0, "{share}: {b:?} {a:?}");
            assert!(b.miss_rms < 1.1 * a.miss_rms, "{share}: {b:?} {a:?}");
            let fit = |g: &Grid| {
                let s = surface::fit(&g.points, g.rows, g.cols, [g.rows / 4, g.cols / 4]).unwrap();
                surface::deviation_of(&s, g).rms
            };
            assert!(fit(warm) < 1.1 * fit(cold), "{share}: {} {}", fit(warm), fit(cold));
            // On the sides the same bits, everywhere on the mesh.
            let (cols, rows) = (warm.cols, warm.rows);
            for k in 0..cols * rows {
                let (i, j) = (k % cols, k / cols);
                if i == 0 || j == 0 || i + 1 == cols || j + 1 == rows {
                    assert_eq!((warm.points[k], warm.places[k]), (cold.points[k], cold.places[k]));
                }
                assert!(warm.places[k].position(&mesh).distance(warm.points[k]) < 1e-12);
            }
        }
    }
}

#[test]
fn grids_that_follow_are_bitwise_equal_on_1_and_4_threads() {
    assert_eq!(both(0.05, 1).3, both(0.05, 4).3);
}

#[test]
fn a_grid_of_a_patch_that_grew_by_a_third_is_made_from_nothing() {
    let sheet =
        |width: f64| shapes::sheet(40, 30, false, false, move |s, t| DVec3::new(width * s, t, 0.1 * (5.0 * s).sin()));
    let one = |mesh: &TriMesh| -> Vec<PatchMesh> {
        let b = mesh.bounds();
        let corner = |x: f64, y: f64| {
            format!(
                r#"{{"edit":"add_corner","at":[{},{},0],"snap":0}}"#,
                b.min.x + x * (b.max.x - b.min.x),
                b.min.y + y
            )
        };
        let edits =
            [corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0), r#"{"edit":"boundaries"}"#.into()];
        imprint(mesh, &drawn(mesh, &edits).network, &Silent).unwrap()
    };
    let (small, large) = (sheet(1.0), sheet(1.33));
    let params = GridParams::default();
    let start = grid::relax(&small, &one(&small), &[(41, 33)], &params, &Silent).unwrap();
    let cold = grid::relax(&large, &one(&large), &[(41, 33)], &params, &Silent).unwrap();
    assert_eq!(grid::follow(&large, &one(&large), &start, &params, &Silent).unwrap(), cold);
    // As many grids as patches, with as many points as they say.
    assert!(grid::follow(&large, &one(&large), &[], &params, &Silent).is_err());
    let mut wrong = start.clone();
    wrong[0].points.pop();
    assert!(grid::follow(&large, &one(&large), &wrong, &params, &Silent).is_err());
}

/// Applies edits written as JSON.
fn drawn(mesh: &TriMesh, edits: &[String]) -> Drawing {
    let ground = Ground::new(mesh);
    let mut drawing = Drawing::default();
    for edit in edits {
        let edit = serde_json::from_str(edit).unwrap_or_else(|e| panic!("{e}: {edit}"));
        apply(&mut drawing, &edit, &ground, &|_| Err("no other".into()), &Silent).unwrap_or_else(|e| panic!("{e}"));
    }
    drawing
}

#[test]
fn surfaces_beside_a_dragged_curve_are_fitted_on_the_seams_of_all_others_bit_for_bit() {
    let (mesh, _, before, after, curve) = edited(0.05);
    let params = PipelineParams::default();
    let mut model = Model { mesh: mesh.clone(), network: before.clone(), ..Model::default() };
    pipeline::rework(&mut model, None, &params, &Silent).unwrap();
    let earlier = Earlier::of(&model).expect("grids");
    let which = changed_patches(&before, &after).unwrap();
    let patches = imprint(&mesh, &after, &Silent).unwrap();
    let some: Vec<PatchMesh> = which.iter().map(|&p| patches[p].clone()).collect();
    let old: Vec<Grid> = which.iter().map(|&p| model.grids[p].clone()).collect();
    let mut grids = model.grids.clone();
    for (&p, grid) in which.iter().zip(grid::follow(&mesh, &some, &old, &params.grid, &Silent).unwrap()) {
        grids[p] = grid;
    }
    let made = surface::retouch(&after, &grids, &model.surfaces, &[curve], &FitParams::default(), &Silent).unwrap();
    assert_eq!(made.iter().map(|m| m.0).collect::<Vec<_>>(), which);
    let mut surfaces = model.surfaces.clone();
    made.into_iter().for_each(|(p, s)| surfaces[p] = s);
    let seams = surface::measure_seams(&after, &surfaces, &Silent).unwrap();
    assert!(seams.iter().all(|s| s.gap_max < 1e-14));
    // As near to the new grids as surfaces were to the old ones, and half as much again.
    for &p in &which {
        let before = surface::deviation_of(&model.surfaces[p], &model.grids[p]).rms;
        let now = surface::deviation_of(&surfaces[p], &grids[p]).rms;
        assert!(now < 1.5 * before, "{now} {before}");
    }
    // The whole model from what it was: grids of the other patches stay, and it is as good as one from nothing.
    let kept = model.grids.clone();
    model.network = after;
    let mut cold = model.clone();
    let warm = pipeline::rework(&mut model, Some(&earlier), &params, &Silent).unwrap();
    assert!((0..kept.len()).all(|p| (model.grids[p] == kept[p]) != which.contains(&p)));
    let from_nothing = pipeline::rework(&mut cold, None, &params, &Silent).unwrap();
    for key in ["displaced.rms", "seam.gap_max", "grid.folds"] {
        let (a, b) = (warm.quality[key].value(), from_nothing.quality[key].value());
        assert!(a <= 1.2 * b + 1e-12, "{key}: {a} {b}");
    }
    assert!(warm.quality["relief.rounding_max_rel"].value() < 1e-12);
}

#[test]
fn a_model_remade_edit_by_edit_is_that_of_the_whole_way_to_the_bit() {
    let (mesh, adjacency, before, after, _) = edited(0.05);
    let params = PipelineParams::default();
    let mut model = Model { mesh, network: before.clone(), ..Model::default() };
    let mut whole = model.clone();
    let mut earlier = None;
    // From nothing, an edit, the edit taken back, and nothing at all.
    for network in [&before, &after, &before, &before] {
        let known = Earlier::of(&whole);
        whole.network = network.clone();
        let told = pipeline::rework(&mut whole, known.as_ref(), &params, &Silent).unwrap();
        model.network = network.clone();
        let made = pipeline::remake(&mut model, &adjacency, earlier.as_ref(), &params, &Silent).unwrap();
        earlier = made.earlier;
        assert!(model == whole);
        // Patches that the edit left alone are not cut out again.
        let cut = made.stages.iter().find(|s| s.name == "imprint").map(|s| s.counts["patches"]).unwrap();
        assert!(cut == network.patches.len() as u64 || cut == 2 || cut == 0, "{cut}");
        // What is measured later is what would have been told at once.
        let found = pipeline::assess(&model, &Silent).unwrap();
        assert_eq!((&found.quality, &found.seams, &found.warnings), (&told.quality, &told.seams, &told.warnings));
        // The surfaces are those of the grids, whatever was there before.
        let mut anew = Model { surfaces: Vec::new(), reliefs: Vec::new(), ..model.clone() };
        pipeline::refit(&mut anew, &params, &Silent).unwrap();
        assert!(anew == model);
    }
}

/// An ellipsoid whose triangles are not symmetric in x, drawn as a box of six patches: two on the sides of the plane
/// x = 0 and four across it. What lies behind the plane is drawn badly.
fn box_across() -> Vec<String> {
    let corner = |x: f64, y: f64, z: f64| format!("[{x},{y},{z}]");
    let mut edits = vec![r#"{"edit":"symmetry","plane":{"point":[0,0,0],"normal":[1,0,0]}}"#.to_string()];
    let paint = |a: String, b: String| format!(r#"{{"edit":"paint","picks":[{a},{b}],"mode":"geodesic","snap":0.02}}"#);
    let turn = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)];
    for k in 0..4 {
        let ((y, z), (v, w)) = (turn[k], turn[(k + 1) % 4]);
        edits.push(paint(corner(0.7, 0.6 * y, 0.55 * z), corner(0.7, 0.6 * v, 0.55 * w)));
    }
    for (y, z) in turn {
        edits.push(paint(corner(0.7, 0.6 * y, 0.55 * z), corner(-0.8, 0.5 * y, 0.6 * z)));
    }
    edits
}

#[test]
fn patches_and_curves_across_the_plane_of_symmetry_become_their_own_images() {
    let mut mesh = shapes::sphere(1.0, 4);
    for p in &mut mesh.points {
        let turn = glam::DQuat::from_axis_angle(DVec3::new(0.3, 0.8, -0.4).normalize(), 0.4);
        let q = turn * *p;
        *p = DVec3::new(1.2 * q.x, q.y + 0.2 * q.x * q.x, 0.9 * q.z * (1.0 + 0.3 * q.y));
    }
    let mut edits = box_across();
    edits.push(r#"{"edit":"mirror"}"#.into());
    let drawing = drawn(&mesh, &edits);
    let network = &drawing.network;
    assert_eq!((network.corners.len(), network.curves.len(), network.patches.len()), (8, 12, 6), "{:?}", edits);
    // One curve on the patch before the plane, and one across it on the patch on top.
    edits.push(r#"{"edit":"feature","picks":[[1.1,0.9,0.1],[1.3,0.2,0.1],[1.1,-0.5,0.1]],"family":"u"}"#.into());
    edits.push(r#"{"edit":"feature","picks":[[0.5,0.1,1.0],[0.1,0.0,1.0],[-0.4,-0.1,1.0]],"family":"u"}"#.into());
    let drawing = {
        let first = drawn(&mesh, &edits);
        // The family that the numbers of the sides ask for is not known beforehand.
        let mut fitting = first.clone();
        let patches = imprint(&mesh, &first.network, &Silent).unwrap();
        for f in &mut fitting.sketch.features {
            let sides = &patches[f.patch as usize].sides;
            let at = |p: &planish::mesh::FacePoint| p.position(&mesh);
            let (a, b) = (at(&f.points[0]), at(&f.points[f.points.len() - 1]));
            let away = |k: usize, p: DVec3| {
                let m = &patches[f.patch as usize].mesh;
                sides[k].iter().map(|&v| m.points[v as usize].distance(p)).fold(f64::INFINITY, f64::min)
            };
            let miss = |k: usize| (away(k, a) + away(k + 2, b)).min(away(k, b) + away(k + 2, a));
            f.family = if miss(0) < miss(1) { grid::Family::V } else { grid::Family::U };
        }
        fitting
    };
    let ground = Ground::new(&mesh);
    let mut mirrored = drawing.clone();
    let edit = serde_json::from_str(r#"{"edit":"mirror"}"#).unwrap();
    apply(&mut mirrored, &edit, &ground, &|_| Err("no other".into()), &Silent).unwrap();
    let features = &mirrored.sketch.features;
    assert_eq!(features.len(), 3);
    let plane = mirrored.sketch.symmetry.unwrap();
    let positions = |k: usize| -> Vec<DVec3> { features[k].points.iter().map(|p| p.position(&mesh)).collect() };
    let miss = |a: &[DVec3], b: &[DVec3]| {
        let to = |p: DVec3| {
            let near = b.windows(2).map(|w| {
                let d = w[1] - w[0];
                let s = ((p - w[0]).dot(d) / d.length_squared().max(1e-300)).clamp(0.0, 1.0);
                p.distance(w[0] + d * s)
            });
            near.fold(f64::INFINITY, f64::min)
        };
        a.iter().map(|p| to(plane.mirror(*p))).fold(0.0, f64::max)
    };
    // The mesh is symmetric as a shape to 3e-3 only, for its triangles are not.
    assert!(miss(&positions(0), &positions(1)) < 3e-3, "{}", miss(&positions(0), &positions(1)));
    assert!(miss(&positions(2), &positions(2)) < 3e-3, "{}", miss(&positions(2), &positions(2)));
    let mut model = Model {
        mesh: mesh.clone(),
        network: mirrored.network.clone(),
        sketch: mirrored.sketch.clone(),
        ..Model::default()
    };
    let told = pipeline::rework(&mut model, None, &PipelineParams::default(), &Silent).unwrap();
    assert!(told.quality["seam.gap_max"].value() < 1e-14 * mesh.bounds().diagonal());
    assert!(told.quality["relief.rounding_max_rel"].value() < 1e-12);
    let own: Vec<usize> = (0..6)
        .filter(|&p| {
            let s = &model.surfaces[p].control;
            s.iter().all(|c| s.iter().any(|d| plane.mirror(*c).distance(*d) < 1e-14))
        })
        .collect();
    assert_eq!(own.len(), 4, "{own:?}");
    let sides: Vec<usize> = (0..6).filter(|p| !own.contains(p)).collect();
    let (a, b) = (&model.surfaces[sides[0]].control, &model.surfaces[sides[1]].control);
    assert!(a.iter().all(|c| b.iter().any(|d| plane.mirror(*c) == *d)));
    assert!(model.network.curves.iter().all(|c| c.kind.is_smooth()));
    // A curve that crosses the plane three times is refused with its number.
    let mut wavy = drawing.clone();
    let points = "[[0.3,0.9,0.2],[-0.3,0.9,0.0],[0.3,0.9,-0.2],[-0.3,0.9,-0.4]]";
    let edit =
        serde_json::from_str(&format!(r#"{{"edit":"paint","picks":{points},"mode":"geodesic","snap":0}}"#)).unwrap();
    apply(&mut wavy, &edit, &ground, &|_| Err("no other".into()), &Silent).unwrap();
    let edit = serde_json::from_str(r#"{"edit":"mirror"}"#).unwrap();
    let told = apply(&mut wavy, &edit, &ground, &|_| Err("no other".into()), &Silent).unwrap_err().to_string();
    assert!(told.contains("more than once") && told.contains("hint"), "{told}");
}
