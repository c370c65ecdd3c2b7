//! Options are checked before the work: each in its range, and against each other.

mod common;

use common::*;
use std::fs;
use std::time::{Duration, Instant};

#[test]
fn options_that_cannot_be_are_told_in_one_line_of_status_2_within_a_second() {
    let folder = tempfile::tempdir().unwrap();
    // Computing on it would take minutes.
    write_box(&folder.path().join("box.ply"), 24);
    for (args, words) in [
        ("run box.ply -o out --control 3x3", "2 whole numbers from 4 to 8193"),
        ("run box.ply -o out --control 1000000x1000000", "2 whole numbers from 4 to 8193"),
        ("run box.ply -o out --control 12", "2 whole numbers"),
        ("run box.ply -o out --control 2000x4", "lower it, or raise --max-side"),
        ("run box.ply -o out --tolerance -1", "a number above 0"),
        ("run box.ply -o out --tolerance 0", "a number above 0"),
        ("run box.ply -o out --tolerance nan", "a number above 0"),
        ("run box.ply -o out --tolerance 1e999mm", "a number above 0"),
        ("run box.ply -o out --tolerance 0.02 --control 8x8", "cannot be used with"),
        ("run box.ply -o out --per-curve 4", "give it with --network"),
        ("run box.ply -o out --min-side 1000 --max-side 10", "lower the first or raise the second"),
        ("run box.ply -o out --patches 100001", "from 0 to 100000"),
        ("run box.ply -o out --patches 5mm", "a whole number"),
        ("run box.ply -o out --density inf", "a number from"),
        ("run box.ply -o out --units furlong", "use one of mm, cm, m, in"),
        ("run box.ply -o out --memory 0", "a number above 0"),
        ("run box.ply -o out --threads 0", "--threads"),
        ("fit box.ply -o m.planish --per-curve 4,4", "give it with --network"),
        ("run box.ply -o out --smooth-curves 3", "give it with --network"),
        ("fit box.ply -o m.planish --network n.json --smooth-curves 3,4 --sharp-curves 4", "leave it out of one"),
        ("fit box.ply -o m.planish --network n.json --sharp-curves 1,two", "--sharp-curves"),
        ("fit box.ply -o m.planish --cells-per-span nan", "a number from"),
        ("layout box.ply -o n.json --sharp-angle-deg 181", "from 1 to 180"),
        ("decimate box.ply -o d.ply --ratio 0", "above 0 and up to 1"),
        ("decimate box.ply -o d.ply --ratio 1.5", "above 0 and up to 1"),
        ("decimate box.ply -o d.ply --tolerance 5ft", "a number above 0"),
        ("compare box.ply box.ply --tolerance -0.1", "a number above 0"),
        ("smooth box.ply -o s.ply --strength 11", "from 0 to 10"),
        ("mesh box.ply -o s.ply --voxel 0", "a number above 0"),
        ("demo --stations 0 -o demo", "from 1 to 160"),
        ("demo --no-such-option", "unexpected argument"),
        ("run", "required arguments were not provided"),
    ] {
        let since = Instant::now();
        let output = planish(&args.split_whitespace().collect::<Vec<_>>(), folder.path());
        assert_eq!(status(&output), 2, "{args}: {}", stderr(&output));
        let line = error_line(&output);
        assert!(line.contains(words) && line.contains(" - hint: ") && line.len() < 400, "{args}: {line}");
        assert!(since.elapsed() < Duration::from_secs(1), "{args}: {:?}", since.elapsed());
        assert_eq!(names(folder.path()), ["box.ply"], "{args}");
    }
}

#[test]
fn a_network_for_a_scan_is_refused_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let points: String = (0..400).map(|k| format!("{} {} {}\n", k % 20, k / 20, (k % 7) as f64 / 10.0)).collect();
    fs::write(folder.path().join("scan.xyz"), points).unwrap();
    let output = planish(&["run", "scan.xyz", "--network", "n.json", "-o", "out"], folder.path());
    assert_eq!(status(&output), 2, "{}", stderr(&output));
    assert!(error_line(&output).contains("the input is a scan"), "{}", stderr(&output));
    assert_eq!(names(folder.path()), ["scan.xyz"]);
}

#[test]
fn counts_for_each_curve_are_held_against_the_network_before_the_fit() {
    let folder = tempfile::tempdir().unwrap();
    write_box(&folder.path().join("box.ply"), 6);
    let layout = planish(&["layout", "box.ply", "-q", "-o", "n.json", "--patches", "6"], folder.path());
    assert_eq!(status(&layout), 0, "{}", stderr(&layout));
    let fit = |counts: &str| {
        let args = ["fit", "box.ply", "--network", "n.json", "-v", "-o", "m.planish", "--per-curve", counts];
        planish(&args, folder.path())
    };
    let output = fit("5,5,5");
    assert_eq!(status(&output), 2, "{}", stderr(&output));
    let told = stderr(&output);
    assert!(told.contains("--per-curve: has 3 numbers for the 12 curves") && !told.contains("surfaces"), "{told}");
    let output = fit(&["5"; 12].join(","));
    assert_eq!(status(&output), 0, "{}", stderr(&output));
}

#[test]
fn seams_of_single_curves_become_smooth_and_sharp_again_and_the_model_keeps_that() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    write_box(&path.join("box.ply"), 6);
    let run = |args: &str| planish(&args.split_whitespace().collect::<Vec<_>>(), path);
    let done = |args: &str| {
        let output = run(args);
        assert_eq!(status(&output), 0, "{args}: {}", stderr(&output));
    };
    let kinds = |model: &str| -> Vec<String> {
        done(&format!("export {model} -o kinds.json --force"));
        let network: serde_json::Value = serde_json::from_slice(&fs::read(path.join("kinds.json")).unwrap()).unwrap();
        let curves = network["curves"].as_array().unwrap();
        curves.iter().map(|curve| curve["kind"].as_str().unwrap().to_owned()).collect()
    };
    done("layout box.ply -q -o n.json --patches 6");
    done("fit box.ply --network n.json --smooth-curves 3,5 -q -o round.planish");
    let round = kinds("round.planish");
    assert!((0..12).all(|c| round[c] == if c == 3 || c == 5 { "rounded" } else { "feature" }), "{round:?}");
    done("fit round.planish --sharp-curves 5 -q -o again.planish");
    let again = kinds("again.planish");
    assert!((0..12).all(|c| again[c] == if c == 3 { "rounded" } else { "feature" }), "{again:?}");
    let none = run("fit round.planish --sharp-curves 12 -q -o m.planish");
    assert_eq!(status(&none), 2);
    assert!(error_line(&none).contains("has curve 12, and the network has 12 curves"), "{}", stderr(&none));
}

#[test]
fn a_missed_tolerance_and_a_missed_number_of_patches_name_the_limit_and_the_option_that_moves_it() {
    let folder = tempfile::tempdir().unwrap();
    // A wave that few control points cannot follow.
    let (n, mut text) = (12, String::new());
    let wave = |i: usize| (i as f64 * 1.9).sin() * 0.05;
    for j in 0..=n {
        for i in 0..=n {
            text += &format!("v {} {} {}\n", i as f64 / n as f64, j as f64 / n as f64, wave(i) * wave(j) * 20.0);
        }
    }
    for j in 0..n {
        for i in 0..n {
            let a = j * (n + 1) + i + 1;
            text += &format!("f {} {} {} {}\n", a, a + 1, a + n + 2, a + n + 1);
        }
    }
    fs::write(folder.path().join("wave.obj"), text).unwrap();
    // One patch: the whole sheet between its four corners.
    let corners = [[1, 0], [1, 1], [0, 1]].map(|[x, y]| {
        let z = wave(n * x) * wave(n * y) * 20.0;
        format!("[[step]]\nedit = \"add_corner\"\nat = [{x}, {y}, {z}]\n")
    });
    let script = format!("[[step]]\nedit = \"boundaries\"\n{}", corners.concat());
    fs::write(folder.path().join("one.toml"), script).unwrap();
    let drawn = planish(&["edit", "wave.obj", "one.toml", "-o", "one.planish", "--no-fit"], folder.path());
    assert_eq!(status(&drawn), 0, "{}", stderr(&drawn));
    let fit = |tolerance: &str, more: &[&str]| {
        let args = ["fit", "one.planish", "-o", "m.planish", "--force", "--tolerance", tolerance];
        planish(&[&args, more].concat(), folder.path())
    };
    let output = fit("1e-7", &[]);
    assert_eq!(status(&output), 1, "{}", stderr(&output));
    assert!(stderr(&output).contains("--cells-per-span 4: lower that, or raise --density"), "{}", stderr(&output));
    assert!(stdout(&output).contains("missed: "), "{}", stdout(&output));
    // One share of the diagonal and the lengths that it is (the box is 1 x 1 x 0.1): the same bytes.
    let bytes = |tolerance: &str| {
        let output = fit(tolerance, &["-q"]);
        assert!(status(&output) < 2, "{}", stderr(&output));
        fs::read(folder.path().join("m.planish")).unwrap().len()
    };
    assert_ne!(bytes("20%"), bytes("0.001%"));
    assert_eq!(bytes("0.02"), bytes("0.002cm"));
    write_box(&folder.path().join("box.ply"), 6);
    for (command, to) in [("fit", "b.planish"), ("layout", "b.json")] {
        let output = planish(&[command, "box.ply", "-o", to, "--patches", "1"], folder.path());
        assert_eq!(status(&output), 0, "{}", stderr(&output));
        let told = stderr(&output);
        assert!(told.contains("patches where 1 were asked for: 12 curves follow sharp edges"), "{command}: {told}");
        assert!(told.contains("a greater --sharp-angle-deg"), "{command}: {told}");
    }
}
