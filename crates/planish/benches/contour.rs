//! Extraction against the figures that it is to reach: quality on measured meshes, and times.
//!
//! * `contour/plain|sharp/<mesh>_<n>` - field and extraction, with the zone around sharp edges
//! * `guarantee/<mesh>_<n>` - every closed mesh at 65, 129 and 257 cells, plain and sharp: what is not as promised
//! * `contour/grid_plain/sphere_257` - a dense scalar grid, cells per second
//! * `decimate/ratio_0.1/<mesh>`, `smooth/noise_0.1%/fandisk`
//! * `milling/513/10000_moves`
//!
//! Meshes that are not there are skipped. Arguments choose by parts of ids. Writes what it measured to
//! `bench/runs/<date>-<machine>-contour.json`: seconds of wall clock, distances in percent of the diagonal, degrees.

#![allow(clippy::print_stderr)] // a bench tells its figures on the terminal

#[path = "../tests/common/mod.rs"]
mod common;
#[path = "record/mod.rs"]
mod record;
#[path = "../tests/common/zone.rs"]
mod zone;

use planish::contour::{self, ContourParams};
use planish::field::{GridParams, Lattice, MeshField, Milling, Move, ScalarGrid, Spacing, Tool, sample_grid};
use planish::geom::Aabb;
use planish::geom::random;
use planish::mesh::{
    CompareParams, DecimateParams, SmoothParams, TriMesh, compare, decimate, diagnose, self_intersections, smooth,
};
use planish::{DVec3, Silent};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

/// Times are the least of so many rounds: what others do on the machine only ever adds.
const ROUNDS: usize = 5;

type Figures = BTreeMap<String, BTreeMap<&'static str, f64>>;

fn main() {
    let mut figures = Figures::new();
    let only: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let wanted = |id: &str| only.is_empty() || only.iter().any(|o| id.contains(o.as_str()));
    for (name, n) in [
        ("fandisk", 65),
        ("fandisk", 129),
        ("joint", 65),
        ("sharp_sphere", 65),
        ("casting", 129),
        ("armadillo", 257),
        ("turbine_blade", 257),
    ] {
        if wanted(&format!("contour/{name}_{n}")) {
            mesh(name, n, &mut figures);
        }
    }
    for name in CLOSED {
        for n in [65, 129, 257].into_iter().filter(|n| wanted(&format!("guarantee/{name}_{n}"))) {
            guarantee(name, n, &mut figures);
        }
    }
    if wanted("contour/grid_plain/sphere_257") {
        grid(&mut figures);
    }
    if wanted("decimate/ratio_0.1/turbine_blade") {
        decimation("turbine_blade", common::data_mesh("turbine_blade.ply"), &mut figures);
    }
    if wanted("decimate/ratio_0.1/armadillo_346k") {
        decimation("armadillo_346k", dense_armadillo(), &mut figures);
    }
    if wanted("smooth") {
        smoothing(&mut figures);
    }
    if wanted("milling/513/10000_moves") {
        milling(&mut figures);
    }
    record::write("contour", &figures);
}

fn least<T>(mut work: impl FnMut() -> T) -> (T, f64) {
    let mut best = f64::INFINITY;
    let mut result = None;
    for _ in 0..ROUNDS {
        let start = Instant::now();
        result = Some(work());
        best = best.min(start.elapsed().as_secs_f64());
    }
    (result.expect("at least one round"), best)
}

fn mesh(name: &str, n: usize, figures: &mut Figures) {
    let Some(mesh) = common::data_mesh(&format!("{name}.ply")) else { return };
    let ((field, lattice, creases), fill) = least(|| {
        let field = MeshField::new(&mesh).expect("a sound mesh");
        let lattice = Lattice::around(&field.bounds(), Spacing::Resolution(n)).expect("a lattice");
        let directed = field.sample(&lattice, &Silent).expect("not cancelled");
        (directed, lattice, field.creases(&lattice, 0.9))
    });
    for plain in [true, false] {
        let params = ContourParams { plain, ..Default::default() };
        let (found, seconds) = least(|| contour::extract(&field, Some(&creases), &params, &Silent).expect("a surface"));
        let d = diagnose(&found.mesh);
        let kind = if plain { "plain" } else { "sharp" };
        let z = zone::measure(&mesh, &found.mesh, lattice.step.x);
        eprintln!(
            "contour/{kind}/{name}_{n}: field {fill:.4} s, extraction {seconds:.4} s, {} triangles, {:?}",
            d.triangles, found.counts
        );
        eprintln!(
            "    zone {:.3} deg ({:.3} % beyond 30), edges rms {:.4} max {:.4} %, surface rms {:.4} max {:.4} %",
            z.normal_deg, z.off_30, z.edge_rms, z.edge_max, z.rms, z.max
        );
        eprintln!(
            "    watertight {} manifold {} genus {:?} degenerate {} self-intersections {}",
            d.watertight,
            d.manifold,
            d.genus,
            d.degenerate_faces,
            self_intersections(&found.mesh).len()
        );
        let own = [
            ("field_s", fill),
            ("extraction_s", seconds),
            ("triangles", d.triangles as f64),
            ("zone_deg", z.normal_deg),
            ("zone_beyond_30_percent", z.off_30),
            ("edge_rms_percent", z.edge_rms),
            ("edge_max_percent", z.edge_max),
            ("surface_rms_percent", z.rms),
            ("surface_max_percent", z.max),
            ("degenerate", d.degenerate_faces as f64),
            ("self_intersections", self_intersections(&found.mesh).len() as f64),
        ];
        figures.insert(format!("contour/{kind}/{name}_{n}"), own.into());
    }
}

/// The measured meshes that are closed.
const CLOSED: [&str; 13] = [
    "acute_wedge_15",
    "armadillo",
    "casting",
    "fandisk",
    "gargoyle",
    "goathead",
    "horse",
    "joint",
    "rocker_arm",
    "sharp_sphere",
    "sword",
    "thin_sheet",
    "turbine_blade",
];

/// Counts what must not be: open, unmanifold, turned, without area, meeting. Pieces and genus tell of thin walls.
fn guarantee(name: &str, n: usize, figures: &mut Figures) {
    let Some(mesh) = common::data_mesh(&format!("{name}.ply")) else { return };
    let sampling = contour::Sampling { spacing: Spacing::Resolution(n), memory: 8 << 30 };
    let whole = diagnose(&mesh);
    for plain in [true, false] {
        let params = ContourParams { plain, ..Default::default() };
        let made = contour::from_mesh(&mesh, sampling, &params, &Silent).expect("a surface").extracted.mesh;
        let d = diagnose(&made);
        let meeting = self_intersections(&made).len();
        let wrong = [!d.watertight, !d.manifold, d.flipped_faces > 0, d.degenerate_faces > 0, meeting > 0];
        let wrong = wrong.into_iter().filter(|w| *w).count();
        let kind = if plain { "plain" } else { "sharp" };
        eprintln!(
            "guarantee/{name}_{n} {kind}: {wrong} wrong; watertight {} manifold {} degenerate {} meeting {meeting}; \
             pieces {} of {}, genus {:?} of {:?}",
            d.watertight, d.manifold, d.degenerate_faces, d.components, whole.components, d.genus, whole.genus
        );
        let own = [("wrong", wrong as f64), ("triangles", d.triangles as f64), ("pieces", d.components as f64)];
        figures.insert(format!("guarantee/{name}_{n}/{kind}"), own.into());
    }
}

fn grid(figures: &mut Figures) {
    let n = 258;
    let at = |i: usize| i as f64 / (n - 1) as f64 * 2.4 - 1.2;
    let values = (0..n * n * n).map(|v| {
        let p = DVec3::new(at(v % n), at(v / n % n), at(v / n / n));
        (p.length() - 1.0 + 0.02 * (9.0 * p.x).sin() * (8.0 * p.y).cos()) as f32
    });
    let grid =
        ScalarGrid { size: [n; 3], origin: DVec3::ZERO, spacing: DVec3::ONE, values: Arc::new(values.collect()) };
    let params = GridParams { close: false, ..Default::default() };
    let (field, fill) = least(|| sample_grid(&grid, &params, &Silent).expect("a volume"));
    for plain in [true, false] {
        let params = ContourParams { plain, ..Default::default() };
        let (found, seconds) = least(|| contour::extract(&field, None, &params, &Silent).expect("a surface"));
        let cells = ((n - 1) as f64).powi(3) / 1e6;
        eprintln!(
            "contour/grid_{}/sphere_257: hits {fill:.4} s, extraction {seconds:.4} s, together {:.0} Mcells/s, {} triangles",
            if plain { "plain" } else { "sharp" },
            cells / (fill + seconds),
            found.mesh.triangles.len()
        );
        let id = format!("contour/grid_{}/sphere_257", if params.plain { "plain" } else { "sharp" });
        figures.insert(
            id,
            [("hits_s", fill), ("extraction_s", seconds), ("mcells_per_s", cells / (fill + seconds))].into(),
        );
    }
}

/// The Armadillo, extracted plain with so many cells that it has 346 742 triangles.
fn dense_armadillo() -> Option<TriMesh> {
    let mesh = common::data_mesh("armadillo.ply")?;
    let sampling = contour::Sampling { spacing: Spacing::Resolution(266), memory: 8 << 30 };
    let params = ContourParams { plain: true, ..Default::default() };
    Some(contour::from_mesh(&mesh, sampling, &params, &Silent).expect("a surface").extracted.mesh)
}

fn decimation(name: &str, mesh: Option<TriMesh>, figures: &mut Figures) {
    let Some(mesh) = mesh else { return };
    let (found, seconds) = least(|| decimate(&mesh, None, &DecimateParams::default(), &Silent).expect("a manifold"));
    let off = compare(&mesh, &found.mesh, &CompareParams::default(), &Silent).expect("surfaces");
    let d = diagnose(&found.mesh);
    eprintln!(
        "decimate/ratio_0.1/{name}: {seconds:.2} s, {} to {}, rms {:.4} max {:.4} %, manifold {}, self-intersections {}",
        mesh.triangles.len(),
        d.triangles,
        100.0 * off.both_rel.rms,
        100.0 * off.both_rel.max,
        d.manifold,
        found.self_intersections
    );
    figures.insert(
        format!("decimate/ratio_0.1/{name}"),
        [
            ("seconds", seconds),
            ("rms_percent", 100.0 * off.both_rel.rms),
            ("max_percent", 100.0 * off.both_rel.max),
            ("self_intersections", found.self_intersections as f64),
        ]
        .into(),
    );
}

fn smoothing(figures: &mut Figures) {
    let Some(mesh) = common::data_mesh("fandisk.ply") else { return };
    let size = 0.001 * mesh.bounds().diagonal();
    let mut rough = mesh.clone();
    for (v, (p, n)) in rough.points.iter_mut().zip(mesh.vertex_normals()).enumerate() {
        // The sum of twelve uniform numbers is nearly normal.
        *p += n * size * ((0..12).map(|k| random::unit(4, 12 * v as u64 + k)).sum::<f64>() - 6.0);
    }
    let (found, seconds) = least(|| smooth(&rough, None, &SmoothParams::default(), &Silent).expect("a sound mesh"));
    for (what, m) in [("rough", &rough), ("smooth", &found.mesh)] {
        let z = zone::measure(&mesh, m, 0.01 * mesh.bounds().diagonal() / 1.5);
        eprintln!(
            "smooth/noise_0.1%/fandisk {what}: {seconds:.2} s, rms {:.4} %, zone {:.2} deg, noise taken for {:.3} % , self-intersections {}",
            z.rms,
            z.normal_deg,
            100.0 * found.noise / mesh.bounds().diagonal(),
            self_intersections(m).len()
        );
        figures.insert(
            format!("smooth/noise_0.1_percent/fandisk/{what}"),
            [("seconds", seconds), ("rms_percent", z.rms), ("zone_deg", z.normal_deg)].into(),
        );
    }
}

/// A stock of 513 cells, a ball-ended tool in 10 000 short sloped moves over it.
fn milling(figures: &mut Figures) {
    let stock = Aabb { min: DVec3::new(0.0, 0.0, -20.0), max: DVec3::new(100.0, 100.0, 0.0) };
    let at = |k: usize| {
        let (row, column) = (k / 100, k % 100);
        let column = if row % 2 == 0 { column } else { 99 - column };
        let (x, y) = (column as f64 + 0.5, row as f64 + 0.5);
        DVec3::new(x, y, -6.0 + 4.0 * (0.11 * x).sin() * (0.13 * y).cos())
    };
    let moves = (0..10_000).map(|k| Move { from: at(k), to: at(k + 1), tool: 0 }).collect();
    let start = Instant::now();
    let job = Milling::new(stock, vec![Tool::Ball { radius: 1.5 }], moves);
    let sampling = contour::Sampling { spacing: Spacing::Resolution(513), memory: 8 << 30 };
    let made = contour::from_field(&job, sampling, &ContourParams::default(), &Silent).expect("a surface");
    let seconds = start.elapsed().as_secs_f64();
    let d = diagnose(&made.extracted.mesh);
    eprintln!("milling/513/10000_moves: {seconds:.2} s, {} triangles, watertight {}", d.triangles, d.watertight);
    figures.insert("milling/513/10000_moves".into(), [("seconds", seconds), ("triangles", d.triangles as f64)].into());
}
