//! The project file: everything comes back, and what is damaged, newer or something else is refused.

#![allow(clippy::print_stdout)] // figures and skipped tests are told to who runs them

mod common;

use common::{coloured_cube, file, folder, torus};
use planish::grid::Grid;
use planish::mesh::FacePoint;
use planish::relief::PatchedMesh;
use planish::relief::Relief;
use planish::{DVec3, HistoryEntry, Model, Units};
use planish_io::{ExportKind, ProjectError, export, export_kind, read_mesh, read_model, write_model};
use proptest::prelude::*;

/// A torus of 16 patches with grids and reliefs of `n x n` points.
fn model(n: usize) -> Model {
    let (network, surfaces) = torus(6);
    let place = |k: usize| FacePoint { face: (k % 12) as u32, bary: [0.5, 0.25 + k as f64 * 1e-9, 0.25] };
    let point = |p: usize, k: usize| {
        let t = (p * n * n + k) as f64;
        DVec3::new((t * 0.01).sin(), (t * 0.013).cos(), t * 1e-6)
    };
    let count = n * n;
    let grids = (0..16).map(|p| Grid {
        rows: n,
        cols: n,
        points: (0..count).map(|k| point(p, k)).collect(),
        places: (0..count).map(place).collect(),
    });
    let reliefs =
        (0..16).map(|p| Relief { rows: n, cols: n, vectors: (0..count).map(|k| point(p, k) * 0.01).collect() });
    let entry = |command: &str| HistoryEntry { command: command.into(), parameters: "{\"tolerance\":0.1}".into() };
    Model {
        mesh: coloured_cube(),
        grids: grids.collect(),
        reliefs: reliefs.collect(),
        surfaces,
        network,
        units: Units::In,
        params: "{\"layout\":{\"patches\":16}}".into(),
        studio: "{\"origin\":1}".into(),
        history: vec![entry("layout"), entry("fit"), entry("move_corner")],
        ..Model::default()
    }
}

#[test]
fn model_comes_back_bit_for_bit_from_a_single_file_and_twice_the_same_bytes() {
    let folder = folder();
    let path = folder.path().join("a.planish");
    let model = model(9);
    write_model(&path, &model).unwrap();
    assert_eq!(read_model(&path).unwrap(), model);
    let bytes = std::fs::read(&path).unwrap();
    write_model(&path, &model).unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), bytes);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn layers_come_back_with_what_can_be_undone_and_damaged_ones_are_told() {
    let folder = folder();
    let path = folder.path().join("a.planish");
    let mut model = model(9);
    model.layers.begin(&model.reliefs);
    let some = |p: usize, r: &Relief| Relief { vectors: if p == 3 { r.vectors.clone() } else { Vec::new() }, ..*r };
    let maps = model.reliefs.iter().enumerate().map(|(p, r)| some(p, r)).collect();
    let entry = HistoryEntry { command: "stroke".into(), parameters: "{}".into() };
    let stack = model.layers.with("stroke", maps);
    model.record_relief(entry.clone(), stack);
    let stack = model.layers.stack[..1].to_vec();
    model.record_relief(HistoryEntry { command: "remove".into(), ..entry }, stack);
    assert!(model.undo_relief());
    assert_eq!(model.reliefs[3].vectors[5], model.layers.pool[0][3].vectors[5] * 2.0);
    write_model(&path, &model).unwrap();
    let mut back = read_model(&path).unwrap();
    assert_eq!(back, model);
    assert!(back.redo_relief() && back.undo_relief() && back.undo_relief() && !back.undo_relief());
    let damage = |sql: &str| {
        let other = folder.path().join("b.planish");
        std::fs::copy(&path, &other).unwrap();
        rusqlite::Connection::open(&other).unwrap().execute(sql, []).unwrap();
        read_model(&other).unwrap_err().to_string()
    };
    assert!(damage("UPDATE layer_map SET rows = 7 WHERE id = 3").contains("do not fit the patches"));
    assert!(damage("DELETE FROM layer_map WHERE id = 20").contains("stand where others should"));
    assert!(damage("UPDATE meta SET value = '{}' WHERE key = 'layers'").contains("missing field"));
}

#[test]
fn a_model_with_feature_curves_and_7_steps_comes_back_and_shares_the_chains_of_its_steps() {
    use planish::curve::symmetry::Plane;
    use planish::grid::{Family, FeatureCurve, Sections};
    let folder = folder();
    let mut model = model(5);
    let entry = |k: usize| HistoryEntry { command: format!("drag_curve_{k}"), parameters: "{}".into() };
    let points = model.network.curves[0].points.clone();
    model.sketch.features.push(FeatureCurve { patch: 1, family: Family::V, points });
    model.sketch.sections.push((1, Sections { u: vec![4, 9], v: Vec::new() }));
    model.sketch.symmetry = Some(Plane { point: DVec3::ONE, normal: DVec3::Y });
    let small = folder.path().join("small.planish");
    write_model(&small, &model).unwrap();
    for k in 0..7 {
        let mut edited = model.drawing();
        edited.network.curves[k].points.reverse();
        model.record(entry(k), edited);
    }
    assert!(model.undo() && model.undo() && model.undo.len() == 5 && model.redo.len() == 2);
    let path = folder.path().join("steps.planish");
    write_model(&path, &model).unwrap();
    let mut back = read_model(&path).unwrap();
    assert_eq!(back, model);
    // Taken back and made again after reading, as before writing.
    assert!(back.redo() && model.redo());
    assert_eq!(back, model);
    while model.undo() {}
    while back.undo() {}
    assert_eq!(back, model);
    assert_eq!(back.history.len(), 3);
}

#[test]
fn empty_model_comes_back() {
    let folder = folder();
    let path = folder.path().join("a.planish");
    write_model(&path, &Model::default()).unwrap();
    assert_eq!(read_model(&path).unwrap(), Model::default());
}

/// Tables of schema 1, before sketches and steps.
const TABLES_1: &str = "
CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE array (id INTEGER PRIMARY KEY, kind TEXT NOT NULL, count INTEGER NOT NULL, checksum INTEGER NOT NULL,
    data BLOB NOT NULL);
CREATE TABLE mesh (id INTEGER PRIMARY KEY, points INTEGER NOT NULL, triangles INTEGER NOT NULL);
CREATE TABLE attribute (id INTEGER PRIMARY KEY, name TEXT NOT NULL, width INTEGER NOT NULL, numbers INTEGER NOT NULL);
CREATE TABLE network (id INTEGER PRIMARY KEY, json TEXT NOT NULL, faces INTEGER NOT NULL, weights INTEGER NOT NULL);
CREATE TABLE grid (patch INTEGER PRIMARY KEY, rows INTEGER NOT NULL, cols INTEGER NOT NULL, points INTEGER NOT NULL,
    faces INTEGER NOT NULL, weights INTEGER NOT NULL);
CREATE TABLE surface (patch INTEGER PRIMARY KEY, rows INTEGER NOT NULL, cols INTEGER NOT NULL,
    control INTEGER NOT NULL, knots_u INTEGER NOT NULL, knots_v INTEGER NOT NULL);
CREATE TABLE relief (patch INTEGER PRIMARY KEY, rows INTEGER NOT NULL, cols INTEGER NOT NULL, vectors INTEGER NOT NULL);
CREATE TABLE history (sequence INTEGER PRIMARY KEY, parent INTEGER REFERENCES history, command TEXT NOT NULL,
    parameters TEXT NOT NULL);
";

/// Writes an array as every schema has them and returns its number: numbers as little-endian bytes, compressed with
/// zstd, and the CRC-32 of kind, count and what is compressed.
fn add_array(database: &rusqlite::Connection, kind: &str, count: usize, bytes: &[u8]) -> i64 {
    add_packed(database, kind, count, zstd::bulk::compress(bytes, 1).unwrap())
}

/// As [`add_array`], of numbers that are compressed already.
fn add_packed(database: &rusqlite::Connection, kind: &str, count: usize, data: Vec<u8>) -> i64 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(kind.as_bytes());
    hasher.update(&(count as u64).to_le_bytes());
    hasher.update(&data);
    let row = rusqlite::params![kind, count as i64, hasher.finalize(), data];
    database.execute("INSERT INTO array (kind, count, checksum, data) VALUES (?1, ?2, ?3, ?4)", row).unwrap();
    database.last_insert_rowid()
}

#[test]
fn a_project_of_schema_1_is_read_without_a_sketch_and_steps_and_written_as_schema_2() {
    let folder = folder();
    let path = folder.path().join("old.planish");
    let floats = |x: &[f64]| x.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    let words = |x: &[u32]| x.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    {
        let database = rusqlite::Connection::open(&path).unwrap();
        database.pragma_update(None, "application_id", 0x706C_616E).unwrap();
        database.pragma_update(None, "user_version", 1).unwrap();
        database.execute_batch(TABLES_1).unwrap();
        database
            .execute_batch(
                "INSERT INTO meta VALUES ('generator', 'planish 0.1.0'), ('params', '{}'), ('units', 'cm');
                 INSERT INTO history VALUES (1, NULL, 'layout', '{}'), (2, 1, 'fit', '{\"tolerance\":0.1}');",
            )
            .unwrap();
        // A square of two triangles; its rim is four curves between four corners, around one patch.
        let points = add_array(&database, "f64", 12, &floats(&[0., 0., 0., 1., 0., 0., 1., 1., 0., 0., 1., 0.5]));
        let triangles = add_array(&database, "u32", 6, &words(&[0, 1, 2, 0, 2, 3]));
        database.execute("INSERT INTO mesh VALUES (1, ?1, ?2)", [points, triangles]).unwrap();
        let corners = [(0u32, [1., 0., 0.]), (0, [0., 1., 0.]), (0, [0., 0., 1.]), (1, [0., 0., 1.])];
        let mut places = corners.to_vec();
        (0..4).for_each(|k| places.extend([corners[k], corners[(k + 1) % 4]]));
        let faces = add_array(&database, "u32", 12, &words(&places.iter().map(|p| p.0).collect::<Vec<_>>()));
        let weights = add_array(&database, "f64", 36, &floats(&places.iter().flat_map(|p| p.1).collect::<Vec<_>>()));
        let curve = |k: usize| format!("{{\"corners\":[{k},{}],\"kind\":\"boundary\",\"points\":2}}", (k + 1) % 4);
        let side = |k: usize| format!("{{\"curve\":{k},\"reversed\":false}}");
        let list = |of: &dyn Fn(usize) -> String| (0..4).map(of).collect::<Vec<_>>().join(",");
        let json =
            format!("{{\"corners\":4,\"curves\":[{}],\"patches\":[{{\"sides\":[{}]}}]}}", list(&curve), list(&side));
        let row = rusqlite::params![json, faces, weights];
        database.execute("INSERT INTO network VALUES (1, ?1, ?2, ?3)", row).unwrap();
    }
    let model = read_model(&path).unwrap();
    assert_eq!((model.mesh.points.len(), model.mesh.triangles.len()), (4, 2));
    assert_eq!(model.mesh.points[3], DVec3::new(0.0, 1.0, 0.5));
    let network = &model.network;
    assert_eq!((network.corners.len(), network.curves.len(), network.patches.len()), (4, 4, 1));
    assert_eq!(network.curves[3].corners, [3, 0]);
    assert_eq!(network.curves[2].points[1], FacePoint { face: 1, bary: [0.0, 0.0, 1.0] });
    assert_eq!(model.units, Units::Cm);
    assert_eq!(model.history.iter().map(|h| &h.command[..]).collect::<Vec<_>>(), ["layout", "fit"]);
    assert_eq!(model.history[1].parameters, "{\"tolerance\":0.1}");
    assert!(model.sketch == Default::default() && model.undo.is_empty() && model.redo.is_empty());
    write_model(&path, &model).unwrap();
    assert_eq!(read_model(&path).unwrap(), model);
    let version = |p: &std::path::Path| -> i32 {
        let database = rusqlite::Connection::open(p).unwrap();
        database.pragma_query_value(None, "user_version", |row| row.get(0)).unwrap()
    };
    assert_eq!(version(&path), 3);
}

#[test]
fn log_that_another_program_left_beside_a_replaced_file_is_not_played_into_the_new_one() {
    let folder = folder();
    let path = folder.path().join("a.planish");
    file(&folder, "a.planish-wal", b"old");
    file(&folder, "a.planish-journal", b"old");
    write_model(&path, &model(4)).unwrap();
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    assert_eq!(read_model(&path).unwrap(), model(4));
}

#[test]
fn newer_schema_other_programs_truncated_and_damaged_files_are_refused_with_a_hint() {
    let folder = folder();
    let path = folder.path().join("a.planish");
    write_model(&path, &model(20)).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let refused = |change: &dyn Fn(&mut Vec<u8>), wanted: &str| {
        let mut bytes = bytes.clone();
        change(&mut bytes);
        let message = read_model(file(&folder, "b.planish", bytes)).map(|_| wanted).unwrap_err().to_string();
        assert!(message.contains(wanted) && message.contains(" - hint: ") && !message.contains('\n'), "{message}");
    };
    refused(&|b| b[63] = 7, "its schema is version 7, newer than 3 that this planish knows - hint: update planish");
    refused(&|b| b[68..72].fill(0), "it is a database of another program (application id 0x00000000)");
    refused(&|b| b.clear(), "it is not a planish project");
    refused(&|b| b[0] = b'X', "it is not a planish project");
    refused(&|b| b.truncate(b.len() - 1), "the file is cut off");
    refused(&|b| b.truncate(50_000), "the file is cut off: 50000 of");
    // A byte in the middle of an array, found in the file by what is around it.
    let blob: Vec<u8> = {
        let database = rusqlite::Connection::open(&path).unwrap();
        database.query_row("SELECT data FROM array ORDER BY length(data) DESC", [], |row| row.get(0)).unwrap()
    };
    let inner = &blob[100..132];
    let at = bytes.windows(32).position(|w| w == inner).unwrap();
    refused(&|b| b[at] ^= 1, "the checksum does not match (array ");
    let sql = |statement: &str, wanted: &str| {
        let path = file(&folder, "c.planish", &bytes);
        rusqlite::Connection::open(&path).unwrap().execute_batch(statement).unwrap();
        let message = read_model(&path).map(|_| wanted).unwrap_err().to_string();
        assert!(message.contains(wanted) && message.contains(" - hint: "), "{message}");
    };
    sql("UPDATE grid SET rows = 21 WHERE patch = 3", "numbers are not the points expected");
    sql("DELETE FROM relief WHERE patch = 15", "15 rows for 16 patches (relief 15)");
    sql("DELETE FROM surface WHERE patch = 0", "stands where 0 should");
    sql("UPDATE meta SET value = 'ell' WHERE key = 'units'", "unknown unit \"ell\"");
    sql("UPDATE array SET count = 1000000000000 WHERE id = 1", "the checksum does not match (array 1)");
    sql("UPDATE mesh SET triangles = points", "(array 1)");
    sql("DROP TABLE grid", "the database is damaged or in use");
    sql("UPDATE network SET json = replace(json, '\"curve\":0', '\"curve\":77')", "names a curve that is not there");
    for knot in [-1.0, 0.1, 3.0, f64::NAN] {
        let mut model = model(4);
        model.surfaces[3].knots_u[5] = knot;
        write_model(folder.path().join("d.planish"), &model).unwrap();
        let message = read_model(folder.path().join("d.planish")).map(|_| knot).unwrap_err().to_string();
        assert!(
            message.contains("its knots are not clamped and rising from 0 to 1") && message.contains("(surface 3)"),
            "{message}"
        );
    }
    assert!(matches!(read_model(folder.path()), Err(ProjectError::Io(_))));
    assert!(matches!(read_model(folder.path().join("none")), Err(ProjectError::Io(_))));
}

#[test]
fn project_of_1_million_grid_points_is_written_and_read() {
    let folder = folder();
    let path = folder.path().join("a.planish");
    let model = model(250);
    let start = std::time::Instant::now();
    write_model(&path, &model).unwrap();
    let written = start.elapsed().as_secs_f64();
    let start = std::time::Instant::now();
    let back = read_model(&path).unwrap();
    let read = start.elapsed().as_secs_f64();
    println!("1 M points: write {written:.2} s, read {read:.2} s, {} bytes", std::fs::metadata(&path).unwrap().len());
    assert!(back == model);
}

#[test]
fn export_chooses_by_extension_and_lists_the_known_ones() {
    let folder = folder();
    let model = model(5);
    let at = |name: &str| folder.path().join(name);
    for (name, kind) in [
        ("a.STEP", ExportKind::Step),
        ("b.glb", ExportKind::Mesh),
        ("c.ply", ExportKind::Mesh),
        ("d.usda", ExportKind::Usd),
        ("e.IGS", ExportKind::Iges),
        ("relief", ExportKind::Relief),
    ] {
        let patched = || PatchedMesh { mesh: model.mesh.clone(), patches: Vec::new() };
        assert_eq!(export(at(name), &model, patched).unwrap(), kind);
        assert!(at(name).exists(), "{name}");
    }
    assert!((read_mesh(at("b.glb")).unwrap().bounds().max.x - 0.0254).abs() < 1e-9);
    assert!(std::fs::read_to_string(at("a.STEP")).unwrap().contains("CONVERSION_BASED_UNIT('INCH'"));
    assert!(at("relief/patch_0015.exr").exists());
    let message = export_kind("a.fbx").unwrap_err().to_string();
    assert!(
        message.contains("unknown extension \"fbx\"") && message.contains(".step, .stp, .igs, .iges, .usda, .ply"),
        "{message}"
    );
    let nothing = export(at("d.step"), &Model::default(), Default::default).unwrap_err().to_string();
    assert!(nothing.contains("there is nothing to write"), "{nothing}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, failure_persistence: None, ..Default::default() })]

    #[test]
    fn bytes_changed_at_random_never_panic(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..20),
    ) {
        static GOOD: std::sync::OnceLock<Vec<u8>> = std::sync::OnceLock::new();
        let folder = folder();
        let mut bytes = GOOD.get_or_init(|| {
            let path = folder.path().join("a.planish");
            write_model(&path, &model(4)).unwrap();
            std::fs::read(&path).unwrap()
        }).clone();
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        let _ = read_model(file(&folder, "b.planish", bytes));
    }
}

#[test]
fn forged_projects_take_no_more_than_their_size_allows_and_compute_nothing() {
    let folder = folder();
    let path = folder.path().join("a.planish");
    write_model(&path, &model(9)).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let zeros = zstd::stream::encode_all(std::io::Read::take(std::io::repeat(0), 1 << 30), 1).unwrap();
    let changed = |change: &dyn Fn(&rusqlite::Connection)| {
        let path = file(&folder, "b.planish", &bytes);
        change(&rusqlite::Connection::open(&path).unwrap());
        read_model(&path)
    };
    // An array that nobody names is not expanded.
    let found = changed(&|database| _ = add_packed(database, "f64", 1 << 27, zeros.clone()));
    assert_eq!(found.unwrap(), model(9));
    // One that the mesh names claims more than such a file holds.
    let bomb = changed(&|database| {
        let array = add_packed(database, "f64", 1 << 27, zeros.clone());
        database.execute("UPDATE mesh SET points = ?1", [array]).unwrap();
    });
    assert!(bomb.unwrap_err().to_string().contains("claims 1073741824 bytes, more than a file of this size holds"));
    let refused = |sql: &str, wanted: &str| {
        let told = changed(&|database| database.execute_batch(sql).unwrap()).map(|_| sql).unwrap_err().to_string();
        assert!(told.contains(wanted) && told.contains(" - hint: "), "{sql}: {told}");
    };
    let endless = "WITH RECURSIVE n(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM n) SELECT x AS sequence, 'a' AS command, \
                   'b' AS parameters FROM n";
    refused(&format!("DROP TABLE history; CREATE VIEW history AS {endless}"), "\"history\" is no plain table");
    refused("CREATE TABLE t (a INTEGER, b TEXT AS (hex(zeroblob(100000000))))", "\"t\" is no plain table");
    // The same array twice would be as many numbers for nothing.
    refused("UPDATE surface SET knots_v = knots_u", "named twice");
    for weights in [[0.0; 3], [1e308; 3], [2.0, -1.0, 0.0], [f64::NAN, 0.5, 0.5]] {
        let told = changed(&|database| {
            let count =
                database
                    .query_row("SELECT count FROM array WHERE id = (SELECT weights FROM network)", [], |r| r.get(0));
            let count: i64 = count.unwrap();
            let bytes: Vec<u8> = (0..count / 3).flat_map(|_| weights).flat_map(|w: f64| w.to_le_bytes()).collect();
            let array = add_array(database, "f64", count as usize, &bytes);
            database.execute("UPDATE network SET weights = ?1", [array]).unwrap();
        });
        assert!(told.unwrap_err().to_string().contains("the places are not on the mesh"), "{weights:?}");
    }
}
