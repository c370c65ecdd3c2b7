//! Speed of the surface stage against what one core can stream.
//!
//! `cargo bench --bench surface` prints each time with its ratio to a reference measured in the same run: summing
//! the same points once, three numbers at a time.
#![allow(clippy::print_stdout)]

#[path = "../tests/patchworks/mod.rs"]
mod patchworks;
mod record;

use glam::DVec3;
use patchworks::*;
use planish::Silent;
use planish::network::CurveKind;
use planish::relief;
use planish::surface::{self, FitParams, Resolution, StitchParams};
use record::time;
use std::hint::black_box;

fn main() {
    let g = grid(1024, 1024, |u, v| DVec3::new(u, v, 0.1 * (9.0 * u).sin() * (7.0 * v).cos()));
    // Four sums, or the additions would wait for one another instead of for the memory.
    let stream = time(20, || {
        let mut sums = [DVec3::ZERO; 4];
        for four in black_box(&g.points).chunks_exact(4) {
            (0..4).for_each(|k| sums[k] += four[k]);
        }
        sums
    });
    println!("reference/stream/1024x1024        {stream:8.2} ms");
    let one = time(20, || surface::fit(black_box(&g.points), 1024, 1024, [65, 100]).unwrap());
    println!("surface/fit/1024x1024_to_65x100   {one:8.2} ms  {:5.2} x stream", one / stream);
    let s = surface::fit(&g.points, 1024, 1024, [65, 100]).unwrap();
    let bake = time(5, || relief::bake(&g, &s).unwrap());
    println!("relief/bake/1024x1024             {bake:8.2} ms  {:5.2} x stream", bake / stream);

    // About a million nodes in 216 patches.
    let shape = |x: f64, y: f64| {
        let (a, b) = (x * std::f64::consts::TAU / 18.0, y * std::f64::consts::TAU / 12.0);
        let r = 2.0 + 0.7 * b.cos() + 0.05 * (9.0 * a).sin();
        DVec3::new(r * a.cos(), r * a.sin(), 0.7 * b.sin())
    };
    let work = sheet(18, 12, [true, true], [69, 69], shape);
    for m in [10, 20] {
        let params = FitParams {
            resolution: Resolution::Control([m, m]),
            cells_per_span: 1.0,
            smoothing: 0.0,
            ..FitParams::default()
        };
        let fit = || surface::fit_network(&work.network, &work.grids, &params, &Silent).unwrap();
        let all = time(5, fit);
        println!("surface/network/216x69x69_to_{m}    {all:8.2} ms  {:5.2} x stream", all / stream);
        let surfaces = fit();
        let sewn = time(5, || {
            surface::stitch(&work.network, &work.grids, &surfaces, &StitchParams::default(), &Silent).unwrap()
        });
        println!("surface/stitch/216x69x69_to_{m}     {sewn:8.2} ms  {:5.2} x stream", sewn / stream);
    }
    let params = FitParams {
        resolution: Resolution::Tolerance(1e-5),
        cells_per_span: 1.0,
        smoothing: 0.0,
        ..FitParams::default()
    };
    let blob = cube(401, CurveKind::Smooth, blob);
    let all = time(3, || surface::fit_network(&blob.network, &blob.grids, &params, &Silent).unwrap());
    println!("surface/tolerance/6x401x401       {all:8.2} ms  {:5.2} x stream", all / stream);
}
