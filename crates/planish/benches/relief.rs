//! Speed of maps and edits of the relief: `cargo bench --bench relief`.
#![allow(clippy::print_stdout)]

#[path = "../tests/patchworks/mod.rs"]
mod patchworks;
mod record;

use glam::DVec3;
use patchworks::*;
use planish::Silent;
use planish::mesh::TriMesh;
use planish::relief::layers::{self, Ground, Layers, ReliefEdit};
use planish::relief::maps::{self, MapFrame, MapKind, MapParams};
use planish::relief::{self, Displaced, Relief};
use planish::surface::{self, FitParams, Resolution};
use record::time;

fn main() {
    // 100 patches on a torus with waves.
    let shape = |x: f64, y: f64| {
        let (a, b) = (x * std::f64::consts::TAU / 10.0, y * std::f64::consts::TAU / 10.0);
        let r = 2.0 + (0.7 + 0.01 * (60.0 * a).sin() * (40.0 * b).cos()) * b.cos();
        DVec3::new(r * a.cos(), r * a.sin(), 0.7 * b.sin())
    };
    let work = sheet(10, 10, [true, true], [65, 65], shape);
    let params = FitParams {
        resolution: Resolution::Control([8, 8]),
        cells_per_span: 1.0,
        smoothing: 0.0,
        ..FitParams::default()
    };
    let surfaces = surface::fit_network(&work.network, &work.grids, &params, &Silent).unwrap();
    let reliefs: Vec<Relief> = work.grids.iter().zip(&surfaces).map(|(g, s)| relief::bake(g, s).unwrap()).collect();
    let displaced = Displaced { network: &work.network, surfaces: &surfaces, reliefs: &reliefs };
    let mesh = TriMesh::default();
    for (kind, frame, texels) in [
        (MapKind::Vector, MapFrame::Surface, 512),
        (MapKind::Vector, MapFrame::Object, 512),
        (MapKind::Scalar, MapFrame::Surface, 512),
        (MapKind::Normal, MapFrame::Surface, 512),
        (MapKind::Vector, MapFrame::Tangent, 65),
    ] {
        let params = MapParams { kind, frame, texels, ..MapParams::default() };
        let each = time(3, || maps::render(&displaced, &mesh, &params, &Silent).unwrap());
        println!("relief/{}_{frame:?}/100x{texels}x{texels}   {each:8.1} ms", kind.word());
    }
    let split = time(1, || layers::split(&displaced, &[0.3], &Silent).unwrap());
    println!("relief/split/100x65x65   {split:8.1} ms");

    // A stroke of about 2 000 texels on the ground that is ready, with the patches that it touches displaced anew.
    let shapes: Vec<[usize; 2]> = reliefs.iter().map(|r| [r.rows, r.cols]).collect();
    let ground = Ground::new(&work.network, &surfaces, shapes).unwrap();
    let json = r#"{"edit":"stroke","path":[{"patch":3,"u":0.2,"v":0.5},{"patch":3,"u":0.9,"v":0.5}],"radius":0.15,"height":0.01}"#;
    let ReliefEdit::Stroke(stroke) = serde_json::from_str(json).unwrap() else { unreachable!("it is a stroke") };
    let mut touched = 0;
    let drawn = time(20, || {
        let layer = stroke.layer(&ground).unwrap();
        touched = layer.iter().flat_map(|r| &r.vectors).filter(|d| **d != DVec3::ZERO).count();
        let patches = layer.iter().enumerate().filter(|(_, r)| !r.vectors.is_empty());
        let one = |(p, more): (usize, &Relief)| {
            let mut sum = reliefs[p].clone();
            sum.vectors.iter_mut().zip(&more.vectors).for_each(|(a, b)| *a += *b);
            relief::displace(&surfaces[p], &sum).unwrap()
        };
        patches.map(one).collect::<Vec<_>>()
    });
    println!("relief/stroke/{touched}_texels   {drawn:8.2} ms");
    let mut layers = Layers::default();
    layers.begin(&reliefs);
    let sum = time(5, || layers.sum().unwrap());
    println!("relief/sum/100x65x65   {sum:8.2} ms");
}
