//! Feature curves pulled, relaxed, drawn to a scalar, smoothed, led on and deleted, as curves of the network are.

use planish::DVec3;
use planish::Silent;
use planish::edit::{ApplyError, CurveNumber, Edit, Ground, Made, apply};
use planish::grid::{GridParams, Sections, relax_with_features};
use planish::mesh::TriMesh;
use planish::model::Drawing;
use planish::network::imprint;
use planish::synthetic::shapes;
use std::f64::consts::PI;

fn make(ground: &Ground, drawing: &mut Drawing, edit: &str) -> Result<Made, ApplyError> {
    let edit: Edit = serde_json::from_str(edit).unwrap_or_else(|e| panic!("{edit}: {e}"));
    apply(drawing, &edit, ground, &|name| Err(format!("no model {name}")), &Silent)
}

/// A sheet of 2 by 1 as one patch.
fn sheet() -> (TriMesh, Drawing) {
    let at = |s: f64, t: f64| DVec3::new(2.0 * s, t, 0.05 * (PI * s).sin() * t);
    let mesh = shapes::sheet(60, 40, false, false, at);
    let ground = Ground::new(&mesh);
    let mut drawing = Drawing::default();
    for [x, y] in [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]] {
        let corner = format!(r#"{{"edit":"add_corner","at":[{x},{y},0],"snap":0.002}}"#);
        make(&ground, &mut drawing, &corner).unwrap();
    }
    make(&ground, &mut drawing, r#"{"edit":"boundaries"}"#).unwrap();
    assert_eq!(drawing.network.patches.len(), 1);
    (mesh, drawing)
}

/// The sheet with a v curve around x = 1 that bends to one side by a fifth, and a straight one at x = 0.4.
fn with_two(mesh: &TriMesh, start: &Drawing) -> Drawing {
    let ground = Ground::new(mesh);
    let mut drawing = start.clone();
    for picks in ["[[1.0,0.01,0],[1.2,0.5,0],[1.0,0.99,0]]", "[[0.4,0.01,0],[0.4,0.99,0]]"] {
        make(&ground, &mut drawing, &format!(r#"{{"edit":"feature","picks":{picks}}}"#)).unwrap();
    }
    drawing
}

fn positions(mesh: &TriMesh, drawing: &Drawing, feature: usize) -> Vec<DVec3> {
    drawing.sketch.features[feature].points.iter().map(|p| p.position(mesh)).collect()
}

fn length(at: &[DVec3]) -> f64 {
    at.windows(2).map(|w| w[0].distance(w[1])).sum()
}

/// How far a curve reaches in x.
fn reach(at: &[DVec3]) -> [f64; 2] {
    at.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], p| [l.min(p.x), h.max(p.x)])
}

/// The grid of the patch follows all feature curves.
fn is_followed(mesh: &TriMesh, drawing: &Drawing) {
    let patch = imprint(mesh, &drawing.network, &Silent).unwrap().remove(0);
    let (features, params) = (&drawing.sketch.features, GridParams::default());
    let made = relax_with_features((mesh, &patch), features, (41, 21), &Sections::default(), &params, &Silent).unwrap();
    for k in 0..features.len() {
        let own = positions(mesh, drawing, k);
        for p in &made.curves[k] {
            let away = own.windows(2).map(|w| {
                let d = w[1] - w[0];
                let share = (*p - w[0]).dot(d) / d.length_squared().max(f64::MIN_POSITIVE);
                p.distance(w[0] + d * share.clamp(0.0, 1.0))
            });
            // The ends are led on to the sides.
            assert!(away.fold(f64::INFINITY, f64::min) < 0.02, "{k}: {p}");
        }
    }
}

#[test]
fn a_feature_curve_relaxes_to_within_2_percent_of_the_straight_way_with_its_ends_and_all_else_where_they_were() {
    let (mesh, start) = sheet();
    let ground = Ground::new(&mesh);
    let before = with_two(&mesh, &start);
    for name in ["0", r#"{"near":[1.2,0.5,0]}"#] {
        let mut drawing = before.clone();
        let edit =
            format!(r#"{{"edit":"relax","curve":{{"feature":{name}}},"forces":{{"fairness":1.0,"curvature":0.0}}}}"#);
        let made = make(&ground, &mut drawing, &edit).unwrap();
        let [told] = &made.relaxed[..] else { panic!("{made:?}") };
        assert_eq!((told.curve, made.features), (CurveNumber::Feature(0), vec![0]));
        assert!(told.relaxed.settled && told.relaxed.energy[1].total() < told.relaxed.energy[0].total());
        let (old, new) = (positions(&mesh, &before, 0), positions(&mesh, &drawing, 0));
        let straight = old[0].distance(old[old.len() - 1]);
        assert!(length(&old) > 1.05 * straight && length(&new) < 1.02 * straight, "{} {straight}", length(&new));
        assert_eq!((old[0], old[old.len() - 1]), (new[0], new[new.len() - 1]));
        assert_eq!(drawing.sketch.features[1], before.sketch.features[1]);
        assert_eq!(drawing.network, before.network);
        is_followed(&mesh, &drawing);
    }
}

#[test]
fn a_feature_curve_is_pulled_in_a_section_and_stays_bit_for_bit_beside_it() {
    let (mesh, start) = sheet();
    let ground = Ground::new(&mesh);
    let before = with_two(&mesh, &start);
    let mut drawing = before.clone();
    let edit = r#"{"edit":"drag_curve","curve":{"feature":1},"at":0.5,"by":[0.15,0,0],"width":0.5}"#;
    make(&ground, &mut drawing, edit).unwrap();
    let (old, new) = (positions(&mesh, &before, 1), positions(&mesh, &drawing, 1));
    assert!((reach(&new)[1] - 0.55).abs() < 0.01, "{:?}", reach(&new));
    let beside = new.iter().filter(|p| (p.y - 0.5).abs() > 0.3);
    assert!(beside.clone().count() > old.len() / 4 && beside.clone().all(|p| old.contains(p)));
    is_followed(&mesh, &drawing);
}

#[test]
fn the_end_of_a_feature_curve_goes_along_its_side() {
    let (mesh, start) = sheet();
    let ground = Ground::new(&mesh);
    let mut drawing = with_two(&mesh, &start);
    let far = positions(&mesh, &drawing, 1)[0];
    let edit = r#"{"edit":"drag_curve","curve":{"feature":1},"at":1.0,"by":[0.2,0,0],"width":1.0}"#;
    make(&ground, &mut drawing, edit).unwrap();
    let new = positions(&mesh, &drawing, 1);
    assert_eq!(new[0], far);
    let end = new[new.len() - 1];
    assert!((end.x - 0.6).abs() < 0.01 && end.y > 0.95, "{end}");
    is_followed(&mesh, &drawing);
}

#[test]
fn a_feature_curve_is_drawn_to_a_ridge_within_half_an_edge() {
    let (mesh, start) = sheet();
    let ground = Ground::new(&mesh);
    let mut drawing = with_two(&mesh, &start);
    let ridge: Vec<f64> = mesh.points.iter().map(|p| (-((p.x - 0.5) / 0.08).powi(2)).exp()).collect();
    let edit = format!(
        r#"{{"edit":"relax","curve":{{"feature":1}},"pull":{{"scalar":{{"values":{ridge:?}}},"weight":20.0}},
            "forces":{{"fairness":0.05,"curvature":0.2,"sweeps":300}}}}"#
    );
    make(&ground, &mut drawing, &edit).unwrap();
    let edge = 2.0 / 60.0;
    let new = positions(&mesh, &drawing, 1);
    let middle = new.iter().filter(|p| (p.y - 0.5).abs() < 0.25);
    assert!(middle.clone().count() > 5 && middle.clone().all(|p| (p.x - 0.5).abs() < edge / 2.0), "{new:?}");
}

#[test]
fn a_feature_curve_is_drawn_through_a_space_curve_of_4_control_vertices() {
    let (mesh, start) = sheet();
    let ground = Ground::new(&mesh);
    let before = with_two(&mesh, &start);
    let mut drawing = before.clone();
    make(&ground, &mut drawing, r#"{"edit":"spline","curve":{"feature":0},"control":4}"#).unwrap();
    // A corner of the stroke at its middle is cut by a cubic.
    let [old, new] = [&before, &drawing].map(|d| reach(&positions(&mesh, d, 0))[1]);
    assert!(old > 1.19 && new < 1.17 && new > 1.05, "{old} {new}");
    let edit = r#"{"edit":"spline","curve":{"feature":1},"control":5,"moves":[{"at":0.5,"by":[-0.2,0,0]}]}"#;
    make(&ground, &mut drawing, edit).unwrap();
    let low = reach(&positions(&mesh, &drawing, 1))[0];
    assert!((low - 0.2).abs() < 0.02, "{low}");
    is_followed(&mesh, &drawing);
}

#[test]
fn a_feature_curve_that_ends_in_the_middle_is_led_on_to_the_other_side() {
    let (mesh, start) = sheet();
    let ground = Ground::new(&mesh);
    let mut drawing = with_two(&mesh, &start);
    make(&ground, &mut drawing, r#"{"edit":"feature","picks":[[1.6,0.01,0],[1.6,0.5,0]],"family":"v"}"#).unwrap();
    make(&ground, &mut drawing, r#"{"edit":"extend","curve":{"feature":2},"picks":[[1.8,0.99,0]]}"#).unwrap();
    let led = positions(&mesh, &drawing, 2);
    assert!(led[led.len() - 1].distance(DVec3::new(1.8, 0.99, 0.0)) < 0.1 && led[0].y < 0.02, "{led:?}");
    is_followed(&mesh, &drawing);
}

#[test]
fn feature_curves_are_deleted_with_curves_of_the_network_and_others_of_their_patch_stay() {
    let (mesh, start) = sheet();
    let ground = Ground::new(&mesh);
    let mut drawing = start.clone();
    for x in [1.4, 1.7] {
        let stroke = format!(r#"{{"edit":"paint","picks":[[{x},0,0],[{x},1,0]],"snap":0.005}}"#);
        make(&ground, &mut drawing, &stroke).unwrap();
    }
    assert_eq!(drawing.network.patches.len(), 3);
    let mut drawing = with_two(&mesh, &drawing);
    let (curves, kept) = (drawing.network.curves.len(), drawing.sketch.features[1].points.clone());
    let edit = r#"{"edit":"delete_curves","curves":[{"feature":{"near":[1.2,0.5,0]}},{"near":[1.7,0.5,0]}]}"#;
    make(&ground, &mut drawing, edit).unwrap();
    assert_eq!(drawing.network.curves.len(), curves - 1);
    let left: Vec<_> = drawing.sketch.features.iter().map(|f| f.points.clone()).collect();
    assert_eq!(left, [kept]);
}

#[test]
fn what_a_patch_could_not_follow_is_refused_by_name_and_leaves_the_drawing_as_it_was() {
    let (mesh, start) = sheet();
    let ground = Ground::new(&mesh);
    let mut drawing = with_two(&mesh, &start);
    let kept = drawing.clone();
    for (edit, told) in [
        (
            r#"{"edit":"drag_curve","curve":{"feature":1},"at":0.5,"by":[0.9,0,0]}"#,
            "feature curves 0 and 1 of one family cross at (",
        ),
        (r#"{"edit":"relax","curve":{"feature":7}}"#, "feature curve 7 is not there, there are 2"),
        (r#"{"edit":"split_curve","curve":{"feature":1},"at":0.5}"#, "feature curve 1 runs from side to side"),
        (
            r#"{"edit":"extend","curve":{"feature":0},"closed":true,"picks":[[0.5,0.5,0]]}"#,
            "feature curve 0 runs from side to side",
        ),
        (r#"{"edit":"relax","curve":{"feature":{"near":[99,0,0]}}}"#, "of the diagonal off the mesh"),
    ] {
        let refused = make(&ground, &mut drawing, edit).unwrap_err().to_string();
        assert!(refused.contains(told), "{edit}: {refused}");
        assert_eq!(drawing, kept);
    }
}
