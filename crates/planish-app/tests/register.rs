//! Shapes compared and moved: sides, tolerances, columns, best fits, and every format on its way through `transform`.

mod common;

use common::*;
use std::fs;
use std::path::Path;

fn report(folder: &Path, name: &str) -> serde_json::Value {
    serde_json::from_slice(&fs::read(folder.join(name)).unwrap()).unwrap()
}

/// Points of a ball of 30, of another size, moved along x.
fn write_ball(path: &Path, size: f64, x: f64) {
    let ball = |k: usize| {
        let (z, a) = (1.0 - 2.0 * (k as f64 + 0.5) / 4000.0, 2.4 * k as f64);
        let r = (1.0f64 - z * z).sqrt();
        format!("{} {} {}\n", 30.0 * size * r * a.cos() + x, 30.0 * size * r * a.sin(), 30.0 * size * z)
    };
    fs::write(path, (0..4000).map(ball).collect::<String>()).unwrap();
}

#[test]
fn a_scan_against_a_mesh_has_sides_a_share_within_the_tolerance_a_column_and_a_picture() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    write_box(&path.join("box.ply"), 4);
    // Points 0.1 above the top face, one of them 0.3.
    let mut text: String =
        (0..400).map(|k| format!("{} {} 1.1\n", (k % 20) as f64 / 20.0, (k / 20) as f64 / 20.0)).collect();
    text += "0.5 0.5 1.3\n";
    fs::write(path.join("top.xyz"), text).unwrap();
    let compare =
        |more: &[&str]| planish(&[&["compare", "top.xyz", "box.ply", "--report", "c.json"], more].concat(), path);
    let output = compare(&["-o", "dist.ply", "--picture", "dist.png"]);
    assert_eq!(status(&output), 0, "{}", stderr(&output));
    let outside = stdout(&output).lines().find(|l| l.starts_with("a outside of b")).unwrap_or_default().to_owned();
    assert!(outside.contains("mean 0.100 mm") && outside.contains("to 0.300"), "{outside}");
    let found = report(path, "c.json");
    let number = |key: &str| found["quality"][key].as_f64().unwrap();
    assert!((number("signed.min") - 0.1).abs() < 1e-9 && (number("distance.max") - 0.3).abs() < 1e-9);
    let shares: f64 = found["histogram"]["shares"].as_array().unwrap().iter().map(|s| s.as_f64().unwrap()).sum();
    assert!((shares - 1.0).abs() < 1e-9);
    let ply = fs::read(path.join("dist.ply")).unwrap();
    let head = String::from_utf8_lossy(&ply[..400]).into_owned();
    assert!(head.contains("distance") && head.contains("red") && head.contains("element vertex 401"), "{head}");
    assert!(fs::read(path.join("dist.png")).unwrap().starts_with(b"\x89PNG"));
    assert_eq!(status(&compare(&["--tolerance", "0.11"])), 1);
    assert_eq!(status(&compare(&["--tolerance", "0.11", "--within", "99%"])), 0);
    assert_eq!(status(&compare(&["--tolerance", "0.31"])), 0);
    assert_eq!(status(&compare(&["--within", "99"])), 2);
    // The other way about: the points of the scan count, and A lies inside.
    ok(&["compare", "box.ply", "top.xyz", "-q", "--report", "d.json"], path);
    let found = report(path, "d.json");
    assert!((found["quality"]["signed.max"].as_f64().unwrap() + 0.1).abs() < 1e-9, "{found}");
    assert!((found["quality"]["distance.max"].as_f64().unwrap() - 0.3).abs() < 1e-9);
}

#[test]
fn two_scans_and_a_scan_of_another_unit_are_compared_and_fitted() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    write_ball(&path.join("a.xyz"), 1.0, 0.0);
    write_ball(&path.join("b.xyz"), 1.02, 5.0);
    let before = report_of(path, &["compare", "a.xyz", "b.xyz"]);
    assert!(
        before["quality"]["distance.max"].as_f64().unwrap() > 4.0 && before["quality"].get("signed.mean").is_none()
    );
    let after = report_of(path, &["compare", "a.xyz", "b.xyz", "--align"]);
    let p95 = after["quality"]["distance.p95"].as_f64().unwrap();
    assert!((0.5..0.7).contains(&p95), "{p95}");
    assert!((after["quality"]["align.matrix_14"].as_f64().unwrap() - 5.0).abs() < 0.05, "{after}");
    // The same scan in metres.
    ok(&["transform", "a.xyz", "--move", "0,0,0", "-q", "-o", "a.e57"], path);
    let same = report_of(path, &["compare", "a.e57", "a.xyz"]);
    assert!(same["quality"]["distance.max"].as_f64().unwrap() < 1e-8, "{same}");
}

fn report_of(folder: &Path, args: &[&str]) -> serde_json::Value {
    ok(&[args, &["-q", "--report", "r.json"]].concat(), folder);
    report(folder, "r.json")
}

#[test]
fn steps_are_done_in_their_order_and_undone_by_their_opposites_in_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    write_box(&path.join("box.ply"), 4);
    let there = ["--move", "1,2,3", "--turn", "z,90", "--scale", "2", "--mirror", "x", "--up", "z-to-y"];
    let back = ["--up", "y-to-z", "--mirror", "x", "--scale", "0.5", "--turn", "z,-90", "--move", "-1,-2,-3"];
    for name in ["a.ply", "a.obj", "a.stl"] {
        ok(&[&["transform", "box.ply", "-q", "-o", name][..], &there].concat(), path);
        ok(&[&["transform", name, "-q", "-o", "b.ply"][..], &back].concat(), path);
        let found = report_of(path, &["compare", "box.ply", "b.ply"]);
        assert!(found["quality"]["distance.max"].as_f64().unwrap() < 1e-6, "{name}: {found}");
        assert_eq!(found["quality"]["normal.flipped_share"], 0.0, "{name}");
    }
    // GLB is in metres.
    ok(&["transform", "box.ply", "-q", "--turn", "y,30", "-o", "a.glb"], path);
    ok(&["transform", "a.glb", "-q", "--turn", "y,-30", "-o", "b.glb"], path);
    assert_eq!(status(&planish(&["compare", "box.ply", "b.glb", "--tolerance", "1e-6mm"], path)), 0);
    // The corner (0, 0, 0) of the box goes to (1, 2, 3), (-2, 1, 3), (-4, 2, 6), (4, 2, 6), and with z up turned to y to (4, 6, -2).
    fs::write(path.join("o.xyz"), "0 0 0\n1 0 0\n0 1 0\n0 0 1\n").unwrap();
    ok(&[&["transform", "o.xyz", "-q", "-o", "p.xyz"][..], &there].concat(), path);
    let text = fs::read_to_string(path.join("p.xyz")).unwrap();
    let first = text.lines().find(|l| l.starts_with(|c: char| c.is_ascii_digit() || c == '-')).unwrap();
    assert_eq!(first.split_whitespace().take(3).collect::<Vec<_>>(), ["4", "6", "-2"], "{text}");
    write_ball(&path.join("a.xyz"), 1.0, 0.0);
    for name in ["s.ply", "s.xyz", "s.las", "s.laz", "s.e57"] {
        ok(&["transform", "a.xyz", "--units", "m", "--turn", "1,1,1,120", "--about", "center", "-q", "-o", name], path);
        ok(&["transform", name, "--units", "m", "--turn", "1,1,1,-120", "-q", "-o", "t.xyz"], path);
        let found = report_of(path, &["compare", "a.xyz", "t.xyz", "--units", "m"]);
        let limit = if name.contains(".la") { 1e-2 } else { 1e-6 };
        assert!(found["quality"]["distance.max"].as_f64().unwrap() < limit, "{name}: {found}");
    }
}

#[test]
fn crops_cut_meshes_and_scans_pairs_bring_points_home_and_far_places_keep_their_digits() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    write_box(&path.join("box.ply"), 4);
    ok(&["transform", "box.ply", "--crop-box", "-1,-1,-1,2,2,0.3", "-q", "-o", "cut.ply"], path);
    let info = report_of(path, &["info", "cut.ply"]);
    assert!((info["quality"]["mesh.area"].as_f64().unwrap() - 2.2).abs() < 1e-6, "{info}");
    write_ball(&path.join("a.xyz"), 1.0, 0.0);
    ok(&["transform", "a.xyz", "--crop-plane", "0,0,1,0", "-q", "-o", "half.xyz"], path);
    assert_eq!(report_of(path, &["info", "half.xyz"])["quality"]["scan.points"], 2000);
    // To the coordinates of a map and back, by pairs.
    fs::write(
        path.join("pairs.csv"),
        "# now, then\n0,0,0,500000,4000000,10\n1,0,0,500000,4000001,10\n0;1;0;499999;4000000;10\n",
    )
    .unwrap();
    ok(&["transform", "box.ply", "--pairs", "pairs.csv", "-q", "-o", "far.ply"], path);
    ok(&["transform", "far.ply", "--move", "-500000,-4000000,-10", "--turn", "z,-90", "-q", "-o", "near.ply"], path);
    assert_eq!(status(&planish(&["compare", "box.ply", "near.ply", "--tolerance", "1e-8"], path)), 0);
    ok(
        &["transform", "near.ply", "--turn", "x,3", "--move", "0.02,0,0", "--align", "box.ply", "-q", "-o", "fit.ply"],
        path,
    );
    assert_eq!(status(&planish(&["compare", "box.ply", "fit.ply", "--tolerance", "1e-6"], path)), 0);
}

#[test]
fn what_cannot_be_moved_or_compared_is_told_in_a_line() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    write_box(&path.join("box.ply"), 2);
    write_ball(&path.join("a.xyz"), 1.0, 0.0);
    fs::write(path.join("bad.csv"), "1,2,3\n").unwrap();
    fs::write(path.join("line.csv"), "0,0,0,0,0,0\n1,1,1,1,1,1\n2,2,2,2,2,2\n").unwrap();
    for (args, wanted, words) in [
        ("transform box.ply -o b.ply", 2, "no step is given"),
        ("transform box.ply -o b.xyz --move 1,0,0", 2, ".ply"),
        ("transform a.xyz -o b.stl --move 1,0,0", 2, ".ply"),
        ("transform box.ply -o box.ply --move 1,0,0", 2, "is an input"),
        ("transform box.ply -o b.ply --move 1,0", 2, "three numbers"),
        ("transform box.ply -o b.ply --crop-plane 1,0,0,5", 2, "nothing on that side"),
        ("transform box.ply -o b.ply --pairs bad.csv", 3, "six numbers (line 1)"),
        ("transform box.ply -o b.ply --pairs line.csv", 3, "lie on a line"),
        ("transform box.ply -o b.ply --align missing.ply", 3, "missing.ply"),
        ("compare a.xyz box.ply -o d.stl", 2, "use .ply"),
        ("compare a.xyz box.ply -o a.ply --picture p.jpg", 2, "use .png"),
        ("compare a.xyz box.ply -o a.ply --report a.ply", 2, "two outputs"),
        ("compare a.xyz box.ply --tolerance 1 --within 0", 2, "above 0"),
    ] {
        let output = planish(&args.split_whitespace().collect::<Vec<_>>(), path);
        let line = error_line(&output);
        assert_eq!(status(&output), wanted, "{args}: {line}");
        assert!(line.contains(words), "{args}: {line}");
    }
    assert_eq!(names(path), ["a.xyz", "bad.csv", "box.ply", "line.csv"]);
}
