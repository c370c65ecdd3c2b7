//! Large scans: seconds, memory and what comes out, as the number of points grows.
//!
//! `scale/demo_<n>` - points of the demo part, noise of .02 % of the diagonal, to one mesh in bricks. Arguments: numbers of points
//! (`1000000,2000000`). The memory is the most that the process has held so far, so numbers are asked in rising order. Writes
//! `bench/runs/<date>-<machine>-scale.json`.

#![allow(clippy::print_stdout)] // a bench tells its figures on the terminal

#[path = "record/mod.rs"]
mod record;

use planish::Silent;
use planish::mesh::diagnose;
use planish::pipeline::{ScanParams, mesh_scan};
use planish::synthetic::{demo, even_scan};
use std::collections::BTreeMap;
use std::time::Instant;

/// Noise over the diagonal.
const NOISE: f64 = 2e-4;

fn main() {
    let given = std::env::args().skip(1).find(|a| !a.starts_with("--"));
    let truth = demo(1, 400_000);
    let mut figures: BTreeMap<String, BTreeMap<&str, f64>> = BTreeMap::new();
    for count in given.as_deref().unwrap_or("1000000,2000000,4000000").split(',').filter_map(|n| n.parse().ok()) {
        let scan = even_scan(&truth, count, NOISE * truth.bounds().diagonal(), 1);
        let start = Instant::now();
        let made = match mesh_scan(&scan, &ScanParams::default(), &Silent) {
            Ok(made) => made,
            Err(e) => {
                println!("scale/demo_{count}: {e}");
                continue;
            }
        };
        let seconds = start.elapsed().as_secs_f64();
        let facts = diagnose(&made.meshed.extracted.mesh);
        let row = BTreeMap::from([
            ("seconds", seconds),
            ("peak_gb", peak_bytes() / 1e9),
            ("bricks", made.bricks as f64),
            ("triangles", facts.triangles as f64),
            ("pieces", facts.components as f64),
            ("watertight", f64::from(u8::from(facts.watertight))),
            ("rms_rel", made.to_points.0 / truth.bounds().diagonal()),
        ]);
        println!("scale/demo_{count}: {row:.4?}");
        figures.insert(format!("scale/demo_{count}"), row);
    }
    record::write("scale", &figures);
}

/// The most memory that this process has held; 0 where the system does not tell.
fn peak_bytes() -> f64 {
    let text = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line =
        text.lines().find_map(|l| l.strip_prefix("VmHWM:")?.trim().strip_suffix("kB")?.trim().parse::<f64>().ok());
    1024.0 * line.unwrap_or(0.0)
}
