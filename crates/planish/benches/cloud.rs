//! Scans with known truth: times of cleaning and meshing, and how far the mesh is from the truth.
//!
//! * `clean/default/<shape>_<noise>`, `mesh/default/<shape>_<noise>` - seconds of wall clock, 100 000 points
//! * `clean/default/demo_<n>k` - growth with the number of points
//!
//! Shapes made here: the demonstration part, a torus. With `PLANISH_DATA` naming a folder of truth meshes also
//! fandisk, rocker_arm, bunny, gargoyle. Arguments choose shapes (`fandisk,bunny`) and noise in percent of the diagonal
//! (`0.1,0.25`). Prints one line per row: distances in percent of the diagonal, angles in degrees; the zone is within
//! 1 % of a true edge above 40 degrees.

#![allow(clippy::print_stdout)] // a bench tells its figures on the terminal

use glam::DVec3;
use planish::Silent;
use planish::cloud::{self, CleanParams, Cloud};
use planish::contour::ContourParams;
use planish::geom::{Bvh, KdTree, random};
use planish::mesh::{Adjacency, TriMesh, diagnose, shapes, sharp_edges};
use planish::pipeline::{ScanParams, mesh_scan};
use rayon::prelude::*;
use std::time::Instant;

const POINTS: u64 = 100_000;
const SAMPLES: u64 = 100_000;

fn main() {
    let args: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let names: Vec<&str> = args.first().map_or(vec!["demo", "torus"], |a| a.split(',').collect());
    let levels: Vec<f64> =
        args.get(1).map_or(vec![0.1, 0.25], |a| a.split(',').filter_map(|x| x.parse().ok()).collect());
    println!(
        "shape noise  points   clean   mesh  noise_est samples  rms   mean  max  normal zone_rms zone_normal  closed components genus"
    );
    for name in &names {
        let Some(mesh) = shape(name) else {
            println!("skipped: {name} is no shape of ours and PLANISH_DATA does not have it");
            continue;
        };
        for &level in &levels {
            row(name, &mesh, level);
        }
    }
    if args.is_empty() {
        let part = shapes::demo(0, 60_000);
        for n in [25_000, 50_000, 100_000, 200_000] {
            let points = scan(&part, n, 0.001 * part.bounds().diagonal(), 1);
            let start = Instant::now();
            let samples =
                cloud::clean(&Cloud::new(points), &CleanParams::default(), &Silent).expect("a part is a surface");
            println!(
                "clean/default/demo_{}k {:.3} s, {} samples",
                n / 1000,
                start.elapsed().as_secs_f64(),
                samples.samples.len()
            );
        }
    }
}

fn shape(name: &str) -> Option<TriMesh> {
    match name {
        "demo" => Some(shapes::demo(0, 60_000)),
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
fn scan(mesh: &TriMesh, count: u64, noise: f64, seed: u64) -> Vec<DVec3> {
    let sums = areas(mesh);
    (0..count)
        .map(|i| {
            let r: [f64; 9] = std::array::from_fn(|k| random::unit(seed, 9 * i + k as u64));
            let g = |u: f64, v: f64| (-2.0 * (1.0 - u).ln()).sqrt() * (std::f64::consts::TAU * v).cos();
            pick(mesh, &sums, [r[0], r[1], r[2]]).0 + noise * DVec3::new(g(r[3], r[4]), g(r[5], r[6]), g(r[7], r[8]))
        })
        .collect()
}

fn row(name: &str, mesh: &TriMesh, level: f64) {
    let diagonal = mesh.bounds().diagonal();
    let scan = Cloud::new(scan(mesh, POINTS, level / 100.0 * diagonal, 1));
    let start = Instant::now();
    let clean = cloud::clean(&scan, &CleanParams::default(), &Silent);
    let clean_seconds = start.elapsed().as_secs_f64();
    let params = ScanParams {
        clean: CleanParams::default(),
        contour: ContourParams::default(),
        voxel: None,
        resolution: None,
        memory: 4 << 30,
        close: None,
    };
    let start = Instant::now();
    let made =
        clean.map_err(|e| e.to_string()).and_then(|_| mesh_scan(&scan, &params, &Silent).map_err(|e| e.to_string()));
    let seconds = start.elapsed().as_secs_f64();
    let made = match made {
        Ok(made) => made,
        Err(e) => {
            println!("{name} {level} failed: {e}");
            return;
        }
    };
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
    println!(
        "{name} {level} {} {clean_seconds:.2} {seconds:.2} {:.4} {} {:.4} {:.4} {:.3} {:.2} {:.4} {:.2} {} {} {:?}",
        scan.points.len(),
        100.0 * made.samples.noise / diagonal,
        made.samples.samples.len(),
        rms(&both),
        mean(&both, |r| r.0),
        both.iter().map(|r| r.0).fold(0.0, f64::max),
        mean(&both, |r| r.1),
        rms(&zone),
        mean(&zone, |r| r.1),
        facts.watertight && facts.manifold,
        facts.components,
        facts.genus
    );
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
