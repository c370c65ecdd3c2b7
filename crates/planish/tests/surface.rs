//! Fits, seams and their figures.

mod patchworks;

use glam::DVec3;
use patchworks::*;
use planish::grid::Grid;
use planish::network::CurveKind;
use planish::surface::{self, FitError, FitParams, Resolution, Surface};
use planish::{Observer, Silent};

fn control(m: usize, n: usize) -> FitParams {
    FitParams { resolution: Resolution::Control([m, n]) }
}

fn fit(work: &Patchwork, params: &FitParams) -> Vec<Surface> {
    surface::fit_network(&work.network, &work.grids, params, &Silent).unwrap()
}

/// Points of a bicubic polynomial.
fn bicubic(u: f64, v: f64) -> DVec3 {
    let f = |a: f64, b: f64, c: f64| a + u * (1.0 + b * v * v + c * u * u * v * v * v) - c * v * v * v + b * u * u;
    DVec3::new(f(0.1, 0.4, -0.7), f(-0.5, -1.1, 0.3), f(2.0, 0.6, 1.4))
}

#[test]
fn fit_recovers_a_bicubic_polynomial_within_1e_12() {
    for control in [[4, 4], [5, 9], [13, 7]] {
        let g = grid(30, 41, bicubic);
        let s = surface::fit(&g.points, 30, 41, control).unwrap();
        for (u, v) in [(0.0, 0.0), (1.0, 0.0), (0.37, 0.91), (0.5, 0.25), (1.0, 1.0)] {
            assert!(s.point(u, v).distance(bicubic(u, v)) < 1e-12);
        }
        assert!(surface::deviation_of(&s, &g).max < 1e-12);
    }
}

#[test]
fn fit_with_as_many_control_points_as_nodes_interpolates_within_1e_9() {
    let g = grid(17, 23, |u, v| DVec3::new(u, v, (9.0 * u).sin() * (7.0 * v).cos()));
    let s = surface::fit(&g.points, 17, 23, [17, 23]).unwrap();
    assert!(surface::deviation_of(&s, &g).max < 1e-9);
}

#[test]
fn jets_match_central_differences_within_1e_5() {
    let g = grid(30, 41, |u, v| DVec3::new(u + 0.2 * (5.0 * v).sin(), v, (4.0 * u * v).cos()));
    let s = surface::fit(&g.points, 30, 41, [9, 12]).unwrap();
    let h = 1e-5;
    for (u, v) in [(0.31, 0.47), (0.05, 0.93), (0.77, 0.123)] {
        let jet = s.jet(u, v);
        let d = |du: f64, dv: f64| s.point(u + du * h, v + dv * h);
        assert!(((d(1.0, 0.0) - d(-1.0, 0.0)) / (2.0 * h)).distance(jet.u) < 1e-5);
        assert!(((d(0.0, 1.0) - d(0.0, -1.0)) / (2.0 * h)).distance(jet.v) < 1e-5);
        let ju = |du: f64, dv: f64| s.jet(u + du * h, v + dv * h).u;
        let jv = |du: f64, dv: f64| s.jet(u + du * h, v + dv * h).v;
        assert!(((ju(1.0, 0.0) - ju(-1.0, 0.0)) / (2.0 * h)).distance(jet.uu) < 1e-5);
        assert!(((ju(0.0, 1.0) - ju(0.0, -1.0)) / (2.0 * h)).distance(jet.uv) < 1e-5);
        assert!(((jv(0.0, 1.0) - jv(0.0, -1.0)) / (2.0 * h)).distance(jet.vv) < 1e-5);
    }
    let all = s.sample(&[0.0, 0.3, 1.0], &[0.2, 1.0], [1, 1]);
    assert!(all[4].distance(s.jet(0.3, 1.0).uv) < 1e-12);
}

#[test]
fn a_cylinder_is_approached_with_order_4() {
    let g = grid(200, 400, |u, v| {
        let a = 2.0 * u;
        DVec3::new(a.cos(), a.sin(), v)
    });
    let worst = |m: usize| surface::deviation_of(&surface::fit(&g.points, 200, 400, [5, m]).unwrap(), &g).max;
    let (coarse, fine) = (worst(3 + 8), worst(3 + 16));
    let order = (coarse / fine).log2();
    assert!((3.7..4.6).contains(&order), "order {order}, {coarse:e} to {fine:e}");
}

#[test]
fn inside_of_a_network_fit_is_the_least_squares_one_for_its_boundary() {
    // No move of an inside control point may lessen the sum of squares.
    let work = cube(21, CurveKind::Smooth, blob);
    let surfaces = fit(&work, &control(7, 7));
    let sum = |s: &Surface, g: &Grid| surface::deviation_of(s, g).rms.powi(2);
    let (s, g) = (&surfaces[0], &work.grids[0]);
    for c in [8, 17, 24, 40] {
        let moved = |d: DVec3| {
            let mut t = s.clone();
            t.control[c] += d;
            sum(&t, g)
        };
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            let slope = (moved(axis * 1e-4) - moved(-axis * 1e-4)) / 2e-4;
            assert!(slope.abs() < 1e-10, "slope {slope:e}");
        }
    }
}

/// Control points along a curve as each of its patches has them, in the direction of the curve.
fn boundary_points(work: &Patchwork, surfaces: &[Surface], curve: usize) -> Vec<Vec<DVec3>> {
    work.network.uses()[curve]
        .iter()
        .map(|&(p, k)| {
            let (s, side) = (&surfaces[p as usize], work.network.patches[p as usize].sides[k as usize]);
            let n = if k % 2 == 0 { s.cols } else { s.rows };
            let mut points: Vec<DVec3> = (0..n)
                .map(|i| match k {
                    0 => s.at(i, 0),
                    1 => s.at(s.cols - 1, i),
                    2 => s.at(s.cols - 1 - i, s.rows - 1),
                    _ => s.at(0, s.rows - 1 - i),
                })
                .collect();
            if side.reversed {
                points.reverse();
            }
            points
        })
        .collect()
}

#[test]
fn seams_share_their_control_points_bit_for_bit_and_gap_below_1e_15() {
    for work in [
        cube(21, CurveKind::Smooth, blob),
        torus(17),
        wavy([12, 15]),
        tube([40, 15]),
        one_patch_torus([40, 30]),
        purse(20),
    ] {
        let surfaces = fit(&work, &control(6, 8));
        for c in 0..work.network.curves.len() {
            let points = boundary_points(&work, &surfaces, c);
            assert!(points.windows(2).all(|w| w[0] == w[1]));
        }
        for seam in surface::measure_seams(&work.network, &surfaces) {
            assert!(seam.gap_max < 2e-15, "{seam:?}");
        }
    }
}

#[test]
fn corners_lie_on_the_grid_corners_to_the_bit() {
    let work = cube(21, CurveKind::Smooth, blob);
    for (s, g) in fit(&work, &control(6, 6)).iter().zip(&work.grids) {
        assert_eq!(s.at(0, 0), g.points[0]);
        assert_eq!(s.at(5, 5), g.points[440]);
    }
}

#[test]
fn a_tolerance_is_kept_in_every_patch_with_counts_equal_along_chords() {
    for fraction in [1e-2, 1e-3, 1e-5] {
        for work in [cube(41, CurveKind::Smooth, blob), wavy([41, 33])] {
            let points: Vec<DVec3> = work.grids.iter().flat_map(|g| g.points.clone()).collect();
            let size = planish::geom::Aabb::of(&points).diagonal();
            let surfaces = fit(&work, &FitParams { resolution: Resolution::Tolerance(fraction) });
            for (s, g) in surfaces.iter().zip(&work.grids) {
                let rms = surface::deviation_of(s, g).rms;
                assert!(rms <= fraction * size, "{rms:e} at {fraction:e} with {} x {}", s.rows, s.cols);
            }
        }
    }
}

#[test]
fn a_looser_tolerance_takes_fewer_control_points() {
    let work = cube(41, CurveKind::Smooth, blob);
    let count =
        |f| fit(&work, &FitParams { resolution: Resolution::Tolerance(f) }).iter().map(|s| s.control.len()).sum();
    let counts: [usize; 3] = [1e-2, 1e-3, 1e-4].map(count);
    assert!(counts[0] < counts[1] && counts[1] < counts[2], "{counts:?}");
}

#[test]
fn counts_per_curve_reach_the_whole_chord() {
    let work = wavy([12, 15]);
    let mut list = vec![5; work.network.curves.len()];
    list[work.network.patches[0].sides[0].curve as usize] = 9;
    let surfaces = fit(&work, &FitParams { resolution: Resolution::PerCurve(list) });
    // Patches 0, 2 and 4 stand above each other.
    let shapes: Vec<_> = surfaces.iter().map(|s| (s.cols, s.rows)).collect();
    assert_eq!(shapes, [(9, 5), (5, 5), (9, 5), (5, 5), (9, 5), (5, 5)]);
}

#[test]
fn bad_input_is_an_error_that_says_what() {
    let mut work = cube(9, CurveKind::Smooth, blob);
    let run = |work: &Patchwork, params: &FitParams| {
        surface::fit_network(&work.network, &work.grids, params, &Silent).unwrap_err()
    };
    assert_eq!(run(&work, &control(10, 5)), FitError::TooFewPoints { points: 9, control: 10 });
    assert_eq!(run(&work, &control(3, 5)), FitError::TooFewControl { control: 3 });
    assert!(matches!(run(&work, &FitParams { resolution: Resolution::Tolerance(0.0) }), FitError::Parameter { .. }));
    work.grids[2].points[3] += DVec3::X * 1e-3;
    assert!(matches!(run(&work, &control(5, 5)), FitError::OpenSeam { .. }));
    work.grids[2].points[40].x = f64::NAN;
    assert_eq!(run(&work, &control(5, 5)), FitError::NotFinite { patch: 2 });
    work.grids[2].points.pop();
    assert!(matches!(run(&work, &control(5, 5)), FitError::Shape { patch: 2, .. }));
    work.grids.pop();
    assert!(matches!(run(&work, &control(5, 5)), FitError::Count { found: 5, wanted: 6, .. }));
    assert!(matches!(surface::fit(&[DVec3::ZERO; 5], 2, 3, [4, 4]), Err(FitError::Shape { .. })));
    struct Stop;
    impl Observer for Stop {
        fn progress(&self, _: f64) {}
        fn cancelled(&self) -> bool {
            true
        }
    }
    let work = cube(9, CurveKind::Smooth, blob);
    assert_eq!(
        surface::fit_network(&work.network, &work.grids, &control(5, 5), &Stop).unwrap_err(),
        FitError::Cancelled
    );
}

#[test]
fn fit_is_the_same_to_the_bit_on_1_and_4_threads() {
    let work = cube(33, CurveKind::Smooth, blob);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| fit(&work, &FitParams { resolution: Resolution::Tolerance(1e-4) }))
    };
    assert_eq!(run(1), run(4));
}

#[test]
fn probe() {
    for (name, work) in [
        ("blob", cube(41, CurveKind::Smooth, blob)),
        ("sphere", cube(41, CurveKind::Smooth, to_sphere)),
        ("torus", torus(33)),
        ("wavy", wavy([33, 33])),
    ] {
        for m in [4, 5, 6, 8, 10, 12, 16, 24] {
            let before = fit(&work, &control(m, m));
            let after = surface::stitch(&work.network, &work.grids, &before, &Default::default(), &Silent).unwrap();
            for (s, t) in [("fit", &before), ("stitched", &after)] {
                let seams = surface::measure_seams(&work.network, t);
                let max = seams.iter().map(|s| s.angle_max_deg).fold(0.0, f64::max);
                let mean = seams.iter().map(|s| s.angle_mean_deg).sum::<f64>() / seams.len() as f64;
                let gap = seams.iter().map(|s| s.gap_max).fold(0.0, f64::max);
                let d = surface::deviation(t, &work.grids);
                println!(
                    "{name} {m:3} {s:9} angle mean {mean:.5} max {max:.4} gap {gap:.1e} rms {:.2e} max {:.2e}",
                    d.rms, d.max
                );
            }
        }
    }
}
