//! Fits, seams and their figures.

mod patchworks;

use glam::DVec3;
use patchworks::*;
use planish::grid::Grid;
use planish::network::CurveKind;
use planish::surface::{self, FitError, FitParams, KnotSpacing, Measure, Resolution, StitchParams, Surface};
use planish::{Observer, Silent};

/// Plain least squares, up to one control point per node.
fn plain(resolution: Resolution) -> FitParams {
    FitParams { resolution, cells_per_span: 1.0, smoothing: 0.0, ..FitParams::default() }
}

fn control(m: usize, n: usize) -> FitParams {
    plain(Resolution::Control([m, n]))
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
fn basis_functions_add_up_to_1_on_knots_with_double_ones_within_1e_14() {
    let knots = [0.0, 0.0, 0.0, 0.0, 0.3, 0.3, 0.7, 1.0, 1.0, 1.0, 1.0];
    for i in 0..=100 {
        let (first, [value, slope, bend]) = surface::basis::basis_at(&knots, i as f64 / 100.0);
        assert!(first <= 3);
        assert!((value.iter().sum::<f64>() - 1.0).abs() < 1e-14 && value.iter().all(|v| *v >= 0.0));
        assert!(slope.iter().sum::<f64>().abs() < 1e-12 && bend.iter().sum::<f64>().abs() < 1e-10);
    }
    let control = (0..28).map(|c| DVec3::new((c % 7) as f64, (c / 7) as f64, 0.0)).collect();
    let knots_v = surface::basis::uniform_knots(4);
    let s = Surface { rows: 4, cols: 7, control, knots_u: knots.to_vec(), knots_v };
    assert_eq!(s.check(), Ok(()));
    assert_eq!(s.point(0.0, 0.0), DVec3::ZERO);
    assert_eq!(s.point(1.0, 1.0), DVec3::new(6.0, 3.0, 0.0));
    assert_eq!(s.point(2.0, -1.0), DVec3::new(6.0, 0.0, 0.0));
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
        for seam in surface::measure_seams(&work.network, &surfaces, &Silent).unwrap() {
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
fn a_tolerance_of_any_measure_is_kept_in_every_patch() {
    for (fraction, tolerance_of) in
        [(1e-2, Measure::Rms), (1e-3, Measure::P95), (1e-3, Measure::Max), (1e-5, Measure::Rms)]
    {
        for work in [cube(41, CurveKind::Smooth, blob), wavy([41, 33])] {
            let points: Vec<DVec3> = work.grids.iter().flat_map(|g| g.points.clone()).collect();
            let allowed = fraction * planish::geom::Aabb::of(&points).diagonal();
            let surfaces = fit(&work, &FitParams { tolerance_of, ..plain(Resolution::Tolerance(fraction)) });
            for (s, g) in surfaces.iter().zip(&work.grids) {
                let found = surface::normal_deviation_of(s, g);
                let found = tolerance_of.among(&found);
                assert!(found <= allowed, "{found:e} at {allowed:e} with {} x {}", s.rows, s.cols);
            }
        }
    }
}

/// A row of three patches with a narrow ridge across the middle one, a third of the way along it.
fn ridge(nodes: [usize; 2]) -> Patchwork {
    sheet(3, 2, [false, false], nodes, |x, y| {
        let away = (x - 4.0 / 3.0) / 0.04;
        DVec3::new(x, y, 0.05 * (-away * away / 2.0).exp())
    })
}

#[test]
fn fitted_knots_stand_where_the_shape_bends() {
    let work = ridge([161, 21]);
    let control = |knots| {
        let params = FitParams { knots, tolerance_of: Measure::Max, ..plain(Resolution::Tolerance(1e-4)) };
        let surfaces = fit(&work, &params);
        for (s, g) in surfaces.iter().zip(&work.grids) {
            let allowed = 1e-4 * 13f64.sqrt() * 1.001;
            assert!(surface::normal_deviation_of(s, g).max <= allowed);
        }
        // Both patches of the middle column have the same knots.
        assert_eq!(surfaces[1].knots_u, surfaces[4].knots_u);
        surfaces
    };
    let (even, fitted) = (control(KnotSpacing::Even), control(KnotSpacing::Fitted));
    assert!(2 * fitted[1].cols <= even[1].cols, "{} of {}", fitted[1].cols, even[1].cols);
    assert_eq!([fitted[0].cols, fitted[0].rows], [5, 5]);
    let inner = &fitted[1].knots_u[4..fitted[1].cols];
    let near = inner.iter().filter(|k| (*k - 1.0 / 3.0).abs() < 0.15).count();
    assert!(2 * near > inner.len(), "{near} of {} knots beside the ridge", inner.len());
}

#[test]
fn smooth_seams_with_fitted_knots_meet_their_tolerance() {
    let work = ridge([161, 61]);
    let params = FitParams { tolerance_of: Measure::Max, ..plain(Resolution::Tolerance(1e-4)) };
    let smooth = surface::stitch(&work.network, &work.grids, &fit(&work, &params), &StitchParams::default(), &Silent);
    let seams = surface::measure_seams(&work.network, &smooth.unwrap(), &Silent).unwrap();
    assert_eq!(seams.len(), 7);
    for seam in seams {
        assert_eq!(seam.gap_bound, 0.0);
        assert!(seam.regular_angle_bound_deg.unwrap() < 0.05, "{seam:?}");
    }
}

#[test]
fn a_patch_gets_the_control_points_that_are_asked_for_at_it() {
    let work = wavy([41, 33]);
    for resolution in [Resolution::Control([6, 6]), Resolution::Tolerance(1e-2)] {
        let params = FitParams { control_at: vec![[2, 13, 9]], ..plain(resolution) };
        let surfaces = fit(&work, &params);
        // Patches 0, 2 and 4 stand above each other, 2 and 3 side by side.
        assert!(
            surfaces.iter().enumerate().all(|(p, s)| (s.cols == 13) == (p % 2 == 0) && (s.rows == 9) == (p / 2 == 1))
        );
    }
    let params = FitParams { control_at: vec![[6, 13, 9]], ..control(6, 6) };
    let error = surface::fit_network(&work.network, &work.grids, &params, &Silent).unwrap_err();
    assert_eq!(error, FitError::NoSuchPatch { patch: 6, patches: 6 });
    let params = FitParams { control_at: vec![[0, usize::MAX, 9]], ..control(6, 6) };
    let error = surface::fit_network(&work.network, &work.grids, &params, &Silent).unwrap_err();
    assert!(matches!(error, FitError::Parameter { name: "control_at", .. }), "{error}");
}

#[test]
fn a_budget_of_control_points_is_kept() {
    let work = cube(41, CurveKind::Smooth, blob);
    let params = |most| FitParams { max_control: Some(most), ..plain(Resolution::Tolerance(1e-5)) };
    let total = |surfaces: &[Surface]| surfaces.iter().map(|s| s.control.len()).sum::<usize>();
    let free = total(&fit(&work, &plain(Resolution::Tolerance(1e-5))));
    for most in [free / 2, free / 4] {
        let found = total(&fit(&work, &params(most)));
        assert!(found <= most && found > most / 3, "{found} of {most}, {free} without");
    }
    let error = surface::fit_network(&work.network, &work.grids, &params(6 * 25 - 1), &Silent).unwrap_err();
    assert_eq!(error, FitError::Budget { most: 149, least: 150 });
}

#[test]
fn coarse_grids_are_told_to_be_too_coarse_for_a_tolerance() {
    let starved = |nodes: usize| {
        let work = ridge([nodes, 21]);
        let params = FitParams { cells_per_span: 4.0, ..plain(Resolution::Tolerance(1e-4)) };
        (surface::starved(&work.network, &work.grids, &params, &Silent).unwrap(), work)
    };
    let (coarse, work) = starved(21);
    let middle = work.network.patches[1].sides[0].curve as usize;
    let chords = work.network.chords();
    for (curve, excess) in coarse.iter().enumerate() {
        assert_eq!(*excess > 1.0, chords[curve] == chords[middle], "curve {curve}: {excess}");
    }
    assert!(starved(321).0.iter().all(|&excess| excess == 0.0));
}

#[test]
fn opposite_sides_run_the_same_way_along_their_chord() {
    let works =
        [cube(5, CurveKind::Smooth, blob), torus(5), wavy([5, 5]), tube([5, 5]), one_patch_torus([5, 5]), purse(5)];
    for work in works {
        let along = work.network.directed_chords();
        for patch in &work.network.patches {
            for (side, other) in [(patch.sides[0], patch.sides[2]), (patch.sides[1], patch.sides[3])] {
                let [a, b] = [side, other].map(|s| (along[s.curve as usize], s.reversed));
                assert_eq!(a.0.chord, b.0.chord);
                assert_ne!(a.0.reversed != a.1, b.0.reversed != b.1, "sides run against each other");
                assert!(!a.0.both_ways);
            }
        }
    }
    // A Moebius strip of one patch.
    let mut strip = tube([5, 5]).network;
    let [one, other] = [strip.patches[0].sides[1], strip.patches[0].sides[3]];
    assert_ne!(one.reversed, other.reversed);
    strip.patches[0].sides[3].reversed = one.reversed;
    assert!(strip.directed_chords()[one.curve as usize].both_ways);
}

#[test]
fn a_looser_tolerance_takes_fewer_control_points() {
    let work = cube(41, CurveKind::Smooth, blob);
    let count = |f| fit(&work, &plain(Resolution::Tolerance(f))).iter().map(|s| s.control.len()).sum();
    let counts: [usize; 3] = [1e-2, 1e-3, 1e-4].map(count);
    assert!(counts[0] < counts[1] && counts[1] < counts[2], "{counts:?}");
}

#[test]
fn counts_per_curve_reach_the_whole_chord() {
    let work = wavy([12, 15]);
    let mut list = vec![5; work.network.curves.len()];
    list[work.network.patches[0].sides[0].curve as usize] = 9;
    let surfaces = fit(&work, &plain(Resolution::PerCurve(list)));
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
    assert!(matches!(run(&work, &plain(Resolution::Tolerance(0.0))), FitError::Parameter { .. }));
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
        FitError::Cancelled(planish::observe::Cancelled)
    );
}

#[test]
fn fit_is_the_same_to_the_bit_on_1_and_4_threads() {
    let work = cube(33, CurveKind::Smooth, blob);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| fit(&work, &plain(Resolution::Tolerance(1e-4))))
    };
    assert_eq!(run(1), run(4));
}

fn stitched(work: &Patchwork, m: usize) -> (Vec<Surface>, Vec<Surface>) {
    stitched_for(work, m, StitchParams::default())
}

fn stitched_for(work: &Patchwork, m: usize, params: StitchParams) -> (Vec<Surface>, Vec<Surface>) {
    let before = fit(work, &control(m, m));
    let after = surface::stitch(&work.network, &work.grids, &before, &params, &Silent).unwrap();
    (before, after)
}

/// `(mean, max)` angle over the smooth seams, degrees.
fn angles(work: &Patchwork, surfaces: &[Surface]) -> (f64, f64) {
    let mut seams = surface::measure_seams(&work.network, surfaces, &Silent).unwrap();
    seams.retain(|s| s.kind.is_smooth());
    let mean = seams.iter().map(|s| s.angle_mean_deg).sum::<f64>() / seams.len() as f64;
    (mean, seams.iter().map(|s| s.angle_max_deg).fold(0.0, f64::max))
}

#[test]
fn stitched_seams_of_a_bumpy_closed_shape_with_corners_of_valence_3_are_smooth_within_a_tenth_of_a_degree() {
    let work = cube(41, CurveKind::Smooth, blob);
    let params = StitchParams { angle_tolerance: 0.01, fit_loss: 0.5, ..StitchParams::default() };
    for (m, mean, max) in [(6, 0.25, 0.9), (8, 0.05, 0.25), (10, 0.02, 0.1), (16, 0.006, 0.035)] {
        let (before, after) = stitched_for(&work, m, params.clone());
        let (was, is) = (angles(&work, &before), angles(&work, &after));
        assert!(is.0 < mean && is.1 < max, "{m}: {is:?} degrees");
        assert!(is.0 < was.0 / 3.0, "{m}: {was:?} to {is:?} degrees");
        let (was, is) = (surface::deviation(&before, &work.grids), surface::deviation(&after, &work.grids));
        assert!(is.rms < 1.4 * was.rms, "{m}: rms {:e} to {:e}", was.rms, is.rms);
    }
}

#[test]
fn stitched_seams_of_regular_networks_are_smooth_within_a_thousandth_of_a_degree() {
    let params = StitchParams { angle_tolerance: 1e-3, ..StitchParams::default() };
    for work in [torus(33), wavy([33, 33])] {
        let (mean, max) = angles(&work, &stitched_for(&work, 10, params.clone()).1);
        assert!(mean < 5e-4 && max < 3e-3, "{mean} {max}");
    }
}

#[test]
fn seams_of_a_rough_scan_become_smooth_and_cost_the_fit_half_of_its_accuracy_at_most() {
    let work = cube(41, CurveKind::Smooth, rough_blob);
    let params = StitchParams { fit_loss: 0.6, ..StitchParams::default() };
    for m in [6, 8, 10] {
        let (before, after) = stitched_for(&work, m, params.clone());
        let (was, is) = (angles(&work, &before), angles(&work, &after));
        assert!(was.0 > 2.0 && is.0 < 0.25 && is.1 < 1.0, "{m}: {was:?} to {is:?} degrees");
        let (was, is) = (surface::deviation(&before, &work.grids), surface::deviation(&after, &work.grids));
        assert!(is.rms < 1.5 * was.rms, "{m}: rms {:e} to {:e}", was.rms, is.rms);
    }
}

#[test]
fn stitching_keeps_seams_bit_identical_and_moves_corners_by_less_than_the_fit_misses() {
    for work in [
        cube(31, CurveKind::Smooth, blob),
        torus(17),
        wavy([12, 15]),
        tube([40, 15]),
        one_patch_torus([40, 30]),
        purse(20),
    ] {
        let (before, after) = stitched(&work, 8);
        for c in 0..work.network.curves.len() {
            let points = boundary_points(&work, &after, c);
            assert!(points.windows(2).all(|w| w[0] == w[1]));
        }
        // Corners with smooth seams all around go along their normals, by less than the fit misses; all others stay.
        let uses = work.network.uses();
        let is_inner = |c: usize| uses[c].len() == 2 && work.network.curves[c].kind.is_smooth();
        let is_held = |corner: u32| {
            let mut curves = work.network.curves.iter().enumerate();
            curves.any(|(c, curve)| curve.corners.contains(&corner) && !is_inner(c))
        };
        let most = surface::deviation(&before, &work.grids).max;
        for (p, (a, b)) in before.iter().zip(&after).enumerate() {
            for (k, (i, j)) in [(0, 0), (7, 0), (7, 7), (0, 7)].into_iter().enumerate() {
                let way = a.at(i, j).distance(b.at(i, j));
                assert!(way <= if is_held(work.network.corner(p, k)) { 0.0 } else { most }, "{way} of {most}");
            }
            assert!(b.control.iter().all(|p| p.is_finite()));
        }
        for seam in surface::measure_seams(&work.network, &after, &Silent).unwrap() {
            assert!(seam.gap_max < 2e-15, "{seam:?}");
        }
    }
}

/// A round can with a wavy rim: caps and wall meet in features, the four seams of the wall are smooth.
fn can() -> Patchwork {
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};
    let mut work = cube(41, CurveKind::Smooth, |p| {
        let r = p.x.abs().max(p.y.abs());
        let a = match (r == 0.0, p.x.abs() >= p.y.abs()) {
            (true, _) => 0.0,
            (_, true) => p.y / p.x * FRAC_PI_4 + if p.x > 0.0 { 0.0 } else { PI },
            (_, false) => FRAC_PI_2 - p.x / p.y * FRAC_PI_4 + if p.y > 0.0 { 0.0 } else { PI },
        };
        DVec3::new(r * a.cos(), r * a.sin(), p.z * (1.0 + 0.2 * (2.0 * a).sin() * r))
    });
    for curve in &mut work.network.curves {
        // Corner ids differ in bit 2 along z.
        if curve.corners[0] ^ curve.corners[1] != 4 {
            curve.kind = CurveKind::Feature;
        }
    }
    work
}

#[test]
fn features_stay_sharp_while_the_smooth_seams_between_them_become_smooth() {
    let work = can();
    let (before, after) = stitched(&work, 8);
    let (mean, max) = angles(&work, &after);
    // Beside the rims the slopes of the grids have a say.
    assert!(mean < 0.03 && max < 0.1, "{mean} {max}");
    for (a, b) in surface::measure_seams(&work.network, &before, &Silent)
        .unwrap()
        .iter()
        .zip(surface::measure_seams(&work.network, &after, &Silent).unwrap())
    {
        assert_eq!(a.curve, b.curve);
        if a.kind == CurveKind::Feature {
            assert!(b.angle_mean_deg > 60.0 && (a.angle_mean_deg - b.angle_mean_deg).abs() < 2.0, "{a:?} {b:?}");
        }
    }
    // A box has features only, and its faces are as its grids say.
    let sharp = cube(11, CurveKind::Feature, |p| p);
    let (before, after) = stitched(&sharp, 5);
    let moved = before.iter().zip(&after).flat_map(|(a, b)| a.control.iter().zip(&b.control));
    assert!(moved.map(|(a, b)| a.distance(*b)).fold(0.0, f64::max) < 1e-12);
    for seam in surface::measure_seams(&sharp.network, &after, &Silent).unwrap() {
        assert!((seam.angle_max_deg - 90.0).abs() < 1e-9 && (seam.length - 2.0).abs() < 1e-12);
    }
}

#[test]
fn faces_that_are_flat_beside_an_edge_meet_at_their_angle_though_what_is_further_inside_makes_the_fit_swing() {
    // A plateau on each face, its foot two knot spans inside.
    let stepped = |p: DVec3| {
        let out = DVec3::from_array([0, 1, 2].map(|k| {
            let others = (0..3).filter(|&j| j != k).all(|j| p[j].abs() < 0.6);
            if p[k].abs() == 1.0 && others { 0.2 * p[k] } else { 0.0 }
        }));
        p + out
    };
    let work = cube(41, CurveKind::Feature, stepped);
    let (before, after) = stitched(&work, 13);
    let off = |surfaces: &[Surface]| -> f64 {
        let seams = surface::measure_seams(&work.network, surfaces, &Silent).unwrap();
        seams.iter().map(|s| (s.angle_mean_deg - 90.0).abs()).sum::<f64>() / seams.len() as f64
    };
    let (was, is) = (off(&before), off(&after));
    assert!(was > 20.0 && is < 0.5, "{was} to {is} degrees");
    let (was, is) = (surface::deviation(&before, &work.grids), surface::deviation(&after, &work.grids));
    assert!(is.rms < 1.1 * was.rms, "{was:?} {is:?}");
}

/// A square tube of 4 x 2 patches; its edges are wavy features, its sides rough away from them.
fn rough_tube() -> Patchwork {
    let corners = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)].map(|(x, y)| DVec3::new(x, y, 0.0));
    let mut work = sheet(4, 2, [true, false], [25, 25], |x, y| {
        let i = x.floor().min(x.ceil() - 1.0).max(0.0);
        let (a, b, t) = (corners[i as usize % 4], corners[(i as usize + 1) % 4], x - i);
        let wave = 0.03 * t * (1.0 - t) * (7.0 * x + 9.0 * y).sin();
        a.lerp(b, t) * (1.0 + 0.02 * (11.0 * y).sin()) + DVec3::Z * y + (b - a).cross(DVec3::Z) * wave
    });
    for curve in &mut work.network.curves {
        if curve.kind.is_smooth() && curve.corners[0] % 4 == curve.corners[1] % 4 {
            curve.kind = CurveKind::Feature;
        }
    }
    work
}

#[test]
fn stitching_leaves_features_within_one_and_a_half_times_the_distance_from_their_nodes_that_they_had() {
    let work = rough_tube();
    let (before, after) = stitched(&work, 8);
    // Side 3 of every patch is a feature.
    let rms = |all: &[Surface]| {
        let off = |(s, g): (&Surface, &Grid)| -> Vec<f64> {
            let v = |j: usize| j as f64 / (g.rows - 1) as f64;
            (0..g.rows).map(|j| s.jet(0.0, v(j)).point.distance_squared(g.points[j * g.cols])).collect()
        };
        let all: Vec<f64> = all.iter().zip(&work.grids).flat_map(off).collect();
        (all.iter().sum::<f64>() / all.len() as f64).sqrt()
    };
    let (was, is) = (rms(&before), rms(&after));
    assert!(is < 1.5 * was, "{was:e} to {is:e}");
}

#[test]
fn stitching_moves_with_the_model_within_1e_6_of_its_size() {
    let turn = glam::DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 0.8);
    let place = |p: DVec3| turn * p * 1000.0 + DVec3::new(300.0, -20.0, 5.0);
    let (_, here) = stitched(&cube(31, CurveKind::Smooth, blob), 8);
    let (_, there) = stitched(&cube(31, CurveKind::Smooth, |p| place(blob(p))), 8);
    for (a, b) in here.iter().zip(&there) {
        for (p, q) in a.control.iter().zip(&b.control) {
            assert!(place(*p).distance(*q) < 1e-3, "{:e}", place(*p).distance(*q));
        }
    }
}

#[test]
fn stitching_bad_input_is_an_error() {
    let work = cube(21, CurveKind::Smooth, blob);
    let before = fit(&work, &control(6, 6));
    let run = |surfaces: &[Surface], angle_tolerance| {
        let params = StitchParams { angle_tolerance, ..StitchParams::default() };
        surface::stitch(&work.network, &work.grids, surfaces, &params, &Silent).unwrap_err()
    };
    assert!(matches!(run(&before, f64::NAN), FitError::Parameter { name: "angle_tolerance", .. }));
    assert!(matches!(run(&before, 0.0), FitError::Parameter { name: "angle_tolerance", .. }));
    assert!(matches!(run(&before[1..], 0.05), FitError::Count { .. }));
    let mut bent = before.clone();
    bent[4].knots_v.pop();
    assert!(matches!(run(&bent, 0.05), FitError::Malformed { .. }));
    let mut bent = before.clone();
    bent[4].knots_u[5] += 0.1;
    assert_eq!(run(&bent, 0.05), FitError::Knots { patch: 4 });
}

#[test]
fn stitch_is_the_same_to_the_bit_on_1_and_4_threads() {
    let work = cube(33, CurveKind::Smooth, blob);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| stitched(&work, 9).1)
    };
    assert_eq!(run(1), run(4));
}

#[test]
fn a_control_point_pulled_over_its_neighbours_is_a_fold_and_a_wavy_sheet_has_none() {
    let work = wavy([41, 33]);
    let mut surfaces = fit(&work, &control(8, 8));
    for (s, g) in surfaces.iter().zip(&work.grids) {
        assert_eq!(surface::folds(s, g), 0);
    }
    let (s, g) = (&mut surfaces[0], &work.grids[0]);
    let pull = (s.at(7, 3) - s.at(0, 3)) * 0.6;
    s.control[3 * 8 + 2] += pull;
    assert!(surface::folds(s, g) > 0);
}

#[test]
fn the_default_leaves_four_cells_to_every_span_however_rough_the_grid() {
    let rough = |p: DVec3| {
        let b = blob(p);
        b * (1.0 + 0.02 * (b.x * 911.7 + b.y * 573.3 + b.z * 771.1).sin())
    };
    let work = cube(41, CurveKind::Smooth, rough);
    for (s, g) in fit(&work, &FitParams::default()).iter().zip(&work.grids) {
        assert!(s.cols - 3 <= (g.cols - 1) / 4 && s.rows - 3 <= (g.rows - 1) / 4, "{} x {}", s.rows, s.cols);
        assert_eq!(surface::folds(s, g), 0);
    }
}

#[test]
fn angles_along_a_seam_are_means_over_its_length() {
    // A sheet whose right half is hinged at the seam by an angle that grows evenly from 0 to 0.2.
    let work = sheet(2, 1, [false, false], [33, 33], |x, y| DVec3::new(x, y, (x - 1.0).max(0.0) * (0.2 * y).tan()));
    let seams = surface::measure_seams(&work.network, &fit(&work, &control(8, 8)), &Silent).unwrap();
    let [seam] = &seams[..] else { panic!("one seam, not {}", seams.len()) };
    let whole = 0.2f64.to_degrees();
    for (found, wanted) in
        [(seam.angle_max_deg, whole), (seam.angle_rms_deg, whole / 3f64.sqrt()), (seam.angle_mean_deg, whole / 2.0)]
    {
        assert!((found / wanted - 1.0).abs() < 1e-3, "{found} {wanted}");
    }
    assert!((seam.length - 1.0).abs() < 1e-9 && seam.gap_max < 1e-15, "{seam:?}");
}

#[test]
fn regress_a_flat_sheet_with_uneven_steps_gets_spans_until_it_does_not_turn_over() {
    // Half of the way lies in a seventeenth of the steps. Along the normal two spans are as near as any number.
    let step = |x: f64| 1.0 - (-12.0 * x).exp() + 0.05 * x;
    let work = sheet(1, 1, [false, false], [81, 41], |x, y| DVec3::new(step(x), y, 0.0));
    let by = |resolution| fit(&work, &FitParams { resolution, smoothing: 0.0, ..FitParams::default() }).remove(0);
    assert!(surface::folds(&by(Resolution::Control([5, 5])), &work.grids[0]) > 0);
    let found = by(Resolution::Tolerance(1e-3));
    assert!(surface::folds(&found, &work.grids[0]) == 0 && found.cols < 10, "{} x {}", found.rows, found.cols);
}

#[test]
fn a_patch_that_folds_is_smoothed_and_leaves_its_neighbours_as_they_are() {
    // One patch with waves, none on its sides: they stand up from it or hang over.
    let waves = |size: f64, overhanging: bool| {
        let mut work = cube(41, CurveKind::Smooth, blob);
        let grid = &mut work.grids[0];
        let along = (grid.points[40] - grid.points[0]).normalize();
        let up = along.cross(grid.points[40 * 41] - grid.points[0]).normalize();
        let way = if overhanging { along } else { up };
        for (k, p) in grid.points.iter_mut().enumerate() {
            let [s, t] = [k % 41, k / 41].map(|i| i as f64 / 40.0);
            *p += way * (size * s * (1.0 - s) * t * (1.0 - t) * (20.0 * s).sin());
        }
        let params = FitParams { resolution: Resolution::Control([13, 13]), ..FitParams::default() };
        let surfaces = fit(&work, &params);
        assert_eq!(surface::folds(&surfaces[0], &work.grids[0]), 0);
        (surface::deviation_of(&surfaces[0], &work.grids[0]).rms, surfaces)
    };
    let (_, flat) = waves(0.0, false);
    let (standing, _) = waves(2.0, false);
    let (hanging, surfaces) = waves(2.0, true);
    assert!(hanging > 2.0 * standing, "smoothed: {hanging} against {standing}");
    assert!(flat[1..] == surfaces[1..], "a neighbour moved");
}

#[test]
fn parameters_out_of_range_are_named() {
    let work = wavy([12, 15]);
    for (cells_per_span, smoothing, wrong) in [(0.5, 0.0, "cells_per_span"), (4.0, f64::NAN, "smoothing")] {
        let params = FitParams { cells_per_span, smoothing, ..FitParams::default() };
        let error = surface::fit_network(&work.network, &work.grids, &params, &Silent).unwrap_err();
        assert!(matches!(error, FitError::Parameter { name, .. } if name == wrong), "{error}");
    }
}
