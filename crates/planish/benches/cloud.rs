//! bench
#![allow(missing_docs)]
use glam::DVec3;
use planish::geom::{Aabb, random};
use planish::mesh::TriMesh;

pub fn read_ply(path: &str) -> TriMesh {
    let bytes = std::fs::read(path).unwrap();
    let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let head = String::from_utf8_lossy(&bytes[..end]).to_string();
    let mut nv = 0; let mut nf = 0; let mut double = false; let mut props = 0; let mut inv = false;
    let mut facekind = String::new();
    for l in head.lines() {
        let w: Vec<&str> = l.split_whitespace().collect();
        if l.starts_with("element vertex") { nv = w[2].parse().unwrap(); inv = true; }
        else if l.starts_with("element face") { nf = w[2].parse().unwrap(); inv = false; }
        else if l.starts_with("property list") { facekind = format!("{} {}", w[2], w[3]); }
        else if l.starts_with("property") && inv { props += 1; if w[1] == "double" || w[1] == "float64" { double = true; } }
    }
    let _ = (props, facekind);
    let mut at = end; let mut points = Vec::new();
    for _ in 0..nv {
        let mut c = [0.0; 3];
        for k in 0..3 { if double { c[k] = f64::from_le_bytes(bytes[at..at+8].try_into().unwrap()); at += 8; } else { c[k] = f32::from_le_bytes(bytes[at..at+4].try_into().unwrap()) as f64; at += 4; } }
        points.push(DVec3::from_array(c));
    }
    let mut tris = Vec::new();
    for _ in 0..nf { at += 1; let mut t = [0; 3]; for k in 0..3 { t[k] = u32::from_le_bytes(bytes[at..at+4].try_into().unwrap()); at += 4; } tris.push(t); }
    assert_eq!(at, bytes.len());
    TriMesh::new(points, tris)
}

pub fn sample(mesh: &TriMesh, n: usize, noise: f64, seed: u64) -> Vec<DVec3> {
    let mut sums = Vec::new(); let mut total = 0.0;
    for t in 0..mesh.triangles.len() { total += mesh.area(t); sums.push(total); }
    (0..n as u64).map(|i| {
        let r: [f64; 9] = std::array::from_fn(|k| random::unit(seed, 9 * i + k as u64));
        let t = sums.partition_point(|&s| s <= r[0] * total).min(sums.len() - 1);
        let [a, b, c] = mesh.corners(t);
        let q = r[1].sqrt();
        let p = a * (1.0 - q) + b * (q * (1.0 - r[2])) + c * (q * r[2]);
        let g = |u: f64, v: f64| (-2.0 * (1.0 - u).ln()).sqrt() * (std::f64::consts::TAU * v).cos();
        p + noise * DVec3::new(g(r[3], r[4]), g(r[5], r[6]), g(r[7], r[8]))
    }).collect()
}

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let data = std::env::var("PLANISH_DATA").unwrap();
    let names: Vec<&str> = args[1].split(',').collect();
    let levels: Vec<f64> = args[2].split(',').map(|x| x.parse().unwrap()).collect();
    let n: usize = args.get(3).map_or(100_000, |x| x.parse().unwrap_or(100_000));
    for name in &names {
        let mesh = if *name == "sphere" { planish::mesh::shapes::sphere(1.0, 6) } else { read_ply(&format!("{data}/{name}.ply")) };
        let diag = Aabb::of(&mesh.points).diagonal();
        for &l in &levels {
            println!("== {name} {l} %: diag {diag} sigma {}", l / 100.0 * diag);
            let points = sample(&mesh, n, l / 100.0 * diag, 1);
            let t = std::time::Instant::now();
            let out = planish::cloud::probe(&points);
            println!("   {:?}", t.elapsed());
            measure(&mesh, &out.0, diag);
            let bvh = planish::geom::Bvh::new(&mesh);
            let mut rows: Vec<(f64, f64, f64, f64, f64, u8)> = out.1.iter().map(|f| { let h = bvh.closest(f.0); (h.distance / diag * 100.0, f.1.dot(mesh.normal(h.place.face as usize)).abs().min(1.0).acos().to_degrees(), f.2 / diag * 100.0, f.3 / diag * 100.0, f.4 / diag * 100.0, f.5) }).collect();
            rows.sort_by(|a, b| a.0.total_cmp(&b.0));
            for q in [0.1, 0.25, 0.5, 0.75, 0.9, 0.95, 0.98, 0.99, 1.0] { println!("   fit {q}: dist/normal/R/noise/err/class {:.4?}", rows[(q * (rows.len() - 1) as f64) as usize]); }
            println!("   fits rms {:.4}", (rows.iter().map(|r| r.0 * r.0).sum::<f64>() / rows.len() as f64).sqrt());
        }
    }
}

fn measure(mesh: &TriMesh, out: &[(DVec3, DVec3, u8)], diag: f64) {
    let bvh = planish::geom::Bvh::new(mesh);
    let adj = planish::mesh::Adjacency::new(mesh);
    let sharp = planish::mesh::sharp_edges(mesh, &adj, 40.0);
    let mut edge_points = Vec::new();
    for (e, _) in sharp.iter().enumerate().filter(|s| *s.1) {
        let h = e;
        let t = mesh.triangles[h / 3];
        let (a, b) = (mesh.points[t[h % 3] as usize], mesh.points[t[(h % 3 + 1) % 3] as usize]);
        let n = ((b - a).length() / (diag * 0.002)).ceil() as usize;
        for k in 0..=n { edge_points.push(a + (b - a) * (k as f64 / n as f64)); }
    }
    let tree = planish::geom::KdTree::new(&edge_points);
    use rayon::prelude::*;
    let rows: Vec<(f64, f64, bool, u8)> = out.par_iter().map(|(p, n, s)| {
        let h = bvh.closest(*p);
        let m = mesh.normal(h.place.face as usize);
        let mut f = Vec::new();
        tree.nearest_within(h.position, 1, diag * 0.01, &mut f);
        (h.distance / diag * 100.0, n.dot(m).abs().min(1.0).acos().to_degrees(), !f.is_empty(), *s)
    }).collect();
    let stat = |f: &dyn Fn(&&(f64, f64, bool, u8)) -> bool| {
        let v: Vec<_> = rows.iter().filter(f).collect();
        let n = v.len().max(1) as f64;
        (v.len(), (v.iter().map(|r| r.0 * r.0).sum::<f64>() / n).sqrt(), v.iter().map(|r| r.1).sum::<f64>() / n, v.iter().map(|r| r.0).fold(0.0, f64::max))
    };
    for (name, r) in [("all", stat(&|_| true)), ("zone", stat(&|r| r.2)), ("rest", stat(&|r| !r.2)), ("multi", stat(&|r| r.3 > 1)), ("single in zone", stat(&|r| r.2 && r.3 == 1))] {
        println!("   {name:15} n {:6} rms {:.4} normal {:.2} max {:.3}", r.0, r.1, r.2, r.3);
    }
}
