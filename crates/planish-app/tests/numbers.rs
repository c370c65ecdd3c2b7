//! No number is silently wrong: places, units and figures.

mod common;

use common::*;
use std::fs;
use std::path::Path;

/// Where the far inputs are: whole numbers, as in a map.
const FAR: [f64; 3] = [515_380.0, 4_918_360.0, 2_330.0];

/// The box of the tests, its edge `size` long, moved to where maps are.
fn write_far(folder: &Path, name: &str, size: f64) {
    write_box(&folder.join("near.ply"), 8);
    let text = fs::read_to_string(folder.join("near.ply")).unwrap();
    let moved = |line: &str| {
        let numbers: Vec<f64> = line.split(' ').filter_map(|w| w.parse().ok()).collect();
        let [x, y, z] = [0, 1, 2].map(|k| numbers[k] * size + FAR[k]);
        format!("{x} {y} {z}")
    };
    let (head, body) = text.split_once("end_header\n").unwrap();
    let lines: Vec<String> =
        body.lines().map(|l| if l.split(' ').count() == 3 { moved(l) } else { l.to_owned() }).collect();
    fs::write(folder.join(name), format!("{head}end_header\n{}\n", lines.join("\n"))).unwrap();
}

fn done(args: &[&str], folder: &Path) -> (String, String) {
    let output = planish(args, folder);
    assert_eq!(status(&output), 0, "{args:?}: {}", stderr(&output));
    (stdout(&output), stderr(&output))
}

fn report(folder: &Path, name: &str) -> serde_json::Value {
    serde_json::from_slice(&fs::read(folder.join(name)).unwrap()).unwrap()
}

#[test]
fn a_mesh_with_the_coordinates_of_a_map_stays_whole_in_every_format_and_comes_back_to_its_place() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    write_far(path, "far.ply", 1.7);
    for name in ["a.stl", "a.glb", "a.ply", "a.obj"] {
        let (_, told) = done(&["decimate", "far.ply", "--ratio", "0.9", "-o", name], path);
        let near = name == "a.stl" || name == "a.glb";
        assert_eq!(told.contains("Add 515381 4918361 2331 to be back in place"), near, "{name}: {told}");
        done(&["info", name, "-q", "--report", "info.json"], path);
        let found = report(path, "info.json");
        assert_eq!(found["quality"]["mesh.components"], 1, "{name}");
        assert_eq!(found["quality"]["mesh.watertight"], true, "{name}");
    }
    done(&["compare", "far.ply", "a.obj", "-q", "--tolerance", "1e-6", "--report", "c.json"], path);
    // Everything that `run` makes is in its place, but for the preview.
    let (_, told) = done(&["run", "far.ply", "-o", "out", "--patches", "6"], path);
    assert!(told.contains("preview.glb lies near the origin"), "{told}");
    let step = fs::read_to_string(path.join("out/surface.step")).unwrap();
    assert!(step.contains("(515380.,4918360.,2330.)"), "{}", &step[..2000]);
    for other in ["out/mesh.ply", "out/model.planish"] {
        done(&["compare", "far.ply", other, "-q", "--tolerance", "1e-6"], path);
    }
    let (_, told) = done(&["export", "out/model.planish", "-o", "m.stl"], path);
    assert!(told.contains("near the origin"), "{told}");
    done(&["export", "out/model.planish", "-q", "-o", "m.ply"], path);
    done(&["compare", "far.ply", "m.ply", "-q", "--tolerance", "1e-6"], path);
}

#[test]
fn missing_digits_of_an_input_are_told() {
    let folder = tempfile::tempdir().unwrap();
    // Steps of half a metre: all that single precision has there.
    write_far(folder.path(), "coarse.ply", 8.0);
    let (_, told) = done(&["smooth", "coarse.ply", "-o", "s.ply"], folder.path());
    assert!(told.contains("come in steps of 0.500 mm, 3.61 % of the diagonal"), "{told}");
    write_far(folder.path(), "fine.ply", 1.7);
    let (_, told) = done(&["smooth", "fine.ply", "-o", "s.ply"], folder.path());
    assert!(!told.contains("steps"), "{told}");
}

#[test]
fn gltf_and_e57_are_in_metres_and_compared_in_the_units_of_the_first() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    write_box(&path.join("box.ply"), 4);
    done(&["decimate", "box.ply", "--ratio", "1", "-q", "-o", "box.glb"], path);
    let (table, _) = done(&["info", "box.glb"], path);
    assert!(table.contains("0.00173 m"), "{table}");
    // The GLB is a thousandth in numbers, and the same in truth.
    done(&["compare", "box.ply", "box.glb", "-q", "--tolerance", "1e-6mm", "--report", "c.json"], path);
    assert_eq!(report(path, "c.json")["input"]["units"], "mm");
    done(&["compare", "box.glb", "box.ply", "-q", "--tolerance", "1e-6mm"], path);
    let ball = |k: usize| {
        let (z, a) = (1.0 - 2.0 * (k as f64 + 0.5) / 3000.0, 2.4 * k as f64);
        let r = (1.0f64 - z * z).sqrt();
        format!("{} {} {}\n", 30.0 * r * a.cos(), 30.0 * r * a.sin(), 30.0 * z)
    };
    fs::write(path.join("a.xyz"), (0..3000).map(ball).collect::<String>()).unwrap();
    done(&["clean", "a.xyz", "-q", "-o", "a.e57"], path);
    let (table, _) = done(&["info", "a.e57"], path);
    assert!(table.contains(" m\n") && table.contains("0.104 m"), "{table}");
    // LAS does not say: the guess is told, and so is that of a part of less than a millimetre.
    done(&["clean", "a.xyz", "-q", "-o", "a.las"], path);
    let (_, told) = done(&["clean", "a.las", "-o", "b.xyz"], path);
    assert!(told.contains("does not tell its unit; m is taken"), "{told}");
    let small = fs::read_to_string(path.join("a.xyz")).unwrap();
    let small: String = small
        .lines()
        .map(|l| l.split(' ').map(|w| format!("{} ", w.parse::<f64>().unwrap() / 1e3)).collect::<String>() + "\n")
        .collect();
    fs::write(path.join("small.xyz"), small).unwrap();
    let (_, told) = done(&["clean", "small.xyz", "-o", "b.xyz"], path);
    assert!(told.contains("makes it 0.104 mm across. If it is in metres, say --units m"), "{told}");
    let (_, told) = done(&["clean", "small.xyz", "--units", "m", "-o", "b.xyz"], path);
    assert!(!told.contains("unit"), "{told}");
}

#[test]
fn the_noise_of_a_scan_is_one_figure_in_clean_mesh_and_run() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let ball = |k: usize| {
        let (z, a) = (1.0 - 2.0 * (k as f64 + 0.5) / 6000.0, 2.4 * k as f64);
        let r = (1.0f64 - z * z).sqrt();
        let noise = 30.0 * (1.0 + 0.004 * ((k * 7919 % 1009) as f64 / 1009.0 - 0.5));
        format!("{} {} {}\n", noise * r * a.cos(), noise * r * a.sin(), noise * z)
    };
    // One point far off: whoever counts it in has another diagonal.
    let text: String = (0..6000).map(ball).collect::<String>() + "150 0 0\n";
    fs::write(path.join("a.xyz"), text).unwrap();
    let row = |table: &str| {
        table.lines().find(|l| l.starts_with("noise ")).unwrap().split_once("  ").unwrap().1.trim().to_owned()
    };
    let (clean, _) = done(&["clean", "a.xyz", "-o", "c.ply", "--report", "c.json"], path);
    let (mesh, _) = done(&["mesh", "a.xyz", "-o", "m.ply", "--report", "m.json"], path);
    let (run, _) = done(&["run", "a.xyz", "-o", "out", "--patches", "24"], path);
    assert_eq!(row(&clean), row(&mesh));
    assert_eq!(row(&clean), row(&run));
    for key in ["scan.noise", "scan.noise_rel", "scan.spacing_rel"] {
        let of = |name: &str| report(path, name)["quality"][key].as_f64().unwrap();
        assert_eq!([of("c.json"), of("m.json")], [of("out/report.json"); 2], "{key}");
    }
    let page = fs::read_to_string(path.join("out/report.html")).unwrap();
    assert!(page.contains("Deviation, RMS") && !page.contains("Mean deviation") && !page.contains("on average"));
}

#[test]
fn a_wild_point_and_invalid_returns_at_the_origin_are_left_out_and_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let ball = |k: usize, far: [f64; 2]| {
        let (z, a) = (1.0 - 2.0 * (k as f64 + 0.5) / 2000.0, 2.4 * k as f64);
        let r = (1.0f64 - z * z).sqrt();
        format!("{} {} {z}\n", r * a.cos() + far[0], r * a.sin() + far[1])
    };
    let near: String = (0..2000).map(|k| ball(k, [0.0; 2])).collect();
    let far: String = (0..2000).map(|k| ball(k, [FAR[0], FAR[1]])).collect();
    fs::write(path.join("wild.xyz"), near + "1e12 0 0\n").unwrap();
    fs::write(path.join("invalid.xyz"), far + &"0 0 0\n".repeat(200)).unwrap();
    for (name, count) in [("wild.xyz", 1), ("invalid.xyz", 200)] {
        let (table, told) = done(&["mesh", name, "-o", "m.ply", "--report", "r.json"], path);
        assert!(told.contains(&format!("{count} points lie more than a hundred times further off")), "{told}");
        assert!(table.contains("watertight, manifold"), "{table}");
        let size = report(path, "r.json")["input"]["diagonal"].as_f64().unwrap();
        assert!(size < 4.0, "{name}: {size}");
        // `info` tells of all points.
        done(&["info", name, "-q", "--report", "i.json"], path);
        assert_eq!(report(path, "i.json")["quality"]["scan.points"], 2000 + count);
    }
}
