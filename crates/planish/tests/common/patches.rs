//! Patches for tests and benches: simple sheets with known geometry, and disks cut from meshes.
#![allow(dead_code)]

use glam::DVec3;
use planish::mesh::{Adjacency, FacePoint, NONE, TriMesh};
use planish::network::PatchMesh;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// A patch that is the whole of its input mesh.
pub struct Sheet {
    pub name: String,
    pub input: TriMesh,
    pub patch: PatchMesh,
}

/// Pseudo-random number in 0..1 of an index (splitmix64).
pub fn noise(index: u64) -> f64 {
    let mut z = index.wrapping_add(0x9E37_79B9_7F4A_7C15).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 30)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

/// A sheet of `nu x nv` vertices at `shape(s, t)` with s, t in 0..1; inner vertices jittered by `jitter` cells,
/// diagonals in irregular order.
pub fn sheet(name: &str, nu: usize, nv: usize, jitter: f64, shape: impl Fn(f64, f64) -> DVec3) -> Sheet {
    let mut points = Vec::new();
    for j in 0..nv {
        for i in 0..nu {
            let inner = i > 0 && j > 0 && i + 1 < nu && j + 1 < nv;
            let k = (j * nu + i) as u64;
            let (di, dj) = if inner { (noise(2 * k) - 0.5, noise(2 * k + 1) - 0.5) } else { (0.0, 0.0) };
            let (s, t) = ((i as f64 + jitter * di) / (nu - 1) as f64, (j as f64 + jitter * dj) / (nv - 1) as f64);
            points.push(shape(s, t));
        }
    }
    let mut triangles = Vec::new();
    for j in 0..nv - 1 {
        for i in 0..nu - 1 {
            let [a, b, c, d] = [j * nu + i, j * nu + i + 1, (j + 1) * nu + i + 1, (j + 1) * nu + i].map(|v| v as u32);
            if noise(a as u64 + 77) < 0.5 {
                triangles.extend([[a, b, c], [a, c, d]]);
            } else {
                triangles.extend([[a, b, d], [b, c, d]]);
            }
        }
    }
    let corners = [0, nu - 1, nu * nv - 1, nu * (nv - 1)].map(|v| v as u32);
    let input = TriMesh::new(points, triangles);
    let all: Vec<u32> = (0..input.triangles.len() as u32).collect();
    let patch = cut(&input, &all, corners);
    Sheet { name: name.into(), input, patch }
}

/// Cuts the disk of `faces` out of `input`; `corners` are vertices of its boundary, counter-clockwise.
pub fn cut(input: &TriMesh, faces: &[u32], corners: [u32; 4]) -> PatchMesh {
    let mut local = vec![NONE; input.points.len()];
    let (mut points, mut origin, mut triangles) = (Vec::new(), Vec::new(), Vec::new());
    for &f in faces {
        triangles.push(std::array::from_fn(|k| {
            let v = input.triangles[f as usize][k] as usize;
            if local[v] == NONE {
                local[v] = points.len() as u32;
                points.push(input.points[v]);
                origin.push(FacePoint::corner(f, k));
            }
            local[v]
        }));
    }
    let mesh = TriMesh::new(points, triangles);
    let adjacency = Adjacency::new(&mesh);
    let corners = corners.map(|v| local[v as usize]);
    let sides = [0, 1, 2, 3].map(|k| {
        let mut chain = vec![corners[k]];
        while *chain.last().unwrap() != corners[(k + 1) % 4] || chain.len() == 1 {
            let h = adjacency.outgoing[*chain.last().unwrap() as usize] as usize;
            chain.push(mesh.triangles[h / 3][(h % 3 + 1) % 3]);
            assert!(chain.len() <= mesh.points.len() + 1, "corners lie on the boundary");
        }
        chain
    });
    PatchMesh { mesh, origin, face_origin: faces.to_vec(), sides }
}

/// The shape of a snout: a round-ended cylinder with a fillet, rising from the square [-1, 1]², leaning over.
#[derive(Clone, Copy)]
pub struct Snout {
    pub radius: f64,
    pub height: f64,
    pub lean: f64,
    pub center: [f64; 2],
}

impl Snout {
    /// A sheet of n x n vertices, spread evenly over the area around the snout.
    pub fn sheet(&self, name: &str, n: usize) -> Sheet {
        let (a, fillet, rim) = (self.radius, 0.4 * self.radius, 0.72);
        let wall = (self.height - a - fillet).max(0.0);
        let lengths = [a * FRAC_PI_2, wall, fillet * FRAC_PI_2, rim - a - fillet];
        let base = fillet + wall;
        // Radius and height of the profile at arc length s from the tip.
        let profile = |s: f64| {
            let mut s = s;
            if s < lengths[0] {
                return (a * (s / a).sin(), base + a * (s / a).cos());
            }
            s -= lengths[0];
            if s < lengths[1] {
                return (a, base - s);
            }
            s -= lengths[1];
            if s < lengths[2] {
                let f = s / fillet;
                return (a + fillet * (1.0 - f.cos()), fillet * (1.0 - f.sin()));
            }
            (a + fillet + s - lengths[2], 0.0)
        };
        let total: f64 = lengths.iter().sum();
        let steps = 4000;
        let mut areas = vec![0.0];
        for k in 0..steps {
            let (r, _) = profile((k as f64 + 0.5) / steps as f64 * total);
            areas.push(areas[k] + TAU * r * total / steps as f64);
        }
        let arc_of = |fraction: f64| {
            let area = fraction * areas[steps];
            let k = areas.partition_point(|x| *x < area).clamp(1, steps);
            (k as f64 - 1.0 + (area - areas[k - 1]) / (areas[k] - areas[k - 1])) / steps as f64 * total
        };
        let lean = self.lean;
        sheet(name, n, n, 0.5, |s, t| {
            let (x, y) = (2.0 * s - 1.0 - self.center[0], 2.0 * t - 1.0 - self.center[1]);
            let r = x.hypot(y);
            if r >= rim || r == 0.0 {
                let z = if r == 0.0 { base + a } else { 0.0 };
                return DVec3::new(x + self.center[0] + lean * z * z, y + self.center[1], z);
            }
            let (radius, z) = profile(arc_of((r / rim) * (r / rim)));
            DVec3::new(x / r * radius + self.center[0] + lean * z * z, y / r * radius + self.center[1], z)
        })
    }
}

/// The hard patches: protruding parts of several heights and widths.
pub fn snouts(n: usize) -> Vec<Sheet> {
    let snout = |radius, height, lean, center| Snout { radius, height, lean, center };
    vec![
        snout(0.25, 0.5, 0.0, [0.0, 0.0]).sheet("snout low", n),
        snout(0.25, 0.8, 0.1, [0.1, 0.05]).sheet("snout middle", n),
        snout(0.18, 0.8, 0.2, [0.15, -0.1]).sheet("snout thin", n),
        snout(0.3, 1.5, 0.1, [0.1, 0.1]).sheet("snout tall", n),
    ]
}

/// Smooth and rough sheets of about n x n vertices.
pub fn sheets(n: usize) -> Vec<Sheet> {
    vec![
        sheet("flat square", n, n, 0.5, |s, t| DVec3::new(s, t, 0.0)),
        sheet("quarter cylinder", n, n, 0.5, |s, t| {
            let a = s * FRAC_PI_2;
            DVec3::new(-a.cos(), 2.0 * t, a.sin())
        }),
        sheet("sixth of a sphere", n, n, 0.5, |s, t| {
            let (a, b) = ((s - 0.5) * FRAC_PI_2, (t - 0.5) * FRAC_PI_2);
            DVec3::new(a.tan(), b.tan(), 1.0).normalize()
        }),
        sheet("saddle", n, n, 0.5, |s, t| {
            let (x, y) = (2.0 * s - 1.0, 2.0 * t - 1.0);
            DVec3::new(x, y, x * x - y * y)
        }),
        sheet("strip 60:1", 4 * n, n / 8 + 2, 0.5, |s, t| DVec3::new(60.0 * s, t, (20.0 * s).sin())),
        sheet("ring sector", n, n, 0.5, |s, t| {
            let (r, a) = (1.0 + s, 1.5 * PI * t);
            DVec3::new(r * a.cos(), r * a.sin(), 0.0)
        }),
        sheet("concave corner", n, n, 0.4, |s, t| {
            // A dart: the corner (1, 1) drawn in past the middle.
            let k = s * t;
            DVec3::new(s - 0.62 * k, t - 0.62 * k, 0.1 * s)
        }),
        sheet("waves", n, n, 0.5, |s, t| DVec3::new(s, t, 0.06 * (19.0 * s).sin() * (23.0 * t).cos())),
        sheet("rough scan", n, n, 0.5, |s, t| {
            let k = ((s * 1e6) as u64) << 24 ^ (t * 1e6) as u64;
            DVec3::new(s, t, 0.1 * (3.0 * s).sin() + 0.3 / n as f64 * noise(k))
        }),
        sheet("slivers 1e-6", n, n, 0.0, |s, t| {
            // One row of cells a million times flatter than the others.
            let h = 1.0 / (n - 1) as f64;
            let a = (n / 2) as f64 * h;
            let t = match t - a {
                x if x < 0.5 * h => t,
                x => a + 1e-6 * h + (x - h) * (1.0 - a - 1e-6 * h) / (1.0 - a - h),
            };
            DVec3::new(s, t, 0.2 * (2.0 * s * t).sin())
        }),
    ]
}

/// Two triangles over four corners.
pub fn two_triangles() -> Sheet {
    sheet("two triangles", 2, 2, 0.0, |s, t| DVec3::new(2.0 * s, t, 0.3 * s * t))
}

/// A square fan whose boundary triangles have two or three vertices on one side: ears that a flat map folds.
pub fn ears() -> Sheet {
    let p = |x: f64, y: f64| DVec3::new(x, y, 0.1 * x * y);
    let points = vec![p(0., 0.), p(1., -0.2), p(2., -0.3), p(3., -0.2), p(4., 0.), p(4., 3.), p(0., 3.)];
    let triangles = vec![[0, 1, 4], [1, 2, 3], [1, 3, 4], [0, 4, 5], [0, 5, 6]];
    let input = TriMesh::new(points, triangles);
    let patch = cut(&input, &[0, 1, 2, 3, 4], [0, 4, 5, 6]);
    Sheet { name: "ears".into(), input, patch }
}

/// A folder of real meshes beside the repository, if there is one.
pub fn data_file(name: &str) -> Option<std::path::PathBuf> {
    let folder = std::env::var("PLANISH_DATA")
        .unwrap_or_else(|_| concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data").into());
    let path = std::path::Path::new(&folder).join(name);
    path.exists().then_some(path)
}

/// Reads a binary little-endian PLY with x, y, z and triangles only.
pub fn read_ply(path: &std::path::Path) -> TriMesh {
    let bytes = std::fs::read(path).expect("a readable file");
    let mark = b"end_header\n";
    let start = bytes.windows(mark.len()).position(|w| w == mark).expect("a PLY header") + mark.len();
    let header = String::from_utf8_lossy(&bytes[..start]).into_owned();
    let count = |what: &str| -> usize {
        let line = header.lines().find(|l| l.starts_with(what)).expect("an element line");
        line.split_whitespace().nth(2).and_then(|n| n.parse().ok()).expect("a count")
    };
    let double = header.contains("property double x") || header.contains("property float64 x");
    let mut at = start;
    let mut points = Vec::new();
    for _ in 0..count("element vertex") {
        let mut xyz = [0.0; 3];
        for x in &mut xyz {
            if double {
                *x = f64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
                at += 8;
            } else {
                *x = f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as f64;
                at += 4;
            }
        }
        points.push(DVec3::from_array(xyz));
    }
    let mut triangles = Vec::new();
    for _ in 0..count("element face") {
        assert_eq!(bytes[at], 3);
        let v = |k: usize| u32::from_le_bytes(bytes[at + 1 + 4 * k..at + 5 + 4 * k].try_into().unwrap());
        triangles.push([v(0), v(1), v(2)]);
        at += 13;
    }
    TriMesh::new(points, triangles)
}

/// The part of `input` around the first corner of face `seed` within a ball of `radius`, cut along the ball's
/// surface; `None` if that part is not a disk. Corners at quarters of its boundary.
pub fn disk(name: &str, input: &TriMesh, seed: u32, radius: f64) -> Option<Sheet> {
    let adjacency = Adjacency::new(input);
    let center = input.points[input.triangles[seed as usize][0] as usize];
    let height: Vec<f64> = input.points.iter().map(|p| p.distance(center) - radius).collect();
    let inside = |v: u32| height[v as usize] < 0.0;
    let mut taken = vec![false; input.triangles.len()];
    let mut stack = vec![seed];
    while let Some(f) = stack.pop() {
        if std::mem::replace(&mut taken[f as usize], true) {
            continue;
        }
        for k in 0..3 {
            let triangle = input.triangles[f as usize];
            let h = adjacency.opposite[3 * f as usize + k];
            if h != NONE && (inside(triangle[k]) || inside(triangle[(k + 1) % 3])) {
                stack.push(h / 3);
            }
        }
    }
    let mut local = std::collections::BTreeMap::new();
    let (mut points, mut origin): (Vec<DVec3>, Vec<FacePoint>) = (vec![], vec![]);
    let (mut triangles, mut face_origin) = (vec![], vec![]);
    for f in (0..input.triangles.len() as u32).filter(|&f| taken[f as usize]) {
        let triangle = input.triangles[f as usize];
        // The polygon of the face inside the ball; every vertex by the ends of its edge, lower first.
        let mut polygon = vec![];
        for k in 0..3 {
            let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
            let mut add = |key: (u32, u32)| {
                let next = local.len() as u32;
                polygon.push(*local.entry(key).or_insert_with(|| {
                    let (p, q) = (input.points[key.0 as usize], input.points[key.1 as usize]);
                    let (s, t) = (height[key.0 as usize], height[key.1 as usize]);
                    let w = if key.0 == key.1 { 0.0 } else { (s / (s - t)).clamp(1e-3, 1.0 - 1e-3) };
                    let mut bary = [0.0; 3];
                    bary[triangle.iter().position(|v| *v == key.0).unwrap()] += 1.0 - w;
                    bary[triangle.iter().position(|v| *v == key.1).unwrap()] += w;
                    points.push(p + (q - p) * w);
                    origin.push(FacePoint { face: f, bary });
                    next
                }));
            };
            if inside(a) {
                add((a, a));
            }
            if inside(a) != inside(b) {
                add((a.min(b), a.max(b)));
            }
        }
        for k in 2..polygon.len() {
            triangles.push([polygon[0], polygon[k - 1], polygon[k]]);
            face_origin.push(f);
        }
    }
    let mesh = TriMesh::new(points, triangles);
    let rim = Adjacency::new(&mesh);
    let open = rim.opposite.iter().filter(|h| **h == NONE).count();
    if mesh.points.len() + mesh.triangles.len() != (rim.opposite.len() + open) / 2 + 1 {
        return None;
    }
    let first = (0..rim.opposite.len()).find(|&h| rim.opposite[h] == NONE)?;
    let mut chain = vec![mesh.triangles[first / 3][first % 3]];
    let mut sums = vec![0.0];
    while chain.len() == 1 || chain.last() != chain.first() {
        let from = *chain.last()?;
        let h = rim.outgoing[from as usize] as usize;
        let to = mesh.triangles[h / 3][(h % 3 + 1) % 3];
        sums.push(sums.last()? + mesh.points[from as usize].distance(mesh.points[to as usize]));
        chain.push(to);
    }
    if chain.len() != open + 1 {
        return None;
    }
    let quarters = [0, 1, 2, 3, 4].map(|k| sums.partition_point(|s| *s < sums[open] * k as f64 / 4.0).min(open));
    let sides = [0, 1, 2, 3].map(|k| chain[quarters[k]..=quarters[k + 1]].to_vec());
    Some(Sheet { name: name.into(), patch: PatchMesh { mesh, origin, face_origin, sides }, input: input.clone() })
}

/// Disks cut from the scans of the data folder, `None` for a scan that is not there: every 17th part of the faces
/// is tried as a centre, with a ball of `reach` of the scan's diagonal.
pub fn scan_disks(reach: f64) -> Vec<(&'static str, Option<Vec<Sheet>>)> {
    let files = ["bunny.ply", "armadillo.ply", "gargoyle.ply", "turbine_blade.ply", "casting.ply", "dragon.ply"];
    let cut = |file: &'static str| {
        let mesh = read_ply(&data_file(file)?);
        let radius = reach * mesh.bounds().diagonal();
        let seeds = (0..16).map(|k| (mesh.triangles.len() * (2 * k + 1) / 34) as u32);
        Some(seeds.filter_map(|seed| disk(&format!("{file} {seed}"), &mesh, seed, radius)).collect())
    };
    files.into_iter().map(|file| (file, cut(file))).collect()
}
