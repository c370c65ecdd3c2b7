//! IGES: 80 columns, sections that count right, the entities of solids and sheets, and what is refused.

#![allow(clippy::print_stdout)] // figures and skipped tests are told to who runs them

mod common;

use common::{ball, both, flat_cube, folder, globe, ring, sheet, torus, tube};
use planish::network::Network;
use planish::surface::Surface;
use planish::{DVec3, Units};
use planish_io::{IgesInput, IgesSummary, WriteError, write_iges};

type Case = (Network, Vec<Surface>);

fn write(case: &Case, units: Units) -> Result<(IgesSummary, String), WriteError> {
    let folder = folder();
    let path = folder.path().join("a.igs");
    let summary = write_iges(&path, &IgesInput { network: &case.0, surfaces: &case.1, units, name: "it's ä, b" })?;
    Ok((summary, std::fs::read_to_string(path).unwrap()))
}

/// The directory: type and form, first line of the parameters and their number, the number behind the label. An entity is named by
/// 2 k + 1 if it is the `k`-th.
fn directory(text: &str) -> Vec<[usize; 5]> {
    let lines: Vec<&str> = text.lines().filter(|l| l.as_bytes()[72] == b'D').collect();
    let field = |line: &str, k: usize| line[8 * k..8 * k + 8].trim().parse::<usize>().unwrap();
    let pairs = lines.chunks_exact(2);
    pairs.map(|l| [field(l[0], 0), field(l[1], 4), field(l[0], 1), field(l[1], 3), field(l[1], 8)]).collect()
}

/// The values of the parameters of an entity, and what each of its lines says that they belong to.
fn parameters(text: &str, entity: [usize; 5]) -> (Vec<String>, Vec<usize>) {
    let lines: Vec<&str> = text.lines().filter(|l| l.as_bytes()[72] == b'P').collect();
    let own = &lines[entity[2] - 1..entity[2] - 1 + entity[3]];
    let values: String = own.iter().map(|l| l[..64].trim_end()).collect();
    let values = values.strip_suffix(';').unwrap().split(',').map(String::from).collect();
    (values, own.iter().map(|l| l[64..72].trim().parse().unwrap()).collect())
}

fn count(text: &str, kind: usize) -> usize {
    directory(text).iter().filter(|e| e[0] == kind).count()
}

#[test]
fn every_line_has_80_columns_and_the_sections_count_their_lines() {
    let (_, text) = write(&both(ball(7, DVec3::ZERO), sheet()), Units::In).unwrap();
    assert!(text.is_ascii() && text.lines().all(|line| line.len() == 80));
    let section = |letter: u8| text.lines().filter(|l| l.as_bytes()[72] == letter).collect::<Vec<_>>();
    for letter in *b"SGDPT" {
        let numbers = section(letter).iter().map(|l| l[73..].trim().parse::<usize>().unwrap()).collect::<Vec<_>>();
        assert_eq!(numbers, (1..=numbers.len()).collect::<Vec<_>>());
    }
    let counts: String = (*b"SGDP").map(|l| format!("{}{:>7}", l as char, section(l).len())).concat();
    assert!(text.lines().last().unwrap().starts_with(&counts));
    // Parameters follow each other without a gap and name their entity.
    let mut next = 1;
    for (k, &entity) in directory(&text).iter().enumerate() {
        let (values, owners) = parameters(&text, entity);
        assert_eq!((entity[2], values[0].parse()), (next, Ok(entity[0])));
        assert!(owners.iter().all(|&owner| owner == 2 * k + 1));
        next += entity[3];
    }
    assert_eq!(next - 1, section(b'P').len());
}

#[test]
fn global_section_tells_unit_accuracy_and_largest_coordinate() {
    let cube = flat_cube(4, DVec3::ZERO);
    for (units, wanted) in
        [(Units::Mm, "1.,2,2HMM,"), (Units::In, "1.,1,2HIN,"), (Units::M, "1.,6,1HM,"), (Units::Cm, "1.,10,2HCM,")]
    {
        let (_, text) = write(&cube, units).unwrap();
        let global: String = text.lines().filter(|l| l.as_bytes()[72] == b'G').map(|l| l[..72].trim_end()).collect();
        assert!(global.starts_with("1H,,1H;,9Hit's _, b,9Hit's _, b,") && global.contains(wanted), "{global}");
        // A ten-millionth of a diagonal of 2 sqrt(3).
        let accuracy = format!("{:?}", 1e-7 * 12.0_f64.sqrt()).replace('e', "D");
        assert!(global.contains(&format!(",{accuracy},1.,,,11,0,15H19700101.000000;")), "{global}");
    }
}

#[test]
fn cube_of_6_flat_patches_is_a_solid_of_6_faces_12_edges_and_8_vertices() {
    let (summary, text) = write(&flat_cube(4, DVec3::ZERO), Units::Mm).unwrap();
    assert_eq!(summary, IgesSummary { solids: 1, faces: 6, surfaces: 0 });
    for (kind, wanted) in [(186, 1), (514, 1), (510, 6), (508, 6), (504, 1), (502, 1), (128, 6), (126, 12), (110, 4)] {
        assert_eq!(count(&text, kind), wanted, "{kind}");
    }
    let entities = directory(&text);
    let values = |kind: usize| parameters(&text, *entities.iter().find(|e| e[0] == kind).unwrap()).0;
    let surface = values(128);
    assert_eq!(surface[..10], ["128", "3", "3", "3", "3", "0", "0", "1", "0", "0"]);
    assert_eq!(surface[10..18], ["0.", "0.", "0.", "0.", "1.", "1.", "1.", "1."]);
    // 16 knots and weights, 16 points and two ranges.
    assert_eq!(surface.len(), 10 + 16 + 16 + 48 + 4);
    assert_eq!(surface[42..45], ["-1.", "-1.", "-1."]);
    assert_eq!(values(502)[..5], ["502", "8", "-1.", "-1.", "-1."]);
    assert_eq!(values(508)[1], "4");
    assert_eq!(entities.iter().filter(|e| e[0] == 510).map(|e| e[4]).collect::<Vec<_>>(), [0, 1, 2, 3, 4, 5]);
}

#[test]
fn open_components_are_bare_surfaces_and_two_balls_are_two_solids() {
    let (summary, text) = write(&both(both(ball(5, DVec3::ZERO), sheet()), ball(5, DVec3::X * 5.0)), Units::M).unwrap();
    assert_eq!(summary, IgesSummary { solids: 2, faces: 12, surfaces: 2 });
    assert_eq!([186, 504, 128].map(|kind| count(&text, kind)), [2, 2, 14]);
    let (_, text) = write(&tube(), Units::M).unwrap();
    assert_eq!([186, 128].map(|kind| count(&text, kind)), [0, 1]);
    // A globe has a seam with two sides and two poles without any length.
    let (_, text) = write(&globe(), Units::M).unwrap();
    assert_eq!([186, 126, 508].map(|kind| count(&text, kind)), [1, 1, 1]);
}

#[test]
fn faces_and_pieces_point_to_their_names_and_faces_to_the_colours_of_the_pictures() {
    let (_, text) = write(&both(ball(5, DVec3::ZERO), sheet()), Units::Mm).unwrap();
    let entities = directory(&text);
    let values = |entity: [usize; 5]| parameters(&text, entity).0;
    let of = |pointer: &str| values(entities[pointer.parse::<usize>().unwrap() / 2]);
    let name = |entity: [usize; 5]| {
        let own = values(entity);
        let (pointer, before) = own.split_last().unwrap();
        assert_eq!(before[before.len() - 2..], ["0", "1"]);
        of(pointer)[..3].join(" ")
    };
    // The six faces of the solid and the two bare surfaces.
    let shown: Vec<usize> = (0..entities.len()).filter(|&k| entities[k][0] == 510 || entities[k][0] == 128).collect();
    let shown: Vec<usize> = shown.into_iter().filter(|&k| entities[k][0] == 510 || entities[k][4] > 5).collect();
    let colors = planish::render::even_colors(8);
    let lines: Vec<&str> = text.lines().filter(|l| l.as_bytes()[72] == b'D').collect();
    assert_eq!(shown.len(), 8);
    for (p, &k) in shown.iter().enumerate() {
        assert_eq!(name(entities[k]), format!("406 1 7Hpatch {p}"));
        let color = of(lines[2 * k + 1][16..24].trim().strip_prefix('-').unwrap());
        let percent: Vec<f64> = color[1..].iter().map(|x| x.parse().unwrap()).collect();
        let bytes = colors[p].map(|byte| f64::from(byte) / 2.55);
        assert_eq!((color[0].as_str(), percent), ("314", bytes.to_vec()));
    }
    let solid = *entities.iter().find(|e| e[0] == 186).unwrap();
    assert_eq!(name(solid), "406 1 7Hpiece 1");
}

#[test]
fn bytes_are_the_same_twice_and_numbers_keep_all_17_digits() {
    let mut case = torus(6);
    case.1[0].control[8].z = 0.1 + 0.2;
    case.1[0].control[14].z = -f64::EPSILON;
    let (_, text) = write(&case, Units::Mm).unwrap();
    assert_eq!(text, write(&case, Units::Mm).unwrap().1);
    assert!(text.contains("0.30000000000000004,") && text.contains("-2.220446049250313D-16,"));
}

#[test]
fn surfaces_that_do_not_fit_the_network_are_refused_with_the_place() {
    let good = ball(5, DVec3::ZERO);
    let refused = |change: &dyn Fn(&mut Case), wanted: &str| {
        let mut case = good.clone();
        change(&mut case);
        let message = write(&case, Units::Mm).unwrap_err().to_string();
        assert!(message.contains(wanted) && message.contains(" - hint: "), "{message}");
    };
    refused(&|c| c.1.clear(), "the model has no surfaces");
    refused(&|c| c.1.truncate(5), "there are 6 patches and 5 surfaces (patch 5)");
    refused(&|c| c.1[2].control[3].x = f64::NAN, "(patch 2)");
}

/// Set `PLANISH_PYTHON` to a Python that has cadquery-ocp to run this one.
#[test]
fn opencascade_finds_the_solids_and_bare_faces_at_tolerances_below_1e_6_of_the_diagonal() {
    let Some(python) = std::env::var_os("PLANISH_PYTHON") else {
        println!("skipped: PLANISH_PYTHON is not set");
        return;
    };
    // Name, model, unit (in millimetres), solids, edges, free edges, volume in cubic units, the share that it may be off by.
    let cases = [
        ("cube", flat_cube(4, DVec3::ZERO), Units::M, [1, 12, 0], 8.0, 1e-6),
        ("torus", torus(6), Units::Cm, [1, 32, 0], 57.0, 0.1),
        ("two", both(ball(6, DVec3::ZERO), ball(6, DVec3::X * 5.0)), Units::In, [2, 24, 0], 7.5, 0.1),
        ("ring", ring(), Units::M, [1, 2, 0], 50.0, 0.1),
        ("globe", globe(), Units::Mm, [1, 1, 0], 3.7, 0.1),
        ("sheet", sheet(), Units::Mm, [0, 8, 8], 0.0, 0.0),
    ];
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR"));
    for (name, case, units, [solids, edges, free], volume, share) in cases {
        let path = folder.join(format!("{name}.igs"));
        write_iges(&path, &IgesInput { network: &case.0, surfaces: &case.1, units, name }).unwrap();
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/step_facts.py");
        let output = std::process::Command::new(&python).arg(script).arg(&path).output().unwrap();
        let text = String::from_utf8_lossy(&output.stdout);
        println!("{name}: {text}");
        let found: serde_json::Value = serde_json::from_str(text.lines().last().unwrap()).unwrap();
        let number = |key: &str| found[key].as_f64().unwrap();
        let counts = ["solids", "faces", "edges", "free_edges", "crowded_edges", "same_way_edges"];
        let counts = counts.map(|key| number(key) as usize);
        assert_eq!(counts, [solids, case.1.len(), edges, free, 0, 0], "{name}");
        assert!(found["valid"].as_bool().unwrap() && number("tolerance_rel") <= 1e-6, "{name}");
        let unit = units.metres() * 1e3;
        assert!((number("volume") / unit.powi(3) - volume).abs() <= share * volume, "{name}: volume");
    }
}
