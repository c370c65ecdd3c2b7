//! Hostile shapes through every command that takes them: an answer or one line, within 60 seconds and a gigabyte.
//!
//! `PLANISH_HOSTILE=all` (or names of shapes) runs every shape through every command (`make fuzz`); without it a part of them.

#![cfg(target_os = "linux")]
#![allow(clippy::print_stdout)] // what took long is told to who runs them

use planish::geom::random;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

const SECONDS: u64 = 60;
const MEMORY_KB: u64 = 1 << 20;

type Mesh = (Vec<[f64; 3]>, Vec<[usize; 3]>);

fn ply((points, triangles): &Mesh) -> String {
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\nelement face {}\n\
         property list uchar int vertex_indices\nend_header\n",
        points.len(),
        triangles.len()
    );
    points.iter().for_each(|p| text += &format!("{:e} {:e} {:e}\n", p[0], p[1], p[2]));
    triangles.iter().for_each(|t| text += &format!("3 {} {} {}\n", t[0], t[1], t[2]));
    text
}

/// A grid of `m` by `n` squares over a rectangle, without those that `hole` names.
fn sheet(m: usize, n: usize, size: [f64; 2], hole: impl Fn(usize, usize) -> bool) -> Mesh {
    let point = |k: usize| [size[0] * (k % (m + 1)) as f64 / m as f64, size[1] * (k / (m + 1)) as f64 / n as f64, 0.0];
    let points = (0..(m + 1) * (n + 1)).map(point).collect();
    let mut triangles = Vec::new();
    for j in 0..n {
        for i in (0..m).filter(|&i| !hole(i, j)) {
            let a = j * (m + 1) + i;
            triangles.extend([[a, a + 1, a + m + 2], [a, a + m + 2, a + m + 1]]);
        }
    }
    (points, triangles)
}

/// A ball of latitudes and longitudes.
fn ball(n: usize) -> Mesh {
    let (mut mesh, turn) = (sheet(2 * n, n, [1.0, 1.0], |_, _| false), std::f64::consts::PI);
    for p in &mut mesh.0 {
        let (a, b) = (2.0 * turn * p[0], turn * p[1]);
        *p = [b.sin() * a.cos(), b.sin() * a.sin(), b.cos()];
    }
    mesh
}

fn unit(k: usize) -> f64 {
    random::unit(11, k as u64)
}

fn shapes() -> Vec<(&'static str, Mesh)> {
    let scaled = |(points, triangles): Mesh, s: f64| {
        (points.into_iter().map(|p: [f64; 3]| p.map(|x| x * s)).collect(), triangles)
    };
    let mut wild = ball(12);
    wild.0[40] = [1e9, 0.0, 0.0];
    let soup: Mesh = (
        (0..900).map(|k| [unit(3 * k), unit(3 * k + 1), unit(3 * k + 2)]).collect(),
        (0..300).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
    );
    let crowd: Mesh = (
        (0..30).map(|k| [unit(3 * k), unit(3 * k + 1), unit(3 * k + 2)]).collect(),
        (0..1500).map(|t| [0, 1, 2].map(|k| (unit(5000 + 3 * t + k) * 30.0) as usize)).collect(),
    );
    let loose: Mesh = (
        (0..9000).map(|k| [(k / 3) as f64 + 0.4 * (k % 3) as f64, (k % 3 / 2) as f64, 0.0]).collect(),
        (0..3000).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
    );
    let needles: Mesh = (
        (0..400).map(|k| [(k / 2) as f64 * 1e-7, (k % 2) as f64, 0.0]).collect(),
        (0..398).map(|k| if k % 2 == 0 { [k, k + 2, k + 1] } else { [k, k + 1, k + 2] }).collect(),
    );
    let mut shuffled = ball(10);
    for k in 0..shuffled.0.len() {
        let other = (unit(k) * shuffled.0.len() as f64) as usize;
        shuffled.0.swap(k, other);
    }
    vec![
        ("strip-1e3", sheet(60, 1, [1e3, 1.0], |_, _| false)),
        ("strip-1e6", sheet(60, 1, [1e6, 1.0], |_, _| false)),
        ("wild", wild),
        ("soup", soup),
        ("crowd", crowd),
        ("holes", sheet(64, 64, [1.0, 1.0], |i, j| i % 2 == 1 && j % 2 == 1 && i < 63 && j < 63)),
        ("loose", loose),
        ("needles", needles),
        ("shuffled", shuffled),
        ("tiny", scaled(ball(8), 1e-300)),
        ("small", scaled(ball(8), 1e-30)),
        ("huge", scaled(ball(8), 1e40)),
        ("one", sheet(1, 1, [1.0, 1.0], |_, _| false)),
    ]
}

fn scans() -> Vec<(&'static str, String)> {
    let point = |k: usize| {
        let (z, a) = (1.0 - 2.0 * (k as f64 + 0.5) / 3000.0, 2.4 * k as f64);
        let r = (1.0f64 - z * z).sqrt();
        [r * a.cos(), r * a.sin(), z]
    };
    let row = |p: [f64; 3]| format!("{} {} {}\n", p[0], p[1], p[2]);
    let ball: String = (0..3000).map(point).map(row).collect();
    let far: String = (0..3000).map(point).map(|p| row([p[0] + 515_380.0, p[1] + 4_918_360.0, p[2]])).collect();
    let helix: String = (0..3000).map(|k| k as f64 / 100.0).map(|t| row([t.cos(), t.sin(), t / 5.0])).collect();
    let noise: String = (0..3000).map(|k| row([unit(3 * k), unit(3 * k + 1), unit(3 * k + 2)])).collect();
    vec![
        ("wild", ball.clone() + "1e12 0 0\n"),
        ("invalid", far + &"0 0 0\n".repeat(300)),
        ("same", "1 2 3\n".repeat(3000)),
        ("helix", helix),
        ("noise", noise),
    ]
}

/// What went wrong with a run, if anything.
fn fault(args: &[&str], folder: &Path) -> Option<String> {
    let mut command = Command::new(env!("CARGO_BIN_EXE_planish"));
    command.args(args).current_dir(folder).stdin(Stdio::null()).stdout(Stdio::null());
    let errors = fs::File::create(folder.join("errors.txt")).unwrap();
    let mut child = command.stderr(errors).spawn().unwrap();
    let (since, mut most) = (Instant::now(), 0);
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        let text = fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap_or_default();
        let held = text.lines().find_map(|l| l.strip_prefix("VmHWM:")).unwrap_or("0 kB");
        most = most.max(held.trim().trim_end_matches(" kB").trim().parse().unwrap_or(0));
        if most > MEMORY_KB || since.elapsed() > Duration::from_secs(SECONDS) {
            child.kill().unwrap();
            child.wait().unwrap();
            return Some(format!("{:.0} s and {} MB", since.elapsed().as_secs_f64(), most >> 10));
        }
        std::thread::sleep(Duration::from_millis(10));
    };
    if since.elapsed() > Duration::from_secs(10) {
        println!("slow: {args:?} {:.0} s, {} MB", since.elapsed().as_secs_f64(), most >> 10);
    }
    let told = fs::read_to_string(folder.join("errors.txt")).unwrap_or_default();
    let lines = told.lines().filter(|l| l.starts_with("error: ")).count();
    match status.code() {
        Some(0 | 1) => None,
        Some(2 | 3) if lines == 1 => None,
        code => Some(format!("status {code:?}: {}", told.trim())),
    }
}

/// Runs the program, and tells a fault at once: what comes after it may take long.
fn tried(args: &[&str], folder: &Path) -> Option<String> {
    let found = fault(args, folder).map(|fault| format!("{args:?}: {fault}"));
    found.iter().for_each(|fault| println!("{fault}"));
    found
}

fn all() -> bool {
    std::env::var("PLANISH_HOSTILE").is_ok()
}

/// True for the shapes that `PLANISH_HOSTILE` names: all, or some with commas between them.
fn is_asked(name: &str) -> bool {
    std::env::var("PLANISH_HOSTILE").map_or(true, |v| v == "all" || v.split(',').any(|asked| asked == name))
}

#[test]
fn hostile_meshes_end_in_a_minute_and_a_gigabyte() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let commands: &[&[&str]] = &[
        &["info"],
        &["smooth", "-q", "--force", "-o", "o.ply"],
        &["decimate", "--ratio", "0.5", "-q", "--force", "-o", "o.ply"],
        &["transform", "--turn", "z,30", "-q", "--force", "-o", "o.ply"],
        &["mesh", "--resolution", "24", "-q", "--force", "-o", "o.ply"],
        &["layout", "-q", "--force", "-o", "o.json"],
        &["fit", "-q", "--force", "-o", "o.planish"],
    ];
    let mut wrong = Vec::new();
    for (name, mesh) in shapes().into_iter().filter(|s| is_asked(s.0)) {
        let file = format!("{name}.ply");
        fs::write(path.join(&file), ply(&mesh)).unwrap();
        for command in commands.iter().take(if all() { commands.len() } else { 4 }) {
            let args = [&[command[0], &file], &command[1..]].concat();
            wrong.extend(tried(&args, path));
        }
        let args = ["compare", &file, &file, "--align", "-q"];
        wrong.extend(tried(&args, path));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn hostile_scans_and_scripts_end_in_a_minute_and_a_gigabyte() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let mut wrong = Vec::new();
    for (name, text) in scans().into_iter().filter(|s| is_asked(s.0)) {
        let file = format!("{name}.xyz");
        fs::write(path.join(&file), text).unwrap();
        let mut runs: Vec<Vec<&str>> = vec![vec!["info", &file], vec!["compare", &file, &file, "-q"]];
        if all() {
            runs.push(vec!["clean", &file, "-q", "--force", "-o", "o.ply"]);
            runs.push(vec!["mesh", &file, "-q", "--force", "-o", "o.ply"]);
        }
        wrong.extend(runs.iter().filter_map(|args| tried(args, path)));
    }
    // Each solid is twice the one before.
    let mut text = String::from("[solid.s0]\nsphere = { radius = 1.0 }\n");
    (1..40).for_each(|k| text += &format!("[solid.s{k}]\nunion = ['s{}', 's{}']\n", k - 1, k - 1));
    fs::write(path.join("double.toml"), text).unwrap();
    let args = ["mesh", "double.toml", "-q", "--force", "-o", "o.ply"];
    wrong.extend(tried(&args, path));
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
