//! The measure: a part of known shape is scanned, goes the whole way, and is held against itself.

use super::cpu;
use planish::Silent;
use planish::cloud::Cloud;
use planish::mesh::TriMesh;
use planish::pipeline::{self, Fitted, Input, RunParams};
use planish::synthetic;
use planish::synthetic::{ScannerParams, virtual_scan};
use std::collections::BTreeMap;

/// Synthetic parts, and levels of noise in percent of the diagonal.
pub const PARTS: [&str; 3] = ["demo", "casting", "bracket"];
pub const NOISES: [f64; 3] = [0.1, 0.25, 0.5];
/// Seeds of the parts and of their scans.
pub const SEEDS: [u64; 3] = [1, 2, 3];
/// Points of a scan: few enough for all rows to take minutes, enough for holes and ribs to be seen.
const POINTS: usize = 24_000;
/// Triangles of the demonstration part, cells along the others: facets leave them by a tenth of the least noise.
const DEMO_TRIANGLES: usize = 60_000;
const CELLS: usize = 180;

/// Figures of one run by key: those of the report, and `cpu`.
pub type Figures = BTreeMap<String, f64>;

/// A shape, what was seen of it, and the standard deviation of its points as a share of the diagonal.
pub struct Scanned {
    pub truth: TriMesh,
    pub cloud: Cloud,
    pub noise: f64,
}

/// A synthetic part of a seed.
pub fn part(name: &str, seed: u64) -> Option<TriMesh> {
    match name {
        "demo" => Some(planish::synthetic::demo(seed, DEMO_TRIANGLES)),
        "casting" => synthetic::casting(seed, CELLS).ok(),
        "bracket" => synthetic::bracket(seed, CELLS).ok(),
        _ => None,
    }
}

/// A scan of a synthetic part as `planish demo` makes it, noise in percent of the diagonal.
pub fn scan(name: &str, percent: f64, seed: u64) -> Scanned {
    let truth = part(name, seed).expect("a synthetic part");
    let noise = percent / 100.0;
    let params = ScannerParams { points: POINTS, noise, seed, ..ScannerParams::default() };
    let cloud = virtual_scan(&truth, &params, &Silent).expect("a part can be seen").cloud;
    Scanned { truth, cloud, noise }
}

/// The whole way from a scan to a model, as `planish run` goes it: the mesh of the scan, and what was fitted to it.
fn run(scan: &Cloud) -> Result<(TriMesh, Fitted), String> {
    let made = pipeline::run(Input::Scan(scan), &RunParams::default(), &Silent).map_err(|e| e.to_string())?;
    let scanned = made.scan.ok_or("a scan that was not meshed")?;
    Ok((scanned.meshed.meshed.extracted.mesh, made.fitted))
}

/// Takes a scan the whole way on one thread and measures the result. On one thread the time is that of the work alone,
/// and two runs beside each other take one core each.
pub fn measure(scan: &Scanned) -> Result<Figures, String> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().map_err(|e| e.to_string())?;
    pool.install(|| {
        let before = cpu::calibration();
        let start = cpu::seconds();
        let (mesh, fitted) = run(&scan.cloud)?;
        let spent = cpu::seconds().zip(start).map(|(end, start)| end - start);
        // The machine before and after: others come and go.
        let unit = before.zip(cpu::calibration()).map(|(a, b)| (a + b) / 2.0);
        let within = pipeline::edge_reach(&scan.truth, scan.noise);
        let against =
            pipeline::truth_figures(&scan.truth, &mesh, &fitted.model, within, &Silent).map_err(|e| e.to_string())?;
        let mut figures: Figures =
            fitted.quality.into_iter().chain(against).map(|(key, figure)| (key, figure.value())).collect();
        figures.extend(spent.zip(unit).map(|(spent, unit)| ("cpu".to_owned(), spent / unit)));
        Ok(figures)
    })
}

/// Least, median and greatest of some values; the median of an even number is the mean of the middle two.
pub fn spread(mut values: Vec<f64>) -> Option<[f64; 3]> {
    values.sort_unstable_by(f64::total_cmp);
    let (low, high) = (*values.first()?, *values.last()?);
    let middle = values.len() / 2;
    let median = if values.len() % 2 == 1 { values[middle] } else { (values[middle - 1] + values[middle]) / 2.0 };
    Some([low, median, high])
}

/// The name of a row.
pub fn row_name(part: &str, percent: f64) -> String {
    format!("{part} {percent} %")
}
