//! Sessions of edits as a person would make them: strokes led on pick by pick, curves that meet others, held and
//! stiffened curves, wrong edits.

use glam::DVec3;
use planish::curve::Relaxed;
use planish::edit::network::EditError;
use planish::edit::{ApplyError, CurveNumber, Edit, Ground, Made, apply};
use planish::geom::Bvh;
use planish::grid::{self, Family};
use planish::mesh::{Adjacency, Attribute, TriMesh};
use planish::model::{Drawing, HistoryEntry, Model};
use planish::network::{CurveKind, Fault, diagnose, imprint};
use planish::observe::Silent;
use planish::pipeline::{self, PipelineParams};
use planish::synthetic::shapes;

fn json(text: &str) -> Edit {
    serde_json::from_str(text).unwrap_or_else(|e| panic!("{e}: {text}"))
}

fn make(ground: &Ground, drawing: &mut Drawing, edit: &str) -> Result<Made, ApplyError> {
    apply(drawing, &json(edit), ground, &|_| Err("no other".into()), &Silent)
}

/// Applies edits written as JSON, and gives what they did.
fn run(mesh: &TriMesh, edits: &[&str]) -> (Drawing, Vec<Made>) {
    let ground = Ground::new(mesh);
    let mut drawing = Drawing::default();
    let made = edits.iter().map(|e| make(&ground, &mut drawing, e).unwrap_or_else(|x| panic!("{x}: {e}"))).collect();
    (drawing, made)
}

const CUTS: [&str; 3] = [
    r#"{"edit":"cut","through":[1,0,0.003],"normal":[0,0.02,1]}"#,
    r#"{"edit":"cut","through":[1,0.004,0],"normal":[0.01,1,0]}"#,
    r#"{"edit":"cut","through":[0.002,1,0],"normal":[1,0,0.03]}"#,
];

#[test]
fn three_great_circles_divide_each_other_at_6_corners_and_their_8_triangles_split_into_four_sided_patches() {
    let mesh = shapes::sphere(1.0, 5);
    let cuts = CUTS.map(|c| c.replace('}', r#","snap":0}"#));
    let (drawing, made) = run(&mesh, &cuts.each_ref().map(|c| c.as_str()));
    let network = &drawing.network;
    let ends = |k: u32| network.curves.iter().flat_map(|c| c.corners).filter(|&c| c == k).count();
    let meetings = (0..network.corners.len() as u32).filter(|&k| ends(k) == 4).count();
    assert_eq!(meetings, 6, "{network:?}");
    // Besides the corners where they meet one is left where the first circle starts.
    assert_eq!((network.corners.len(), network.curves.len()), (7, 13));
    let told = made[2].faults.as_ref().unwrap();
    assert!(told.iter().all(|f| f.to_string().contains("sides, not 4")), "{told:?}");
    // Corners lie on both planes.
    for (k, c) in network.corners.iter().enumerate().filter(|(k, _)| ends(*k as u32) == 4) {
        let p = c.place.position(&mesh);
        let on = [p.z + 0.02 * p.y - 0.003, 0.01 * (p.x - 1.0) + p.y - 0.004, p.x - 0.002 + 0.03 * p.z];
        assert_eq!(on.iter().filter(|h| h.abs() < 1e-4).count(), 2, "{k}: {p} {on:?}");
    }
    // The corner of the first circle's start goes, and every region is split.
    let ground = Ground::new(&mesh);
    let mut drawing = drawing.clone();
    let start = (0..7u32).find(|&k| ends(k) == 2).unwrap();
    make(&ground, &mut drawing, &format!(r#"{{"edit":"delete_corner","corner":{start}}}"#)).unwrap();
    // As the diagnosis offers it, until nothing is left to do: a split puts corners into neighbours.
    for _ in 0..40 {
        let found = diagnose(&mesh, &Adjacency::new(&mesh), &drawing.network);
        let Some(Fault::NotFourSided { place, .. }) = found.faults.first() else { break };
        let split = format!(r#"{{"edit":"split_region","at":[{},{},{}]}}"#, place.x, place.y, place.z);
        make(&ground, &mut drawing, &split).unwrap();
    }
    let found = diagnose(&mesh, &Adjacency::new(&mesh), &drawing.network);
    assert!(found.is_finished(), "{:?}", found.faults);
    // A triangle with a corner in one side is a patch: two triangles across from each other are split, six are not.
    assert_eq!(found.patches.len(), 12);
    assert_eq!(imprint(&mesh, &drawing.network, &Silent).unwrap().len(), found.patches.len());
}

#[test]
fn a_stroke_through_a_corner_where_others_meet_is_divided_there_and_nowhere_else() {
    let mesh = shapes::sphere(1.0, 5);
    let ground = Ground::new(&mesh);
    let (mut drawing, _) = run(&mesh, &CUTS[..2]);
    let four = |d: &Drawing, p: DVec3| {
        let ends = |k: usize| d.network.curves.iter().flat_map(|c| c.corners).filter(|&c| c as usize == k).count();
        let near = d.network.corners.iter().position(|c| c.place.position(&mesh).distance(p) < 0.02);
        near.map(ends)
    };
    assert_eq!(four(&drawing, DVec3::X), Some(4));
    let before = drawing.network.curves.len();
    let stroke =
        r#"{"edit":"paint","mode":"geodesic","picks":[[0.8,0.4,0.4],[1.0,0.005,0.004],[0.8,-0.4,-0.4]],"snap":0.02}"#;
    let made = make(&ground, &mut drawing, stroke).unwrap();
    assert_eq!(drawing.network.curves.len(), before + 2);
    assert_eq!(four(&drawing, DVec3::X), Some(6));
    assert_eq!(made.curves.len(), 2, "no other curve has another course: {made:?}");
}

#[test]
fn a_stroke_led_on_pick_by_pick_is_that_painted_at_once_and_is_taken_back_pick_by_pick() {
    let mesh = shapes::sphere(1.0, 5);
    let at = ["[1,0,0.1]", "[0.6,0.7,0]", "[0,1,0.2]", "[-0.7,0.6,0]"];
    for mode in ["straight", "geodesic", "magnetic"] {
        let whole = format!(r#"{{"edit":"paint","mode":"{mode}","snap":0,"picks":[{}]}}"#, at.join(","));
        let (whole, _) = run(&mesh, &[&whole]);
        let ground = Ground::new(&mesh);
        let mut model = Model { mesh: mesh.clone(), ..Model::default() };
        let mut states = vec![model.drawing()];
        let first = format!(r#"{{"edit":"paint","mode":"{mode}","snap":0,"picks":[{},{}]}}"#, at[0], at[1]);
        let more = |p: &str| format!(r#"{{"edit":"extend","curve":0,"mode":"{mode}","snap":0,"picks":[{p}]}}"#);
        for edit in [first, more(at[2]), more(at[3])] {
            let mut drawing = model.drawing();
            make(&ground, &mut drawing, &edit).unwrap();
            model.record(HistoryEntry { command: json(&edit).name(), parameters: json(&edit).parameters() }, drawing);
            states.push(model.drawing());
        }
        assert_eq!(model.network.curves.len(), 1);
        assert_eq!(model.network.corners.len(), 2);
        if mode != "magnetic" {
            assert_eq!(model.network.curves[0].points, whole.network.curves[0].points, "{mode}");
        }
        for state in states.iter().rev().skip(1) {
            assert!(model.undo());
            assert_eq!(model.drawing(), *state);
        }
        assert!(!model.undo());
        // Led on to its own start it is closed, and has no free end any more.
        let mut drawing = whole.clone();
        let close =
            r#"{"edit":"extend","curve":{"near":[0,1,0.2]},"mode":"geodesic","picks":[[0,-1,0]],"closed":true}"#;
        make(&ground, &mut drawing, close).unwrap();
        let curve = &drawing.network.curves[0];
        assert_eq!((drawing.network.corners.len(), curve.corners[0]), (1, curve.corners[1]));
        let refused = make(&ground, &mut drawing, close).unwrap_err();
        assert_eq!(refused, ApplyError::NotFree { curve: 0 });
    }
}

#[test]
fn picks_go_to_sharp_edges_within_the_snap_distance_and_stay_where_they_are_without() {
    let mesh = shapes::cuboid(DVec3::ONE, 20);
    let stroke = |snap: f64| {
        let edit = format!(r#"{{"edit":"paint","snap":{snap},"picks":[[-0.28,0.01,0.5],[0.47,0.02,0.5]]}}"#);
        let (drawing, _) = run(&mesh, &[&edit]);
        drawing.network.corners.iter().map(|c| c.place.position(&mesh)).collect::<Vec<_>>()
    };
    let b = mesh.bounds();
    let x = |p: DVec3| (p.x - b.min.x) / (b.max.x - b.min.x);
    let free = stroke(0.0);
    let held = stroke(0.03);
    assert!((x(free[1]) - x(held[1])).abs() > 1e-6);
    assert_eq!(x(held[1]), 1.0, "{held:?}");
    assert_eq!(free[0], held[0]);
}

#[test]
fn sharp_lines_asked_for_twice_are_there_once_and_a_part_that_was_deleted_comes_back() {
    let mesh = shapes::cuboid(DVec3::ONE, 6);
    let lines = r#"{"edit":"feature_lines","angle_deg":40}"#;
    let (twice, made) = run(&mesh, &[lines, lines]);
    assert_eq!((twice.network.curves.len(), twice.network.patches.len()), (12, 6));
    assert!(made[0].changed && !made[1].changed);
    let (again, _) = run(&mesh, &[lines, r#"{"edit":"delete_curves","curves":[0,{"near":[0.5,0.5,0.0]}]}"#, lines]);
    assert_eq!((again.network.curves.len(), again.network.patches.len()), (12, 6));
}

#[test]
fn energy_and_rest_are_told_pins_hold_and_a_stiff_stretch_bends_less() {
    let mesh = shapes::sphere(1.0, 5);
    let ground = Ground::new(&mesh);
    let painted = r#"{"edit":"paint","picks":[[1,0,-0.2],[0.7,0.7,0.3],[0,1,-0.2],[-0.7,0.7,0.3]],"snap":0}"#;
    let (start, _) = run(&mesh, &[painted]);
    let relax = |more: &str| {
        let mut drawing = start.clone();
        let edit = format!(
            r#"{{"edit":"relax","curve":0,"forces":{{"fairness":1.0,"curvature":0.5,"sweeps":400,"settle":1e-5}}{more}}}"#
        );
        let made = make(&ground, &mut drawing, &edit).unwrap();
        let at: Vec<DVec3> = drawing.network.curves[0].points.iter().map(|p| p.position(&mesh)).collect();
        (at, made)
    };
    let (free, made) = relax("");
    let [told] = &made.relaxed[..] else { panic!("{made:?}") };
    let Relaxed { energy, settled, sweeps, last_move, .. } = told.relaxed;
    assert!(settled && sweeps <= 400 && last_move < 1e-5 && energy[1].total() < energy[0].total(), "{told:?}");
    assert_eq!(told.curve, CurveNumber::Curve(0));
    let away = |curve: &[DVec3], p: DVec3| curve.iter().map(|q| q.distance(p)).fold(f64::INFINITY, f64::min);
    let old: Vec<DVec3> = start.network.curves[0].points.iter().map(|p| p.position(&mesh)).collect();
    let length: f64 = old.windows(2).map(|w| w[0].distance(w[1])).sum();
    let mut sum = 0.0;
    let third = old.windows(2).find_map(|w| {
        sum += w[0].distance(w[1]);
        (sum > length / 3.0).then_some(w[1])
    });
    let third = third.unwrap();
    let edge = length / 60.0;
    let (held, _) = relax(r#","pins":[0.3333333]"#);
    assert!(away(&free, third) > 2.0 * edge && away(&held, third) < edge, "{} {edge}", away(&held, third));
    // Sharpest turn in the surface around the pin, between places some edges apart.
    let kink = |curve: &[DVec3]| -> f64 {
        let n = curve.len();
        let places: Vec<DVec3> = curve[n / 6..n / 2].iter().step_by(3).copied().collect();
        let turn = |w: &[DVec3]| {
            let (a, b, up) = (w[1] - w[0], w[2] - w[1], w[1].normalize());
            let flat = |v: DVec3| (v - up * v.dot(up)).normalize_or_zero();
            flat(a).cross(flat(b)).dot(up).abs().asin()
        };
        places.windows(3).map(turn).fold(0.0, f64::max)
    };
    let stretch = r#","pins":[0.3333333],"stiffness":[{"from":0.17,"to":0.5,"curvature":200.0,"fairness":0.05}]"#;
    let (stiff, _) = relax(stretch);
    assert!(kink(&stiff) < 0.7 * kink(&held), "{} {}", kink(&stiff), kink(&held));
}

#[test]
fn a_loop_without_other_curves_relaxes_and_bends_as_one_without_a_corner_and_one_that_shrinks_is_refused() {
    let mesh = shapes::torus(2.0, 0.6, 120, 48);
    let ground = Ground::new(&mesh);
    let around = r#"{"edit":"paint","closed":true,"snap":0,"mode":"geodesic",
        "picks":[[1.5,0.2,0.2],[0.0,1.5,-0.2],[-1.5,0.0,0.2],[0.0,-1.5,0.1]]}"#;
    let (start, _) = run(&mesh, &[around]);
    let bend = |d: &Drawing| {
        let p: Vec<DVec3> = d.network.curves[0].points.iter().map(|p| p.position(&mesh)).collect();
        // Over four edges to both sides of the corner.
        let reach = 4.0 * (2.0 * std::f64::consts::TAU / 120.0);
        let ahead = p.iter().find(|q| q.distance(p[0]) > reach).unwrap();
        let back = p.iter().rev().find(|q| q.distance(p[0]) > reach).unwrap();
        (*ahead - p[0]).angle_between(p[0] - *back).to_degrees()
    };
    let (before, mut drawing) = (start.network.corners[0].place, start.clone());
    make(&ground, &mut drawing, r#"{"edit":"relax","curve":0,"forces":{"fairness":1.0,"curvature":0.0}}"#).unwrap();
    // The shortest way around the hole is the inner equator, 1.4 away from the axis.
    let far = |d: &Drawing| {
        let p = d.network.curves[0].points.iter().map(|p| p.position(&mesh));
        p.map(|p| (p.truncate().length() - 1.4).abs()).fold(0.0, f64::max)
    };
    assert!(drawing.network.corners[0].place != before && far(&drawing) < 0.01, "{}", far(&drawing));
    let mut smooth = start.clone();
    make(&ground, &mut smooth, r#"{"edit":"spline","curve":0,"control":8}"#).unwrap();
    assert!(bend(&smooth) < 0.8 * bend(&start).max(25.0), "{} {}", bend(&smooth), bend(&start));
    let ends = &smooth.network.curves[0];
    assert_eq!(ends.points[0], smooth.network.corners[0].place);
    assert_eq!(ends.points[0], ends.points[ends.points.len() - 1]);
    // A small loop on the outside shrinks.
    let small = r#"{"edit":"paint","closed":true,"snap":0,"picks":[[2.55,0.3,0],[2.5,0,0.3],[2.55,-0.3,0]]}"#;
    let (mut drawing, _) = run(&mesh, &[small]);
    let kept = drawing.clone();
    let refused = make(
        &ground,
        &mut drawing,
        r#"{"edit":"relax","curve":0,"forces":{"fairness":1.0,"curvature":0.0,"sweeps":5000}}"#,
    );
    assert_eq!(refused.unwrap_err(), ApplyError::Edit(EditError::Shrunk { curve: 0 }));
    assert_eq!(drawing, kept);
}

#[test]
fn curves_are_drawn_to_colour_luminance_curvatures_and_a_users_values_within_half_an_edge() {
    // A ring of colour at z = 0.3, as luminance, as a channel, as an attribute of the user's, as values in the script.
    let mut mesh = shapes::sphere(1.0, 4);
    let ring = |p: DVec3| (-((p.z - 0.3) / 0.12).powi(2)).exp();
    let color: Vec<f32> = mesh.points.iter().flat_map(|p| [ring(*p) as f32; 3]).collect();
    let heat: Vec<f32> = mesh.points.iter().map(|p| ring(*p) as f32).collect();
    mesh.attributes.push(Attribute { name: "color".into(), width: 3, values: color });
    mesh.attributes.push(Attribute { name: "heat".into(), width: 1, values: heat });
    let values: Vec<String> = mesh.points.iter().map(|p| format!("{:.6}", ring(*p))).collect();
    let edge = mesh.points[mesh.triangles[0][0] as usize].distance(mesh.points[mesh.triangles[0][1] as usize]);
    let ground = Ground::new(&mesh);
    let painted = r#"{"edit":"paint","closed":true,"snap":0,"mode":"geodesic",
        "picks":[[0.9,0,0.4],[0,0.95,0.2],[-0.9,0,0.4],[0,-0.95,0.2]]}"#;
    let (start, _) = run(&mesh, &[painted]);
    let scalars = [
        r#""luminance""#.to_string(),
        r#"{"channel":{"attribute":"color","channel":1}}"#.into(),
        r#"{"channel":{"attribute":"heat","channel":0}}"#.into(),
        format!(r#"{{"values":[{}]}}"#, values.join(",")),
    ];
    for scalar in scalars {
        let mut drawing = start.clone();
        let edit = format!(
            r#"{{"edit":"relax","curve":0,"pull":{{"scalar":{scalar},"weight":30.0,"blending":4}},
                "forces":{{"fairness":0.02,"curvature":0.2,"sweeps":300}}}}"#
        );
        make(&ground, &mut drawing, &edit).unwrap();
        let at = drawing.network.curves[0].points.iter().map(|p| p.position(&mesh));
        let miss = at.map(|p| (p.z - 0.3).abs()).fold(0.0, f64::max);
        assert!(miss < edge / 2.0, "{miss} {edge} {}", &scalar[..scalar.len().min(40)]);
    }
    // Curvature: the rim of a lens, and low values turned round lead away from it.
    let mut lens = shapes::sphere(1.0, 4);
    lens.points.iter_mut().for_each(|p| p.z *= 0.4);
    let ground = Ground::new(&lens);
    let painted = r#"{"edit":"paint","closed":true,"snap":0,"mode":"geodesic",
        "picks":[[0.95,0,0.1],[0,0.95,0.12],[-0.95,0,0.1],[0,-0.95,0.12]]}"#;
    let (start, _) = run(&lens, &[painted]);
    let height = |d: &Drawing| {
        let at = d.network.curves[0].points.iter().map(|p| p.position(&lens).z.abs());
        at.fold(0.0, f64::max)
    };
    for scalar in ["mean_curvature", "gaussian_curvature", "maximum_curvature"] {
        let mut drawing = start.clone();
        let edit = format!(
            r#"{{"edit":"relax","curve":0,"pull":{{"scalar":"{scalar}","weight":30.0}},
                "forces":{{"fairness":0.02,"curvature":0.2,"sweeps":300}}}}"#
        );
        make(&ground, &mut drawing, &edit).unwrap();
        assert!(height(&drawing) < edge / 2.0, "{scalar}: {} {}", height(&drawing), height(&start));
    }
}

/// A flat sheet with a bump as one patch, and strokes from side to side of it.
fn sheet() -> (TriMesh, Drawing) {
    let at =
        |s: f64, t: f64| DVec3::new(2.0 * s, t, 0.2 * (-(9.0 * (s - 0.5).powi(2) + 12.0 * (t - 0.5).powi(2))).exp());
    let mesh = shapes::sheet(60, 40, false, false, at);
    let corner = |x: f64, y: f64| format!(r#"{{"edit":"add_corner","at":[{x},{y},0],"snap":0.002}}"#);
    let corners = [corner(0.0, 0.0), corner(2.0, 0.0), corner(2.0, 1.0), corner(0.0, 1.0)];
    let mut edits: Vec<&str> = corners.iter().map(|s| s.as_str()).collect();
    edits.push(r#"{"edit":"boundaries"}"#);
    let (drawing, _) = run(&mesh, &edits);
    assert_eq!(drawing.network.patches.len(), 1);
    (mesh, drawing)
}

#[test]
fn feature_curves_tell_their_family_and_those_that_cross_are_refused_when_they_are_drawn() {
    let (mesh, start) = sheet();
    let ground = Ground::new(&mesh);
    let feature = |a: [f64; 2], b: [f64; 2]| {
        format!(r#"{{"edit":"feature","mode":"geodesic","picks":[[{},{},0],[{},{},0]]}}"#, a[0], a[1], b[0], b[1])
    };
    let mut drawing = start.clone();
    make(&ground, &mut drawing, &feature([0.6, 0.02], [0.8, 0.98])).unwrap();
    make(&ground, &mut drawing, &feature([0.03, 0.4], [1.97, 0.6])).unwrap();
    let families: Vec<Family> = drawing.sketch.features.iter().map(|f| f.family).collect();
    assert!(families[0] != families[1], "{families:?}");
    let kept = drawing.clone();
    let refused = make(&ground, &mut drawing, &feature([0.9, 0.02], [0.4, 0.98])).unwrap_err().to_string();
    assert!(refused.contains("feature curves 0 and 2 of one family cross at ("), "{refused}");
    assert_eq!(drawing, kept);
    // One that is not from side to side, and a wrong number of sections.
    let sections = |u: &str| format!(r#"{{"edit":"sections","at":[1.0,0.5,0.2],"{}":{u}}}"#, across(&families));
    let refused = make(&ground, &mut drawing, &sections("[8,8,8]")).unwrap_err().to_string();
    assert!(refused.contains("3 sections") && refused.contains("2 are between"), "{refused}");
    make(&ground, &mut drawing, &sections("[8,20]")).unwrap();
    assert_eq!(drawing.sketch.sections.len(), 1);
    // One curve less: the cells across it were of other sections.
    make(&ground, &mut drawing, r#"{"edit":"delete_feature","feature":{"near":[0.7,0.5,0.1]}}"#).unwrap();
    assert_eq!((drawing.sketch.features.len(), drawing.sketch.sections.len()), (1, 0));
}

/// The letter of the direction in which sections lie between curves of the first family.
fn across(families: &[Family]) -> &'static str {
    if families[0] == Family::V { "u" } else { "v" }
}

#[test]
fn a_patch_without_feature_curves_gets_the_cells_that_are_given() {
    let (mesh, start) = sheet();
    let ground = Ground::new(&mesh);
    let mut drawing = start;
    make(&ground, &mut drawing, r#"{"edit":"sections","at":[1.0,0.5,0.2],"u":[37],"v":[23]}"#).unwrap();
    let mut model = Model { mesh, network: drawing.network, sketch: drawing.sketch, ..Model::default() };
    pipeline::rework(&mut model, None, &PipelineParams::default(), &Silent).unwrap();
    assert_eq!((model.grids[0].cols, model.grids[0].rows), (38, 24));
    let patches = imprint(&model.mesh, &model.network, &Silent).unwrap();
    assert_eq!(grid::measure(&model.grids[0], &patches[0]).folds, 0);
}

#[test]
fn numbers_out_of_their_range_are_told_by_name_and_leave_the_drawing_as_it_was() {
    let mesh = shapes::sphere(1.0, 4);
    let ground = Ground::new(&mesh);
    let (mut drawing, _) = run(&mesh, &CUTS[..1]);
    let before = drawing.clone();
    for (edit, told) in [
        (r#"{"edit":"relax","curve":0,"forces":{"fairness":-1.0}}"#, "fairness is -1, not 0 or more"),
        (r#"{"edit":"relax","curve":0,"section":[0.5,0.0]}"#, "the width of the section is 0, not more than 0"),
        (r#"{"edit":"relax","curve":0,"pins":[1.5]}"#, "a pin is 1.5, not between 0 and 1"),
        (r#"{"edit":"relax","curve":0,"stiffness":[{"from":0.6,"to":0.4}]}"#, "the length of a stretch is"),
        (r#"{"edit":"cut","through":[1,0,0],"normal":[0,0,0]}"#, "the length of normal is 0, not more than 0"),
        (r#"{"edit":"spline","curve":0,"control":3}"#, "control is 3, not between 4 and 1000"),
        (r#"{"edit":"paint","picks":[[1,0,0],[0,1,0]],"snap":-0.1}"#, "snap is -0.1, not 0 or more"),
        (r#"{"edit":"feature_lines","angle_deg":200}"#, "angle_deg is 200, not between 0 and 180 degrees"),
        (r#"{"edit":"complete","patches":0}"#, "patches is 0, not 1 or more"),
        (r#"{"edit":"sections","at":[1,0,0],"u":[1]}"#, "the number of cells of a section is 1"),
        (r#"{"edit":"split_curve","curve":{"near":[90,0,0]},"at":0.5}"#, "off the mesh"),
        (r#"{"edit":"delete_feature","feature":{"near":[1,0,0]}}"#, "there is no feature curve yet"),
        (r#"{"edit":"join","corner":9}"#, "corner 9 is not there, there are 1"),
        (r#"{"edit":"paint","picks":[[1,0,0],[0,1,0]],"magnet":"creases"}"#, "a magnet draws magnetic strokes alone"),
    ] {
        let refused = make(&ground, &mut drawing, edit).unwrap_err().to_string();
        assert!(refused.contains(told), "{edit}: {refused}");
        assert_eq!(drawing, before, "{edit}");
    }
    assert!(serde_json::from_str::<Edit>(r#"{"edit":"relax","curve":{"close":[1,0,0]}}"#).is_err());
}

#[test]
fn face_points_of_strokes_that_meet_lie_on_their_faces_and_on_both_curves() {
    let mesh = shapes::sphere(1.0, 4);
    let (drawing, _) = run(&mesh, &CUTS);
    let bvh = Bvh::new(&mesh);
    for curve in &drawing.network.curves {
        for p in &curve.points {
            assert!(p.bary.iter().all(|b| (-1e-12..=1.0 + 1e-12).contains(b)));
            let at = p.position(&mesh);
            assert!(bvh.closest(at).position.distance(at) < 1e-12);
        }
        let [a, b] = curve.corners.map(|k| drawing.network.corners[k as usize].place);
        assert_eq!((curve.points[0], curve.points[curve.points.len() - 1]), (a, b));
    }
}

/// A body that is symmetric in x as a shape but not in its triangles, drawn as a box with four patches across x = 0.
fn box_across() -> (TriMesh, Drawing) {
    let mut mesh = shapes::sphere(1.0, 4);
    for p in &mut mesh.points {
        let q = glam::DQuat::from_axis_angle(DVec3::new(0.3, 0.8, -0.4).normalize(), 0.4) * *p;
        *p = DVec3::new(1.2 * q.x, q.y + 0.2 * q.x * q.x, 0.9 * q.z * (1.0 + 0.3 * q.y));
    }
    let turn = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)];
    let paint =
        |[a, b]: [[f64; 3]; 2]| format!(r#"{{"edit":"paint","picks":[{a:?},{b:?}],"mode":"geodesic","snap":0.02}}"#);
    let mut edits = vec![r#"{"edit":"symmetry","plane":{"point":[0,0,0],"normal":[1,0,0]}}"#.to_string()];
    for k in 0..4 {
        let ((y, z), (v, w)) = (turn[k], turn[(k + 1) % 4]);
        edits.push(paint([[0.7, 0.6 * y, 0.55 * z], [0.7, 0.6 * v, 0.55 * w]]));
    }
    edits.extend(turn.map(|(y, z)| paint([[0.7, 0.6 * y, 0.55 * z], [-0.8, 0.5 * y, 0.6 * z]])));
    edits.push(r#"{"edit":"mirror"}"#.into());
    let (drawing, _) = run(&mesh, &edits.iter().map(|s| s.as_str()).collect::<Vec<_>>());
    assert_eq!(drawing.network.patches.len(), 6);
    (mesh, drawing)
}

#[test]
fn sections_of_a_patch_across_the_plane_of_symmetry_become_their_own_image() {
    let (mesh, start) = box_across();
    let ground = Ground::new(&mesh);
    // One curve along the plane, before it: behind the plane its image joins it.
    let feature = r#"{"edit":"feature","mode":"geodesic","picks":[[0.35,0.5,0.95],[0.35,0.0,0.95],[0.35,-0.45,0.7]]}"#;
    let plain = start.clone();
    let mut drawing = start;
    make(&ground, &mut drawing, feature).unwrap();
    let letter = across(&[drawing.sketch.features[0].family]);
    for given in [[10, 30], [30, 10]] {
        let mut drawing = drawing.clone();
        let sections = format!(r#"{{"edit":"sections","at":[0.1,0.0,0.95],"{letter}":{given:?}}}"#);
        make(&ground, &mut drawing, &sections).unwrap();
        make(&ground, &mut drawing, r#"{"edit":"mirror"}"#).unwrap();
        assert_eq!(drawing.sketch.features.len(), 2);
        let [(_, cells)] = &drawing.sketch.sections[..] else { panic!("{:?}", drawing.sketch.sections) };
        let list = if letter == "u" { &cells.u } else { &cells.v };
        assert!(list[..] == [10, 20, 10] || list[..] == [30, 10, 30], "{list:?}");
        // What is mirrored once stays as it is, and can be fitted.
        let once = drawing.sketch.sections.clone();
        make(&ground, &mut drawing, r#"{"edit":"mirror"}"#).unwrap();
        assert_eq!(drawing.sketch.sections, once);
    }
    // Sections of a patch before the plane go to its image, in its order.
    let mut drawing = plain;
    let side = r#"{"edit":"feature","mode":"geodesic","picks":[[1.0,0.8,0.15],[1.2,0.3,0.15],[1.0,-0.4,0.1]]}"#;
    make(&ground, &mut drawing, side).unwrap();
    let letter = across(&[drawing.sketch.features[0].family]);
    let sections = format!(r#"{{"edit":"sections","at":[1.2,0.0,0.0],"{letter}":[8,14]}}"#);
    make(&ground, &mut drawing, &sections).unwrap();
    make(&ground, &mut drawing, r#"{"edit":"mirror"}"#).unwrap();
    let sketch = &drawing.sketch;
    assert_eq!((sketch.features.len(), sketch.sections.len()), (2, 2));
    let patches = imprint(&mesh, &drawing.network, &Silent).unwrap();
    for (patch, cells) in &sketch.sections {
        grid::check_features(&mesh, (*patch, &patches[*patch as usize]), &sketch.features, Some(cells)).unwrap();
        // The 8 cells lie above the curve or below it on both sides of the plane.
        let feature = sketch.features.iter().find(|f| f.patch == *patch).unwrap();
        let list = if feature.family == Family::V { &cells.u } else { &cells.v };
        let low = if feature.family == Family::V { 3 } else { 0 };
        let sides = &patches[*patch as usize];
        let z = |k: usize| {
            let chain = &sides.sides[k];
            chain.iter().map(|&v| sides.mesh.points[v as usize].z).sum::<f64>() / chain.len() as f64
        };
        let first_is_low = z(low) < z((low + 2) % 4);
        let lower = if first_is_low { list[0] } else { list[1] };
        let other = sketch.sections.iter().find(|s| s.0 != *patch).map(|s| s.1.u.iter().chain(&s.1.v).sum::<usize>());
        assert_eq!((list.iter().sum::<usize>(), other), (22, Some(22)));
        assert_eq!(lower, if below(&drawing, &mesh) { 8 } else { 14 });
    }
}

/// Whether the section of 8 cells of the patch before the plane lies below its curve.
fn below(drawing: &Drawing, mesh: &TriMesh) -> bool {
    let front = drawing.sketch.features.iter().find(|f| f.points[0].position(mesh).x > 0.0).unwrap();
    let (patch, cells) = drawing.sketch.sections.iter().find(|s| s.0 == front.patch).unwrap();
    let patches = imprint(mesh, &drawing.network, &Silent).unwrap();
    let own = &patches[*patch as usize];
    let (list, low) = if front.family == Family::V { (&cells.u, 3) } else { (&cells.v, 0) };
    let z =
        |k: usize| own.sides[k].iter().map(|&v| own.mesh.points[v as usize].z).sum::<f64>() / own.sides[k].len() as f64;
    (z(low) < z((low + 2) % 4)) == (list[0] == 8)
}

#[test]
fn corners_near_the_plane_of_symmetry_are_put_into_it_and_have_no_image_besides() {
    let mesh = shapes::sphere(1.0, 5);
    let off = 0.003;
    let strokes = [
        r#"{"edit":"symmetry","plane":{"point":[0,0,0],"normal":[2,0,0]}}"#.to_string(),
        format!(r#"{{"edit":"paint","picks":[[{off},0.9,0.4],[0.8,0.5,0.3],[-{off},-0.7,0.7]],"snap":0}}"#),
    ];
    let ground = Ground::new(&mesh);
    let (mut drawing, _) = run(&mesh, &[&strokes[0], &strokes[1]]);
    let near = |d: &Drawing| -> Vec<f64> {
        let x = d.network.corners.iter().map(|c| c.place.position(&mesh).x.abs());
        x.filter(|x| *x < 2e-3 * mesh.bounds().diagonal()).collect()
    };
    assert!(near(&drawing).iter().all(|x| *x > 1e-3));
    make(&ground, &mut drawing, r#"{"edit":"mirror"}"#).unwrap();
    assert_eq!((drawing.network.corners.len(), drawing.network.curves.len()), (2, 2));
    assert!(near(&drawing).len() == 2 && near(&drawing).iter().all(|x| *x < 1e-9), "{:?}", near(&drawing));
    // The curve and its image part the sphere in two regions of two sides.
    let found = diagnose(&mesh, &Adjacency::new(&mesh), &drawing.network);
    assert!(found.faults.iter().all(|f| f.to_string().contains("2 sides")) && found.faults.len() == 2, "{found:?}");
}

/// World length of a curve.
fn length(mesh: &TriMesh, points: &[planish::mesh::FacePoint]) -> f64 {
    points.windows(2).map(|w| w[0].position(mesh).distance(w[1].position(mesh))).sum()
}

#[test]
fn a_corner_on_the_boundary_slides_along_it_and_its_curves_follow() {
    let (mesh, start) = sheet();
    let ground = Ground::new(&mesh);
    let mut drawing = start;
    make(&ground, &mut drawing, r#"{"edit":"paint","mode":"geodesic","picks":[[0.9,0,0],[1.1,1,0]]}"#).unwrap();
    let before = drawing.network.clone();
    assert_eq!((before.corners.len(), before.curves.len(), before.patches.len()), (6, 7, 2));
    let corner =
        (0..6).find(|&k| before.corners[k].place.position(&mesh).distance(DVec3::new(0.9, 0.0, 0.0)) < 0.1).unwrap();
    let along = |n: &planish::network::Network| -> f64 {
        n.curves.iter().filter(|c| c.kind == CurveKind::Boundary).map(|c| length(&mesh, &c.points)).sum()
    };
    // Dragged into the sheet, and by an uneven part of an edge.
    let to = r#"[0.713,0.15,0.05]"#;
    let made =
        make(&ground, &mut drawing, &format!(r#"{{"edit":"drag_corner","corner":{corner},"to":{to}}}"#)).unwrap();
    assert_eq!(made.faults, Some(Vec::new()));
    assert_eq!(made.relaxed.len(), 1);
    let after = drawing.network.clone();
    let p = after.corners[corner].place.position(&mesh);
    assert!(p.y == 0.0 && (p.x - 0.713).abs() < 0.02, "{p}");
    assert_eq!(after.patches, before.patches);
    assert!((along(&after) - along(&before)).abs() < 1e-12);
    for (k, (old, new)) in before.curves.iter().zip(&after.curves).enumerate() {
        let ends_there = old.corners.contains(&(corner as u32));
        assert_eq!(old != new, ends_there, "{k}");
        assert_eq!((old.corners, old.kind), (new.corners, new.kind));
    }
    // Back again: the boundary is what it was, without a trace of where the corner has been.
    let was = serde_json::to_string(&before.corners[corner].place).unwrap();
    make(&ground, &mut drawing, &format!(r#"{{"edit":"drag_corner","corner":{corner},"to":{was}}}"#)).unwrap();
    for (old, new) in before.curves.iter().zip(&drawing.network.curves).filter(|(c, _)| c.kind == CurveKind::Boundary) {
        let places = |c: &planish::network::Curve| c.points.iter().map(|p| p.position(&mesh)).collect::<Vec<_>>();
        let (old, new) = (places(old), places(new));
        assert_eq!(old.len(), new.len());
        assert!(old.iter().zip(&new).all(|(a, b)| a.distance(*b) < 1e-9));
    }
    // Past the next corner of the boundary, and a boundary curve off the boundary.
    let kept = drawing.clone();
    for (edit, told) in [
        (format!(r#"{{"edit":"drag_corner","corner":{corner},"to":[-0.3,-0.1,0]}}"#), "would meet corner 0"),
        (r#"{"edit":"drag_curve","curve":{"near":[1.5,0,0]},"at":0.5,"by":[0,0.1,0]}"#.into(), "follows the boundary"),
    ] {
        let refused = make(&ground, &mut drawing, &edit).unwrap_err().to_string();
        assert!(refused.contains(told), "{refused}");
        assert_eq!(drawing, kept);
    }
}

#[test]
fn a_closed_boundary_turns_with_its_only_corner_and_corners_on_sharp_edges_slide_along_them() {
    let mesh = shapes::annulus(1.0, 2.0, 48);
    let (mut drawing, _) = run(&mesh, &[r#"{"edit":"boundaries"}"#]);
    let ground = Ground::new(&mesh);
    let whole: Vec<f64> = drawing.network.curves.iter().map(|c| length(&mesh, &c.points)).collect();
    for to in ["[-2.1,0.3,0]", "[0.2,-2.3,0]"] {
        let edit = format!(r#"{{"edit":"drag_corner","corner":{{"near":[2,0,0]}},"to":{to}}}"#);
        let edit = if to.starts_with("[0.2") { edit.replace("[2,0,0]", "[-2,0.3,0]") } else { edit };
        make(&ground, &mut drawing, &edit).unwrap();
    }
    let at = drawing.network.corners.iter().map(|c| c.place.position(&mesh));
    assert!(at.clone().any(|p| p.distance(DVec3::new(0.17, -1.99, 0.0)) < 0.05), "{:?}", at.collect::<Vec<_>>());
    for (curve, whole) in drawing.network.curves.iter().zip(whole) {
        assert!((length(&mesh, &curve.points) - whole).abs() < 1e-12);
        assert_eq!(
            curve.points.len(),
            curve
                .points
                .iter()
                .map(|p| p.position(&mesh).to_array().map(f64::to_bits))
                .collect::<std::collections::BTreeSet<_>>()
                .len()
                + 1
        );
    }
    // A box: the corner on an edge slides, those of the box stay.
    let mesh = shapes::cuboid(DVec3::ONE, 8);
    let low = mesh.bounds().min;
    let at = |x: f64, y: f64, z: f64| format!("[{},{},{}]", low.x + x, low.y + y, low.z + z);
    let add = format!(r#"{{"edit":"add_corner","at":{}}}"#, at(0.5, 0.0, 0.0));
    let (mut drawing, _) = run(&mesh, &[r#"{"edit":"feature_lines","angle_deg":40}"#, &add]);
    let ground = Ground::new(&mesh);
    let corner = drawing.network.corners.len() - 1;
    let drag = |to: String, corner: usize| format!(r#"{{"edit":"drag_corner","corner":{corner},"to":{to}}}"#);
    make(&ground, &mut drawing, &drag(at(0.31, 0.1, 0.0), corner)).unwrap();
    let p = drawing.network.corners[corner].place.position(&mesh) - low;
    assert!(p.distance(DVec3::new(0.31, 0.0, 0.0)) < 1e-9, "{p}");
    let tip = (0..corner).find(|&k| drawing.network.corners[k].place.position(&mesh).distance(low) < 1e-9).unwrap();
    let refused = make(&ground, &mut drawing, &drag(at(0.2, 0.0, 0.0), tip)).unwrap_err().to_string();
    assert!(refused.contains("ends 3 curves along sharp edges"), "{refused}");
}

#[test]
fn a_dragged_section_goes_on_from_the_rest_of_its_curve_without_a_kink() {
    let mesh = shapes::sphere(1.0, 5);
    let ground = Ground::new(&mesh);
    let (start, _) = run(&mesh, &CUTS[..1]);
    let turns = |forces: &str| -> f64 {
        let mut drawing = start.clone();
        let edit =
            format!(r#"{{"edit":"drag_curve","curve":0,"at":0.5,"by":[0,0,0.1],"width":0.3,"forces":{forces}}}"#);
        make(&ground, &mut drawing, &edit).unwrap();
        let at: Vec<DVec3> = drawing.network.curves[0].points.iter().map(|p| p.position(&mesh)).collect();
        let old = &start.network.curves[0].points;
        // Where the section starts and ends: the bits change there.
        let new = &drawing.network.curves[0].points;
        let first = old.iter().zip(new).take_while(|(a, b)| a == b).count() - 1;
        let last = new.len() - old.iter().rev().zip(new.iter().rev()).take_while(|(a, b)| a == b).count();
        let turn = |k: usize| {
            let arm = |step: &dyn Fn(usize) -> usize| {
                let mut i = k;
                while at[i].distance(at[k]) < 0.05 {
                    i = step(i);
                }
                at[i]
            };
            let (a, b) = (arm(&|i| i - 1), arm(&|i| i + 1));
            // In the surface: without the bend of the sphere.
            let n = at[k].normalize();
            let flat = |d: DVec3| d - n * d.dot(n);
            flat(at[k] - a).angle_between(flat(b - at[k])).to_degrees()
        };
        turn(first).max(turn(last))
    };
    let band = turns(r#"{"fairness":1.0,"curvature":0.0}"#);
    let wire = turns(r#"{"fairness":0.02,"curvature":1.0}"#);
    assert!(band > 6.0 && wire < 0.4 * band, "{band} {wire}");
}

#[test]
fn a_stroke_along_edges_that_a_curve_runs_along_adds_what_is_not_there_yet() {
    let mesh = shapes::cuboid(DVec3::ONE, 8);
    let low = mesh.bounds().min;
    let ground = Ground::new(&mesh);
    let (start, _) = run(&mesh, &[r#"{"edit":"feature_lines","angle_deg":40}"#]);
    let at = |x: f64, y: f64, z: f64| format!("[{},{},{}]", low.x + x, low.y + y, low.z + z);
    let whole = |d: &Drawing| -> f64 { d.network.curves.iter().map(|c| length(&mesh, &c.points)).sum() };
    assert!((whole(&start) - 12.0).abs() < 1e-9);
    // Down one face onto an edge, along it, and off again over the other.
    let mut drawing = start.clone();
    let picks = [at(0.25, 0.5, 0.0), at(0.25, 0.0, 0.0), at(0.75, 0.0, 0.0), at(0.75, 0.0, 0.5)].join(",");
    let made =
        make(&ground, &mut drawing, &format!(r#"{{"edit":"paint","mode":"geodesic","picks":[{picks}]}}"#)).unwrap();
    let faults: Vec<String> = made.faults.unwrap().iter().map(|f| f.to_string()).collect();
    assert!(faults.iter().all(|f| !f.contains("cross")), "{faults:?}");
    assert!((whole(&drawing) - 13.0).abs() < 1e-9, "{}", whole(&drawing));
    assert_eq!(drawing.network.corners.len(), start.network.corners.len() + 4);
    // A stroke along nothing else adds no curve.
    let mut drawing = start.clone();
    let picks = [at(0.25, 0.0, 0.0), at(0.75, 0.0, 0.0)].join(",");
    make(&ground, &mut drawing, &format!(r#"{{"edit":"paint","mode":"geodesic","picks":[{picks}]}}"#)).unwrap();
    assert!((whole(&drawing) - 12.0).abs() < 1e-9);
    assert!(diagnose(&mesh, &ground.canvas.adjacency, &drawing.network).is_finished());
}
