//! Displacement maps: what is written is read back bit for bit, and other programs read the same numbers.

#![allow(clippy::print_stdout)] // figures and skipped tests are told to who runs them

mod common;

use common::folder;
use planish::relief::Relief;
use planish::{DVec3, Units};
use planish_io::{read_relief, write_relief};

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
