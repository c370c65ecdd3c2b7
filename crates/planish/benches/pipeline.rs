//! Times every stage of the pipeline on the demonstration part: `stage/default/demo_60k`.
//!
//! Writes `bench/runs/<date>-<machine>.json`: the median of the rounds, seconds of wall clock.

#![allow(clippy::print_stderr)] // a bench tells its figures on the terminal

use planish::Silent;
use planish::mesh::shapes;
use planish::pipeline::{self, PipelineParams};
use std::collections::BTreeMap;
use std::process::Command;

/// Rounds per input; the median of three is not moved by one disturbed round.
const ROUNDS: usize = 3;
/// Seed and triangles of the parts.
const PARTS: [(&str, u64, usize); 2] = [("demo_20k", 0, 20_000), ("demo_60k", 0, 60_000)];

fn main() {
    let mut medians = BTreeMap::new();
    for (name, seed, triangles) in PARTS {
        let part = shapes::demo(seed, triangles);
        let mut times: BTreeMap<String, Vec<f64>> = BTreeMap::new();
        for _ in 0..ROUNDS {
            let fitted = pipeline::fit(&part, None, &PipelineParams::default(), &Silent).expect("the part is sound");
            for stage in fitted.stages {
                times.entry(format!("{}/default/{name}", stage.name)).or_default().push(stage.seconds);
            }
        }
        for (id, mut seconds) in times {
            seconds.sort_by(f64::total_cmp);
            medians.insert(id, seconds[seconds.len() / 2]);
        }
    }
    let machine = machine();
    let record = serde_json::json!({
        "planish": env!("CARGO_PKG_VERSION"),
        "machine": machine,
        "threads": rayon::current_num_threads(),
        "rounds": ROUNDS,
        "seconds": medians,
    });
    let text = serde_json::to_string_pretty(&record).expect("numbers and names") + "\n";
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../bench/runs");
    let path = format!("{folder}/{}-{machine}.json", output("date", &["+%Y-%m-%d"]));
    std::fs::create_dir_all(folder).and_then(|()| std::fs::write(&path, &text)).expect("bench/runs can be written");
    for (id, seconds) in &medians {
        eprintln!("{id:32} {seconds:9.4} s");
    }
    eprintln!("{path}");
}

/// The processor in small letters with dashes, and its number of cores.
fn machine() -> String {
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

fn output(program: &str, arguments: &[&str]) -> String {
    let done = Command::new(program).args(arguments).output();
    done.map(|d| String::from_utf8_lossy(&d.stdout).trim().to_owned()).unwrap_or_else(|_| "unknown".into())
}
