//! Grids of hard and easy patches: time and quality, one line each. Ids are `grid/relax/<patch>`.

#[path = "../tests/common/patches.rs"]
mod patches;

use planish::Silent;
use planish::grid::{GridParams, measure, relax};
use std::io::Write;
use std::time::Instant;

fn main() {
    let filter = std::env::args().skip(1).find(|a| !a.starts_with('-')).unwrap_or_default();
    let mut all: Vec<(patches::Sheet, usize)> = patches::snouts(256).into_iter().map(|s| (s, 257)).collect();
    all.extend(patches::sheets(129).into_iter().map(|s| (s, 129)));
    for sheet in patches::scan_disks(0.1).into_iter().filter_map(|(_, disks)| disks).flatten() {
        let n = (sheet.patch.mesh.points.len() as f64).sqrt().ceil() as usize;
        all.push((sheet, n.max(17)));
    }
    let mut out = std::io::stdout().lock();
    let header =
        "patch                    vertices  grid   seconds folds spacing  worst  angle95  area   miss max   rms";
    writeln!(out, "{header}").expect("a terminal");
    for (sheet, n) in all.iter().filter(|(s, _)| s.name.contains(&filter)) {
        let start = Instant::now();
        let result = relax(&sheet.input, &[sheet.patch.clone()], &[(*n, *n)], &GridParams::default(), &Silent);
        let seconds = start.elapsed().as_secs_f64();
        match result {
            Ok(grids) => {
                let q = measure(&grids[0], &sheet.patch);
                let line = format!(
                    "{:<24} {:>8} {:>5} {:>8.3} {:>5} {:>8.4} {:>6.3} {:>7.1} {:>6.2} {:>8.4}% {:.4}%",
                    sheet.name,
                    sheet.patch.mesh.points.len(),
                    n,
                    seconds,
                    q.folds,
                    q.spacing_cv,
                    q.spacing_cv_worst,
                    q.angle_p95_deg,
                    q.area_cv,
                    100.0 * q.miss_max,
                    100.0 * q.miss_rms
                );
                writeln!(out, "{line}").expect("a terminal");
            }
            Err(error) => writeln!(out, "{:<24} {error}", sheet.name).expect("a terminal"),
        }
    }
}
