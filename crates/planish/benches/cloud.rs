//! Scans with known truth: times of cleaning and meshing, and how far the mesh is from the truth. What of its sharp edges
//! reaches the patches is measured by the bench `figures`.
//!
//! * `cloud/<kind>/<shape>_<noise>` - 100 000 points to a mesh; kinds: `even` (noise in all directions), `outliers`
//!   (2 % in the box around), `missing` (a ball of 8 % of the diagonal left out), `scanner` (`virtual_scan`)
//! * `cloud/growth/demo_<n>` - cleaning alone, seconds of wall clock
//!
//! Shapes made here: demo, torus. Where the folder of truth meshes is there also its meshes. Arguments: shapes
//! (`fandisk,bunny`), noise in percent of the diagonal (`0.1,0.25`), kinds (`even,outliers`). Distances in percent of the
//! diagonal, angles in degrees; the zone is within 1 % of a true edge above 40 degrees. Writes
//! `bench/runs/<date>-<machine>-cloud.json`.

#![allow(clippy::print_stdout)] // a bench tells its figures on the terminal

#[path = "../tests/common/mod.rs"]
mod common;
#[path = "record/mod.rs"]
mod record;

use glam::DVec3;
use planish::Silent;
use planish::cloud::{self, CleanParams, Cloud};
use planish::contour::ContourParams;
use planish::geom::{Bvh, random};
use planish::mesh::{self, CompareParams, TriMesh, diagnose};
use planish::pipeline::{self, ScanParams, mesh_scan};
use planish::synthetic::{self, ScannerParams, even_scan, shapes, virtual_scan};
use std::collections::BTreeMap;
use std::time::Instant;

const POINTS: usize = 100_000;

type Figures = BTreeMap<String, BTreeMap<&'static str, f64>>;

fn main() {
    let args: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let list = |k: usize, usual: &str| -> Vec<String> {
        args.get(k).map_or(usual, String::as_str).split(',').map(String::from).collect()
    };
    let kinds = list(2, "even,outliers,missing,scanner");
    let mut figures = Figures::new();
    for name in &list(0, "demo,torus,fandisk,rocker_arm,bunny,gargoyle") {
        let Some(mesh) = shape(name) else {
            println!("skipped: {name} is no shape of ours");
            continue;
        };
        for level in list(1, "0.1,0.25,0.5,1").iter().filter_map(|x| x.parse::<f64>().ok()) {
            for kind in &kinds {
                // Hard kinds are asked at one level unless the user says.
                if args.len() < 2 && kind != "even" && level != 0.25 {
                    continue;
                }
                let Some(found) = row(kind, &mesh, level) else { continue };
                println!("cloud/{kind}/{name}_{level}: {found:.4?}");
                figures.insert(format!("cloud/{kind}/{name}_{level}"), found);
            }
        }
    }
    if args.is_empty() {
        let part = synthetic::demo(0, 60_000);
        for n in [25_000, 50_000, 100_000, 200_000] {
            let scan = even_scan(&part, n, 0.001 * part.bounds().diagonal(), 1);
            let start = Instant::now();
            let samples = cloud::clean(&scan, &CleanParams::default(), &Silent).expect("a part is a surface");
            let seconds = start.elapsed().as_secs_f64();
            println!("cloud/growth/demo_{n}: {seconds:.3} s, {} samples", samples.samples.len());
            figures.insert(format!("cloud/growth/demo_{n}"), [("seconds", seconds)].into());
        }
    }
    record::write("cloud", &figures);
}

/// The scan of a row.
fn scan(kind: &str, mesh: &TriMesh, noise: f64) -> Option<Cloud> {
    let bounds = mesh.bounds();
    let mut points = match kind {
        "even" | "outliers" | "missing" => even_scan(mesh, POINTS, noise * bounds.diagonal(), 1).points,
        "scanner" => {
            let params = ScannerParams { points: POINTS, noise, ..ScannerParams::default() };
            return virtual_scan(mesh, &params, &Silent).ok().map(|s| s.cloud);
        }
        _ => {
            println!("skipped: there is no kind {kind}");
            return None;
        }
    };
    if kind == "outliers" {
        points.extend((0..POINTS as u64 / 50).map(|i| {
            let place = DVec3::from_array([0, 1, 2].map(|k| random::unit(99, 3 * i + k) - 0.5));
            bounds.center() + 1.2 * bounds.size() * place
        }));
    }
    if kind == "missing" {
        let middle = points[17];
        points.retain(|p| p.distance(middle) > 0.08 * bounds.diagonal());
    }
    Some(Cloud::new(points))
}

fn shape(name: &str) -> Option<TriMesh> {
    match name {
        "demo" => Some(synthetic::demo(0, 60_000)),
        "torus" => Some(shapes::torus(1.0, 0.4, 256, 128)),
        "sphere" => Some(shapes::sphere(1.0, 6)),
        _ => common::data_mesh(&format!("{name}.ply")),
    }
}

fn row(kind: &str, mesh: &TriMesh, level: f64) -> Option<BTreeMap<&'static str, f64>> {
    let diagonal = mesh.bounds().diagonal();
    let scan = scan(kind, mesh, level / 100.0)?;
    let params = ScanParams {
        clean: CleanParams::default(),
        contour: ContourParams::default(),
        points: Default::default(),
        cells: None,
        memory: 4 << 30,
        close: None,
    };
    let start = Instant::now();
    let made = match mesh_scan(&scan, &params, &Silent) {
        Ok(made) => made,
        Err(e) => {
            println!("failed: {e}");
            return None;
        }
    };
    let seconds = start.elapsed().as_secs_f64();
    let got = &made.meshed.extracted.mesh;
    let (all, samples) = mesh::compare_samples(mesh, got, &CompareParams::default(), &Silent).ok()?;
    let zone = pipeline::zone(mesh, &samples);
    let percent = 100.0 / diagonal;
    let facts = diagnose(got);
    let tree = Bvh::new(mesh);
    let wrong = made.samples.samples.iter().filter(|s| {
        let n = mesh.normal(tree.closest(s.center).place.face as usize);
        // Beside an edge the closest place may be on the other face.
        s.normal.dot(n) < -0.5
    });
    let found: BTreeMap<&'static str, f64> = [
        ("seconds", seconds),
        ("noise", 100.0 * made.samples.noise / diagonal),
        ("samples", made.samples.samples.len() as f64),
        ("wrong_share", wrong.count() as f64 / made.samples.samples.len() as f64),
        ("rms", percent * all.both.rms),
        ("mean", percent * all.both.mean),
        ("max", percent * all.both.max),
        ("normal_deg", all.normal_deg.mean),
        ("zone_rms", percent * zone.rms),
        ("zone_normal_deg", zone.normal_deg),
        ("closed", f64::from(u8::from(facts.watertight && facts.manifold))),
        ("components", facts.components as f64),
        ("genus", facts.genus.map_or(f64::NAN, |g| g as f64)),
    ]
    .into();
    Some(found)
}
