//! Sharp lines of meshes that were made of scans: what they have that the part does not.
//!
//! `cargo test --release -p planish --test lines -- --ignored --nocapture` prints the census of all parts and noises.
#![allow(clippy::print_stdout)]

#[allow(dead_code)]
#[path = "regress/cpu.rs"]
mod cpu;
#[allow(dead_code)]
#[path = "regress/measure.rs"]
mod measure;

use planish::geom::random;
use planish::mesh::{Adjacency, FeatureTags, TriMesh, diagnose, next, self_intersections, sharp_edges};
use planish::pipeline::{ScanParams, edge_reach, mesh_scan};
use planish::sharp::{Census, LinesFound, ScanScale, census, find_lines, lines_found, tidy_lines};
use planish::synthetic::shapes;
use planish::{DVec3, Silent};

/// The angle between normals that extraction takes for a sharp edge, radians.
const SHARP: f64 = 0.451;

/// A cube of 24 by 24 squares a side, three to a cell, its vertices off by normal deviates of 3 % of a cell; and its true edges.
fn noisy_cube() -> (TriMesh, FeatureTags, ScanScale) {
    let mut mesh = shapes::cuboid(DVec3::ONE, 24);
    let sharp = sharp_edges(&mesh, &Adjacency::new(&mesh), 40.0);
    let ends = |h: usize| [mesh.origin(h as u32), mesh.origin(next(h as u32))];
    let tags = FeatureTags::from_edges(mesh.points.len(), (0..sharp.len()).filter(|&h| sharp[h]).map(ends));
    let scale = ScanScale { noise: 0.03, spacing: 0.08, cell: 0.125 };
    let draw = |k: u64| random::normal(random::unit(3, 2 * k), random::unit(3, 2 * k + 1));
    for (v, p) in mesh.points.iter_mut().enumerate() {
        let v = 3 * v as u64;
        *p += 0.03 * scale.cell * DVec3::new(draw(v), draw(v + 1), draw(v + 2));
    }
    (mesh, tags, scale)
}

fn found(mesh: &TriMesh, scale: &ScanScale) -> FeatureTags {
    let mut tags = FeatureTags::from_edges(mesh.points.len(), []);
    find_lines(mesh, &mut tags, scale, SHARP, &Silent).expect("nobody cancels");
    tags
}

#[test]
fn the_borders_of_a_noisy_cube_are_its_288_edges_and_no_others() {
    let (mesh, tags, scale) = noisy_cube();
    assert_eq!(tags.edges.len(), 12 * 24);
    assert_eq!(found(&mesh, &scale), tags);
}

#[test]
fn a_ball_and_a_torus_of_any_size_have_no_lines() {
    for (mesh, size) in
        [(shapes::sphere(1.0, 4), 1.0), (shapes::torus(2.0, 0.7, 96, 48), 0.01), (shapes::torus(2.0, 0.7, 48, 24), 1.0)]
    {
        let points = mesh.points.iter().map(|p| *p * size).collect();
        let mesh = TriMesh { points, ..mesh };
        let cell = 2.0 * mesh.mean_edge();
        let scale = ScanScale { noise: 0.1 * cell, spacing: cell / 1.6, cell };
        assert_eq!(found(&mesh, &scale).edges.len(), 0);
    }
}

#[test]
fn a_line_whose_angle_fades_from_60_degrees_to_none_ends_once_where_it_is_between_15_and_40() {
    // A sheet of 4 by 2 that is folded along y = 0, less and less.
    let mut mesh = shapes::rectangle(4.0, 2.0, 80, 40);
    let low = mesh.bounds().min;
    let angle_deg = |p: DVec3| 60.0 * (1.0 - (p.x - low.x) / 4.0);
    for p in &mut mesh.points {
        let aside = p.y - low.y - 1.0;
        p.z = -aside.abs() * (angle_deg(*p) / 2.0).to_radians().tan();
    }
    let tags = found(&mesh, &ScanScale { noise: 0.01, spacing: 0.07, cell: 0.1 });
    let counts = census(&mesh, &tags);
    assert_eq!((counts.ends, counts.junctions, counts.turns), (1, 0, 0), "{counts:?}");
    let off = |v: &u32| (mesh.points[*v as usize].y - low.y - 1.0).abs();
    assert!(tags.edges.iter().flatten().all(|v| off(v) < 1e-9));
    let last = tags.edges.iter().flatten().map(|&v| mesh.points[v as usize]).max_by(|a, b| a.x.total_cmp(&b.x));
    let angle = angle_deg(last.expect("a line"));
    assert!((15.0..40.0).contains(&angle), "ends at {angle} degrees");
}

#[test]
fn lines_are_found_and_tidied_to_the_bit_on_1_and_4_threads() {
    let run = |threads| {
        let (mut mesh, _, scale) = noisy_cube();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| {
            let mut tags = found(&mesh, &scale);
            tidy_lines(&mut mesh, &mut tags, &scale, &Silent).expect("nobody cancels");
            (mesh, tags)
        })
    };
    assert_eq!(run(1), run(4));
}

#[test]
fn a_vertex_that_all_but_touches_a_line_and_one_next_to_another_on_it_leave_no_sliver() {
    let mut mesh = shapes::cuboid(DVec3::ONE, 8);
    let sharp = sharp_edges(&mesh, &Adjacency::new(&mesh), 40.0);
    let ends = |h: usize| [mesh.origin(h as u32), mesh.origin(next(h as u32))];
    let mut tags = FeatureTags::from_edges(mesh.points.len(), (0..sharp.len()).filter(|&h| sharp[h]).map(ends));
    let at = |mesh: &TriMesh, p: DVec3| mesh.points.iter().position(|q| q.distance(p) < 1e-9).expect("a vertex there");
    // In the face on top, beside the edge at y = 1/2; and on the edge at y = -1/2.
    let (beside, on) = (at(&mesh, DVec3::new(0.0, 0.375, 0.5)), at(&mesh, DVec3::new(0.125, -0.5, 0.5)));
    mesh.points[beside] = DVec3::new(0.06, 0.4995, 0.5);
    mesh.points[on] = DVec3::new(0.001, -0.5, 0.5);
    let scale = ScanScale { noise: 0.02, spacing: 0.1, cell: 0.25 };
    assert!(census(&mesh, &tags).slivers >= 2);
    let gone = tidy_lines(&mut mesh, &mut tags, &scale, &Silent).expect("nobody cancels");
    let after = census(&mesh, &tags);
    assert!(gone >= 2 && after.slivers == 0, "{gone} triangles gone, {after:?}");
    assert_eq!((after.junctions, after.ends, after.turns, after.folded_back), (8, 0, 0, 0));
    assert!((after.length - 12.0).abs() < 1e-3, "{}", after.length);
    let now = diagnose(&mesh);
    assert!(now.watertight && now.manifold && now.genus == Some(0), "{now:?}");
    assert!(self_intersections(&mesh).is_empty());
    let area: f64 = (0..mesh.triangles.len()).map(|t| mesh.area(t)).sum();
    assert!((area - 6.0).abs() < 1e-3, "{area}");
}

/// Meshes a scan of a synthetic part, and counts what its lines have.
fn lines_of(part: &str, percent: f64, seed: u64) -> (Census, LinesFound) {
    let scanned = measure::scan(part, percent, seed);
    let made = mesh_scan(&scanned.cloud, &ScanParams::default(), &Silent).expect("a part can be meshed");
    let extracted = &made.meshed.extracted;
    let within = 2.0 * edge_reach(&scanned.truth, scanned.noise);
    let found = lines_found(&scanned.truth, &extracted.mesh, &extracted.tags, within);
    (census(&extracted.mesh, &extracted.tags), found)
}

fn print(part: &str, percent: f64, seed: u64) -> Census {
    let (c, found) = lines_of(part, percent, seed);
    println!(
        "{part:8} {percent:4} % seed {seed}: {:4} junctions {:3} ends {:4} turns {:5} slivers {:3} folded, {:5.1} % found {:4.1} % false",
        c.junctions,
        c.ends,
        c.turns,
        c.slivers,
        c.folded_back,
        100.0 * found.found,
        100.0 * found.false_share
    );
    c
}

#[test]
#[ignore = "prints a table, in minutes"]
fn census_of_the_lines_of_all_parts_and_noises() {
    for part in measure::PARTS {
        for percent in [0.1, 0.25] {
            measure::SEEDS.iter().for_each(|&seed| _ = print(part, percent, seed));
        }
    }
}
