//! Scans meshed in bricks against the same scans in one piece.

use glam::DVec3;
use planish::Silent;
use planish::cloud::bricks::CloudStore;
use planish::cloud::{self, Cleaned, Cloud, PointFacts, ProjectParams};
use planish::mesh::{Attribute, CompareParams, Diagnosis, TriMesh, compare, diagnose, self_intersections};
use planish::pipeline::{
    Input, RunParams, ScanError, ScanMeshed, ScanParams, clean_bricks, mesh_bricks, mesh_scan, project_bricks,
    run_with_points,
};
use planish::synthetic::{bracket, demo, even_scan, shapes};

fn in_bricks(scan: &Cloud, most: usize) -> ScanMeshed {
    mesh_bricks(&CloudStore::new(scan, most), &ScanParams::default(), &Silent).unwrap()
}

fn mesh(made: &ScanMeshed) -> &TriMesh {
    &made.meshed.extracted.mesh
}

/// Root mean square distance of a mesh to the surface that was scanned.
fn off(truth: &TriMesh, made: &TriMesh) -> f64 {
    compare(made, truth, &CompareParams::default(), &Silent).unwrap().a_to_b.rms
}

fn facts(made: &ScanMeshed) -> Diagnosis {
    diagnose(mesh(made))
}

#[test]
fn a_part_with_edges_in_a_dozen_bricks_is_closed_and_as_near_as_in_one_piece() {
    let truth = bracket(1, 120).unwrap();
    let diagonal = truth.bounds().diagonal();
    let scan = even_scan(&truth, 40_000, 1e-3 * diagonal, 1);
    let whole = mesh_scan(&scan, &ScanParams::default(), &Silent).unwrap();
    let parts = in_bricks(&scan, 5_000);
    let (a, b) = (facts(&whole), facts(&parts));
    assert!(b.watertight && b.manifold, "{b:?}");
    assert_eq!((b.components, b.genus), (a.components, a.genus));
    assert_eq!(self_intersections(mesh(&parts)).len(), 0);
    let (a, b) = (off(&truth, mesh(&whole)), off(&truth, mesh(&parts)));
    assert!(b < 1.1 * a, "{b} in bricks, {a} in one piece");
    let edges = |m: &ScanMeshed| -> f64 {
        let at = |v: u32| mesh(m).points[v as usize];
        m.meshed.extracted.tags.edges.iter().map(|e| at(e[0]).distance(at(e[1]))).sum()
    };
    let ratio = edges(&parts) / edges(&whole);
    assert!((ratio - 1.0).abs() < 0.05, "{ratio} times as much length of sharp edges");
}

#[test]
fn two_bricks_at_once_give_the_same_bytes_as_one_after_the_other_and_too_little_memory_is_refused() {
    let scan = even_scan(&demo(1, 40_000), 12_000, 0.004, 1);
    let made = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| in_bricks(&scan, 3_000))
    };
    let bits = |m: &ScanMeshed| {
        let points: Vec<[u64; 3]> = mesh(m).points.iter().map(|p| p.to_array().map(f64::to_bits)).collect();
        (points, mesh(m).triangles.clone(), m.meshed.extracted.tags.clone())
    };
    assert!(bits(&made(1)) == bits(&made(2)));
    let params = ScanParams { memory: 2_000_000, ..ScanParams::default() };
    let refused = mesh_bricks(&CloudStore::new(&scan, 3_000), &params, &Silent);
    assert!(matches!(refused, Err(ScanError::Memory { points: 12_000, .. })));
}

#[test]
fn an_open_scan_in_bricks_stays_open_with_one_border_and_its_points_far_from_no_surface() {
    let sheet = shapes::rectangle(3.0, 2.0, 30, 20);
    let bent = TriMesh::new(
        sheet.points.iter().map(|p| DVec3::new(p.x, p.y, 0.2 * (2.0 * p.x).sin())).collect(),
        sheet.triangles.clone(),
    );
    let scan = even_scan(&bent, 30_000, 1e-3, 1);
    let made = in_bricks(&scan, 5_000);
    let found = facts(&made);
    assert!(!made.closed && found.manifold, "{found:?}");
    assert_eq!((found.components, found.boundary_loops), (1, 1));
    let whole = facts(&mesh_scan(&scan, &ScanParams::default(), &Silent).unwrap());
    assert!((found.area / whole.area - 1.0).abs() < 0.005, "{} for {}", found.area, whole.area);
    assert!(made.to_points.0 < 1.1e-3, "{}", made.to_points.0);
}

#[test]
fn two_balls_in_bricks_look_outward_and_a_hollow_in_one_looks_in() {
    let ball = |radius: f64, at: DVec3, count: usize| {
        let scan = even_scan(&shapes::sphere(radius, 5), count, 1e-3, 1);
        scan.points.into_iter().map(move |p| p + at).collect::<Vec<_>>()
    };
    let apart = DVec3::X * 3.0;
    let points = [ball(1.0, DVec3::ZERO, 20_000), ball(0.5, DVec3::ZERO, 5_000), ball(1.0, apart, 20_000)].concat();
    let made = in_bricks(&Cloud::new(points), 6_000);
    let found = facts(&made);
    assert!(found.watertight && found.components == 3, "{found:?}");
    let volume = 4.0 / 3.0 * std::f64::consts::PI * (2.0 - 0.125);
    let error = found.volume.unwrap() / volume - 1.0;
    assert!(error.abs() < 0.01, "{error}");
}

#[test]
fn normals_of_the_file_tell_all_bricks_the_outside() {
    let flat = shapes::rectangle(3.0, 2.0, 2, 2);
    let mut scan = even_scan(&flat, 20_000, 1e-3, 1);
    let down = [0.0, 0.0, -1.0].repeat(scan.points.len());
    scan.attributes = vec![Attribute { name: "normal".into(), width: 3, values: down }];
    let made = in_bricks(&scan, 3_000);
    let mesh = mesh(&made);
    let up = (0..mesh.triangles.len()).map(|t| mesh.area_vector(t)).sum::<DVec3>().z;
    assert!(up < -0.95 * diagnose(mesh).area, "{up}");
}

/// The points of a scan in bricks on its surface, and what is known of them.
fn points_in_bricks(scan: &Cloud, points: ProjectParams) -> (Vec<Cleaned>, PointFacts) {
    let store = CloudStore::new(scan, 5_000);
    let params = ScanParams { points, ..ScanParams::default() };
    let plan = clean_bricks(&store, &params, &Silent).unwrap();
    let mut pieces = Vec::new();
    let mut take = |raw: &Cloud, piece: Cleaned| {
        assert_eq!(raw.points.len(), piece.strays.len());
        pieces.push(piece);
        Ok(())
    };
    let facts = project_bricks(&store, &plan, &params, &mut take, &Silent).unwrap();
    (pieces, facts)
}

#[test]
fn points_of_a_scan_in_bricks_come_to_the_surface_as_near_as_in_one_piece_with_what_the_file_tells_of_them() {
    let truth = bracket(1, 120).unwrap();
    let diagonal = truth.bounds().diagonal();
    let mut scan = even_scan(&truth, 40_000, 1e-3 * diagonal, 1);
    (0..40).for_each(|k| scan.points[100 * k] += DVec3::splat(0.05 * diagonal));
    let own = (0..scan.points.len()).map(|k| k as f32).collect();
    scan.attributes = vec![Attribute { name: "number".into(), width: 1, values: own }];
    let params = ScanParams::default();
    let samples = cloud::clean(&scan, &params.clean, &Silent).unwrap();
    let whole = cloud::project(&scan, &samples, params.clean.outlier, &params.points, &Silent).unwrap();
    let (pieces, facts) = points_in_bricks(&scan, params.points.clone());
    assert_eq!(pieces.iter().map(|p| p.cloud.points.len()).sum::<usize>(), facts.kept);
    assert!(facts.kept.abs_diff(whole.facts.kept) < 40, "{} for {}", facts.kept, whole.facts.kept);
    assert!((facts.moved_rms / whole.facts.moved_rms - 1.0).abs() < 0.03);
    let bvh = planish::geom::Bvh::new(&truth);
    let off = |clouds: &[&Cloud]| {
        let all: Vec<f64> = clouds.iter().flat_map(|c| &c.points).map(|p| bvh.closest(*p).distance).collect();
        (all.iter().map(|d| d * d).sum::<f64>() / all.len() as f64).sqrt()
    };
    let parts: Vec<&Cloud> = pieces.iter().map(|p| &p.cloud).collect();
    let (a, b) = (off(&[&whole.cloud]), off(&parts));
    assert!(b < 1.05 * a, "{b} in bricks, {a} in one piece");
    // Each point still has its own number, and is near where it was.
    let names = |c: &Cloud| c.attributes.iter().map(|a| a.name.clone()).collect::<Vec<_>>();
    for part in parts {
        assert_eq!(names(part), names(&whole.cloud));
        let numbers = &part.attribute("number", 1).unwrap().values;
        let moved = numbers.iter().zip(&part.points).map(|(&k, p)| scan.points[k as usize].distance(*p));
        assert!(moved.fold(0.0, f64::max) < 0.01 * diagonal);
    }
    let length = |facts: &PointFacts| -> f64 {
        facts.lines.iter().flat_map(|l| l.windows(2)).map(|w| w[0].distance(w[1])).sum()
    };
    let ratio = length(&facts) / length(&whole.facts);
    assert!((ratio - 1.0).abs() < 0.1, "{ratio} times as much length of sharp lines");
}

#[test]
fn thinned_points_of_bricks_keep_their_distance_across_cuts_and_bodies_are_numbered_by_area() {
    let ball = |radius: f64, at: DVec3, count: usize| {
        let scan = even_scan(&shapes::sphere(radius, 5), count, 1e-3, 1);
        scan.points.into_iter().map(move |p| p + at).collect::<Vec<_>>()
    };
    let scan = Cloud::new([ball(0.5, DVec3::ZERO, 10_000), ball(1.0, DVec3::X * 3.0, 20_000)].concat());
    let spacing = 0.1;
    let (pieces, facts) = points_in_bricks(&scan, ProjectParams { spacing, outliers: false });
    let points: Vec<DVec3> = pieces.iter().flat_map(|p| p.cloud.points.clone()).collect();
    let near = |i: usize, j: usize| points[i].distance(points[j]) < spacing;
    assert!((0..points.len()).all(|i| (0..i).all(|j| !near(i, j))));
    // Circles of one spacing around all points cover the surface; those of half a spacing do not overlap.
    let area = 4.0 * std::f64::consts::PI * 1.25 / (spacing * spacing);
    let [least, most] = [area / std::f64::consts::PI, area / 0.75f64.sqrt()];
    assert!((least..most).contains(&(facts.kept as f64)), "{} of {least} to {most}", facts.kept);
    for piece in &pieces {
        let segment = &piece.cloud.attribute("segment", 1).unwrap().values;
        assert!(segment.iter().zip(&piece.cloud.points).all(|(&s, p)| (s == 0.0) == (p.x > 1.5)));
    }
}

#[test]
fn a_run_on_bricks_has_the_mesh_of_these_and_gives_its_points() {
    let scan = even_scan(&shapes::sphere(1.0, 5), 12_000, 1e-3, 1);
    let store = CloudStore::new(&scan, 5_000);
    let mut count = 0;
    let mut take = |_: &Cloud, piece: Cleaned| {
        count += piece.cloud.points.len();
        Ok(())
    };
    let run = run_with_points(Input::Bricks(&store), &RunParams::default(), &mut take, &Silent).unwrap();
    let scanned = run.scan.unwrap();
    assert!(mesh(&scanned.meshed) == mesh(&in_bricks(&scan, 5_000)));
    assert_eq!((count, scanned.meshed.bricks > 2), (scanned.points.kept, true));
    assert!(count > 11_900 && run.fitted.quality.contains_key("scan.bricks"));
}
