//! Faces of STEP files as triangles: where they lie, that shells are closed, and what is refused.

mod common;

use common::step_text::{File, can, wrapped};
use common::{ball, folder, globe, ring, sheet, torus, tube, volume6};
use planish::mesh::{TriMesh, diagnose};
use planish::{DVec3, Units};
use planish_io::{FileUnits, StepInput, file_units, read_mesh, write_step};
use std::f64::consts::PI;

/// The share of the diagonal that triangles may be off.
const TOLERANCE: f64 = 2e-5;

fn read(text: &str) -> Result<TriMesh, String> {
    let folder = folder();
    let path = folder.path().join("a.stp");
    std::fs::write(&path, text).unwrap();
    read_mesh(&path).map_err(|e| e.to_string())
}

/// Holds a mesh against a solid: closed, as large, and with its triangles no farther off than they may be.
fn check(mesh: &TriMesh, wanted: f64, away: impl Fn(DVec3) -> f64) {
    let found = diagnose(mesh);
    assert!(found.watertight && found.manifold, "{found:?}");
    let size = planish::geom::Aabb::of(&mesh.points).diagonal();
    let area: f64 = (0..mesh.triangles.len()).map(|t| mesh.area(t)).sum();
    let found = volume6(mesh) / 6.0;
    assert!((found - wanted).abs() < TOLERANCE * size * area, "{found} for {wanted}");
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|v| mesh.points[v as usize]);
        for p in [a, (a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0, (a + b + c) / 3.0] {
            assert!(away(p).abs() <= 1.01 * TOLERANCE * size, "{p} is {:e} off, of {size}", away(p));
        }
    }
}

fn away_from_can(p: DVec3) -> f64 {
    let side = p.truncate().length() - 1.0;
    [side, p.z, p.z - 2.0].into_iter().min_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap()
}

#[test]
fn a_can_with_a_seam_or_two_circles_is_closed_and_round() {
    for has_seam in [true, false] {
        check(&read(&can(has_seam).text()).unwrap(), 2.0 * PI, away_from_can);
    }
}

#[test]
fn balls_and_tori_without_edges_are_whole() {
    let mut file = File::default();
    let pole = file.vertex([0.0, 0.0, -1.5]);
    let frame = file.frame([0.0; 3]);
    let surface = file.add(format!("SPHERICAL_SURFACE('',#{frame},1.5)"));
    let bound = file.point_bound(pole);
    file.face(&[bound], surface, true);
    check(&read(&file.text()).unwrap(), 4.0 / 3.0 * PI * 1.5f64.powi(3), |p| p.length() - 1.5);

    let mut file = File::default();
    let vertex = file.vertex([4.0, 0.0, 0.0]);
    let frame = file.frame([0.0; 3]);
    let surface = file.add(format!("TOROIDAL_SURFACE('',#{frame},3.,1.)"));
    let bound = file.point_bound(vertex);
    file.face(&[bound], surface, true);
    let mesh = read(&file.text()).unwrap();
    let away = |p: DVec3| DVec3::new(p.truncate().length() - 3.0, p.z, 0.0).length() - 1.0;
    check(&mesh, 2.0 * PI * PI * 3.0, away);
}

#[test]
fn a_dome_on_a_cone_reaches_both_poles_from_one_circle() {
    // A cone from its tip at the origin to radius 1 at height 2, half an angle of 26.565 degrees, and half a ball on it.
    let mut file = File::default();
    let degree = file.add("(CONVERSION_BASED_UNIT('DEGREE',#2)NAMED_UNIT(#4)PLANE_ANGLE_UNIT())".into());
    file.add("PLANE_ANGLE_MEASURE_WITH_UNIT(PLANE_ANGLE_MEASURE(0.0174532925199432957),#3)".into());
    file.add("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))".into());
    file.add("DIMENSIONAL_EXPONENTS(0.,0.,0.,0.,0.,0.,0.)".into());
    file.add(format!(
        "(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNIT_ASSIGNED_CONTEXT((#{degree}))REPRESENTATION_CONTEXT('',''))"
    ));
    let vertex = file.vertex([1.0, 0.0, 2.0]);
    let rim = file.circle(2.0, 1.0, vertex);
    let frame = file.frame([0.0, 0.0, 2.0]);
    let cone = file.add(format!("CONICAL_SURFACE('',#{frame},1.,{:?})", 0.5f64.atan().to_degrees()));
    let ball = file.add(format!("SPHERICAL_SURFACE('',#{frame},1.)"));
    let bound = file.bound(&[(rim, false)]);
    file.face(&[bound], cone, true);
    let bound = file.bound(&[(rim, true)]);
    file.face(&[bound], ball, true);
    let away = |p: DVec3| match p.z < 2.0 {
        true => (p.truncate().length() - p.z / 2.0) * 0.5f64.atan().cos(),
        false => p.distance(DVec3::new(0.0, 0.0, 2.0)) - 1.0,
    };
    check(&read(&file.text()).unwrap(), PI * 2.0 / 3.0 + PI * 2.0 / 3.0, away);
}

#[test]
fn a_washer_has_its_hole() {
    let mut file = File::default();
    let mut rims = Vec::new();
    for (radius, height) in [(1.0, 0.0), (1.0, 2.0), (0.25, 0.0), (0.25, 2.0)] {
        let vertex = file.vertex([radius, 0.0, height]);
        rims.push(file.circle(height, radius, vertex));
    }
    for (radius, k, outward) in [(1.0, 0, true), (0.25, 2, false)] {
        let frame = file.frame([0.0; 3]);
        let side = file.add(format!("CYLINDRICAL_SURFACE('',#{frame},{radius:?})"));
        let bounds = [file.bound(&[(rims[k], outward)]), file.bound(&[(rims[k + 1], !outward)])];
        file.face(&bounds, side, outward);
    }
    for (height, k, up) in [(0.0, 0, false), (2.0, 1, true)] {
        let frame = file.frame([0.0, 0.0, height]);
        let plane = file.add(format!("PLANE('',#{frame})"));
        let bounds = [file.bound(&[(rims[k], up)]), file.bound(&[(rims[k + 2], !up)])];
        file.face(&bounds, plane, up);
    }
    let away = |p: DVec3| {
        let hole = p.truncate().length() - 0.25;
        if hole.abs() < away_from_can(p).abs() { hole } else { away_from_can(p) }
    };
    let mesh = read(&file.text()).unwrap();
    check(&mesh, 2.0 * PI * (1.0 - 0.0625), away);
    assert_eq!(diagnose(&mesh).genus, Some(1));
}

#[test]
fn what_planish_writes_comes_back_closed_where_it_was_and_in_its_unit() {
    for (case, closed, pieces) in [
        (ball(7, DVec3::new(3.0, 2.0, 1.0)), true, 1),
        (globe(), true, 1),
        (torus(9), true, 1),
        (tube(), false, 1),
        (ring(), true, 1),
        (sheet(), false, 1),
    ] {
        let folder = folder();
        let path = folder.path().join("a.step");
        let input = StepInput { network: &case.0, surfaces: &case.1, units: Units::In, name: "a", time: None };
        write_step(&path, &input).unwrap();
        assert_eq!(file_units(&path), FileUnits::Standard(Units::In));
        let mesh = read_mesh(&path).unwrap();
        let found = diagnose(&mesh);
        assert_eq!((found.watertight, found.components, found.manifold), (closed, pieces, true), "{found:?}");
        assert!(!closed || volume6(&mesh) > 0.0);
        // Each surface passes through the mesh: at the middle of each patch there is a triangle.
        let tree = planish::geom::Bvh::new(&mesh);
        let size = planish::geom::Aabb::of(&mesh.points).diagonal();
        for surface in &case.1 {
            for (u, v) in [(0.5, 0.5), (0.1, 0.7), (0.9, 0.35)] {
                let p = surface.jet(u, v).point;
                let off = tree.closest(p).distance / size;
                assert!(off <= 1.01 * TOLERANCE, "{off:e}");
            }
        }
    }
}

#[test]
fn parts_stand_where_their_assembly_has_them() {
    // The can twice: turned about x by 90 degrees, and moved within a part that is moved again.
    let mut file = can(true);
    file.text();
    let [can, back, here] = [file.lines.len(), file.frame([0.0; 3]), file.frame([0.0, 0.0, 10.0])];
    let (o, y, x) = (file.point([5.0, 0.0, 0.0]), file.direction([0.0, -1.0, 0.0]), file.direction([1.0, 0.0, 0.0]));
    let turned = file.add(format!("AXIS2_PLACEMENT_3D('',#{o},#{y},#{x})"));
    let inner = file.add(format!("SHAPE_REPRESENTATION('',(#{back},#{here}),$)"));
    let outer = file.add(format!("SHAPE_REPRESENTATION('',(#{back},#{turned}),$)"));
    for (part, whole, to) in [(can, inner, here), (can, outer, turned), (inner, outer, here)] {
        let by = file.add(format!("ITEM_DEFINED_TRANSFORMATION('','',#{back},#{to})"));
        file.add(format!(
            "(REPRESENTATION_RELATIONSHIP('','',#{part},#{whole})\
             REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION(#{by})SHAPE_REPRESENTATION_RELATIONSHIP())"
        ));
    }
    let mesh = read(&wrapped(&file.lines.join("\n"))).unwrap();
    let found = diagnose(&mesh);
    assert!(found.watertight && found.components == 2, "{found:?}");
    let bounds = planish::geom::Aabb::of(&mesh.points);
    let [low, high] = [bounds.min, bounds.max];
    assert!(low.distance(DVec3::new(-1.0, -2.0, -1.0)) < 1e-12, "{low}");
    assert!(high.distance(DVec3::new(6.0, 1.0, 22.0)) < 1e-12, "{high}");
}

#[test]
fn what_cannot_be_read_is_named_with_its_entity() {
    let can = can(true).text();
    for (from, to, wanted) in [
        ("CYLINDRICAL_SURFACE", "OFFSET_SURFACE", "the kind OFFSET_SURFACE cannot be read (entity "),
        ("CYLINDRICAL_SURFACE('',#25,1.)", "CYLINDRICAL_SURFACE('',#25,-1.)", "a radius is not above 0 (entity 26)"),
        ("CYLINDRICAL_SURFACE('',#25,1.)", "CYLINDRICAL_SURFACE('',#99,1.)", "entity 99 is referred to and not there"),
        ("#27=", "#26=", "entity 26 stands in the file twice (line "),
        ("(#27,#28,#29,#30)", "(#27,#28,#29)", "the loop of edges is not closed"),
        ("(#27,#28,#29,#30)", "(#27,#29,#28,#30)", "the edge does not begin where the one before it ends"),
        ("END-ISO-10303-21;", "", "the file is cut off"),
    ] {
        assert!(can.contains(from), "{can}");
        let error = read(&can.replace(from, to)).unwrap_err();
        assert!(error.contains(wanted), "{error}");
    }
    let error = read(&wrapped("#1=CARTESIAN_POINT('',(1.,2.,3.));")).unwrap_err();
    assert!(error.contains("no triangle with area"), "{error}");
    // Parts that hold themselves.
    let mut file = File::default();
    let a = file.frame([0.0; 3]);
    let part = file.add(format!("SHAPE_REPRESENTATION('',(#{a}),$)"));
    let by = file.add(format!("ITEM_DEFINED_TRANSFORMATION('','',#{a},#{a})"));
    let top = file.add(format!("SHAPE_REPRESENTATION('',(#{a}),$)"));
    for whole in [part, top] {
        file.add(format!("(REPRESENTATION_RELATIONSHIP('','',#{part},#{whole})REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION(#{by}))"));
    }
    // So that the file has a size.
    file.vertex([0.0; 3]);
    file.vertex([1.0, 0.0, 0.0]);
    let error = read(&wrapped(&file.lines.join("\n"))).unwrap_err();
    assert!(error.contains("parts hold parts without end"), "{error}");
}
