//! The built program as a user meets it: help, statuses, messages, products whole or not at all.

mod common;

use common::*;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

#[test]
fn help_shows_the_commands_in_the_order_of_the_pipeline() {
    let folder = tempfile::tempdir().unwrap();
    let output = planish(&["--help"], folder.path());
    assert_eq!(status(&output), 0);
    let text = stdout(&output);
    let at = |word: &str| text.find(&format!("\n  {word} ")).unwrap_or_else(|| panic!("no {word} in\n{text}"));
    let places: Vec<usize> = ["demo", "run", "layout", "fit", "edit", "export", "compare", "info"].map(at).into();
    assert!(places.is_sorted(), "{text}");
}

#[test]
fn every_command_has_help_and_every_option_of_it_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    for command in ["demo", "run", "layout", "fit", "edit", "export", "compare", "info"] {
        let output = planish(&[command, "--help"], folder.path());
        assert_eq!(status(&output), 0, "{command}");
        let text = stdout(&output);
        assert!(text.contains("--report") && text.contains("--threads") && text.contains("--units"), "{command}");
        let mut lines = text.lines().peekable();
        while let Some(line) = lines.next() {
            if line.trim_start().starts_with("--") || line.trim_start().starts_with('-') && line.contains(", --") {
                let told =
                    line.trim().split("  ").count() > 1 || lines.peek().is_some_and(|l| l.starts_with("          "));
                assert!(told, "{command}: no help for {line}");
            }
        }
    }
}

#[test]
fn version_is_told_with_status_0() {
    let folder = tempfile::tempdir().unwrap();
    let output = planish(&["--version"], folder.path());
    assert_eq!((status(&output), stdout(&output).trim()), (0, concat!("planish ", env!("CARGO_PKG_VERSION"))));
}

#[test]
fn the_program_is_smaller_than_40_mb() {
    // Builds for debugging are as large as they are.
    if cfg!(not(debug_assertions)) {
        let bytes = fs::metadata(env!("CARGO_BIN_EXE_planish")).unwrap().len();
        assert!(bytes < 40_000_000, "{bytes}");
    }
}

#[test]
fn wrong_usage_is_status_2() {
    let folder = tempfile::tempdir().unwrap();
    write_box(&folder.path().join("box.ply"), 2);
    for args in [
        &["polish"][..],
        &["run", "box.ply"],
        &["run", "box.ply", "-o", "out", "--no-such-option"],
        &["run", "box.ply", "-o", "out", "--threads", "0"],
        &["run", "box.ply", "-o", "out", "--units", "furlong"],
        &["run", "box.ply", "-o", "out", "-q", "-v"],
        &["run", "box.ply", "-o", "out", "--density", "many"],
        &["run", "box.ply", "-o", "out", "--density", "-1"],
        &["info", "box.ply", "--report", "facts.txt"],
        &["layout", "box.ply", "-o", "network.xml"],
        &["fit", "box.ply", "-o", "model.step"],
    ] {
        let output = planish(args, folder.path());
        assert_eq!(status(&output), 2, "{args:?}: {}", stderr(&output));
        assert!(stderr(&output).starts_with("error: "), "{args:?}: {}", stderr(&output));
        assert_eq!(names(folder.path()), ["box.ply"], "{args:?} left something");
    }
}

#[test]
fn unusable_input_is_status_3_with_file_and_hint_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| fs::write(folder.path().join(name), bytes).unwrap();
    write("empty.ply", b"");
    write("words.ply", b"this is no mesh\n");
    write("short.ply", b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0");
    write("lying.ply", b"ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n");
    write("index.ply", b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n");
    write("cloud.ply", b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n");
    write("part.docx", b"PK");
    write("broken.planish", b"SQLite format 3\0 but not really");
    let before = names(folder.path());
    for name in [
        "none.ply",
        "empty.ply",
        "words.ply",
        "short.ply",
        "lying.ply",
        "index.ply",
        "cloud.ply",
        "part.docx",
        "broken.planish",
    ] {
        for args in [
            &["run", name, "-o", "out"][..],
            &["info", name],
            &["compare", name, name],
            &["fit", name, "-o", "m.planish"],
        ] {
            if name == "cloud.ply" && ["info", "compare"].contains(&args[0]) {
                continue; // points are a scan: one point can be told of, and compared with itself
            }
            let output = planish(args, folder.path());
            assert_eq!(status(&output), 3, "{args:?}: {}", stderr(&output));
            let line = error_line(&output);
            assert!(line.starts_with(&format!("error: {name}: ")), "{line}");
            assert!(line.contains(" - hint: "), "{line}");
            assert_eq!(names(folder.path()), before, "{args:?} left something");
        }
    }
}

#[test]
fn a_network_of_another_mesh_or_of_no_sense_is_status_3() {
    let folder = tempfile::tempdir().unwrap();
    write_box(&folder.path().join("box.ply"), 3);
    for (name, text) in [
        ("words.json", "no json"),
        ("list.json", "[]"),
        ("far.json", r#"{"corners":[{"place":{"face":99999,"bary":[1,0,0]}}],"curves":[],"patches":[]}"#),
    ] {
        fs::write(folder.path().join(name), text).unwrap();
        let output = planish(&["fit", "box.ply", "--network", name, "-o", "m.planish"], folder.path());
        assert_eq!(status(&output), 3, "{name}: {}", stderr(&output));
        assert!(error_line(&output).starts_with(&format!("error: {name}: ")), "{}", stderr(&output));
        assert!(!folder.path().join("m.planish").exists());
    }
}

#[test]
fn an_output_that_cannot_be_written_is_told_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    write_box(&folder.path().join("box.ply"), 2);
    fs::write(folder.path().join("file"), "x").unwrap();
    fs::create_dir(folder.path().join("dir")).unwrap();
    for args in [
        &["run", "box.ply", "-o", "file"][..],
        &["run", "box.ply", "-o", "file/out"],
        &["fit", "box.ply", "-o", "dir"],
        &["fit", "box.ply", "-o", "nowhere/m.planish"],
        &["layout", "box.ply", "-o", "nowhere/n.json"],
        &["info", "box.ply", "--report", "nowhere/r.json"],
    ] {
        let output = planish(args, folder.path());
        assert_eq!(status(&output), 2, "{args:?}: {}", stderr(&output));
        assert!(error_line(&output).contains(" - hint: "), "{}", stderr(&output));
        assert_eq!(names(folder.path()), ["box.ply", "dir", "file"], "{args:?} left something");
    }
}

#[test]
fn run_leaves_all_products_and_the_same_bytes_on_1_and_2_threads() {
    let folder = tempfile::tempdir().unwrap();
    write_box(&folder.path().join("box.ply"), 6);
    // A folder that is there already, with a file of the user's own and an old product.
    fs::create_dir(folder.path().join("one")).unwrap();
    fs::write(folder.path().join("one/notes.txt"), "mine").unwrap();
    fs::write(folder.path().join("one/surface.step"), "old, by planish").unwrap();
    for (out, threads) in [("one", "1"), ("two", "2")] {
        let output = planish(
            &["run", "box.ply", "-o", out, "--threads", threads, "--units", "cm", "--patches", "6"],
            folder.path(),
        );
        assert_eq!(status(&output), 0, "{}", stderr(&output));
        assert!(stderr(&output).is_empty(), "not a terminal: no bars, and nothing to warn of: {}", stderr(&output));
        assert!(stdout(&output).contains("patches"), "{}", stdout(&output));
    }
    let products = ["mesh.ply", "model.planish", "preview.glb", "relief", "report.html", "report.json", "surface.step"];
    assert_eq!(names(&folder.path().join("two")), products);
    assert_eq!(fs::read_to_string(folder.path().join("one/notes.txt")).unwrap(), "mine");
    assert_eq!(names(folder.path()), ["box.ply", "one", "two"]);
    let read = |out: &str, name: &str| fs::read(folder.path().join(out).join(name)).unwrap();
    for name in ["mesh.ply", "model.planish", "preview.glb", "surface.step"] {
        assert!(read("one", name) == read("two", name), "{name} differs");
    }
    for name in names(&folder.path().join("two/relief")) {
        let name = format!("relief/{name}");
        assert!(read("one", &name) == read("two", &name), "{name} differs");
    }
    let report: serde_json::Value = serde_json::from_slice(&read("two", "report.json")).unwrap();
    assert_eq!(report["input"]["units"], "cm");
    assert_eq!(report["quality"]["mesh.watertight"], true);
    assert_eq!(report["quality"]["grid.folds"], 0);
    assert_eq!(report["quality"]["patches.count"], 6);
}

#[test]
fn layout_then_fit_then_export_then_compare_works_step_by_step() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    write_box(&path.join("box.ply"), 6);
    let done = |args: &[&str]| ok(args, path);
    done(&["layout", "box.ply", "-o", "network.json", "--patches", "6"]);
    done(&["fit", "box.ply", "--network", "network.json", "-o", "box.planish", "--report", "fit.json"]);
    for name in ["box.step", "box.glb", "box-surface.ply", "box.stl", "box.obj"] {
        done(&["export", "box.planish", "-o", name]);
        assert!(fs::metadata(path.join(name)).unwrap().len() > 100, "{name}");
    }
    assert!(done(&["info", "box.planish"]).contains("patches"));
    assert!(done(&["info", "box.ply"]).contains("watertight"));
    let table = done(&["compare", "box.ply", "box.planish", "--report", "compare.json"]);
    assert!(table.contains("distance"), "{table}");
    let report: serde_json::Value = serde_json::from_slice(&fs::read(path.join("compare.json")).unwrap()).unwrap();
    // A box of flat faces: its surface is exact.
    assert!(report["quality"]["distance.max_rel"].as_f64().unwrap() < 1e-9, "{report}");
    let missed = planish(&["export", "box.planish", "-o", "box.docx"], path);
    assert_eq!(status(&missed), 2, "{}", stderr(&missed));
    assert!(error_line(&missed).contains("step"), "the hint names the formats: {}", stderr(&missed));
}

#[test]
fn a_demanded_tolerance_that_is_missed_is_status_1_and_the_result_is_there() {
    let folder = tempfile::tempdir().unwrap();
    write_box(&folder.path().join("box.ply"), 3);
    write_box(&folder.path().join("finer.ply"), 4);
    let shifted = fs::read_to_string(folder.path().join("finer.ply")).unwrap().replace("\n1 1 1\n", "\n1.5 1.5 1.5\n");
    fs::write(folder.path().join("finer.ply"), shifted).unwrap();
    let compare = |tolerance: &str| {
        planish(&["compare", "box.ply", "finer.ply", "--tolerance", tolerance, "--report", "r.json"], folder.path())
    };
    let (far, near) = (compare("0.1"), compare("10"));
    assert_eq!((status(&far), status(&near)), (1, 0), "{}{}", stderr(&far), stderr(&near));
    assert!(folder.path().join("r.json").exists());
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_within_1_s_with_status_130_and_no_partial_file() {
    let folder = tempfile::tempdir().unwrap();
    let mut child = Command::new(env!("CARGO_BIN_EXE_planish"))
        .args(["demo", "-o", "out", "--points", "400000"])
        .current_dir(folder.path())
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    std::thread::sleep(Duration::from_millis(1500));
    assert!(child.try_wait().unwrap().is_none(), "the run ended before it could be interrupted");
    let pressed = Instant::now();
    Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    let ended = child.wait().unwrap();
    let took = pressed.elapsed();
    assert_eq!(ended.code(), Some(130));
    assert!(took < Duration::from_millis(1500), "took {took:?}");
    assert!(names(folder.path()).is_empty(), "left {:?}", names(folder.path()));
}

/// Twelve edges of the box become curves, then one curve is bent and the bend taken back.
const BOX_SCRIPT: &str = r#"
[view]
toward = [1.0, 0.7, 0.5]

[[step]]
edit = "feature_lines"
angle_deg = 40.0

[[step]]
edit = "paint"
picks = [[0.5, 0.0, 1.0], [0.5, 0.4, 1.0], [0.5, 1.0, 1.0]]
mode = "geodesic"
"#;

#[test]
fn a_script_draws_a_network_on_a_bare_mesh_and_the_history_goes_back_and_forth_in_later_runs() {
    let folder = tempfile::tempdir().unwrap();
    write_box(&folder.path().join("box.ply"), 12);
    let script = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    script("draw.toml", BOX_SCRIPT);
    let arguments = ["edit", "box.ply", "draw.toml", "-o", "box.planish", "--pictures", "seen", "--report", "r.json"];
    let output = planish(&arguments, folder.path());
    assert_eq!(status(&output), 0, "{}", stderr(&output));
    // What every step did, in the table and in the report.
    let table = stdout(&output);
    assert!(table.contains("feature_lines: corners 0 to 7, curves 0 to 11, all patches"), "{table}");
    assert!(table.contains("paint: corners 8, 9, curves ") && table.contains(", 2 to put right"), "{table}");
    let report: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(folder.path().join("r.json")).unwrap()).unwrap();
    assert_eq!(report["edits"][1]["faults"], 2, "{report}");
    assert_eq!(report["edits"][1]["corners"], serde_json::json!([8, 9]));
    // The same is told of the model later on.
    let info = planish(&["info", "box.planish"], folder.path());
    assert_eq!(stderr(&info).lines().filter(|l| l.contains("has 5 sides, not 4")).count(), 2);
    assert!(stdout(&info).contains("10 corners, 15 curves"), "{}", stdout(&info));
    // The stroke divides the top in two patches and puts a corner into two edges: their other sides have five.
    let told = stderr(&output);
    assert_eq!(
        told.lines().filter(|l| l.starts_with("warning: ") && l.contains("has 5 sides, not 4")).count(),
        2,
        "{told}"
    );
    assert!(stdout(&output).contains("not finished"));
    assert_eq!(names(&folder.path().join("seen")), ["01-feature_lines.png", "02-paint.png"]);
    // Split across the neighbours all the way round: finished, and fitted.
    script("split.toml", "[[step]]\nedit = \"split_region\"\nat = [0.25, 0.0, 0.3]\n");
    let output = planish(&["edit", "box.planish", "split.toml", "--threads", "1"], folder.path());
    assert_eq!(status(&output), 0, "{}", stderr(&output));
    assert!(stdout(&output).contains("10 patches, finished"), "{}{}", stdout(&output), stderr(&output));
    script("back.toml", "[[step]]\nedit = \"undo\"\ncount = 2\n");
    let output = planish(&["edit", "box.planish", "back.toml", "-o", "plain.planish", "--threads", "2"], folder.path());
    assert_eq!(status(&output), 0, "{}", stderr(&output));
    let text = stdout(&output);
    assert!(text.contains("6 patches, finished") && text.contains("1 to take back, 2 to make again"), "{text}");
    script("again.toml", "[[step]]\nedit = \"redo\"\ncount = 2\n");
    let output = planish(&["edit", "plain.planish", "again.toml", "-o", "again.planish"], folder.path());
    assert_eq!(status(&output), 0, "{}", stderr(&output));
    assert_eq!(
        fs::read(folder.path().join("box.planish")).unwrap(),
        fs::read(folder.path().join("again.planish")).unwrap()
    );
    // Nothing is left to make again.
    let output = planish(&["edit", "again.planish", "again.toml", "-o", "x.planish"], folder.path());
    assert_eq!(status(&output), 3);
    assert!(error_line(&output).contains("step 1 (redo, line 1): there is nothing left to make again"));
    assert!(!folder.path().join("x.planish").exists());
}

/// A figure of a report.
fn figure(path: &Path, key: &str) -> f64 {
    let report: serde_json::Value = serde_json::from_slice(&fs::read(path).unwrap()).unwrap();
    report["quality"][key].as_f64().unwrap_or_else(|| panic!("no {key} in {report}"))
}

#[test]
fn fit_makes_of_a_model_that_edit_left_without_surfaces_what_edit_would_have_made() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    write_box(&path.join("box.ply"), 6);
    fs::write(path.join("lines.toml"), "[[step]]\nedit = \"feature_lines\"\nangle_deg = 40.0\n").unwrap();
    let done = |args: &[&str]| ok(args, path);
    done(&["edit", "box.ply", "lines.toml", "-o", "whole.planish"]);
    done(&["edit", "box.ply", "lines.toml", "-o", "bare.planish", "--no-fit"]);
    let table = done(&["fit", "bare.planish", "-o", "fitted.planish", "--report", "plain.json"]);
    assert!(table.contains("control points"), "{table}");
    done(&["export", "whole.planish", "-o", "whole.step"]);
    done(&["export", "fitted.planish", "-o", "fitted.step"]);
    let step = |name: &str| fs::read_to_string(path.join(name)).unwrap().replace("fitted", "whole");
    assert!(step("whole.step") == step("fitted.step"));
    assert!(done(&["info", "fitted.planish"]).contains("feature_lines, fit"));
    // Grids are still to be made: their options count, also those that were given to `edit`.
    done(&["fit", "bare.planish", "-o", "dense.planish", "--min-side", "40", "--report", "dense.json"]);
    done(&["edit", "box.ply", "lines.toml", "-o", "wish.planish", "--no-fit", "--min-side", "40"]);
    done(&["fit", "wish.planish", "-o", "wish.planish", "--in-place", "--report", "wish.json"]);
    let points = |name: &str| figure(&path.join(name), "grid.points");
    assert_eq!([points("plain.json"), points("dense.json"), points("wish.json")], [1734.0, 9600.0, 9600.0]);
    // Now they are there.
    let output = planish(&["fit", "dense.planish", "-o", "no.planish", "--min-side", "20"], path);
    assert!(status(&output) == 2 && error_line(&output).starts_with("error: --min-side: "), "{}", stderr(&output));
}

#[test]
fn a_model_whose_network_is_not_finished_is_not_fitted_and_the_way_out_is_told() {
    let folder = tempfile::tempdir().unwrap();
    write_box(&folder.path().join("box.ply"), 12);
    for (script, wanted) in [(BOX_SCRIPT, "unfinished network with 2 things to put right"), ("", "has no network")] {
        fs::write(folder.path().join("s.toml"), script).unwrap();
        let output = planish(&["edit", "box.ply", "s.toml", "-o", "box.planish", "-q"], folder.path());
        assert_eq!(status(&output), 0, "{}", stderr(&output));
        let output = planish(&["fit", "box.planish", "-o", "no.planish"], folder.path());
        assert_eq!(status(&output), 3);
        let line = error_line(&output);
        assert!(line.contains(wanted) && line.contains("planish edit"), "{line}");
        assert!(!folder.path().join("no.planish").exists());
    }
}

#[test]
fn the_network_of_a_model_goes_out_as_layout_writes_it_and_in_again() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    write_box(&path.join("box.ply"), 6);
    let done = |args: &[&str]| ok(args, path);
    done(&["layout", "box.ply", "-o", "network.json", "--patches", "6"]);
    done(&["fit", "box.ply", "--network", "network.json", "-o", "box.planish"]);
    done(&["export", "box.planish", "-o", "out.json"]);
    let bytes = |name: &str| fs::read(path.join(name)).unwrap();
    assert!(bytes("out.json") == bytes("network.json"));
    // With the mesh of the model, too.
    done(&["export", "box.planish", "--surface", "mesh", "-o", "mesh.ply"]);
    done(&["fit", "mesh.ply", "--network", "out.json", "-o", "again.planish"]);
    done(&["export", "again.planish", "-o", "again.json"]);
    assert!(bytes("again.json") == bytes("network.json"));
}

#[test]
fn a_script_makes_one_edge_of_a_box_smooth_and_model_network_and_seams_keep_to_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    write_box(&path.join("box.ply"), 6);
    let edit = |input: &str, script: &str| {
        fs::write(path.join("s.toml"), script).unwrap();
        let output = planish(&["edit", input, "s.toml", "-o", "box.planish", "--in-place", "--report", "r.json"], path);
        assert_eq!(status(&output), 0, "{script}: {}", stderr(&output));
        let report: serde_json::Value = serde_json::from_slice(&fs::read(path.join("r.json")).unwrap()).unwrap();
        let output = planish(&["export", "box.planish", "-o", "n.json"], path);
        assert_eq!(status(&output), 0, "{}", stderr(&output));
        let smooth = fs::read_to_string(path.join("n.json")).unwrap().matches("\"kind\":\"rounded\"").count();
        let seams = report["seams"].as_array().unwrap();
        let angles = |feature: bool| -> Vec<f64> {
            let own = seams.iter().filter(|s| s["feature"] == feature);
            own.map(|s| s["angle_rms_deg"].as_f64().unwrap()).collect()
        };
        (smooth, angles(false), angles(true), report["edits"][0]["curves"].as_array().unwrap().len())
    };
    let (smooth, bent, sharp, _) = edit("box.ply", "[[step]]\nedit = \"feature_lines\"\nangle_deg = 40.0\n");
    assert_eq!((smooth, bent.len(), sharp.len()), (0, 0, 12));
    let step = "[[step]]\nedit = \"continuity\"\ncurves = [{ near = [0.5, 0.0, 1.0] }]\nseam = ";
    let (smooth, bent, sharp, changed) = edit("box.planish", &format!("{step}\"smooth\"\n"));
    assert_eq!((smooth, bent.len(), sharp.len(), changed), (1, 1, 11, 1));
    assert!(bent[0] < 60.0 && sharp.iter().all(|a| *a > 80.0), "{bent:?} {sharp:?}");
    let (smooth, bent, sharp, _) = edit("box.planish", &format!("{step}\"sharp\"\n"));
    assert_eq!((smooth, bent.len(), sharp.len()), (0, 0, 12));
}

#[test]
fn displacement_maps_read_back_from_their_files_bring_the_surface_to_the_grid_within_single_precision() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    write_box(&path.join("box.ply"), 6);
    // A bump that a surface of few control points leaves to its map.
    let bumped = fs::read_to_string(path.join("box.ply")).unwrap().replace("\n0.5 0.5 1\n", "\n0.5 0.5 1.1\n");
    fs::write(path.join("box.ply"), bumped).unwrap();
    let options = ["--patches", "6", "--control", "4x4", "-o", "out"];
    let output = planish(&[&["run", "box.ply"], &options[..]].concat(), path);
    assert_eq!(status(&output), 0, "{}", stderr(&output));
    let output = planish(&["export", "out/model.planish", "-o", "maps", "--report", "maps.json"], path);
    assert_eq!(status(&output), 0, "{}", stderr(&output));
    let read = |key: &str| figure(&path.join("out/report.json"), key);
    let (most, away, exact) = (read("relief.max"), read("relief.roundtrip_max"), read("relief.rounding_max"));
    // Not an identity: single precision is seen, and no more than that.
    assert!(most > 0.01 && away > 1e-12 && away < 1.1 * most * 2f64.powi(-24), "{away} of {most}");
    assert!(exact < 1e-15, "{exact}");
    assert_eq!(figure(&path.join("maps.json"), "relief.roundtrip_max"), away);
}

#[test]
fn wrong_scripts_are_told_with_file_line_and_hint_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    write_box(&folder.path().join("box.ply"), 4);
    let run = |text: &str| {
        fs::write(folder.path().join("s.toml"), text).unwrap();
        let arguments = ["edit", "box.ply", "s.toml", "-o", "box.planish", "--pictures", "seen"];
        let output = planish(&arguments, folder.path());
        assert_eq!(status(&output), 3, "{text}");
        let line = error_line(&output);
        assert!(line.starts_with("error: s.toml: ") && line.contains(" - hint: "), "{line}");
        // Neither a model nor the pictures of the steps before.
        let mut left: Vec<_> = fs::read_dir(folder.path()).unwrap().map(|f| f.unwrap().file_name()).collect();
        left.sort();
        assert_eq!(left, ["box.ply", "s.toml"], "{text}");
        line
    };
    let good = "[[step]]\nedit = \"feature_lines\"\nangle_deg = 40.0\n\n";
    for (text, wanted) in [
        ("[[step]]\nedit = \"paint\"\npicks = 3\n".to_string(), "(line 1)"),
        (format!("{good}[[step]]\nedit = \"fly\"\n"), "step 2: unknown variant `fly`"),
        (format!("{good}[[step]]\nedit = \"fly\"\n"), "(line 5)"),
        (format!("{good}[[step]]\nedit = \"join\"\ncorner = 1\nwings = 2\n"), "(line 5)"),
        ("[[step]\n".into(), "(line 1)"),
        ("[view]\nlens = 3\n".into(), "unknown field `lens`"),
        (
            format!("{good}[[step]]\nedit = \"split_curve\"\ncurve = 40\nat = 0.5\n"),
            "step 2 (split_curve, line 5): curve 40 is not there, there are 12",
        ),
        (
            "[[step]]\nedit = \"paint\"\npicks = [[nan, 0, 0], [1, 1, 1]]\n".into(),
            "step 1 (paint, line 1): a pick is not a finite number",
        ),
        (
            "[[step]]\nedit = \"paint\"\npicks = [[0.5, 0.5, 1.0], [900, 0, 0]]\n".into(),
            "(900, 0, 0) is 51904 % of the diagonal off the mesh",
        ),
        (
            format!("{good}[[step]]\nedit = \"relax\"\ncurve = {{ near = [0, 0, 90] }}\n"),
            "step 2 (relax, line 5): (0, 0, 90) is ",
        ),
        (
            format!("{good}[[step]]\nedit = \"relax\"\ncurve = {{ close = [0, 0, 1] }}\n"),
            "step 2: a number counted from 0, { near = [x, y, z] } or { feature = .. } is wanted (line 5)",
        ),
        (
            format!("{good}[[step]]\nedit = \"spline\"\ncurve = 0\ncontrol = 100000\n"),
            "step 2 (spline, line 5): control is 100000, not between 4 and 1000",
        ),
        (
            "[[step]]\nedit = \"paint\"\npicks = [{ face = 1, bary = [2, 0, 5] }, [1, 1, 1]]\n".into(),
            "step 1 (paint, line 1): a weight of bary is 2, not between 0 and 1",
        ),
        ("[[step]]\nedit = \"undo\"\n".into(), "step 1 (undo, line 1): there is nothing left to take back"),
        (
            "[[step]]\nedit = \"carry\"\nfrom = \"none.planish\"\nlandmarks = []\n".into(),
            "step 1 (carry, line 1): none.planish: ",
        ),
    ] {
        let line = run(&text);
        assert!(line.contains(wanted), "{line}");
    }
    fs::remove_file(folder.path().join("s.toml")).unwrap();
    let output = planish(&["edit", "box.ply", "s.toml", "-o", "box.planish"], folder.path());
    assert!(status(&output) == 3 && error_line(&output).contains("s.toml: cannot read it"));
    let output = planish(&["edit", "box.ply", "s.toml"], folder.path());
    assert_eq!(status(&output), 2);
    assert!(error_line(&output).contains("--output"));
}
