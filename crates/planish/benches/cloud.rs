//! Scans with known truth: times of cleaning and meshing, how far the mesh is from the truth, and what of its sharp
//! edges reaches the patches.
//!
//! * `cloud/<kind>/<shape>_<noise>` - 100 000 points to a mesh; kinds: `even` (noise in all directions), `outliers`
//!   (2 % in the box around), `missing` (a ball of 8 % of the diagonal left out), `scanner` (`virtual_scan`)
//! * `cloud/growth/demo_<n>` - cleaning alone, seconds of wall clock
//! * `cloud/handover/<shape>_<noise>` - on to the patches; only when asked for, it takes minutes
//!
//! Shapes made here: demo, torus. With `PLANISH_DATA` naming a folder of truth meshes also its meshes. Arguments: shapes
//! (`fandisk,bunny`), noise in percent of the diagonal (`0.1,0.25`), kinds (`even,outliers`). Distances in percent of the
//! diagonal, angles in degrees; the zone is within 1 % of a true edge above 40 degrees. Writes
//! `bench/runs/<date>-<machine>-cloud.json`.

#![allow(clippy::print_stdout)] // a bench tells its figures on the terminal

#[path = "record/mod.rs"]
mod record;

use glam::DVec3;
use planish::Silent;
use planish::cloud::{self, CleanParams, Cloud};
use planish::contour::ContourParams;
use planish::geom::{Bvh, KdTree, random};
use planish::mesh::{Adjacency, TriMesh, diagnose, sharp_edges};
use planish::pipeline::{self, ScanParams, mesh_scan};
use planish::synthetic::{self, ScannerParams, shapes, virtual_scan};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::time::Instant;

const POINTS: u64 = 100_000;
const SAMPLES: u64 = 100_000;

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
            println!("skipped: {name} is no shape of ours and PLANISH_DATA does not have it");
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
            let points = even(&part, n, 0.001 * part.bounds().diagonal(), 1);
            let start = Instant::now();
            let samples =
                cloud::clean(&Cloud::new(points), &CleanParams::default(), &Silent).expect("a part is a surface");
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
        "even" | "outliers" | "missing" | "handover" => even(mesh, POINTS, noise * bounds.diagonal(), 1),
        "scanner" => {
            let params = ScannerParams { points: POINTS as usize, noise, ..ScannerParams::default() };
            return virtual_scan(mesh, &params, &Silent).ok().map(|s| s.cloud);
        }
        _ => {
            println!("skipped: there is no kind {kind}");
            return None;
        }
    };
    if kind == "outliers" {
        points.extend((0..POINTS / 50).map(|i| {
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
        _ => truth(&format!("{}/{name}.ply", std::env::var("PLANISH_DATA").ok()?)),
    }
}

/// A truth mesh: binary little-endian PLY with vertices of three numbers and triangles.
fn truth(path: &str) -> Option<TriMesh> {
    let bytes = std::fs::read(path).ok()?;
    let end = bytes.windows(11).position(|w| w == b"end_header\n")? + 11;
    let head = String::from_utf8_lossy(&bytes[..end]).into_owned();
    let count = |what: &str| -> Option<usize> {
        head.lines().find_map(|l| l.strip_prefix(&format!("element {what} "))?.trim().parse().ok())
    };
    let double = head.lines().any(|l| l == "property double x" || l == "property float64 x");
    let (size, vertices) = (if double { 8 } else { 4 }, count("vertex")?);
    let number = |at: usize| {
        if double {
            f64::from_le_bytes(bytes[at..at + 8].try_into().expect("8 bytes"))
        } else {
            f32::from_le_bytes(bytes[at..at + 4].try_into().expect("4 bytes")) as f64
        }
    };
    let points =
        (0..vertices).map(|v| DVec3::from_array([0, 1, 2].map(|k| number(end + (3 * v + k) * size)))).collect();
    let faces = end + 3 * vertices * size;
    let corner = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().expect("4 bytes"));
    let triangles = (0..count("face")?).map(|f| [1, 5, 9].map(|k| corner(faces + 13 * f + k))).collect();
    Some(TriMesh::new(points, triangles))
}

/// The place on a surface where a share of its area lies before it.
fn pick(mesh: &TriMesh, sums: &[f64], r: [f64; 3]) -> (DVec3, DVec3) {
    let t = sums.partition_point(|&s| s <= r[0] * sums[sums.len() - 1]).min(sums.len() - 1);
    let [a, b, c] = mesh.corners(t);
    let q = r[1].sqrt();
    (a * (1.0 - q) + b * (q * (1.0 - r[2])) + c * (q * r[2]), mesh.normal(t))
}

fn areas(mesh: &TriMesh) -> Vec<f64> {
    let mut total = 0.0;
    (0..mesh.triangles.len())
        .map(|t| {
            total += mesh.area(t);
            total
        })
        .collect()
}

/// Points evenly by area with normal noise in all directions.
fn even(mesh: &TriMesh, count: u64, noise: f64, seed: u64) -> Vec<DVec3> {
    let sums = areas(mesh);
    (0..count)
        .map(|i| {
            let r: [f64; 9] = std::array::from_fn(|k| random::unit(seed, 9 * i + k as u64));
            let g = random::normal;
            pick(mesh, &sums, [r[0], r[1], r[2]]).0 + noise * DVec3::new(g(r[3], r[4]), g(r[5], r[6]), g(r[7], r[8]))
        })
        .collect()
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
    let edges = edge_points(mesh, diagonal);
    let both: Vec<(f64, f64, bool)> =
        [distances(mesh, got, &edges, diagonal), distances(got, mesh, &edges, diagonal)].concat();
    let zone: Vec<_> = both.iter().filter(|r| r.2).copied().collect();
    let rms = |v: &[(f64, f64, bool)]| (v.iter().map(|r| r.0 * r.0).sum::<f64>() / v.len().max(1) as f64).sqrt();
    let mean = |v: &[(f64, f64, bool)], of: fn(&(f64, f64, bool)) -> f64| {
        v.iter().map(of).sum::<f64>() / v.len().max(1) as f64
    };
    let facts = diagnose(got);
    let tree = Bvh::new(mesh);
    let wrong = made.samples.samples.iter().filter(|s| {
        let n = mesh.normal(tree.closest(s.center).place.face as usize);
        // Beside an edge the closest place may be on the other face.
        s.normal.dot(n) < -0.5
    });
    let mut found: BTreeMap<&'static str, f64> = [
        ("seconds", seconds),
        ("noise", 100.0 * made.samples.noise / diagonal),
        ("samples", made.samples.samples.len() as f64),
        ("wrong_share", wrong.count() as f64 / made.samples.samples.len() as f64),
        ("rms", rms(&both)),
        ("mean", mean(&both, |r| r.0)),
        ("max", both.iter().map(|r| r.0).fold(0.0, f64::max)),
        ("normal_deg", mean(&both, |r| r.1)),
        ("zone_rms", rms(&zone)),
        ("zone_normal_deg", mean(&zone, |r| r.1)),
        ("closed", f64::from(u8::from(facts.watertight && facts.manifold))),
        ("components", facts.components as f64),
        ("genus", facts.genus.map_or(f64::NAN, |g| g as f64)),
    ]
    .into();
    if kind == "handover" {
        let start = Instant::now();
        let tags = &made.meshed.extracted.tags;
        let params = pipeline::params_for(&made);
        match pipeline::fit(got, Some(tags), None, &params, &Silent) {
            Ok(fitted) => {
                // A tenth of a percent, at noise above that two tenths.
                let within = if level > 0.15 { 2e-3 } else { 1e-3 } * diagonal;
                let edges = pipeline::edges_found(mesh, &fitted.model, within);
                found.extend([
                    ("fit_seconds", start.elapsed().as_secs_f64()),
                    ("patches", fitted.model.network.patches.len() as f64),
                    ("folds", fitted.quality.get("grid.folds").map_or(f64::NAN, |f| f.value())),
                    ("edges_found", edges.found),
                    ("edges_met", edges.met),
                    ("edges_false", edges.false_share),
                ]);
            }
            Err(e) => println!("no patches: {e}"),
        }
    }
    Some(found)
}

/// Places on the sharp edges of the truth.
fn edge_points(mesh: &TriMesh, diagonal: f64) -> KdTree {
    let sharp = sharp_edges(mesh, &Adjacency::new(mesh), 40.0);
    let mut points = Vec::new();
    for (h, _) in sharp.iter().enumerate().filter(|s| *s.1) {
        let t = mesh.triangles[h / 3];
        let (a, b) = (mesh.points[t[h % 3] as usize], mesh.points[t[(h % 3 + 1) % 3] as usize]);
        let n = ((b - a).length() / (0.002 * diagonal)).ceil() as usize;
        points.extend((0..=n).map(|k| a + (b - a) * (k as f64 / n.max(1) as f64)));
    }
    KdTree::new(&points)
}

/// Distance (percent), angle (degrees) and whether in the zone, of samples of one surface against the other.
fn distances(from: &TriMesh, to: &TriMesh, edges: &KdTree, diagonal: f64) -> Vec<(f64, f64, bool)> {
    let (bvh, sums) = (Bvh::new(to), areas(from));
    (0..SAMPLES)
        .into_par_iter()
        .map(|i| {
            let (p, n) = pick(from, &sums, [0, 1, 2].map(|k| random::unit(77, 3 * i + k)));
            let hit = bvh.closest(p);
            let m = to.normal(hit.place.face as usize);
            let mut near = Vec::new();
            edges.nearest_within(p, 1, 0.01 * diagonal, &mut near);
            (100.0 * hit.distance / diagonal, n.cross(m).length().atan2(n.dot(m)).to_degrees(), !near.is_empty())
        })
        .collect()
}
