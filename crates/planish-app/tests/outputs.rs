//! Nobody loses a file: what a command may write, replace and leave behind.

mod common;

use common::*;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// A small cloud on a sphere, with an outlier of its own so that there is something to clean.
fn write_cloud(path: &Path) {
    let turn = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let point = |k: usize| {
        let z = 1.0 - 2.0 * (k as f64 + 0.5) / 2000.0;
        let (r, a) = ((1.0 - z * z).sqrt(), turn * k as f64);
        format!("{} {} {z}\n", r * a.cos(), r * a.sin())
    };
    fs::write(path, (0..2000).map(point).collect::<String>()).unwrap();
}

#[test]
fn run_keeps_a_folder_and_files_of_somebody_else_and_says_so_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    write_box(&at("box.ply"), 8);
    fs::create_dir_all(at("out/relief")).unwrap();
    fs::write(at("out/relief/sculpt.blend"), "mine").unwrap();
    let output = planish(&["run", "box.ply", "-o", "out"], folder.path());
    assert_eq!(status(&output), 2);
    assert!(error_line(&output).contains("relief: is a folder with files of its own"), "{}", stderr(&output));
    assert_eq!(names(&at("out")), ["relief"]);
    fs::remove_dir_all(at("out")).unwrap();
    fs::create_dir_all(at("out/mesh.ply")).unwrap();
    fs::write(at("out/mesh.ply/notes.txt"), "mine").unwrap();
    for more in [&[][..], &["--force"]] {
        let output = planish(&[&["run", "box.ply", "-o", "out"], more].concat(), folder.path());
        assert_eq!(status(&output), 2);
        assert!(error_line(&output).contains("mesh.ply: is a folder where a file is to go"), "{}", stderr(&output));
    }
    fs::remove_dir_all(at("out")).unwrap();
    fs::create_dir_all(at("out")).unwrap();
    fs::write(at("out/surface.step"), "ISO-10303-21; drawn by hand").unwrap();
    fs::write(at("out/notes.txt"), "mine").unwrap();
    let output = planish(&["run", "box.ply", "-o", "out"], folder.path());
    assert!(error_line(&output).contains("surface.step: is there already and was not written by planish"));
    // With --force, and again without: now all products are of this program.
    for more in [&["--force"][..], &[]] {
        let output = planish(&[&["run", "box.ply", "-q", "-o", "out"], more].concat(), folder.path());
        assert_eq!(status(&output), 0, "{}", stderr(&output));
    }
    fs::write(at("out/relief/sculpt.blend"), "mine").unwrap();
    assert_eq!(status(&planish(&["run", "box.ply", "-q", "-o", "out"], folder.path())), 0);
    assert_eq!(fs::read_to_string(at("out/notes.txt")).unwrap(), "mine");
    assert_eq!(fs::read_to_string(at("out/relief/sculpt.blend")).unwrap(), "mine");
    let output = planish(&["run", "box.ply", "-o", "out", "--no-clobber"], folder.path());
    assert_eq!(status(&output), 2, "{}", stderr(&output));
    // A product is no input of the run that would replace it.
    let output = planish(&["run", "out/mesh.ply", "-o", "out"], folder.path());
    assert!(error_line(&output).contains("is an input of this command"), "{}", stderr(&output));
}

#[test]
fn two_outputs_or_an_output_and_an_input_that_are_one_file_are_refused_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    write_box(&at("box.ply"), 4);
    write_cloud(&at("a.xyz"));
    let before = fs::read(at("box.ply")).unwrap();
    fs::create_dir(at("sub")).unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink(at("box.ply"), at("link.ply")).unwrap();
    for (args, words) in [
        (&["layout", "box.ply", "-o", "n.json", "--report", "sub/../n.json"][..], "two outputs"),
        (&["clean", "a.xyz", "-o", "x.obj", "--lines", "x.obj"], "two outputs"),
        (&["clean", "a.xyz", "-o", "s.ply", "--lines", "a.xyz"], "is an input"),
        (&["smooth", "box.ply", "-o", "box.ply"], "is an input"),
        (&["decimate", "box.ply", "-o", "./sub/../box.ply", "--ratio", "0.5"], "is an input"),
        #[cfg(unix)]
        (&["smooth", "box.ply", "-o", "link.ply"], "is an input"),
        (&["fit", "box.ply", "--network", "n.json", "-o", "m.planish", "--report", "n.json"], "is an input"),
    ] {
        let output = planish(args, folder.path());
        assert_eq!(status(&output), 2, "{args:?}: {}", stderr(&output));
        assert!(error_line(&output).contains(words), "{args:?}: {}", stderr(&output));
    }
    assert_eq!(fs::read(at("box.ply")).unwrap(), before);
    let output = planish(&["smooth", "box.ply", "-q", "-o", "box.ply", "--in-place"], folder.path());
    assert_eq!(status(&output), 0, "{}", stderr(&output));
    assert_ne!(fs::read(at("box.ply")).unwrap(), before);
}

#[test]
fn segments_take_the_place_of_no_file_of_somebody_else() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    write_cloud(&at("p-0.xyz"));
    let before = fs::read(at("p-0.xyz")).unwrap();
    let output = planish(&["clean", "p-0.xyz", "-o", "p.xyz", "--segment"], folder.path());
    assert_eq!(status(&output), 2, "{}", stderr(&output));
    assert!(error_line(&output).contains("p-0.xyz: is an input"), "{}", stderr(&output));
    assert_eq!(fs::read(at("p-0.xyz")).unwrap(), before);
    assert_eq!(names(folder.path()), ["p-0.xyz"]);
    // Twice: what the first run wrote bears the mark of the program.
    for _ in 0..2 {
        let output = planish(&["clean", "p-0.xyz", "-q", "-o", "q.xyz", "--segment"], folder.path());
        assert_eq!(status(&output), 0, "{}", stderr(&output));
    }
    assert_eq!(names(folder.path()), ["p-0.xyz", "q-0.xyz", "q.xyz"]);
}

#[test]
fn every_format_that_is_written_can_be_written_again_without_force() {
    let folder = tempfile::tempdir().unwrap();
    write_box(&folder.path().join("box.ply"), 4);
    write_cloud(&folder.path().join("a.xyz"));
    for _ in 0..2 {
        for name in ["m.ply", "m.obj", "m.stl"] {
            let output = planish(&["smooth", "box.ply", "-q", "-o", name], folder.path());
            assert_eq!(status(&output), 0, "{name}: {}", stderr(&output));
        }
        for name in ["c.ply", "c.xyz", "c.las", "c.laz", "c.e57"] {
            let output = planish(&["clean", "a.xyz", "-q", "-o", name, "--lines", "l.obj"], folder.path());
            assert_eq!(status(&output), 0, "{name}: {}", stderr(&output));
        }
        for args in [
            &["layout", "box.ply", "-q", "-o", "n.json", "--report", "r.json"][..],
            &["fit", "box.ply", "-q", "-o", "m.planish"],
            &["export", "m.planish", "-q", "-o", "m.step"],
            &["export", "m.planish", "-q", "-o", "m.glb"],
            &["export", "m.planish", "-q", "-o", "maps"],
        ] {
            ok(args, folder.path());
        }
    }
}

#[cfg(unix)]
#[test]
fn sigterm_and_sighup_end_like_ctrl_c_with_nothing_left_and_a_line() {
    let folder = tempfile::tempdir().unwrap();
    for signal in ["TERM", "HUP", "INT"] {
        let mut child = Command::new(env!("CARGO_BIN_EXE_planish"))
            .args(["demo", "-q", "-o", "out"])
            .current_dir(folder.path())
            .stdin(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        std::thread::sleep(Duration::from_millis(700));
        let kill = Command::new("kill").args([format!("-{signal}"), child.id().to_string()]).status().unwrap();
        assert!(kill.success());
        let since = Instant::now();
        let ended = child.wait().unwrap();
        // A second is promised; a machine that runs other tests beside this one gets more.
        assert!(since.elapsed() < Duration::from_secs(3), "{signal}: {:?}", since.elapsed());
        assert_eq!(ended.code(), Some(130), "{signal}");
        assert!(names(folder.path()).is_empty(), "{signal}: {:?}", names(folder.path()));
    }
}

#[test]
fn tiles_hold_the_mesh_and_replace_those_of_an_older_list_and_no_file_of_somebody_else() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    write_box(&at("box.ply"), 4);
    let mesh = |more: &[&str]| planish(&[&["mesh", "box.ply", "-q", "--resolution=33"], more].concat(), folder.path());
    let tiles = |more: &[&str]| mesh(&[&["-o", "tiles", "--report", "r.json"], more].concat());
    assert_eq!(status(&mesh(&["-o", "whole.ply"])), 0);
    assert_eq!(status(&tiles(&["--tiles=10%"])), 0);
    let many = names(&at("tiles")).len();
    fs::write(at("tiles/notes.txt"), "mine").unwrap();
    let output = tiles(&["--tiles", "40%"]);
    assert_eq!(status(&output), 0, "{}", stderr(&output));
    let found: Vec<String> = names(&at("tiles")).into_iter().filter(|n| planish_io::is_tile_name(n)).collect();
    assert!(2 < found.len() && found.len() < many && at("tiles/notes.txt").exists(), "{found:?} of {many}");
    let whole = planish_io::read_mesh(at("whole.ply")).unwrap();
    let report: serde_json::Value = serde_json::from_slice(&fs::read(at("r.json")).unwrap()).unwrap();
    assert_eq!(report["quality"]["mesh.tiles"], found.len() - 1);
    let place = |p: &planish::DVec3| p.to_array().map(f64::to_bits);
    let mut places = std::collections::BTreeSet::new();
    let mut triangles = 0;
    for name in found.iter().filter(|n| n.ends_with(".ply")) {
        let tile = planish_io::read_mesh(at("tiles").join(name)).unwrap();
        triangles += tile.triangles.len();
        places.extend(tile.points.iter().map(place));
    }
    assert_eq!(triangles, whole.triangles.len());
    assert!(places.into_iter().eq(whole.points.iter().map(place).collect::<std::collections::BTreeSet<_>>()));
    fs::write(at("tiles/tile_7_7_7.ply"), "mine").unwrap();
    let output = tiles(&["--tiles", "40%"]);
    assert_eq!(status(&output), 2);
    assert!(error_line(&output).contains("tile_7_7_7.ply: is there already"), "{}", stderr(&output));
    assert_eq!(fs::read(at("tiles/tile_7_7_7.ply")).unwrap(), b"mine");
    let output = mesh(&["-o", "none", "--tiles", "1e-300"]);
    assert_eq!(status(&output), 2);
    assert!(error_line(&output).contains("more than 100000") && !at("none").exists(), "{}", stderr(&output));
}

#[test]
fn export_of_maps_removes_those_of_an_older_export_and_no_map_of_somebody_else() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    write_box(&at("box.ply"), 4);
    let output = planish(&["fit", "box.ply", "-q", "-o", "m.planish", "--patches", "6"], folder.path());
    assert_eq!(status(&output), 0, "{}", stderr(&output));
    let export = |more: &[&str]| planish(&[&["export", "m.planish", "-q", "-o", "maps"], more].concat(), folder.path());
    // An older export had more patches.
    fs::create_dir(at("maps")).unwrap();
    fs::write(at("maps/patch_0140.exr"), "old").unwrap();
    fs::write(at("maps/notes.txt"), "mine").unwrap();
    fs::write(at("maps/relief.json"), r#"{"planish_relief": 1, "patches": [{"file": "patch_0140.exr"}]}"#).unwrap();
    let output = export(&[]);
    assert_eq!(status(&output), 0, "{}", stderr(&output));
    let found = names(&at("maps"));
    assert_eq!(found.iter().filter(|n| n.ends_with(".exr")).count(), 6, "{found:?}");
    assert!(!at("maps/patch_0140.exr").exists() && at("maps/notes.txt").exists(), "{found:?}");
    // A map that no sidecar of this program names is somebody else's, and so is a sidecar without its mark.
    for (name, words) in
        [("patch_0003.exr", "patch_0003.exr: is there already"), ("relief.json", "relief.json: is there already")]
    {
        fs::remove_dir_all(at("maps")).unwrap();
        fs::create_dir(at("maps")).unwrap();
        fs::write(at("maps").join(name), r#"{"by": "planish? no, by hand"}"#).unwrap();
        let output = export(&[]);
        assert_eq!(status(&output), 2, "{name}: {}", stderr(&output));
        assert!(error_line(&output).contains(words), "{}", stderr(&output));
        assert_eq!(names(&at("maps")), [name]);
        assert_eq!(status(&export(&["--force"])), 0);
        assert_eq!(names(&at("maps")).len(), 7);
    }
    let output = export(&["--no-clobber"]);
    assert_eq!(status(&output), 2, "{}", stderr(&output));
    assert_eq!(status(&export(&[])), 0);
}
