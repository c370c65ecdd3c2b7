//! `planish mesh`, `smooth` and `decimate` as a user meets them.

mod common;

use common::planish;
use std::fs;
use std::path::Path;

const PART: &str = "units = \"mm\"\n[solid.block]\nbox = { size = [4, 3, 2] }\n[solid.bore]\ncylinder = { radius = 0.8, height = 3 }\n[solid.part]\ndifference = [\"block\", \"bore\"]\n";
const JOB: &str = "[stock]\nfrom = [0, 0, -2]\nto = [6, 4, 0]\n[[tool]]\nname = \"flat\"\nkind = \"flat\"\ndiameter = 1\n[[path]]\ntool = \"flat\"\ngcode = \"cut.nc\"\n";

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn done(args: &[&str], folder: &Path) -> String {
    let output = planish(args, folder);
    assert_eq!(output.status.code(), Some(0), "{args:?}: {}", text(&output.stderr));
    text(&output.stdout)
}

/// The one error line of a command that must fail with status 3 and leave `out.ply` unwritten.
fn refused(args: &[&str], folder: &Path) -> String {
    let output = planish(args, folder);
    assert_eq!(output.status.code(), Some(3), "{args:?}: {}", text(&output.stderr));
    let line = text(&output.stderr);
    assert!(line.starts_with("error: ") && line.lines().count() == 1, "{line}");
    assert!(line.contains(" - hint: "), "{line}");
    assert!(!folder.join("out.ply").exists(), "{args:?} left something");
    line
}

fn number(report: &Path, key: &str) -> f64 {
    let report: serde_json::Value = serde_json::from_str(&fs::read_to_string(report).unwrap()).unwrap();
    report["quality"][key].as_f64().unwrap_or_else(|| panic!("{key} in {report}"))
}

#[test]
fn a_part_is_meshed_decimated_and_smoothed_and_stays_closed_with_its_genus() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("part.toml"), PART).unwrap();
    let said =
        done(&["mesh", "part.toml", "-o", "part.ply", "--resolution", "32", "--report", "r.json"], folder.path());
    assert!(said.contains("watertight, manifold"), "{said}");
    assert_eq!(number(&at("r.json"), "mesh.genus"), 1.0);
    let volume = 24.0 - std::f64::consts::PI * 0.64 * 2.0;
    assert!((number(&at("r.json"), "mesh.volume") / volume - 1.0).abs() < 3e-3);
    assert!(number(&at("r.json"), "mesh.feature_edges") > 100.0);
    for (command, option, value, out) in
        [("decimate", "--ratio", "0.2", "less.ply"), ("smooth", "--noise", "0.01", "even.ply")]
    {
        done(&[command, "part.ply", option, value, "-o", out, "--report", "s.json"], folder.path());
        let facts = text(&planish(&["info", out], folder.path()).stdout);
        assert!(facts.contains("watertight"), "{facts}");
    }
    assert!(fs::metadata(at("less.ply")).unwrap().len() * 3 < fs::metadata(at("part.ply")).unwrap().len());
}

#[test]
fn the_same_part_has_the_same_bytes_on_1_and_2_threads() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("part.toml"), PART).unwrap();
    for threads in ["1", "2"] {
        let out = format!("{threads}.ply");
        done(&["mesh", "part.toml", "-o", &out, "--resolution", "30", "--threads", threads, "-q"], folder.path());
    }
    assert!(fs::read(folder.path().join("1.ply")).unwrap() == fs::read(folder.path().join("2.ply")).unwrap());
}

#[test]
fn a_milling_job_reads_its_gcode_and_refuses_what_it_does_not_understand_with_its_line() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("job.toml"), JOB).unwrap();
    fs::write(at("cut.nc"), "G21 G90\nG0 X1 Y2 Z1\nG1 Z-1 F100\nG1 X5\nM5\n").unwrap();
    done(&["mesh", "job.toml", "-o", "slot.ply", "--resolution", "60", "--report", "r.json"], folder.path());
    let slot = 4.0 * 1.0 + std::f64::consts::PI * 0.25;
    let left = number(&at("r.json"), "mesh.volume");
    assert!((left - (48.0 - slot)).abs() < 0.02 * slot, "{left}");
    fs::write(at("cut.nc"), "G21 G90\nG0 X1 Y2 Z1\nG2 X5 Y2 I2 J0\n").unwrap();
    let line = refused(&["mesh", "job.toml", "-o", "out.ply"], folder.path());
    assert!(line.contains("cut.nc") && line.contains('3') && line.contains("G2"), "{line}");
}

#[test]
fn faulty_scripts_volumes_and_sizes_are_status_3_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    write("part.toml", PART);
    write("key.toml", &PART.replace("height = 3", "heigth = 3"));
    write("name.toml", &PART.replace("\"bore\"]", "\"hole\"]"));
    write("units.toml", &PART.replace("mm", "furlong"));
    write("empty.toml", "[solid.a]\nsphere = { radius = 1 }\n[solid.b]\ndifference = [\"a\", \"a\"]\n");
    write("short.nrrd", "NRRD0004\ntype: float\ndimension: 3\nsizes: 9 9 9\nencoding: raw\nendian: little\n\nabcd");
    for (name, word) in [("key.toml", "heigth"), ("name.toml", "hole"), ("units.toml", "furlong"), ("empty.toml", "")] {
        let line = refused(&["mesh", name, "-o", "out.ply", "--resolution", "20"], folder.path());
        assert!(line.starts_with(&format!("error: {name}: ")) && line.contains(word), "{line}");
    }
    refused(&["mesh", "short.nrrd", "-o", "out.ply"], folder.path());
    let line = refused(&["mesh", "part.toml", "-o", "out.ply", "--voxel", "0.0001", "--memory", "0.5"], folder.path());
    assert!(line.contains("MB") && line.contains("larger voxel"), "{line}");
}

#[test]
fn volumes_without_a_surface_tell_their_range_and_options_that_mean_nothing_for_them_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut volume = b"NRRD0004\ntype: uchar\ndimension: 3\nsizes: 5 5 5\nencoding: raw\n\n".to_vec();
    volume.extend((0..125u8).map(|n| if n == 62 { 200 } else { 7 }));
    fs::write(folder.path().join("dot.nrrd"), volume).unwrap();
    let line = refused(&["mesh", "dot.nrrd", "-o", "out.ply"], folder.path());
    assert!(line.contains("from 7 to 200") && line.contains("hint: choose a level"), "{line}");
    done(&["mesh", "dot.nrrd", "-o", "dot.ply", "--iso", "100", "--body", "above", "-q"], folder.path());
    for option in [["--voxel", "0.1"], ["--resolution", "20"]] {
        let output = planish(&[&["mesh", "dot.nrrd", "-o", "no.ply"], option.as_slice()].concat(), folder.path());
        let told = text(&output.stderr);
        assert!(output.status.code() == Some(2) && told.contains(option[0]), "{told}");
    }
    fs::write(folder.path().join("head.nhdr"), "NRRD0004\n").unwrap();
    let line = refused(&["mesh", "head.nhdr", "-o", "no.ply"], folder.path());
    assert!(line.contains("nhdr") && line.contains(".nrrd") && line.contains(".toml"), "{line}");
    assert!(!folder.path().join("no.ply").exists());
}

#[test]
fn a_decimation_that_cannot_go_as_far_as_asked_is_told_and_targets_that_are_none_are_wrong_usage() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("box.toml"), "[solid.a]\nbox = { size = [3, 2, 1] }\n").unwrap();
    done(&["mesh", "box.toml", "-o", "box.ply", "--resolution", "12", "-q"], folder.path());
    let output = planish(&["decimate", "box.ply", "--triangles", "6", "-o", "few.ply"], folder.path());
    let told = text(&output.stderr);
    assert!(output.status.code() == Some(0) && told.contains("12 triangles are left where 6 were wanted"), "{told}");
    let output = planish(&["decimate", "box.ply", "--ratio", "0", "-o", "none.ply"], folder.path());
    assert_eq!(output.status.code(), Some(2));
    assert!(!folder.path().join("none.ply").exists());
}

#[test]
fn a_fin_thinner_than_the_voxel_is_kept_and_two_in_one_cell_are_told_with_the_voxel_that_they_need() {
    let folder = tempfile::tempdir().unwrap();
    let block = "[solid.block]\nbox = { size = [4, 4, 4] }\n[solid.fin]\nbox = { size = [10, 4, 0.03] }\n";
    let other = "[solid.other]\nbox = { size = [10, 4, 0.03] }\nmove = [0, 0, 0.06]\n";
    let told = |name: &str, part: String| {
        fs::write(folder.path().join("fin.toml"), part).unwrap();
        let made = format!("{name}.ply");
        done(&["mesh", "fin.toml", "-o", &made, "--voxel", "0.012", "-q", "--memory", "4"], folder.path());
        let output = planish(&["mesh", &made, "-o", "out.ply", "--voxel", "0.2", "--force"], folder.path());
        assert_eq!(output.status.code(), Some(0));
        let mesh = planish_io::read_mesh(folder.path().join("out.ply")).unwrap();
        (text(&output.stderr), mesh.bounds().size().x, planish::mesh::diagnose(&mesh).components)
    };
    let (warned, length, pieces) = told("fin", format!("{block}[solid.part]\nunion = [\"block\", \"fin\"]\n"));
    assert!(!warned.contains("too thin") && (length - 10.0).abs() < 0.1 && pieces == 1, "{length} {pieces}: {warned}");
    let (warned, ..) = told("fins", format!("{block}{other}[solid.part]\nunion = [\"block\", \"fin\", \"other\"]\n"));
    assert!(warned.contains("too thin for the voxel") && warned.contains("0.03"), "{warned}");
}

/// A dome, scanned: the unit sphere above z = -.2 without a spot of .07 around, which is small enough to be closed.
fn dome() -> String {
    let n = 60_000;
    let mut text = String::new();
    for i in 0..n {
        // Fibonacci points, uneven by a five-hundredth.
        let z = 2.0 * (i as f64 + 0.5) / n as f64 - 1.0;
        let (turn, r) = (i as f64 * std::f64::consts::PI * (3.0 - 5f64.sqrt()), (1.0 - z * z).sqrt());
        let (x, y) = (r * turn.cos(), r * turn.sin());
        if z >= -0.2 && 0.8 * x + 0.6 * z <= 0.07f64.cos() {
            let s = 1.0 + 0.002 * (12.9898 * i as f64 + 78.233 * z).sin();
            text += &format!("{:.6} {:.6} {:.6}\n", s * x, s * y, s * z);
        }
    }
    text
}

#[test]
fn a_scanned_dome_with_a_hole_has_one_boundary_as_it_is_two_open_and_a_lid_over_all_closed() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("dome.xyz"), dome()).unwrap();
    let made = |options: &[&str]| {
        let command = ["mesh", "dome.xyz", "-o", "dome.ply", "-q", "--report", "r.json"];
        done(&[&command, options].concat(), folder.path());
        let report: serde_json::Value =
            serde_json::from_str(&fs::read_to_string(folder.path().join("r.json")).unwrap()).unwrap();
        let closed = report["quality"]["scan.closed"].as_bool().unwrap();
        let area = report["quality"]["mesh.area"].as_f64().unwrap();
        done(&["info", "dome.ply", "--report", "r.json"], folder.path());
        (closed, number(&folder.path().join("r.json"), "mesh.boundary_loops"), area)
    };
    let [plain, open, close] = [&[][..], &["--open"], &["--close"]].map(made);
    assert_eq!((plain.0, plain.1), (false, 1.0));
    assert_eq!((open.0, open.1), (false, 2.0));
    // The sphere above z = -.2 has an area of 2.4 pi; a lid over its rim is 1.2 pi at most.
    let dome = 2.4 * std::f64::consts::PI;
    assert!(close.0 && (1.1..1.5).contains(&(close.2 / dome)), "{close:?}");
    assert!(plain.2 < 1.05 * dome && open.2 < plain.2, "{plain:?} {open:?}");
}

#[test]
fn holes_are_a_matter_of_scans_and_the_border_of_a_volume_has_an_option_of_its_own() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("part.toml"), PART).unwrap();
    for option in ["--open", "--close"] {
        let output = planish(&["mesh", "part.toml", option, "-o", "no.ply"], folder.path());
        let told = text(&output.stderr);
        assert!(output.status.code() == Some(2) && told.starts_with(&format!("error: {option}: ")), "{told}");
        assert!(told.contains(" - hint: ") && !folder.path().join("no.ply").exists(), "{told}");
    }
    // Half of a ball: the border of the volume cuts it.
    let mut volume = b"NRRD0004\ntype: uchar\ndimension: 3\nsizes: 9 9 5\nencoding: raw\n\n".to_vec();
    let far = |i: usize| [i % 9, i / 9 % 9, i / 81].iter().zip([4, 4, 0]).map(|(&a, b)| a.abs_diff(b).pow(2)).sum();
    volume.extend((0..405).map(|i| (60 * usize::min(far(i), 16) / 16) as u8));
    fs::write(folder.path().join("half.nrrd"), volume).unwrap();
    for (value, watertight) in [("--volume-close", true), ("--volume-close=false", false)] {
        // The option does not take the input for its value.
        done(&["mesh", value, "half.nrrd", "--iso", "30", "-o", "half.ply", "--report", "r.json"], folder.path());
        let report: serde_json::Value =
            serde_json::from_str(&fs::read_to_string(folder.path().join("r.json")).unwrap()).unwrap();
        assert_eq!(report["quality"]["mesh.watertight"], watertight, "{value}");
    }
}

/// 6 000 points spread evenly over a ball of radius 1, as text.
fn ball_of_points() -> String {
    let place = |n: usize| {
        let (z, turn) = (1.0 - (2 * n + 1) as f64 / 6000.0, 2.399963229728653 * n as f64);
        let r = (1.0 - z * z).sqrt();
        format!("{} {} {z}\n", r * turn.cos(), r * turn.sin())
    };
    (0..6000).map(place).collect()
}

#[test]
fn cells_and_cleaning_of_a_scan_can_be_set_in_run_and_mesh_and_are_refused_for_a_mesh() {
    let folder = tempfile::tempdir().unwrap();
    let report = folder.path().join("r.json");
    fs::write(folder.path().join("ball.xyz"), ball_of_points()).unwrap();
    let triangles = |options: &[&str]| {
        done(&[&["mesh", "ball.xyz", "-o", "ball.ply", "--report", "r.json", "-q"], options].concat(), folder.path());
        number(&report, "mesh.triangles")
    };
    let (fine, coarse) = (triangles(&["--voxel", "0.1"]), triangles(&["--voxel", "0.2", "--outlier", "6"]));
    assert!(fine > 2.5 * coarse, "{fine} and {coarse} triangles");
    done(&["run", "ball.xyz", "-o", "out", "--voxel", "0.2", "--report", "r.json", "-q"], folder.path());
    assert_eq!(number(&report, "mesh.triangles"), coarse);
    for option in [["--voxel", "0.2"], ["--outlier", "6"], ["--spacing", "0.1"]] {
        let output = planish(&[&["run", "ball.ply", "-o", "no"], option.as_slice()].concat(), folder.path());
        let told = text(&output.stderr);
        assert!(output.status.code() == Some(2) && told.contains(option[0]), "{told}");
    }
    for wrong in [["--voxel", "0"], ["--resolution", "0"], ["--outlier", "1"]] {
        let output = planish(&[&["run", "ball.xyz", "-o", "no"], wrong.as_slice()].concat(), folder.path());
        assert_eq!(output.status.code(), Some(2), "{wrong:?}");
    }
    assert!(!folder.path().join("no").exists());
}
