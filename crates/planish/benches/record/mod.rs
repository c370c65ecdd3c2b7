//! What the benches share: one dated file per run and machine, and the clock.
#![allow(dead_code, clippy::print_stderr)]

use std::hint::black_box;
use std::process::Command;
use std::time::Instant;

/// Writes the figures of one bench to `bench/runs/<date>-<machine>-<bench>.json`.
pub fn write(bench: &str, figures: &impl serde::Serialize) {
    let machine = machine();
    let record = serde_json::json!({
        "planish": env!("CARGO_PKG_VERSION"),
        "machine": machine,
        "threads": rayon::current_num_threads(),
        "load_after": std::fs::read_to_string("/proc/loadavg").unwrap_or_default().split(' ').next(),
        "figures": figures,
    });
    let text = serde_json::to_string_pretty(&record).expect("numbers and names") + "\n";
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../bench/runs");
    let path = format!("{folder}/{}-{machine}-{bench}.json", output("date", &["+%Y-%m-%d"]));
    std::fs::create_dir_all(folder).and_then(|()| std::fs::write(&path, &text)).expect("bench/runs can be written");
    eprintln!("{path}");
}

/// Least of several runs, milliseconds.
pub fn time<T>(runs: usize, mut work: impl FnMut() -> T) -> f64 {
    (0..runs)
        .map(|_| {
            let start = Instant::now();
            black_box(work());
            start.elapsed().as_secs_f64() * 1e3
        })
        .fold(f64::INFINITY, f64::min)
}

/// The processor in small letters with dashes, and its number of cores.
pub fn machine() -> String {
    let facts = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let line = facts.lines().find(|l| l.starts_with("model name")).and_then(|l| l.split(':').nth(1));
    let name = line.map(str::trim).map_or_else(|| output("uname", &["-m"]), str::to_owned);
    let words: Vec<String> = name
        .split(|c: char| !c.is_ascii_alphanumeric())
        .filter(|w| !w.is_empty() && !["R", "TM", "CPU"].contains(w))
        .map(str::to_lowercase)
        .collect();
    format!("{}-{}cores", words.join("-"), std::thread::available_parallelism().map_or(1, |n| n.get()))
}

pub fn output(program: &str, arguments: &[&str]) -> String {
    let done = Command::new(program).args(arguments).output();
    done.map(|d| String::from_utf8_lossy(&d.stdout).trim().to_owned()).unwrap_or_else(|_| "unknown".into())
}
