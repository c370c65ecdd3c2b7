//! The headline figures: what the guard of `tests/regress.rs` measures, of its synthetic parts and of measured meshes.
//!
//! * `<part>_<noise>` - a synthetic part as in the guard: `demo`, `casting`, `bracket`
//! * `<file>_<noise>` - 100 000 points spread evenly over a truth mesh of the data folder, noise in all directions
//!
//! Noise in percent of the diagonal; a figure is the median of its seeds with the least and greatest. Arguments: shapes
//! (`casting,fandisk.ply`), noise (`0.1,0.25`; the usual ones of each shape if not given), seeds (`1,2,3`). Writes `bench/runs/<date>-<machine>-figures.json`.

#![allow(clippy::print_stdout)] // a bench tells its figures on the terminal

#[path = "../tests/common/mod.rs"]
mod common;
#[path = "../tests/regress/cpu.rs"]
mod cpu;
#[path = "../tests/regress/measure.rs"]
#[allow(dead_code)]
mod measure;
#[path = "record/mod.rs"]
mod record;
#[path = "../tests/regress/table.rs"]
#[allow(dead_code)]
mod table;

use measure::{Figures, NOISES, PARTS, SEEDS, Scanned};
use planish::mesh::TriMesh;
use planish::synthetic::even_scan;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use table::HEADLINES;

/// Measured meshes and their noise unless the arguments say: those whose figures the README tells, one with blends, and
/// one without edges.
const MEASURED: [(&str, f64); 5] = [
    ("fandisk.ply", 0.1),
    ("fandisk.ply", 0.25),
    ("casting.ply", 0.1),
    ("rocker_arm.ply", 0.25),
    ("gargoyle.ply", 0.25),
];
/// Points of a scan of a measured mesh.
const POINTS: usize = 100_000;

/// A figure of a row.
#[derive(serde::Serialize)]
struct Row {
    unit: &'static str,
    median: f64,
    spread: [f64; 2],
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let list = |k: usize| -> Option<Vec<&str>> { args.get(k).map(|words| words.split(',').collect()) };
    let seeds: Vec<u64> = list(2).map_or(SEEDS.to_vec(), |words| words.iter().filter_map(|w| w.parse().ok()).collect());
    let noises = list(1).map(|words| words.iter().filter_map(|w| w.parse().ok()).collect::<Vec<f64>>());
    let usual: Vec<(&str, f64)> = PARTS.iter().flat_map(|&p| NOISES.map(|n| (p, n))).chain(MEASURED).collect();
    let noises_of = |shape: &str| -> Vec<f64> {
        let own: Vec<f64> = usual.iter().filter(|row| row.0 == shape).map(|row| row.1).collect();
        noises.clone().unwrap_or(if own.is_empty() { NOISES.to_vec() } else { own })
    };
    let rows: Vec<(&str, f64)> = match list(0) {
        Some(shapes) => shapes.into_iter().flat_map(|s| noises_of(s).into_iter().map(move |n| (s, n))).collect(),
        None => usual.clone(),
    };
    let shapes: BTreeMap<&str, Option<TriMesh>> =
        rows.iter().filter(|r| r.0.ends_with(".ply")).map(|r| (r.0, common::data_mesh(r.0))).collect();
    let jobs: Vec<(usize, u64)> = (0..rows.len()).flat_map(|r| seeds.iter().map(move |&seed| (r, seed))).collect();
    let runs: Vec<Mutex<Vec<Figures>>> = rows.iter().map(|_| Mutex::default()).collect();
    // Each run takes one thread.
    let next = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, |n| n.get()) {
            scope.spawn(|| {
                while let Some(&(r, seed)) = jobs.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let (name, noise) = rows[r];
                    let Some(scanned) = scan(name, noise, seed, &shapes) else { continue };
                    match measure::measure(&scanned) {
                        Ok(figures) => runs[r].lock().unwrap_or_else(PoisonError::into_inner).push(figures),
                        Err(e) => println!("failed: {name} at {noise} %, seed {seed}: {e}"),
                    }
                }
            });
        }
    });
    let mut record: BTreeMap<String, BTreeMap<&str, Row>> = BTreeMap::new();
    for ((name, noise), runs) in rows.iter().zip(runs) {
        let runs = runs.into_inner().unwrap_or_else(PoisonError::into_inner);
        if runs.is_empty() {
            continue;
        }
        println!("{} ({} seeds)", measure::row_name(name, *noise), runs.len());
        let row = record.entry(format!("{name}_{noise}")).or_default();
        for headline in &HEADLINES {
            let Some([low, median, high]) = headline.of(&runs) else { continue };
            println!("  {:26}{median:10.4} ({low:.4} .. {high:.4}) {}", headline.key, headline.unit);
            row.insert(headline.key, Row { unit: headline.unit, median, spread: [low, high] });
        }
    }
    if record.is_empty() {
        println!("nothing was measured: no shape of those asked for is there");
    } else {
        record::write("figures", &record);
    }
}

/// The scan of one run; nothing where the shape is not there.
fn scan(name: &str, percent: f64, seed: u64, measured: &BTreeMap<&str, Option<TriMesh>>) -> Option<Scanned> {
    let Some(truth) = measured.get(name) else {
        if !PARTS.contains(&name) {
            println!("skipped: there is no part {name}; measured meshes end in .ply");
            return None;
        }
        return Some(measure::scan(name, percent, seed));
    };
    let truth = truth.clone()?;
    let noise = percent / 100.0;
    let cloud = even_scan(&truth, POINTS, noise * truth.bounds().diagonal(), seed);
    Some(Scanned { truth, cloud, noise })
}
