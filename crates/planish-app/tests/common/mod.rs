//! The built program, run in a folder of its own.

#![allow(dead_code)] // each test file uses some of these

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};

/// Runs the built program in a folder.
pub fn planish(args: &[&str], folder: &Path) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_planish"));
    command.args(args).current_dir(folder).stdin(Stdio::null());
    command.output().expect("the program starts")
}

/// Its exit status.
pub fn status(output: &Output) -> i32 {
    output.status.code().expect("an exit status")
}

pub fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

pub fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Runs the program, which must end well; what it wrote to standard output.
pub fn ok(args: &[&str], folder: &Path) -> String {
    let output = planish(args, folder);
    assert_eq!(status(&output), 0, "{args:?}: {}", stderr(&output));
    stdout(&output)
}

/// The one line of an error, checked for its form.
pub fn error_line(output: &Output) -> String {
    let text = stderr(output);
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), 1, "one line, not: {text}");
    assert!(lines[0].starts_with("error: "), "{text}");
    lines[0].to_owned()
}

/// A closed box of `n x n` squares per face, as a PLY file, unit edge.
pub fn write_box(path: &Path, n: usize) {
    let mut points: Vec<[i64; 3]> = Vec::new();
    let mut triangles: Vec<[usize; 3]> = Vec::new();
    let m = n as i64;
    let mut index = |p: [i64; 3]| {
        points.iter().position(|q| *q == p).unwrap_or_else(|| {
            points.push(p);
            points.len() - 1
        })
    };
    for axis in 0..3 {
        for side in [0, m] {
            for a in 0..m {
                for b in 0..m {
                    let mut at = |a: i64, b: i64| {
                        let mut p = [0; 3];
                        (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (side, a, b);
                        index(p)
                    };
                    let [w, x, y, z] = [at(a, b), at(a + 1, b), at(a + 1, b + 1), at(a, b + 1)];
                    for t in [[w, x, y], [w, y, z]] {
                        triangles.push(if side == 0 { [t[0], t[2], t[1]] } else { t });
                    }
                }
            }
        }
    }
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        points.len(),
        triangles.len()
    );
    for p in &points {
        text += &format!("{} {} {}\n", p[0] as f64 / m as f64, p[1] as f64 / m as f64, p[2] as f64 / m as f64);
    }
    for t in &triangles {
        text += &format!("3 {} {} {}\n", t[0], t[1], t[2]);
    }
    fs::write(path, text).unwrap();
}

/// Names of the files in a folder, sorted.
pub fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}
