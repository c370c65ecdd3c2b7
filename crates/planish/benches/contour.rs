//! Extraction: quality on measured meshes, and times.

#![allow(clippy::print_stderr)] // a bench tells its figures on the terminal

#[path = "../tests/common/mod.rs"]
mod common;
#[path = "../tests/common/zone.rs"]
mod zone;

use planish::Silent;
use planish::contour::{self, ContourParams};
use planish::field::{Lattice, MeshField, Spacing};
use planish::mesh::{diagnose, self_intersections};
use std::time::Instant;

fn main() {
    let names: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let (name, n) = match &names[..] {
        [name, n] => (name.as_str(), n.parse().unwrap()),
        _ => ("fandisk", 65),
    };
    let Some(mesh) = common::data_mesh(&format!("{name}.ply")) else { return };
    for plain in [true, false] {
        let t0 = Instant::now();
        let field = MeshField::new(&mesh).unwrap();
        let lattice = Lattice::around(&field.bounds(), Spacing::Resolution(n)).unwrap();
        let directed = field.sample(&lattice, &Silent).unwrap();
        let creases = field.creases(&lattice, 0.9);
        let t1 = Instant::now();
        let params = ContourParams { plain, ..Default::default() };
        let found = contour::extract(&directed, Some(&creases), &params, &Silent).unwrap();
        let t2 = Instant::now();
        let d = diagnose(&found.mesh);
        eprintln!(
            "{name} {n} plain {plain}: field {:.4} extract {:.4} s, {} triangles, {:?}, mended {}",
            (t1 - t0).as_secs_f64(),
            (t2 - t1).as_secs_f64(),
            d.triangles,
            found.counts,
            directed.mended
        );
        eprintln!(
            "  watertight {} manifold {} genus {:?} degenerate {} components {} self {}",
            d.watertight,
            d.manifold,
            d.genus,
            d.degenerate_faces,
            d.components,
            self_intersections(&found.mesh).len()
        );
        eprintln!("  {:?}", zone::measure(&mesh, &found.mesh, lattice.step.x));
    }
}
