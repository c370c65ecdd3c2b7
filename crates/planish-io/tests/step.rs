//! STEP: topology as it was meant, bytes that do not change, and what OpenCASCADE makes of the files.

#![allow(clippy::print_stdout)] // figures and skipped tests are told to who runs them

mod common;

use common::{ball, both, folder, globe, ring, sheet, torus, tube};
use planish::network::Network;
use planish::surface::Surface;
use planish::{DVec3, Units};
use planish_io::{StepInput, StepSummary, WriteError, write_step};

type Case = (Network, Vec<Surface>);

fn input<'a>(case: &'a Case, units: Units, name: &'a str) -> StepInput<'a> {
    StepInput { network: &case.0, surfaces: &case.1, units, name, time: None }
}

fn write(case: &Case) -> Result<(StepSummary, String), WriteError> {
    let folder = folder();
    let path = folder.path().join("a.step");
    let summary = write_step(&path, &input(case, Units::Mm, "it's ä test"))?;
    Ok((summary, std::fs::read_to_string(path).unwrap()))
}

fn count(text: &str, entity: &str) -> usize {
    text.matches(&format!("={entity}(")).count()
}

#[test]
fn ball_of_6_patches_is_one_solid_with_12_shared_edges_and_8_vertices() {
    let (summary, text) = write(&ball(7, DVec3::ZERO)).unwrap();
    assert_eq!(summary, StepSummary { solids: 1, shells: 0, faces: 6, edges: 12, gap_max: 0.0 });
    for (entity, wanted) in [
        ("MANIFOLD_SOLID_BREP", 1),
        ("CLOSED_SHELL", 1),
        ("ADVANCED_FACE", 6),
        ("B_SPLINE_SURFACE_WITH_KNOTS", 6),
        ("EDGE_CURVE", 12),
        ("B_SPLINE_CURVE_WITH_KNOTS", 12),
        ("ORIENTED_EDGE", 24),
        ("VERTEX_POINT", 8),
        ("OPEN_SHELL", 0),
        ("SURFACE_CURVE", 12),
        ("PCURVE", 24),
        ("LINE", 8),
    ] {
        assert_eq!(count(&text, entity), wanted, "{entity}");
    }
    // 8 corners, 12 edges of 5 and 6 faces of 25 inner points, and the origin: shared points stand once. The sides of the
    // square of parameters begin in 8 more.
    assert_eq!(count(&text, "CARTESIAN_POINT"), 8 + 60 + 150 + 1 + 8);
    assert!(text.contains("'it''s \\X2\\00E4\\X0\\ test'") && text.is_ascii());
    assert!(text.contains("(4,1,1,1,4),(4,1,1,1,4),(0.,0.25,0.5,0.75,1.)"));
}

#[test]
fn double_knots_are_written_once_with_multiplicity_2_on_surfaces_and_edges() {
    let (network, mut surfaces) = ball(6, DVec3::ZERO);
    // Clamped knots with two spans; the same control points, so the shape bends a little, and seams with it.
    let knots = vec![0.0, 0.0, 0.0, 0.0, 0.5, 0.5, 1.0, 1.0, 1.0, 1.0];
    for surface in &mut surfaces {
        assert_eq!((surface.cols, surface.rows), (6, 6));
        (surface.knots_u, surface.knots_v) = (knots.clone(), knots.clone());
    }
    let (_, text) = write(&(network, surfaces)).unwrap();
    assert_eq!(text.matches("(4,2,4),(4,2,4),(0.,0.5,1.),(0.,0.5,1.)").count(), 6);
    // On surfaces once for u and once for v, on each of the 12 edges once.
    assert_eq!(count(&text, "B_SPLINE_CURVE_WITH_KNOTS"), 12);
    assert_eq!(text.matches(",(4,2,4),(0.,0.5,1.),.UNSPECIFIED.)").count(), 12);
}

#[test]
fn open_sheet_is_an_open_shell_and_a_mixed_model_has_both_kinds() {
    let (summary, text) = write(&sheet()).unwrap();
    assert_eq!((summary.solids, summary.shells, summary.edges), (0, 1, 7));
    assert_eq!((count(&text, "OPEN_SHELL"), count(&text, "SHELL_BASED_SURFACE_MODEL")), (1, 1));
    let (summary, _) = write(&both(ball(5, DVec3::ZERO), sheet())).unwrap();
    assert_eq!((summary.solids, summary.shells, summary.faces), (1, 1, 8));
}

#[test]
fn globe_with_poles_is_a_solid_of_one_face_with_one_edge_and_144_faces_take_less_than_2_mb() {
    let (summary, text) = write(&globe()).unwrap();
    assert_eq!((summary.solids, summary.faces, summary.edges), (1, 1, 1));
    assert_eq!((count(&text, "VERTEX_POINT"), count(&text, "ORIENTED_EDGE")), (2, 2));
    let many = (0..9).map(|_| torus(14)).reduce(both).unwrap();
    let start = std::time::Instant::now();
    let (summary, text) = write(&many).unwrap();
    println!("144 faces of 14 x 14: {:.3} s, {} bytes", start.elapsed().as_secs_f64(), text.len());
    assert_eq!((summary.solids, summary.faces), (9, 144));
    assert!(text.len() < 2_000_000);
}

#[test]
fn faces_edges_and_pieces_have_their_numbers_as_names_and_faces_the_colours_of_the_pictures() {
    let (_, text) = write(&both(ball(5, DVec3::ZERO), sheet())).unwrap();
    let has = |words: &str| assert!(text.contains(words), "{words}");
    (0..8).for_each(|p| has(&format!("=ADVANCED_FACE('patch {p}',")));
    (0..19).for_each(|c| has(&format!("=EDGE_CURVE('curve {c}',")));
    has("=MANIFOLD_SOLID_BREP('piece 1',");
    has("=OPEN_SHELL('piece 2',");
    let colors = planish::render::even_colors(8);
    for color in &colors {
        let [r, g, b] = color.map(|byte| format!("{:?}", byte as f64 / 255.0).replace("1.0", "1."));
        has(&format!("=COLOUR_RGB('',{r},{g},{b});"));
    }
    assert_eq!((count(&text, "STYLED_ITEM"), count(&text, "COLOUR_RGB")), (8, 8));
    let faces = text.lines().filter(|l| l.contains("=ADVANCED_FACE(")).map(|l| l.split('=').next().unwrap());
    for face in faces {
        assert_eq!(
            text.lines().filter(|l| l.contains("=STYLED_ITEM(") && l.ends_with(&format!(",{face});"))).count(),
            1
        );
    }
}

#[test]
fn a_hundred_faces_of_24_x_24_take_less_than_6_mb() {
    // Sizes of their own, or equal points would be written once.
    let sized = |k: u32| {
        let (network, mut surfaces) = torus(24);
        surfaces.iter_mut().flat_map(|s| &mut s.control).for_each(|p| *p *= 1.0 + f64::from(k) / 7.0);
        (network, surfaces)
    };
    let many = (0..7).map(sized).reduce(both).unwrap();
    let (summary, text) = write(&many).unwrap();
    println!("{} faces of 24 x 24: {} bytes", summary.faces, text.len());
    assert!(text.len() * 100 < 6_000_000 * summary.faces);
}

#[test]
fn every_reference_names_an_entity_and_the_bytes_are_the_same_twice() {
    let case = both(torus(6), tube());
    let (_, text) = write(&case).unwrap();
    assert_eq!(text, write(&case).unwrap().1);
    let last = text.lines().filter(|l| l.starts_with('#')).count();
    let referred = text.split('#').skip(1).map(|s| s.split(|c: char| !c.is_ascii_digit()).next().unwrap());
    assert!(referred.map(|n| n.parse::<usize>().unwrap()).all(|n| (1..=last).contains(&n)));
}

#[test]
fn control_points_keep_all_17_digits() {
    let mut case = sheet();
    case.1[0].control[8].z = 0.1 + 0.2;
    case.1[0].control[9].z = -f64::EPSILON;
    let (_, text) = write(&case).unwrap();
    assert!(text.contains(",0.30000000000000004))") && text.contains("-2.220446049250313E-16))"));
}

#[test]
fn surfaces_that_do_not_fit_the_network_are_refused_with_the_place() {
    let refused = |case: &Case, wanted: &str| {
        let message = write(case).unwrap_err().to_string();
        assert!(message.contains(wanted) && message.contains(" - hint: "), "{message}");
    };
    let good = ball(5, DVec3::ZERO);
    let change = |f: &dyn Fn(&mut Case)| {
        let mut case = good.clone();
        f(&mut case);
        case
    };
    refused(&change(&|c| c.1.clear()), "there is nothing to write");
    refused(&change(&|c| c.1.truncate(5)), "there are 6 patches and 5 surfaces (patch 5)");
    refused(&change(&|c| c.1[2].control[3].x = f64::NAN), "(patch 2)");
    refused(&change(&|c| c.1[2].rows = 7), "control points and knots of the surface do not agree (patch 2)");
    refused(&change(&|c| c.1[1] = ball(6, DVec3::ZERO).1.swap_remove(1)), "have 6 and 5 control points there");
    refused(&change(&|c| c.0.patches[1].sides[0].reversed ^= true), "in the same direction");
    refused(&change(&|c| c.0.patches[1].sides[0].curve = 99), "names a curve that is not there (patch 1)");
}

#[test]
fn gap_of_a_seam_is_measured_and_covered_by_the_accuracy() {
    let mut case = sheet();
    case.1[1].control[7].z += 0.001;
    let (summary, text) = write(&case).unwrap();
    assert!((summary.gap_max - 0.001).abs() < 1e-12);
    assert!(text.contains("LENGTH_MEASURE(0.002"));
}

/// Set `PLANISH_PYTHON` to a Python that has cadquery-ocp to run this one.
#[test]
fn opencascade_finds_closed_solids_without_free_edges_at_tolerances_below_1e_6_of_the_diagonal() {
    let Some(python) = std::env::var_os("PLANISH_PYTHON") else {
        println!("skipped: PLANISH_PYTHON is not set");
        return;
    };
    let shift = DVec3::new(5.0, 0.0, 0.0);
    // Name, model, unit (in millimetres), solids, edges, free edges, volume in cubic units of about.
    let cases: Vec<(&str, Case, Units, usize, usize, usize, f64)> = vec![
        ("ball", ball(9, DVec3::ZERO), Units::Mm, 1, 12, 0, 4.0),
        ("torus", torus(6), Units::Cm, 1, 32, 0, 57.0),
        ("two", both(ball(6, DVec3::ZERO), ball(6, shift)), Units::In, 2, 24, 0, 7.5),
        ("ring", ring(), Units::M, 1, 2, 0, 50.0),
        ("globe", globe(), Units::Mm, 1, 1, 0, 3.7),
        ("sheet", sheet(), Units::Mm, 0, 7, 6, 0.0),
        ("tube", tube(), Units::Mm, 0, 3, 2, 0.0),
        ("mixed", both(ball(6, shift), tube()), Units::Mm, 1, 15, 2, 3.7),
    ];
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR"));
    for (name, case, units, solids, edges, free, volume) in cases {
        let path = folder.join(format!("{name}.step"));
        write_step(&path, &input(&case, units, name)).unwrap();
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/step_facts.py");
        let output = std::process::Command::new(&python).arg(script).arg(&path).output().unwrap();
        let text = String::from_utf8_lossy(&output.stdout);
        println!("{name}: {text}");
        let found: serde_json::Value = serde_json::from_str(&text).unwrap();
        let number = |key: &str| found[key].as_f64().unwrap();
        let whole = |key: &str| number(key) as usize;
        let counts = ["solids", "faces", "edges", "free_edges", "crowded_edges", "same_way_edges"].map(whole);
        assert_eq!(counts, [solids, case.1.len(), edges, free, 0, 0], "{name}");
        assert!(found["valid"].as_bool().unwrap(), "{name}");
        assert!(number("tolerance_rel") <= 1e-6, "{name}");
        let unit = units.metres() * 1e3;
        assert!((number("volume") / unit.powi(3) - volume).abs() <= 0.1 * volume, "{name}: volume");
    }
}
