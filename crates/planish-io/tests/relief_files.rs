//! Displacement maps: what is written is read back bit for bit, and other programs read the same numbers.

#![allow(clippy::print_stdout)] // figures and skipped tests are told to who runs them

mod common;

use common::folder;
use planish::grid::Grid;
use planish::relief::{Relief, bake, frames};
use planish::surface::{Surface, fit};
use planish::{DVec3, Units};
use planish_io::{read_relief, relief_roundtrip, write_relief};

/// A relief whose numbers `f32` holds exactly.
fn relief(cols: usize, rows: usize, seed: f64) -> Relief {
    let single = |x: f64| x as f32 as f64;
    let at = |k: usize| {
        let t = k as f64 + seed;
        DVec3::new(single(t.sin() * 1e-3), single((1.7 * t).cos()), single((0.3 * t).sin() * 1e4))
    };
    Relief { rows, cols, vectors: (0..rows * cols).map(at).collect() }
}

#[test]
fn reliefs_of_different_sizes_come_back_bit_for_bit_with_their_unit() {
    let folder = folder();
    let reliefs = vec![relief(17, 9, 0.0), relief(2, 2, 5.0), relief(65, 40, 9.0)];
    let path = folder.path().join("deep/relief");
    write_relief(&path, &reliefs, Units::In).unwrap();
    assert_eq!(read_relief(&path).unwrap(), (reliefs.clone(), Units::In));
    let first = std::fs::read(path.join("patch_0002.exr")).unwrap();
    write_relief(&path, &reliefs, Units::In).unwrap();
    assert_eq!(std::fs::read(path.join("patch_0002.exr")).unwrap(), first);
    let names: Vec<_> = std::fs::read_dir(&path).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(names.len(), 4, "{names:?}");
}

#[test]
fn sidecar_says_frame_sampling_uv_and_the_largest_displacement() {
    let folder = folder();
    let mut small = relief(3, 3, 0.0);
    small.vectors = vec![DVec3::ZERO; 9];
    small.vectors[4] = DVec3::new(0.0, 3.0, 4.0);
    write_relief(folder.path(), &[small], Units::Mm).unwrap();
    let text = std::fs::read_to_string(folder.path().join("relief.json")).unwrap();
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(json["largest"], 5.0);
    assert_eq!(json["channels"]["G"], "bitangent");
    assert_eq!(json["sampling"], "node");
    assert_eq!(json["uv"], "(u (n - 1) + 0.5) / n");
    assert_eq!((json["patches"][0]["width"].as_u64(), json["units"].as_str()), (Some(3), Some("mm")));
}

#[test]
fn damaged_images_and_lying_sidecars_are_refused_with_a_hint() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    let reset = || write_relief(folder.path(), &[relief(17, 9, 0.0)], Units::Mm).unwrap();
    let refused = |wanted: &str| {
        let message = read_relief(folder.path()).unwrap_err().to_string();
        assert!(message.contains(wanted) && message.contains(" - hint: ") && !message.contains('\n'), "{message}");
    };
    refused("relief.json");
    reset();
    let image = std::fs::read(at("patch_0000.exr")).unwrap();
    for length in (0..image.len()).step_by(7) {
        std::fs::write(at("patch_0000.exr"), &image[..length]).unwrap();
        refused("patch_0000.exr");
    }
    std::fs::remove_file(at("patch_0000.exr")).unwrap();
    refused("patch_0000.exr");
    reset();
    let sidecar = std::fs::read_to_string(at("relief.json")).unwrap();
    for (from, to, wanted) in [
        ("\"width\": 17", "\"width\": 18", "not one layer of 18 x 9"),
        ("\"width\": 17", "\"width\": 4000000000", "more than it can hold"),
        ("\"planish_relief\": 1", "\"planish_relief\": 2", "version 2 of relief.json"),
        ("patch_0000.exr", "../patch_0000.exr", "names no file of its folder"),
        ("\"node\"", "\"texel\"", "another order of channels, sampling or rows"),
        ("{", "", "is not a relief"),
    ] {
        std::fs::write(at("relief.json"), sidecar.replacen(from, to, 1)).unwrap();
        refused(wanted);
    }
    let mut bad = relief(3, 3, 0.0);
    bad.vectors[1].x = 1e300;
    assert!(write_relief(folder.path(), &[bad], Units::Mm).unwrap_err().to_string().contains("(patch 0)"));
}

/// Set `PLANISH_PYTHON` to a Python that has openexr to run this one.
#[test]
fn openexr_reads_tangent_bitangent_normal_as_r_g_b_with_v_0_in_the_lowest_row() {
    let Some(python) = std::env::var_os("PLANISH_PYTHON") else {
        println!("skipped: PLANISH_PYTHON is not set");
        return;
    };
    let folder = folder();
    let relief = relief(5, 3, 0.0);
    write_relief(folder.path(), std::slice::from_ref(&relief), Units::Mm).unwrap();
    let script = "import OpenEXR,sys\nf=OpenEXR.File(sys.argv[1],separate_channels=True)\nc=f.channels()\n\
                  print(f.header()['compression'],sorted(c),*['%.9g'%v for k in 'RGB' for v in c[k].pixels.ravel()])";
    let image = folder.path().join("patch_0000.exr");
    let output = std::process::Command::new(python).args(["-c", script]).arg(image).output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(text.contains("ZIP") && text.contains("['B', 'G', 'R']"), "{text}");
    let numbers: Vec<f32> = text.split("]").nth(1).unwrap().split_whitespace().map(|w| w.parse().unwrap()).collect();
    for channel in 0..3 {
        for y in 0..3 {
            for x in 0..5 {
                let wanted = relief.vectors[(2 - y) * 5 + x][channel] as f32;
                assert_eq!(numbers[channel * 15 + y * 5 + x], wanted);
            }
        }
    }
}

/// The cubic surface through `place` on 7 x 7 control points, and a grid of 23 x 31 nodes off it by `detail` in every direction.
fn patch(place: impl Fn(f64, f64) -> DVec3, detail: f64) -> (Surface, Grid) {
    let nodes = |rows: usize, cols: usize, off: f64| -> Vec<DVec3> {
        let at = |n: usize| ((n % cols) as f64 / (cols - 1) as f64, (n / cols) as f64 / (rows - 1) as f64);
        let off = |n: usize| DVec3::new((1.3 * n as f64).sin(), (2.1 * n as f64).cos(), (0.7 * n as f64).sin()) * off;
        (0..rows * cols).map(|n| place(at(n).0, at(n).1) + off(n)).collect()
    };
    let surface = fit(&nodes(23, 31, 0.0), 23, 31, [7, 7]).unwrap();
    (surface, Grid { rows: 23, cols: 31, points: nodes(23, 31, detail), places: Vec::new() })
}

#[test]
fn maps_read_back_give_the_grid_within_single_precision_in_every_kind_of_frame() {
    let detail = 0.05;
    let turn = std::f64::consts::FRAC_PI_2;
    let patches = [
        // A quarter of a cylinder: orthogonal derivatives.
        patch(|u, v| DVec3::new((turn * u).cos(), (turn * u).sin(), v), detail),
        // A sheared saddle far from the origin: derivatives at 20 degrees to each other.
        patch(|u, v| DVec3::new(1e4 + u + 0.9 * v, 0.35 * v - 1e4, u * v), detail),
        // A quarter of a cone: the side v = 1 is one point, where the frame is that of the place beside it.
        patch(|u, v| DVec3::new((turn * u).cos(), (turn * u).sin(), 0.0) * (1.0 - v) + DVec3::Z * v, detail),
        // One point, one line: no frame at all, the world axes.
        patch(|_, _| DVec3::ONE, detail),
        patch(|u, v| DVec3::X * (u + v), detail),
    ];
    let (surfaces, grids): (Vec<Surface>, Vec<Grid>) = patches.into_iter().unzip();
    let world = |k: usize| frames(&surfaces[k], 23, 31)[40].tangent == DVec3::X;
    assert!(world(3) && world(4) && !world(0) && !world(2));
    let reliefs: Vec<Relief> = grids.iter().zip(&surfaces).map(|(g, s)| bake(g, s).unwrap()).collect();
    for (k, relief) in reliefs.iter().enumerate() {
        let folder = folder();
        write_relief(folder.path(), std::slice::from_ref(relief), Units::Mm).unwrap();
        let away = relief_roundtrip(folder.path(), &surfaces[k..=k], &grids[k..=k]).unwrap();
        let most = relief.vectors.iter().map(|d| d.length()).fold(0.0, f64::max);
        // Each of three numbers is off by half a unit in its last of 24 bits; places by 1e-16 of how far out they are.
        let far = grids[k].points.iter().map(|p| p.length()).fold(0.0, f64::max);
        assert!(away > 1e-3 * most * 2f64.powi(-24), "patch {k}: {away}");
        assert!(away < most * 2f64.powi(-24) + 1e-15 * far, "patch {k}: {away} of {most}");
    }
    // All in one folder, and told if they are those of others.
    let folder = folder();
    write_relief(folder.path(), &reliefs, Units::Mm).unwrap();
    assert!(relief_roundtrip(folder.path(), &surfaces, &grids).unwrap() < 1e-8);
    assert!(relief_roundtrip(folder.path(), &surfaces[1..], &grids[1..]).is_err());
    let mut other = grids.clone();
    other[2].points.truncate(22 * 31);
    other[2].rows = 22;
    let told = relief_roundtrip(folder.path(), &surfaces, &other).unwrap_err().to_string();
    assert!(told.contains("(patch 2)") && told.contains(" - hint: "), "{told}");
}
