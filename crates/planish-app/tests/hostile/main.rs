//! Hostile input through every command that takes it: an answer or one line, within 60 seconds and a gigabyte, and nothing
//! half-written.
//!
//! First shapes, scans and scripts with a name, each known to have been a trouble; then [`KINDS`], 3 000 inputs drawn by a seed. `PLANISH_HOSTILE=all` runs
//! all through all commands (`make fuzz`), without it a part of them; names of shapes and kinds with commas between them
//! run those. `PLANISH_HOSTILE_FROM` begins the drawn inputs at another number.

#![cfg(target_os = "linux")]
#![allow(clippy::print_stdout)] // what took long is told to who runs them

mod clouds;
mod dice;
mod meshes;
mod models;
mod scripts;

use dice::Dice;
use meshes::{Mesh, ball, ply, sheet};
use planish::geom::random;
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Of computing, on all threads together: what else the machine does adds nothing.
const SECONDS: f64 = 60.0;
/// Times as long by the clock, on a loaded machine: what waits for nothing hangs.
const PATIENCE: f64 = 5.0;
/// Bytes of a message.
const LONGEST: usize = 500;
const MEMORY_KB: u64 = 1 << 20;

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

/// How a run ended.
struct End {
    /// What went wrong, if anything.
    fault: Option<String>,
    seconds: f64,
    megabytes: u64,
}

/// Names in a folder but that of the messages.
fn names(folder: &Path) -> BTreeSet<String> {
    let entries = fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().to_string_lossy().into_owned());
    entries.filter(|name| name != "errors.txt").collect()
}

/// Runs the program and judges it: options and outputs of these runs are right, so a fault is that of the input.
fn run(args: &[&str], folder: &Path) -> End {
    let before = names(folder);
    let mut command = Command::new(env!("CARGO_BIN_EXE_planish"));
    command.args(args).current_dir(folder).stdin(Stdio::null()).stdout(Stdio::null());
    let errors = fs::File::create(folder.join("errors.txt")).unwrap();
    let mut child = command.stderr(errors).spawn().unwrap();
    let (since, mut most) = (Instant::now(), 0);
    let mut code = None;
    let fault = loop {
        if let Some(status) = child.try_wait().unwrap() {
            code = status.code();
            break None;
        }
        let text = fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap_or_default();
        let held = text.lines().find_map(|l| l.strip_prefix("VmHWM:")).unwrap_or("0 kB");
        most = most.max(held.trim().trim_end_matches(" kB").trim().parse().unwrap_or(0));
        if most > MEMORY_KB || computed(child.id()) > SECONDS || since.elapsed().as_secs_f64() > PATIENCE * SECONDS {
            child.kill().unwrap();
            child.wait().unwrap();
            break Some(format!("{:.0} s and {} MB", since.elapsed().as_secs_f64(), most >> 10));
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    let told = fs::read_to_string(folder.join("errors.txt")).unwrap_or_default();
    let lines = told.lines().filter(|l| l.starts_with("error: ")).count();
    let after = names(folder);
    let left = after.difference(&before).next();
    let fault = fault.or_else(|| match (code, left) {
        (_, Some(name)) if name.contains("partial") => Some(format!("{name} is left")),
        (Some(0 | 1), _) => None,
        (Some(3), None) if lines == 1 && told.lines().last().is_some_and(|l| l.len() < LONGEST) => None,
        (Some(3), Some(name)) => Some(format!("{name} is written, with status 3")),
        (code, _) => Some(format!("status {code:?}: {}", told.trim())),
    });
    let end = End { fault, seconds: since.elapsed().as_secs_f64(), megabytes: most >> 10 };
    if end.seconds > 10.0 {
        println!("slow: {args:?} {:.0} s, {} MB", end.seconds, end.megabytes);
    }
    end
}

/// Seconds of computing that a process has taken.
fn computed(process: u32) -> f64 {
    let text = fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
    let fields = text.rsplit(')').next().unwrap_or_default().split_whitespace();
    // User and system time, in the kernel's hundredths.
    fields.skip(11).take(2).filter_map(|n| n.parse::<f64>().ok()).sum::<f64>() / 100.0
}

/// Runs the program, and tells a fault at once: what comes after it may take long.
fn tried(args: &[&str], folder: &Path) -> Option<String> {
    let found = run(args, folder).fault.map(|fault| format!("{args:?}: {fault}"));
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

/// Shapes that took gigabytes in the layout before its working meshes and systems had bounds.
const BOUNDED: [&str; 2] = ["strip-1e6", "shuffled"];
/// Shapes of loose triangles: each had a patch of its own before they were refused.
const LOOSE: [&str; 3] = ["soup", "crowd", "loose"];

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
        &["run", "-q", "--force", "-o", "o"],
    ];
    let mut wrong = Vec::new();
    for (name, mesh) in shapes().into_iter().filter(|s| is_asked(s.0)) {
        let file = format!("{name}.ply");
        fs::write(path.join(&file), ply(&mesh)).unwrap();
        let is_bounded = |command: &str| match command {
            "layout" => BOUNDED.contains(&name) || LOOSE.contains(&name),
            "run" => LOOSE.contains(&name),
            _ => false,
        };
        let taken = |k: usize| all() || k < 4 || is_bounded(commands[k][0]);
        for (_, command) in commands.iter().enumerate().filter(|(k, _)| taken(*k)) {
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

/// Kinds of drawn inputs, with their numbers and how many of their commands the test command chooses from: those after take
/// long on some inputs.
const KINDS: [(&str, usize, usize); 6] = [
    ("mesh", 1000, 6),
    ("cloud", 500, 4),
    ("solid", 500, 2),
    ("edit", 350, 1),
    ("network", 350, 2),
    ("project", 300, 5),
];

/// Of so many drawn inputs one is tried in the test command, by one of the commands that take it.
const SHARE: usize = 31;

/// What the inputs of a kind are laid beside: a box with a network and a model of it.
struct Ground {
    network: String,
    model: planish::Model,
}

fn ground(folder: &Path) -> Ground {
    fs::write(folder.join("box.ply"), ply(&meshes::cuboid(3))).unwrap();
    for args in [["layout", "box.ply", "-q", "-o", "box.json"], ["fit", "box.ply", "-q", "-o", "box.planish"]] {
        assert_eq!(run(&args, folder).fault, None);
    }
    let network = fs::read_to_string(folder.join("box.json")).unwrap();
    Ground { network, model: planish_io::read_model(folder.join("box.planish")).unwrap() }
}

/// Writes the input of a kind and a number, and tells the commands that take it.
fn input(kind: usize, number: usize, ground: &Ground, folder: &Path) -> Vec<String> {
    let dice = &mut Dice::new((number * KINDS.len() + kind) as u64);
    let put = |name: &str, bytes: &[u8]| {
        assert!(bytes.len() < 200_000, "{name}: {} bytes", bytes.len());
        fs::write(folder.join(name), bytes).unwrap();
    };
    let commands: Vec<String> = match KINDS[kind].0 {
        "mesh" => {
            let (extension, text) = meshes::drawn(dice);
            put(&format!("i.{extension}"), text.as_bytes());
            [
                "info I",
                "smooth I -o o.ply",
                "decimate I --ratio 0.5 -o o.ply",
                "transform I --turn z,30 -o o.ply",
                "compare I I --align",
                "mesh I --resolution 24 -o o.ply",
                "layout I -o o.json",
                "fit I -o o.planish",
                "run I -o o",
            ]
            .map(|c| c.replace('I', &format!("i.{extension}")))
            .to_vec()
        }
        "cloud" => {
            let (extension, text) = clouds::drawn(dice);
            put(&format!("i.{extension}"), text.as_bytes());
            [
                "info I",
                "transform I --turn z,30 -o o.ply",
                "compare I I --align",
                "clean I -o o.ply",
                "mesh I -o o.ply",
                "run I -o o",
            ]
            .map(|c| c.replace('I', &format!("i.{extension}")))
            .to_vec()
        }
        "solid" if number % 4 == 1 => {
            let formula = scripts::formula(1 + dice.below(7), dice);
            return vec![format!(
                "mesh\n{formula}\n--formula\n--bounds=-2,2\n--resolution\n24\n-q\n--force\n-o\no.ply"
            )];
        }
        "solid" => {
            let text = if number % 4 == 2 { scripts::job(dice) } else { scripts::solids(dice) };
            put("i.toml", text.as_bytes());
            vec!["info i.toml".into(), "mesh i.toml --resolution 24 -o o.ply".into()]
        }
        "edit" => {
            let (text, command) = match number % 4 {
                0 => (scripts::reliefs(dice), "relief edit box.planish i.toml -o o.planish"),
                1 => (scripts::moves(dice), "deform box.planish i.toml -o o.planish"),
                2 => (scripts::edits(dice), "edit box.ply i.toml -o o.planish"),
                _ => (scripts::edits(dice), "edit box.planish i.toml -o o.planish"),
            };
            put("i.toml", text.as_bytes());
            vec![command.into()]
        }
        "network" => {
            put("i.json", models::network(&ground.network, dice).as_bytes());
            ["info i.json", "fit box.ply --network i.json -o o.planish", "run box.ply --network i.json -o o"]
                .map(String::from)
                .to_vec()
        }
        _ => {
            let path = folder.join("i.planish");
            // What the writer itself refuses is no file.
            if planish_io::write_model(&path, &models::model(&ground.model, dice)).is_err() {
                return Vec::new();
            }
            fs::write(folder.join("s.toml"), scripts::edits(dice)).unwrap();
            [
                "info i.planish",
                "export i.planish -o o.step",
                "export i.planish -o o.glb",
                "relief export i.planish -o o",
                "compare i.planish box.ply",
                "fit i.planish --control 6x6 -o o.planish",
                "edit i.planish s.toml -o o.planish",
            ]
            .map(String::from)
            .to_vec()
        }
    };
    let flags = |c: String| if c.contains(" -o ") { format!("{c} -q --force") } else { format!("{c} -q") };
    commands.into_iter().map(flags).map(|c| c.replace(' ', "\n")).collect()
}

/// Removes what a run has made, so that the next one is judged by what it makes.
fn clear(folder: &Path) {
    for name in names(folder).iter().filter(|n| n.starts_with("o.") || *n == "o") {
        let path = folder.join(name);
        let gone = if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) };
        gone.unwrap();
    }
}

#[test]
fn inputs_drawn_by_a_seed_end_with_an_answer_or_one_line_and_nothing_half_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let ground = ground(path);
    let from: usize = std::env::var("PLANISH_HOSTILE_FROM").ok().and_then(|v| v.parse().ok()).unwrap_or(0);
    let mut wrong = Vec::new();
    for (kind, &(name, count, light)) in KINDS.iter().enumerate().filter(|(_, k)| is_asked(k.0)) {
        let (mut inputs, mut runs, mut seconds, mut longest, mut most) = (0, 0, 0.0, 0.0f64, 0);
        for number in (from..from + count).filter(|n| all() || n % SHARE == 0) {
            let commands = input(kind, number, &ground, path);
            inputs += 1;
            for (k, command) in commands.iter().enumerate() {
                // In the test command each input goes through one of the commands, the next input through the next.
                if !all() && k != (number / SHARE) % commands.len().min(light) {
                    continue;
                }
                let args: Vec<&str> = command.split('\n').collect();
                let end = run(&args, path);
                clear(path);
                runs += 1;
                seconds += end.seconds;
                longest = longest.max(end.seconds);
                most = most.max(end.megabytes);
                if let Some(fault) = end.fault {
                    println!("{name} {number} {args:?}: {fault}");
                    wrong.push(format!("{name} {number} {args:?}: {fault}"));
                }
            }
        }
        println!(
            "hostile: {inputs} of {name} in {runs} runs, {seconds:.0} s, the longest {longest:.1} s, {most} MB at most"
        );
    }
    assert!(wrong.is_empty(), "{} faults:\n{}", wrong.len(), wrong.join("\n"));
}
