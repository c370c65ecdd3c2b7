//! Grids: closed forms, invariants, boundaries shared between neighbours, hard and degenerate patches.

#![allow(clippy::print_stdout)]

#[path = "common/patches.rs"]
mod patches;

use glam::{DQuat, DVec3};
use patches::{Sheet, cut, ears, sheet, sheets, snouts, two_triangles};
use planish::grid::{Grid, GridError, GridParams, choose_sizes, divide, measure, relax};
use planish::layout::{Known, LayoutParams, count_is_near, layout};
use planish::mesh::{FacePoint, TriMesh};
use planish::network::{Corner, Curve, CurveKind, Network, Patch, Side, imprint};
use planish::pipeline;
use planish::synthetic::shapes;
use planish::{Observer, Silent};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

fn grid_of(sheet: &Sheet, cols: usize, rows: usize) -> Grid {
    let patches = [sheet.patch.clone()];
    let mut grids = relax(&sheet.input, &patches, &[(cols, rows)], &GridParams::default(), &Silent)
        .unwrap_or_else(|e| panic!("{}: {e}", sheet.name));
    grids.pop().unwrap()
}

/// Every point finite, where its place says, with weights that are not negative and sum to one.
fn assert_on_the_mesh(sheet: &Sheet, grid: &Grid) {
    let tolerance = 1e-12 * sheet.input.bounds().diagonal();
    assert_eq!(grid.points.len(), grid.rows * grid.cols);
    assert_eq!(grid.places.len(), grid.points.len());
    for (p, place) in grid.points.iter().zip(&grid.places) {
        assert!(p.is_finite(), "{}", sheet.name);
        assert!(place.position(&sheet.input).distance(*p) <= tolerance, "{}: {place:?}", sheet.name);
        assert!(place.bary.iter().all(|b| *b >= 0.0) && (place.bary.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }
}

#[test]
fn a_flat_square_gives_the_regular_grid_of_33_x_21_within_1e_9() {
    let flat = sheet("flat", 40, 40, 0.5, |s, t| DVec3::new(s, t, 0.0));
    let grid = grid_of(&flat, 33, 21);
    for j in 0..21 {
        for i in 0..33 {
            let want = DVec3::new(i as f64 / 32.0, j as f64 / 20.0, 0.0);
            assert!(grid.points[j * 33 + i].distance(want) < 1e-9, "{i} {j} {}", grid.points[j * 33 + i]);
        }
    }
}

#[test]
fn a_quarter_cylinder_gives_equal_angles_within_1e_3_of_the_radius() {
    let cylinder = sheet("cylinder", 81, 41, 0.5, |s, t| {
        let a = s * std::f64::consts::FRAC_PI_2;
        DVec3::new(-a.cos(), 1.5 * t, a.sin())
    });
    let grid = grid_of(&cylinder, 41, 21);
    for j in 0..21 {
        for i in 0..41 {
            let a = i as f64 / 40.0 * std::f64::consts::FRAC_PI_2;
            let want = DVec3::new(-a.cos(), 1.5 * j as f64 / 20.0, a.sin());
            let miss = grid.points[j * 41 + i].distance(want);
            assert!(miss < 1e-3, "{i} {j}: {miss}");
        }
    }
}

#[test]
fn sheets_of_every_kind_give_grids_without_folds_on_the_mesh() {
    for sheet in sheets(49) {
        for (cols, rows) in [(49, 49), (17, 33), (81, 60)] {
            let grid = grid_of(&sheet, cols, rows);
            assert_on_the_mesh(&sheet, &grid);
            let quality = measure(&grid, &sheet.patch);
            assert_eq!(quality.folds, 0, "{} {cols} x {rows}: {quality:?}", sheet.name);
        }
    }
}

#[test]
fn grids_larger_than_the_patch_lie_on_it_for_2_and_5_triangles() {
    for sheet in [two_triangles(), ears()] {
        for (cols, rows) in [(2, 2), (9, 5), (65, 65)] {
            let grid = grid_of(&sheet, cols, rows);
            assert_on_the_mesh(&sheet, &grid);
            assert_eq!(measure(&grid, &sheet.patch).folds, 0, "{} {cols} x {rows}", sheet.name);
        }
    }
}

#[test]
fn moving_turning_and_scaling_a_patch_moves_its_grid_within_1e_6_of_the_diagonal() {
    let base = patches::Snout { radius: 0.25, height: 0.6, lean: 0.1, center: [0.1, 0.0] }.sheet("snout", 64);
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 1.1);
    let place = |p: DVec3| 1000.0 * (turn * p) + DVec3::new(300.0, -70.0, 45.0);
    let mut moved = Sheet { name: "moved".into(), input: base.input.clone(), patch: base.patch.clone() };
    moved.input.points.iter_mut().chain(moved.patch.mesh.points.iter_mut()).for_each(|p| *p = place(*p));
    // Nothing is caught: what is missed is told by the box around the mesh, which turning changes.
    let params = GridParams { miss: 1.0, ..GridParams::default() };
    let grid =
        |s: &Sheet| relax(&s.input, std::slice::from_ref(&s.patch), &[(65, 65)], &params, &Silent).unwrap().remove(0);
    let (a, b) = (grid(&base), grid(&moved));
    let diagonal = 1000.0 * base.input.bounds().diagonal();
    for (p, q) in a.points.iter().zip(&b.points) {
        assert!(place(*p).distance(*q) < 1e-6 * diagonal, "{}", place(*p).distance(*q) / diagonal);
    }
}

#[test]
fn relax_is_bitwise_equal_on_1_and_4_threads() {
    let all: Vec<Sheet> = sheets(33);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| all.iter().map(|s| grid_of(s, 129, 40)).collect::<Vec<_>>())
    };
    assert!(run(1) == run(4));
}

/// A sheet divided into 2 x 1 patches by the mesh line s = 1/2, and its network.
fn two_neighbours(n: usize) -> (TriMesh, Vec<planish::network::PatchMesh>, Network) {
    let (nu, nv) = (2 * n - 1, n);
    let whole = sheet("whole", nu, nv, 0.0, |s, t| DVec3::new(2.0 * s, t, 0.3 * (4.0 * s * t).sin() + 0.1 * t * t));
    let at = |i: usize, j: usize| (j * nu + i) as u32;
    let faces = |left: bool| -> Vec<u32> {
        let is_left = |f: u32| whole.input.triangles[f as usize].iter().all(|&v| v as usize % nu < n);
        (0..whole.input.triangles.len() as u32).filter(|&f| is_left(f) == left).collect()
    };
    let left = cut(&whole.input, &faces(true), [at(0, 0), at(n - 1, 0), at(n - 1, n - 1), at(0, n - 1)]);
    let right = cut(&whole.input, &faces(false), [at(n - 1, 0), at(nu - 1, 0), at(nu - 1, n - 1), at(n - 1, n - 1)]);
    let corner = |patch: &planish::network::PatchMesh, k: usize| patch.origin[patch.sides[k][0] as usize];
    let corners = vec![
        corner(&left, 0),
        corner(&left, 1),
        corner(&left, 2),
        corner(&left, 3),
        corner(&right, 1),
        corner(&right, 2),
    ];
    let curve = |patch: &planish::network::PatchMesh, k: usize, ends: [u32; 2]| Curve {
        corners: ends,
        kind: CurveKind::Smooth,
        points: patch.sides[k].iter().map(|&v| patch.origin[v as usize]).collect::<Vec<FacePoint>>(),
    };
    let curves = vec![
        curve(&left, 0, [0, 1]),
        curve(&left, 1, [1, 2]),
        curve(&left, 2, [2, 3]),
        curve(&left, 3, [3, 0]),
        curve(&right, 0, [1, 4]),
        curve(&right, 1, [4, 5]),
        curve(&right, 2, [5, 2]),
    ];
    let side = |curve: u32, reversed: bool| Side { curve, reversed };
    let network = Network {
        corners: corners.into_iter().map(|place| Corner { place }).collect(),
        curves,
        patches: vec![
            Patch { sides: [side(0, false), side(1, false), side(2, false), side(3, false)] },
            Patch { sides: [side(4, false), side(5, false), side(6, false), side(1, true)] },
        ],
    };
    (whole.input, vec![left, right], network)
}

#[test]
fn neighbours_share_the_nodes_of_their_curve_bit_for_bit() {
    let (input, patches, network) = two_neighbours(31);
    let sizes = choose_sizes(&network, &patches, &GridParams::default());
    assert_eq!(sizes[0].1, sizes[1].1);
    let grids = relax(&input, &patches, &sizes, &GridParams::default(), &Silent).unwrap();
    for j in 0..grids[0].rows {
        let (a, b) = (&grids[0], &grids[1]);
        let (p, q) = (a.points[j * a.cols + a.cols - 1], b.points[j * b.cols]);
        assert_eq!(p.to_array().map(f64::to_bits), q.to_array().map(f64::to_bits), "row {j}");
    }
}

#[test]
fn sizes_hold_the_density_within_10_percent_and_the_bounds() {
    let (_, patches, network) = two_neighbours(61);
    let vertices: usize = patches.iter().map(|p| p.mesh.points.len()).sum();
    for density in [0.5, 1.0, 3.0] {
        let params = GridParams { density, ..GridParams::default() };
        let sizes = choose_sizes(&network, &patches, &params);
        let total: usize = sizes.iter().map(|(c, r)| c * r).sum();
        assert!((total as f64 / (vertices as f64 * density) - 1.0).abs() < 0.1, "{density}: {total}");
    }
    let params = GridParams { min_side: 21, max_side: 23, density: 9.0, ..GridParams::default() };
    let sizes = choose_sizes(&network, &patches, &params);
    assert!(sizes.iter().all(|&(c, r)| (21..=23).contains(&c) && (21..=23).contains(&r)));
    let params = GridParams { max_points: 1000, min_side: 4, ..GridParams::default() };
    let total: usize = choose_sizes(&network, &patches, &params).iter().map(|(c, r)| c * r).sum();
    assert!(total < 1100, "{total}");
}

#[test]
fn bad_patches_are_errors_that_name_the_patch() {
    let good = sheet("good", 8, 8, 0.0, |s, t| DVec3::new(s, t, 0.0));
    let run = |patch: &planish::network::PatchMesh, size: (usize, usize)| {
        let patches = [good.patch.clone(), patch.clone()];
        relax(&good.input, &patches, &[(5, 5), size], &GridParams::default(), &Silent).unwrap_err()
    };
    assert_eq!(run(&good.patch, (1, 9)), GridError::TooSmall { patch: 1, cols: 1, rows: 9 });
    let mut flat_side = good.patch.clone();
    for &v in &flat_side.sides[2].clone() {
        flat_side.mesh.points[v as usize] = DVec3::new(0.5, 1.0, 0.0);
    }
    assert_eq!(run(&flat_side, (9, 9)), GridError::DegenerateSide { patch: 1, side: 2 });
    let mut torn = good.patch.clone();
    torn.mesh.triangles.remove(40);
    torn.face_origin.remove(40);
    assert!(matches!(run(&torn, (9, 9)), GridError::NotADisk { patch: 1, .. }));
    let mut short = good.patch.clone();
    short.sides[1].pop();
    assert!(matches!(run(&short, (9, 9)), GridError::NotADisk { patch: 1, .. }));
    let mut not_finite = good.patch.clone();
    not_finite.mesh.points[20].x = f64::NAN;
    assert!(matches!(run(&not_finite, (9, 9)), GridError::NotADisk { patch: 1, .. }));
    let none = relax(&good.input, std::slice::from_ref(&good.patch), &[], &GridParams::default(), &Silent).unwrap_err();
    assert_eq!(none, GridError::SizeCount { patches: 1, sizes: 0 });
}

/// Cancels some milliseconds after the start, and remembers the progress.
struct Impatient {
    start: Instant,
    patience: Duration,
    asked: AtomicUsize,
}

impl Observer for Impatient {
    fn progress(&self, _fraction: f64) {}
    fn cancelled(&self) -> bool {
        self.asked.fetch_add(1, Ordering::Relaxed);
        self.start.elapsed() > self.patience
    }
}

#[test]
fn cancelling_inside_a_patch_of_200_k_vertices_returns_within_a_second() {
    // The aim is 200 ms; the test allows for a machine that other tests keep busy.
    let big = sheet("big", 450, 450, 0.5, |s, t| DVec3::new(s, t, 0.2 * (5.0 * s).sin() * (4.0 * t).cos()));
    for millis in [20, 500] {
        let patience = Duration::from_millis(millis);
        let observer = Impatient { start: Instant::now(), patience, asked: AtomicUsize::new(0) };
        let patches = [big.patch.clone()];
        let observer = Impatient { start: Instant::now(), ..observer };
        let result = relax(&big.input, &patches, &[(450, 450)], &GridParams::default(), &observer);
        let late = observer.start.elapsed().saturating_sub(patience);
        assert_eq!(result.unwrap_err(), GridError::Cancelled(planish::observe::Cancelled));
        assert!(observer.asked.load(Ordering::Relaxed) > 0);
        assert!(late < Duration::from_secs(1), "{late:?}");
    }
}

#[test]
fn snouts_give_grids_without_folds_that_stay_on_the_mesh() {
    for sheet in snouts(96) {
        let grid = grid_of(&sheet, 97, 97);
        assert_on_the_mesh(&sheet, &grid);
        let quality = measure(&grid, &sheet.patch);
        assert_eq!(quality.folds, 0, "{}: {quality:?}", sheet.name);
    }
}

#[test]
fn a_grid_follows_a_needle_20_times_as_high_as_wide_over_60_percent_of_its_height() {
    let needle = patches::Snout { radius: 0.05, height: 2.0, lean: 0.05, center: [0.1, 0.0] }.sheet("needle", 96);
    let grid = grid_of(&needle, 97, 97);
    assert_on_the_mesh(&needle, &grid);
    // The chart shrinks the needle far below the cells; the grid must follow it up nevertheless.
    let top = grid.points.iter().map(|p| p.z).fold(0.0, f64::max);
    assert!(top > 1.2, "{top}");
}

#[test]
fn a_snout_of_65_k_vertices_gives_even_square_cells_that_miss_it_by_less_than_0_15_percent() {
    let snout = patches::Snout { radius: 0.4, height: 1.2, lean: 0.1, center: [0.05, 0.03] }.sheet("snout", 256);
    let grid = grid_of(&snout, 257, 257);
    let quality = measure(&grid, &snout.patch);
    assert_eq!(quality.folds, 0);
    assert!(quality.spacing_cv < 0.055, "spacing {}", quality.spacing_cv);
    assert!(quality.angle_p95_deg < 46.0, "angle {}", quality.angle_p95_deg);
    assert!(quality.miss_max < 0.0015, "miss {}", quality.miss_max);
}

#[test]
fn measure_of_a_sheared_uneven_grid_gives_30_degrees_and_its_known_spacing() {
    // Columns at 0, 1, 3 (spacing 1 and 2: deviation over mean 1/3), lines sheared by 30 degrees.
    let shear = 30f64.to_radians().tan();
    let flat = sheet("flat", 2, 2, 0.0, |s, t| DVec3::new(3.0 * s + 2.0 * shear * t, 2.0 * t, 0.0));
    let at = |x: f64, y: f64| DVec3::new(x + shear * y, y, 0.0);
    let points: Vec<DVec3> = [0.0, 1.0, 2.0].iter().flat_map(|&y| [0.0, 1.0, 3.0].map(|x| at(x, y))).collect();
    let place = FacePoint::corner(0, 0);
    let grid = Grid { rows: 3, cols: 3, points, places: vec![place; 9] };
    let quality = measure(&grid, &flat.patch);
    assert_eq!(quality.folds, 0);
    assert!((quality.spacing_cv - 1.0 / 6.0).abs() < 1e-12 && (quality.spacing_cv_worst - 1.0 / 3.0).abs() < 1e-12);
    assert!((quality.angle_p95_deg - 30.0).abs() < 1e-9);
    assert!(quality.miss_max < 1e-12);
    let mut folded = grid.clone();
    folded.points[4] = at(3.5, 1.0);
    assert!(measure(&folded, &flat.patch).folds > 0);
}

#[test]
fn disks_cut_from_scans_give_grids_on_the_mesh() {
    for (file, disks) in patches::scan_disks(0.05) {
        let Some(disks) = disks else {
            println!("skipped: {file} is not there");
            continue;
        };
        let mut folds = 0;
        for sheet in &disks {
            let n = (sheet.patch.mesh.points.len() as f64).sqrt().ceil().clamp(17.0, 60.0) as usize;
            let grid = grid_of(sheet, n, n);
            assert_on_the_mesh(sheet, &grid);
            folds += measure(&grid, &sheet.patch).folds;
        }
        println!("{file}: {} disks, {folds} folds", disks.len());
        assert_eq!(folds, 0, "{file}");
    }
}

#[test]
fn a_box_divided_by_3_has_54_patches_with_corners_at_thirds_of_its_sides_within_1e_4() {
    let size = DVec3::new(3.0, 6.0, 9.0);
    let mesh = shapes::cuboid(size, 10);
    let network = layout(&mesh, Known::default(), &LayoutParams::default(), None, &Silent).unwrap().network;
    assert_eq!(network.patches.len(), 6);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| divide(&mesh, &network, 3, &GridParams::default(), &Silent).unwrap())
    };
    let divided = run(1);
    assert_eq!(divided, run(4));
    assert_eq!([divided.corners.len(), divided.curves.len(), divided.patches.len()], [56, 108, 54]);
    assert_eq!(divided.curves.iter().filter(|c| c.kind == CurveKind::Feature).count(), 36);
    let low = mesh.bounds().min;
    for corner in &divided.corners {
        let thirds = (corner.place.position(&mesh) - low) / size * 3.0;
        assert!(thirds.distance(thirds.round()) < 1e-4, "{thirds}");
    }
    for patch in imprint(&mesh, &divided, &Silent).unwrap() {
        let sides = patch.mesh.bounds().max - patch.mesh.bounds().min;
        let area: f64 = (0..patch.mesh.triangles.len()).map(|f| patch.mesh.area(f)).sum();
        let flat = [sides.x * sides.y, sides.y * sides.z, sides.z * sides.x].iter().sum::<f64>();
        assert!((area / flat - 1.0).abs() < 1e-3, "{area} of {flat}");
    }
    assert_eq!(divide(&mesh, &network, 1, &GridParams::default(), &Silent).unwrap(), network);
}

#[test]
fn regress_2000_patches_on_a_ball_follow_its_form_and_their_number_is_kept() {
    // They are more than the working mesh of a layout has room for.
    let mesh = shapes::sphere(1.0, 6);
    let params = LayoutParams { patches: 2000, ..LayoutParams::default() };
    let drafted = pipeline::layout(&mesh, None, &params, &Silent).unwrap();
    let found = drafted.network.patches.len();
    assert!(count_is_near(found, 2000), "{found}");
    assert_eq!(drafted.warnings.len(), 0, "{:?}", drafted.warnings);
    let mut ends = vec![0; drafted.network.corners.len()];
    drafted.network.curves.iter().flat_map(|c| c.corners).for_each(|c| ends[c as usize] += 1);
    assert_eq!(ends.iter().filter(|n| **n != 4).count(), 8, "a ball has eight corners with three patches");
    imprint(&drafted.mesh, &drafted.network, &Silent).unwrap();
}
