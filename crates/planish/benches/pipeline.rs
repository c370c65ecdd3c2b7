//! Times of the whole library on the demonstration part, as one dated file.
//!
//! * `<stage>/default/demo_<n>k` - every stage of a run at four sizes, and how each grows with the triangles
//! * `refit/control_12x12/demo_60k` - surfaces, seams and reliefs anew on the grids that are there
//! * `fit/65x100/grid_1024x1024` - one grid, with its ratio to summing the same points once
//!
//! Writes `bench/runs/<date>-<machine>.json`: the least of the rounds, seconds of wall clock.

#![allow(clippy::print_stderr)] // a bench tells its figures on the terminal

#[path = "record/mod.rs"]
mod record;

use glam::DVec3;
use planish::pipeline::{self, PipelineParams, StageRecord};
use planish::surface::{self, Resolution};
use planish::synthetic::{self};
use planish::{Model, Silent};
use std::collections::BTreeMap;
use std::hint::black_box;
use std::time::Instant;

/// Parts: name, triangles, rounds. What others do on the machine only ever adds, so the least of the rounds counts;
/// a large part runs long enough to be disturbed evenly.
const PARTS: [(&str, usize, usize); 4] =
    [("demo_15k", 15_000, 3), ("demo_30k", 30_000, 2), ("demo_60k", 60_000, 2), ("demo_120k", 120_000, 1)];
/// Seed of the parts.
const SEED: u64 = 0;
/// The part that is fitted anew, and how often.
const REFIT: (&str, usize) = ("demo_60k", 10);
/// Stages shorter than this have no growth worth telling.
const MEASURABLE: f64 = 0.01;

type Seconds = BTreeMap<String, f64>;

fn main() {
    let mut seconds = Seconds::new();
    let mut curves: BTreeMap<String, Vec<(f64, f64)>> = BTreeMap::new();
    for (name, wanted, rounds) in PARTS {
        let part = synthetic::demo(SEED, wanted);
        let mut least = Seconds::new();
        for round in 0..rounds {
            let fitted =
                pipeline::fit(&part, None, None, &PipelineParams::default(), &Silent).expect("the part is sound");
            keep(&mut least, &fitted.stages);
            if round == 0 && name == REFIT.0 {
                seconds.insert(format!("refit/control_12x12/{name}"), refit(fitted.model, REFIT.1));
            }
        }
        for (stage, s) in least {
            eprintln!("{:32} {s:9.4} s", format!("{stage}/default/{name}"));
            curves.entry(stage.clone()).or_default().push((part.triangles.len() as f64, s));
            seconds.insert(format!("{stage}/default/{name}"), s);
        }
    }
    let growth: Seconds = curves.into_iter().filter_map(|(stage, curve)| Some((stage, slope(&curve)?))).collect();
    let (stream, fit) = grid_fit();
    seconds.insert("reference/stream/grid_1024x1024".into(), stream);
    seconds.insert("fit/65x100/grid_1024x1024".into(), fit);
    let machine = record::machine();
    let record = serde_json::json!({
        "planish": env!("CARGO_PKG_VERSION"),
        "machine": machine,
        "threads": rayon::current_num_threads(),
        "load_before": std::fs::read_to_string("/proc/loadavg").unwrap_or_default().split(' ').next(),
        "seconds": seconds,
        "ratio": { "fit/65x100/grid_1024x1024 to reference/stream": fit / stream },
        "growth_exponent": growth,
    });
    let text = serde_json::to_string_pretty(&record).expect("numbers and names") + "\n";
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../bench/runs");
    let path = format!("{folder}/{}-{machine}.json", record::output("date", &["+%Y-%m-%d"]));
    std::fs::create_dir_all(folder).and_then(|()| std::fs::write(&path, &text)).expect("bench/runs can be written");
    eprintln!("{text}{path}");
}

/// Keeps the least time of every stage, and of all together.
fn keep(least: &mut Seconds, stages: &[StageRecord]) {
    let all = ("run", stages.iter().map(|s| s.seconds).sum());
    for (name, s) in stages.iter().map(|s| (s.name.as_str(), s.seconds)).chain([all]) {
        let entry = least.entry(name.into()).or_insert(f64::INFINITY);
        *entry = entry.min(s);
    }
}

/// Least time of fitting a model anew.
fn refit(mut model: Model, rounds: usize) -> f64 {
    let mut params = PipelineParams::default();
    params.fit.resolution = Resolution::Control([12, 12]);
    least_of(rounds, || pipeline::refit(&mut model, &params, &Silent).expect("the model is sound"))
}

/// Seconds to stream a grid of 1024 x 1024 points, and to fit a surface of 65 x 100 control points to it.
fn grid_fit() -> (f64, f64) {
    let n = 1024;
    let at = |k: usize| {
        let (u, v) = ((k % n) as f64 / (n - 1) as f64, (k / n) as f64 / (n - 1) as f64);
        DVec3::new(u, v, 0.1 * (9.0 * u).sin() * (7.0 * v).cos())
    };
    let points: Vec<DVec3> = (0..n * n).map(at).collect();
    let stream = least_of(20, || {
        // Four sums, or the additions would wait for one another instead of for the memory.
        let mut sums = [DVec3::ZERO; 4];
        for four in black_box(&points).chunks_exact(4) {
            (0..4).for_each(|k| sums[k] += four[k]);
        }
        sums
    });
    let fit = least_of(20, || surface::fit(black_box(&points), n, n, [65, 100]).expect("enough points"));
    (stream, fit)
}

fn least_of<T>(rounds: usize, mut work: impl FnMut() -> T) -> f64 {
    let once = |work: &mut dyn FnMut() -> T| {
        let start = Instant::now();
        black_box(work());
        start.elapsed().as_secs_f64()
    };
    (0..rounds).map(|_| once(&mut work)).fold(f64::INFINITY, f64::min)
}

/// Exponent of time over size: the slope of the line through the logarithms.
fn slope(curve: &[(f64, f64)]) -> Option<f64> {
    if curve.iter().any(|c| c.1 < MEASURABLE) {
        return None;
    }
    let n = curve.len() as f64;
    let logs: Vec<(f64, f64)> = curve.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    let (mx, my) = logs.iter().fold((0.0, 0.0), |m, l| (m.0 + l.0 / n, m.1 + l.1 / n));
    let (xy, xx) = logs.iter().fold((0.0, 0.0), |s, l| (s.0 + (l.0 - mx) * (l.1 - my), s.1 + (l.0 - mx).powi(2)));
    Some(xy / xx)
}
