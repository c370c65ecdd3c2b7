//! Reliefs and the meshes made of them.

mod patchworks;

use glam::DVec3;
use patchworks::*;
use planish::Silent;
use planish::mesh::{Adjacency, NONE, TriMesh};
use planish::model::Model;
use planish::network::CurveKind;
use planish::pipeline::{self, PipelineParams};
use planish::relief::{self, Relief, ReliefError};
use planish::surface::{self, Surface};
use std::f64::consts::TAU;

/// `(Euler number, boundary edges)`; panics if an edge is not used once in each direction at most.
fn topology(mesh: &TriMesh) -> (i64, usize) {
    let mut edges: Vec<[u32; 2]> =
        mesh.triangles.iter().flat_map(|t| (0..3).map(move |k| [t[k], t[(k + 1) % 3]])).collect();
    edges.sort_unstable();
    if let Some(w) = edges.windows(2).find(|w| w[0] == w[1]) {
        let at = w[0].map(|v| mesh.points[v as usize]);
        panic!("edge {:?} at {at:?} is used twice in one direction", w[0]);
    }
    let open = edges.iter().filter(|e| edges.binary_search(&[e[1], e[0]]).is_err()).count();
    let mut used: Vec<u32> = mesh.triangles.iter().flatten().copied().collect();
    used.sort_unstable();
    used.dedup();
    let count = (edges.len() + open) / 2;
    (used.len() as i64 - count as i64 + mesh.triangles.len() as i64, open)
}

fn volume(mesh: &TriMesh) -> f64 {
    (0..mesh.triangles.len()).map(|t| mesh.corners(t)).map(|[a, b, c]| a.dot(b.cross(c))).sum::<f64>() / 6.0
}

#[test]
fn displacing_returns_the_grid_within_1e_15_of_the_size() {
    for work in [cube(33, CurveKind::Smooth, blob), torus(25), wavy([20, 31]), tube([30, 12]), purse(17)] {
        let (surfaces, reliefs) = fitted(&work, 6);
        for ((grid, s), r) in work.grids.iter().zip(&surfaces).zip(&reliefs) {
            let back = relief::displace(s, r).unwrap();
            let worst = back.iter().zip(&grid.points).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
            assert!(worst < 4e-15, "{worst:e}");
        }
    }
}

#[test]
fn a_flat_net_with_skew_sides_gives_the_displacement_in_an_orthonormal_frame() {
    // S_u = (1, 0, 0), S_v = (1, 1, 0): not orthogonal.
    let base = grid(9, 9, |u, v| DVec3::new(u + v, v, 0.0));
    let s = surface::fit(&base.points, 9, 9, [4, 4]).unwrap();
    let bumped = grid(9, 9, |u, v| DVec3::new(u + v + 0.1, v + 0.2, 0.3 * u));
    let map = relief::bake(&bumped, &s).unwrap();
    for (i, d) in map.vectors.iter().enumerate() {
        let want = DVec3::new(0.1, 0.2, 0.3 * (i % 9) as f64 / 8.0);
        assert!(d.distance(want) < 1e-12);
    }
    assert_eq!(relief::normal_component(&map), map.vectors.iter().map(|d| d.z).collect::<Vec<_>>());
}

#[test]
fn a_side_collapsed_to_a_point_still_round_trips_and_has_an_orthonormal_frame() {
    // A spherical cap: side 2 is the pole.
    let cap = grid(17, 21, |u, v| {
        let (a, b) = (u * 1.2, v * std::f64::consts::FRAC_PI_2);
        DVec3::new(a.cos() * b.cos(), a.sin() * b.cos(), b.sin())
    });
    let pole = DVec3::Z;
    let points: Vec<DVec3> = cap.points.iter().enumerate().map(|(i, &p)| if i / 21 == 16 { pole } else { p }).collect();
    let cap = planish::grid::Grid { points, ..cap };
    let mut s = surface::fit(&cap.points, 17, 21, [6, 6]).unwrap();
    s.control[30..36].fill(pole);
    for frame in relief::frames(&s, 17, 21) {
        assert!((frame.tangent.length() - 1.0).abs() < 1e-12);
        assert!(frame.tangent.cross(frame.bitangent).distance(frame.normal) < 1e-12);
        assert!(frame.normal.dot(DVec3::ONE) > 0.0);
    }
    let map = relief::bake(&cap, &s).unwrap();
    let back = relief::displace(&s, &map).unwrap();
    assert!(back.iter().zip(&cap.points).all(|(a, b)| a.distance(*b) < 1e-14));
    // A net that is one point has the world axes.
    let dot = Surface { control: vec![DVec3::ONE; 36], ..s };
    assert_eq!(relief::frame_at(&dot, 0.3, 0.7).normal, DVec3::Z);
}

#[test]
fn displaced_rows_agree_across_every_seam_within_1e_14() {
    let work = cube(33, CurveKind::Smooth, blob);
    let (surfaces, reliefs) = fitted(&work, 7);
    let mesh = relief::displaced_mesh(&work.network, &surfaces, &reliefs, &Silent).unwrap();
    // Every displaced node of every patch has a vertex of the welded mesh at its place.
    for (s, r) in surfaces.iter().zip(&reliefs) {
        for p in relief::displace(s, r).unwrap() {
            assert!(mesh.points.iter().any(|q| q.distance(p) < 1e-14));
        }
    }
}

#[test]
fn closed_networks_give_closed_meshes_with_euler_number_2_or_0() {
    for (work, euler) in [
        (cube(17, CurveKind::Smooth, blob), 2),
        (cube(9, CurveKind::Feature, |p| p), 2),
        (torus(13), 0),
        (one_patch_torus([24, 17]), 0),
        (purse(16), 2),
    ] {
        let (surfaces, reliefs) = fitted(&work, 5);
        let mesh = relief::displaced_mesh(&work.network, &surfaces, &reliefs, &Silent).unwrap();
        assert_eq!(topology(&mesh), (euler, 0));
        let adjacency = Adjacency::new(&mesh);
        assert!(adjacency.opposite.iter().all(|&h| h != NONE));
        let smooth =
            relief::surface_mesh(&work.network, &surfaces, &relief::span_shapes(&surfaces, 4), &Silent).unwrap();
        assert_eq!(topology(&smooth), (euler, 0));
    }
}

#[test]
fn open_networks_keep_their_boundary_and_have_euler_number_1_or_0() {
    for (work, euler) in [(wavy([9, 12]), 1), (tube([24, 10]), 0)] {
        let (surfaces, reliefs) = fitted(&work, 5);
        let mesh = relief::displaced_mesh(&work.network, &surfaces, &reliefs, &Silent).unwrap();
        let (found, open) = topology(&mesh);
        assert_eq!(found, euler);
        assert!(open > 0);
    }
}

#[test]
fn a_cube_of_side_2_has_volume_8_within_1e_12() {
    let work = cube(9, CurveKind::Feature, |p| p);
    let (surfaces, reliefs) = fitted(&work, 5);
    let mesh = relief::displaced_mesh(&work.network, &surfaces, &reliefs, &Silent).unwrap();
    assert!((volume(&mesh) - 8.0).abs() < 1e-12);
}

#[test]
fn displacement_beyond_the_radius_of_a_cylinder_is_a_fold() {
    // Radius 1, the normal outward: S_u x S_v with u around and v up.
    let work = tube([61, 9]);
    let (surfaces, _) = fitted(&work, 9);
    let map = |n: f64| Relief { rows: 9, cols: 61, vectors: vec![DVec3::new(0.0, 0.0, n); 9 * 61] };
    assert!(relief::fold_over(&surfaces[0], &map(-0.8)).unwrap().is_empty());
    assert!(relief::fold_over(&surfaces[0], &map(5.0)).unwrap().is_empty());
    assert_eq!(relief::fold_over(&surfaces[0], &map(-1.2)).unwrap().len(), 9 * 61);
}

#[test]
fn a_patch_mesh_puts_its_nodes_on_texel_centres() {
    let g = grid(3, 5, |u, v| DVec3::new(u, v, 0.0));
    let mesh = relief::patch_mesh(g.points, 3, 5).unwrap();
    assert_eq!(mesh.triangles.len(), 16);
    assert_eq!(mesh.attributes[0].values[2 * 7..2 * 8], [0.5, 0.5]);
    assert!(mesh.triangles.iter().enumerate().all(|(t, _)| mesh.area_vector(t).z > 0.0));
}

#[test]
fn lists_that_do_not_fit_are_errors() {
    let work = torus(9);
    let (surfaces, mut reliefs) = fitted(&work, 5);
    assert!(relief::displaced_mesh(&work.network, &surfaces[1..], &reliefs, &Silent).is_err());
    reliefs[3].vectors.pop();
    let error = relief::displaced_mesh(&work.network, &surfaces, &reliefs, &Silent).unwrap_err();
    assert!(error.to_string().contains("patch 3"), "{error}");
    let mut broken = surfaces[0].clone();
    broken.control.pop();
    assert!(matches!(relief::bake(&work.grids[0], &broken), Err(ReliefError::Surface(_))));
}

#[test]
fn displaced_mesh_is_the_same_to_the_bit_on_1_and_4_threads() {
    let work = cube(25, CurveKind::Smooth, blob);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let (surfaces, reliefs) = fitted(&work, 8);
            relief::displaced_mesh(&work.network, &surfaces, &reliefs, &Silent).unwrap()
        })
    };
    assert_eq!(run(1), run(4));
}

#[test]
fn regress_parting_at_10_gives_99_9_percent_of_a_wave_of_30_to_the_surface_and_of_one_of_3_to_the_map() {
    let (long, short) = (|y: f64| (TAU * y / 30.0).sin(), |x: f64| 0.1 * (TAU * x / 3.0).sin());
    // Two by two patches of 30 x 30, five nodes for each of the short waves.
    let shape = |u: f64, v: f64| DVec3::new(30.0 * u, 30.0 * v, long(30.0 * v) + short(30.0 * u));
    let work = sheet(2, 2, [false, false], [51, 51], shape);
    let mut model = Model { network: work.network, grids: work.grids, ..Model::default() };
    let params = PipelineParams::default();
    pipeline::refit(&mut model, &params, &Silent).unwrap();
    pipeline::part_at(&mut model, 10.0, &params, &Silent).unwrap();
    // The heights of the surfaces, as shares of both waves by least squares.
    let (mut sums, mut rest) = ([0.0; 5], 0.0);
    for surface in &model.surfaces {
        for k in 0..200 * 200 {
            let p = surface.point((k % 200) as f64 / 199.0, (k / 200) as f64 / 199.0);
            let (a, b) = (long(p.y), short(p.x));
            sums = [sums[0] + a * a, sums[1] + a * b, sums[2] + b * b, sums[3] + a * p.z, sums[4] + b * p.z];
            rest += (p.z - a).powi(2);
        }
    }
    let [aa, ab, bb, az, bz] = sums;
    let whole = aa * bb - ab * ab;
    let (kept, taken) = ((az * bb - bz * ab) / whole, (bz * aa - az * ab) / whole);
    assert!((kept - 1.0).abs() < 0.001, "{kept} of the long wave is in the surface");
    assert!(taken.abs() < 0.001, "{taken} of the short wave is in the surface");
    assert!((rest / aa).sqrt() < 0.01, "{}", (rest / aa).sqrt());
    let told = pipeline::part_at(&mut model, 100.0, &params, &Silent).unwrap_err().to_string();
    assert!(told.contains("longer than the model"), "{told}");
    // What the grids cannot carry is told with the shortest that they can.
    for wavelength in [1e-9, 0.1, 2.0] {
        let told = pipeline::part_at(&mut model, wavelength, &params, &Silent).unwrap_err().to_string();
        let (_, shortest) = told.split_once("the shortest is ").expect(&told);
        pipeline::part_at(&mut model.clone(), shortest.parse().unwrap(), &params, &Silent).unwrap();
    }
}

/// The surfaces of a patchwork that is parted at a wavelength, at 100 x 100 places of each.
fn parted(work: Patchwork, wavelength: f64) -> Vec<Vec<DVec3>> {
    let mut model = Model { network: work.network, grids: work.grids, ..Model::default() };
    let params = PipelineParams::default();
    pipeline::refit(&mut model, &params, &Silent).unwrap();
    pipeline::part_at(&mut model, wavelength, &params, &Silent).unwrap();
    let place = |s: &Surface, k: usize| s.point((k % 100) as f64 / 99.0, (k / 100) as f64 / 99.0);
    model.surfaces.iter().map(|s| (0..10_000).map(|k| place(s, k)).collect()).collect()
}

/// Root mean square and largest of what `off` says of all places.
fn spread(places: &[Vec<DVec3>], off: impl Fn(DVec3) -> f64) -> [f64; 2] {
    let all: Vec<f64> = places.iter().flatten().map(|&p| off(p).abs()).collect();
    let square: f64 = all.iter().map(|d| d * d).sum();
    [(square / all.len() as f64).sqrt(), all.iter().copied().fold(0.0, f64::max)]
}

#[test]
fn regress_a_ball_in_six_patches_is_off_by_12_ten_thousandths_of_its_radius_at_most_rms_parted_at_twice_that() {
    // Longer than the sides of the patches: with surfaces too stiff for shorter waves in place of an energy, .48 was missing.
    for wavelength in [5.0, 10.0, 20.0] {
        let ball = cube(33, CurveKind::Smooth, |p| p.normalize() * 10.0);
        let [rms, most] = spread(&parted(ball, wavelength), |p| p.length() - 10.0);
        assert!(rms < 0.012 && most < 0.05, "{wavelength}: {rms}, {most}");
    }
}

#[test]
fn parting_takes_waves_along_sharp_edges_and_leaves_the_edges() {
    // A wave of 2 along each edge of a cube with sides of 20, none at its corners.
    let wave = |p: DVec3| p * 10.0 + DVec3::splat(0.1 * (TAU * 5.0 * (p.x + p.y + p.z)).sin());
    let [rms, most] = spread(&parted(cube(65, CurveKind::Feature, wave), 5.0), |p| p.abs().max_element() - 10.0);
    assert!(rms < 5e-4 && most < 5e-3, "{rms}, {most}");
}

#[test]
fn parting_leaves_a_bent_sheet_bent_up_to_its_border() {
    // A quarter of a cylinder with a wave of 1 along it.
    let sheet = || {
        sheet(2, 2, [false, false], [65, 65], |x, y| {
            let (angle, y) = (x * std::f64::consts::FRAC_PI_4, 8.0 * y);
            let radius = 10.0 + 0.05 * (TAU * y).sin();
            DVec3::new(radius * angle.cos(), y, radius * angle.sin())
        })
    };
    for (wavelength, bound) in [(5.0, 3e-4), (10.0, 4e-3)] {
        let [rms, _] = spread(&parted(sheet(), wavelength), |p| p.x.hypot(p.z) - 10.0);
        assert!(rms < bound, "{wavelength}: {rms}");
    }
}
