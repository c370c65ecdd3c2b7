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
            let samples = planish::cloud::clean(&planish::cloud::Cloud::new(points.clone()), &Default::default(), &planish::Silent).unwrap();
            println!("   clean {:?} samples {} noise {:.5} spacing {:.5} segs {}", t.elapsed(), samples.samples.len(), samples.noise, samples.spacing, samples.closed.len());
            let bvh = planish::geom::Bvh::new(&mesh);
            let wrong = samples.samples.iter().filter(|f| f.normal.dot(mesh.normal(bvh.closest(f.center).place.face as usize)) < -0.3).count();
            println!("   wrong {:.3} %", 100.0 * wrong as f64 / samples.samples.len() as f64);
            {
                let fc: Vec<DVec3> = (0..mesh.triangles.len()).map(|t| { let [a, b, c] = mesh.corners(t); (a + b + c) / 3.0 }).collect();
                let ft = planish::geom::KdTree::new(&fc);
                let mut table = std::collections::BTreeMap::new();
                for f in &samples.samples {
                    let mut best = 0.0f64; 
                    let h = bvh.closest(f.center);
                    best = best.max(f.normal.dot(mesh.normal(h.place.face as usize)));
                    ft.within(f.center, 0.015 * diag, |i, _, _| best = best.max(f.normal.dot(mesh.normal(i as usize))));
                    let a = best.clamp(-1.0, 1.0).acos().to_degrees();
                    let e = table.entry((f.class, f.sheets.min(3))).or_insert([0usize; 5]);
                    e[0] += 1; if a > 10.0 { e[1] += 1; } if a > 20.0 { e[2] += 1; } if a > 40.0 { e[3] += 1; }
                    if h.distance > 0.004 * diag { e[4] += 1; }
                }
                for (k, v) in table { println!("   class/sheets {k:?}: n {} >10 {} >20 {} >40 {} far {}", v[0], v[1], v[2], v[3], v[4]); }
            }
            let t = std::time::Instant::now();
            let field = planish::field::SampleField::new(&samples, true);
            let step = (samples.spacing * 1.6).max(samples.noise * 1.0);
            let lattice = planish::field::Lattice::around(&planish::field::Field::bounds(&field), planish::field::Spacing::Voxel(step)).unwrap();
            let directed = planish::field::sample(&field, &lattice, &planish::Silent).unwrap();
            let t1 = t.elapsed();
            let out = planish::contour::extract(&directed, None, &Default::default(), &planish::Silent).unwrap();
            println!("   sample {t1:?} all {:?}  cells {:?} step {step:.5} tris {} fallbacks {}", t.elapsed(), lattice.cells, out.mesh.triangles.len(), out.counts.fallbacks);
            let dir = std::env::var("OUTDIR").unwrap_or("/tmp".into());
            write_stl(&out.mesh, &format!("{dir}/{name}_{l}.stl"));
            measure(&mesh, &out.mesh, diag);
        }
    }
}

fn write_stl(m: &TriMesh, path: &str) {
    use planish::render::*;
    let cam = Camera::around(&m.points, DVec3::new(1.0, -0.6, 0.7), DVec3::Y, 1.0);
    let look = Look { crease_deg: 0.0, hollows: 0.5, ..Default::default() };
    let img = render(m, &look, &cam, 900, 900).unwrap();
    let mut b = format!("P6\n900 900\n255\n").into_bytes();
    for p in img.rgba.chunks(4) { b.extend(&p[..3]); }
    std::fs::write(path.replace(".stl", ".ppm"), b).unwrap();
}

fn measure(truth: &TriMesh, got: &TriMesh, diag: f64) {
    use rayon::prelude::*;
    let adj = planish::mesh::Adjacency::new(truth);
    let sharp = planish::mesh::sharp_edges(truth, &adj, 40.0);
    let mut edge_points = Vec::new();
    for (h, _) in sharp.iter().enumerate().filter(|s| *s.1) {
        let t = truth.triangles[h / 3];
        let (a, b) = (truth.points[t[h % 3] as usize], truth.points[t[(h % 3 + 1) % 3] as usize]);
        let n = ((b - a).length() / (diag * 0.002)).ceil() as usize;
        for k in 0..=n { edge_points.push(a + (b - a) * (k as f64 / n as f64)); }
    }
    let tree = planish::geom::KdTree::new(&edge_points);
    let run = |from: &TriMesh, to: &TriMesh| -> Vec<(f64, f64, bool)> {
        let bvh = planish::geom::Bvh::new(to);
        let mut sums = Vec::new(); let mut total = 0.0;
        for t in 0..from.triangles.len() { total += from.area(t); sums.push(total); }
        (0..60000u64).into_par_iter().map(|i| {
            let r: [f64; 3] = std::array::from_fn(|k| random::unit(77, 3 * i + k as u64));
            let t = sums.partition_point(|&s| s <= r[0] * total).min(sums.len() - 1);
            let [a, b, c] = from.corners(t);
            let q = r[1].sqrt();
            let p = a * (1.0 - q) + b * (q * (1.0 - r[2])) + c * (q * r[2]);
            let h = bvh.closest(p);
            let mut f = Vec::new();
            tree.nearest_within(p, 1, diag * 0.01, &mut f);
            (h.distance / diag * 100.0, from.normal(t).dot(to.normal(h.place.face as usize)).clamp(-1.0, 1.0).acos().to_degrees(), !f.is_empty())
        }).collect()
    };
    let ab = run(truth, got);
    let ba = run(got, truth);
    let all: Vec<_> = ab.iter().chain(&ba).collect();
    let stat = |v: &[&(f64, f64, bool)]| { let n = v.len().max(1) as f64; ((v.iter().map(|r| r.0 * r.0).sum::<f64>() / n).sqrt(), v.iter().map(|r| r.0).sum::<f64>() / n, v.iter().map(|r| r.1).sum::<f64>() / n, v.iter().map(|r| r.0).fold(0.0, f64::max)) };
    let zone: Vec<_> = all.iter().filter(|r| r.2).copied().collect();
    let rest: Vec<_> = all.iter().filter(|r| !r.2).copied().collect();
    let d = planish::mesh::diagnose(got);
    println!("   all  rms {:.4} mean {:.4} normal {:.2} max {:.3}", stat(&all).0, stat(&all).1, stat(&all).2, stat(&all).3);
    println!("   t->g rms {:.4} max {:.3}  g->t rms {:.4} max {:.3}", stat(&ab.iter().collect::<Vec<_>>()).0, stat(&ab.iter().collect::<Vec<_>>()).3, stat(&ba.iter().collect::<Vec<_>>()).0, stat(&ba.iter().collect::<Vec<_>>()).3);
    println!("   zone rms {:.4} mean {:.4} normal {:.2};  rest rms {:.4} normal {:.2}", stat(&zone).0, stat(&zone).1, stat(&zone).2, stat(&rest).0, stat(&rest).2);
    println!("   {d:?}");
}
