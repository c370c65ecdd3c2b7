//! Manners of the command line: standard streams, JSON in place of tables, several files, completions, pages of the manual.

mod common;

use common::{error_line, names, planish, status, stderr, stdout, write_box};
use serde_json::Value;
use std::fs::{self, File};
use std::path::Path;
use std::process::{Command, Output, Stdio};

/// Runs the program with a file as its standard input.
fn fed(args: &[&str], input: &Path, folder: &Path) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_planish"));
    command.args(args).current_dir(folder).stdin(Stdio::from(File::open(input).unwrap()));
    command.output().unwrap()
}

fn boxed() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    write_box(&folder.path().join("a.ply"), 4);
    folder
}

#[test]
fn what_goes_through_pipes_is_byte_for_byte_what_goes_through_files_and_no_scratch_file_is_told_or_left() {
    let folder = boxed();
    let at = |name: &str| folder.path().join(name);
    assert_eq!(status(&planish(&["decimate", "a.ply", "-o", "file.stl", "--ratio", "0.5"], folder.path())), 0);
    let piped = fed(&["decimate", "-", "-o", "-", "--to", "stl", "--ratio", "0.5"], &at("a.ply"), folder.path());
    assert_eq!(status(&piped), 0, "{}", stderr(&piped));
    assert_eq!(piped.stdout, fs::read(at("file.stl")).unwrap());
    // The table is where it is in nobody's way, and speaks of `-`.
    assert!(stderr(&piped).lines().any(|l| l.starts_with("mesh ") && l.ends_with(" -")), "{}", stderr(&piped));
    // STL has no mark in text: it is told.
    let model = fed(&["fit", "-", "--from", "stl", "-o", "-", "--patches", "6"], &at("file.stl"), folder.path());
    assert_eq!(status(&model), 0, "{}", stderr(&model));
    fs::write(at("m.planish"), &model.stdout).unwrap();
    let step = fed(&["export", "-", "-o", "-", "--to", "step"], &at("m.planish"), folder.path());
    assert!(step.stdout.starts_with(b"ISO-10303-21"), "{}", stderr(&step));
    let told = fed(&["info", "-", "--json"], &at("a.ply"), folder.path());
    let report: Value = serde_json::from_str(&stdout(&told)).unwrap();
    assert_eq!((&report["input"]["path"], &report["quality"]["mesh.triangles"]), (&"-".into(), &192.into()));
    fs::write(at("text"), "hello there").unwrap();
    let wrong = error_line(&fed(&["info", "-"], &at("text"), folder.path()));
    assert!(wrong.starts_with("error: -: is of no kind") && wrong.contains("--from"), "{wrong}");
    let broken = error_line(&fed(&["info", "-", "--from", "ply"], &at("text"), folder.path()));
    assert!(broken.starts_with("error: -: ") && !broken.contains("stdin"), "{broken}");
    assert!(std::env::temp_dir().read_dir().unwrap().flatten().all(|e| {
        let name = e.file_name().to_string_lossy().into_owned();
        // Other tests may be at work; theirs hold a lock.
        !name.starts_with(".planish-partial-")
            || File::open(e.path().join(".lock")).is_ok_and(|f| f.try_lock().is_err())
            || !e.path().exists()
    }));
}

#[test]
fn streams_that_cannot_be_meant_are_wrong_usage() {
    let folder = boxed();
    for (args, what) in [
        (&["smooth", "a.ply", "-o", "-"][..], "does not tell the format"),
        (&["smooth", "a.ply", "-o", "b.ply", "--to", "stl"], "no output is -"),
        (&["smooth", "a.ply", "-o", "b.ply", "--from", "stl"], "no input is -"),
        (&["compare", "-", "-"], "two inputs"),
        (&["smooth", "a.ply", "-o", "-", "--to", "ply", "--json"], "exclude each other"),
    ] {
        let output = planish(args, folder.path());
        let line = error_line(&output);
        assert!(status(&output) == 2 && line.contains(what) && line.contains(" - hint: "), "{args:?}: {line}");
    }
    assert_eq!(names(folder.path()), ["a.ply"]);
}

#[test]
fn json_is_the_report_in_one_line_in_place_of_the_table() {
    let folder = boxed();
    let output = planish(&["layout", "a.ply", "-o", "n.json", "--json", "--report", "r.json"], folder.path());
    assert_eq!(status(&output), 0, "{}", stderr(&output));
    let text = stdout(&output);
    assert_eq!(text.lines().count(), 1, "{text}");
    let line: Value = serde_json::from_str(&text).unwrap();
    let file: Value = serde_json::from_str(&fs::read_to_string(folder.path().join("r.json")).unwrap()).unwrap();
    assert_eq!(line, file);
}

#[test]
fn info_takes_several_files_and_patterns_and_one_that_is_bad_stops_no_other() {
    let folder = boxed();
    write_box(&folder.path().join("b.ply"), 2);
    fs::write(folder.path().join("c.ply"), "nothing").unwrap();
    let output = planish(&["info", "*.ply", "--json"], folder.path());
    assert_eq!(status(&output), 3);
    let triangles: Vec<Value> = stdout(&output)
        .lines()
        .map(|l| serde_json::from_str::<Value>(l).unwrap()["quality"]["mesh.triangles"].clone())
        .collect();
    assert_eq!(triangles, [192, 48]);
    assert!(error_line(&output).contains("c.ply"));
    let tables = stdout(&planish(&["info", "a.ply", "b.ply"], folder.path()));
    assert!(
        tables.contains("a.ply: mesh") && tables.contains("\n\nfile ") && tables.contains("b.ply: mesh"),
        "{tables}"
    );
}

#[test]
fn shells_get_completions_of_every_command_and_the_manual_a_page_of_each() {
    let folder = tempfile::tempdir().unwrap();
    for shell in ["bash", "zsh", "fish", "powershell"] {
        let text = stdout(&planish(&["completions", shell], folder.path()));
        for word in ["transfer", "patches", "sharp-angle-deg", "completions"] {
            assert!(text.contains(word), "{shell} has no {word}");
        }
    }
    if let Ok(checked) = Command::new("bash").args(["-n", "-s"]).stdin(Stdio::piped()).spawn() {
        let mut checked = checked;
        let text = stdout(&planish(&["completions", "bash"], folder.path()));
        std::io::Write::write_all(&mut checked.stdin.take().unwrap(), text.as_bytes()).unwrap();
        assert!(checked.wait().unwrap().success());
    }
    let page = stdout(&planish(&["man", "run"], folder.path()));
    assert!(
        page.contains(".TH planish-run 1") && page.contains("\\-\\-patches") && page.contains("Examples"),
        "{page}"
    );
    assert_eq!(status(&planish(&["man", "-o", "pages"], folder.path())), 0);
    let pages = names(&folder.path().join("pages"));
    assert!(pages.len() > 20 && pages.contains(&"planish.1".into()), "{pages:?}");
    assert!(pages.contains(&"planish-relief-transfer.1".into()), "{pages:?}");
    let wrong = error_line(&planish(&["man", "walk"], folder.path()));
    assert!(wrong.contains("is no command") && wrong.contains("run"), "{wrong}");
}

#[test]
fn a_formula_becomes_a_closed_mesh_and_a_volume_and_its_faults_have_a_column() {
    let folder = tempfile::tempdir().unwrap();
    let run = |args: &[&str]| planish(args, folder.path());
    let can = ["mesh", "max(x^2 + y^2 - 1, abs(z) - 2)", "--formula", "--bounds=-3,3", "--voxel", "0.1"];
    let output = run(&[&can[..], &["-o", "can.ply", "--json"]].concat());
    assert_eq!(status(&output), 0, "{}", stderr(&output));
    let report: Value = serde_json::from_str(&stdout(&output)).unwrap();
    let quality = &report["quality"];
    let volume = quality["mesh.volume"].as_f64().unwrap();
    assert!((volume / (4.0 * std::f64::consts::PI) - 1.0).abs() < 2e-3, "{volume}");
    assert!(quality["mesh.watertight"] == true && quality["mesh.feature_edges"].as_u64().unwrap() > 100);
    assert_eq!(status(&run(&[&can[..], &["-o", "can.nrrd"]].concat())), 0);
    let again = run(&["mesh", "can.nrrd", "-o", "again.ply", "--json"]);
    let report: Value = serde_json::from_str(&stdout(&again)).unwrap();
    let volume = report["quality"]["mesh.volume"].as_f64().unwrap();
    assert!((volume / (4.0 * std::f64::consts::PI) - 1.0).abs() < 1e-2, "{volume}");
    for (formula, what) in [("x^2 + y^2 = 1", "column 11"), ("x + foo(2)", "column 5")] {
        let output = run(&["mesh", formula, "--formula", "--bounds", "0,1", "-o", "b.ply"]);
        assert!(status(&output) == 2 && error_line(&output).contains(what), "{}", stderr(&output));
    }
    assert_eq!(status(&run(&["mesh", "x", "--formula", "-o", "b.ply"])), 2);
    assert_eq!(status(&run(&["mesh", "x", "--formula", "--bounds", "1,0", "-o", "b.ply"])), 2);
}
