//! Surfaces that turn over or cross, and proof that others do not.

mod patchworks;

use glam::DVec3;
use patchworks::{Patchwork, cube, grid, to_sphere, torus, wavy};
use planish::Silent;
use planish::network::{CurveKind, Network};
use planish::relief::{span_shapes, surface_patches};
use planish::surface::{Crossing, FitParams, Resolution, Surface, crossings, facet_error, fit, fit_network, turning};

/// Quads per knot span in the tests.
const CUTS: usize = 3;

fn surfaces(work: &Patchwork, control: usize) -> Vec<Surface> {
    let resolution = Resolution::Control([control, control]);
    let params = FitParams { resolution, cells_per_span: 1.0, smoothing: 0.0, ..FitParams::default() };
    fit_network(&work.network, &work.grids, &params, &Silent).unwrap()
}

fn found(network: &Network, surfaces: &[Surface]) -> Vec<Crossing> {
    let shapes = span_shapes(surfaces, CUTS);
    let patched = surface_patches(network, surfaces, &shapes, &Silent).unwrap();
    crossings(surfaces, &patched.mesh, &patched.facets(), &Silent).unwrap()
}

/// Two shapes as one network.
fn both(mut a: Patchwork, b: Patchwork) -> Patchwork {
    let (corners, curves) = (a.network.corners.len() as u32, a.network.curves.len() as u32);
    a.network.corners.extend(b.network.corners);
    a.network.curves.extend(b.network.curves.into_iter().map(|mut curve| {
        curve.corners = curve.corners.map(|c| c + corners);
        curve
    }));
    a.network.patches.extend(b.network.patches.into_iter().map(|mut patch| {
        patch.sides.iter_mut().for_each(|side| side.curve += curves);
        patch
    }));
    a.grids.extend(b.grids);
    a
}

fn ball(center: DVec3) -> Patchwork {
    cube(33, CurveKind::Smooth, move |p| to_sphere(p) + center)
}

#[test]
fn a_ball_a_torus_a_cube_and_a_wavy_sheet_cross_nowhere_and_are_proven_not_to_turn_over() {
    let solid = cube(17, CurveKind::Feature, |p| p);
    for (name, work) in [("ball", ball(DVec3::ZERO)), ("torus", torus(33)), ("cube", solid), ("sheet", wavy([33, 33]))]
    {
        let surfaces = surfaces(&work, 9);
        assert_eq!(found(&work.network, &surfaces), [], "{name}");
        for (s, g) in surfaces.iter().zip(&work.grids) {
            let turning = turning(s, g);
            assert!(turning.is_proven(), "{name}: {turning:?}");
        }
    }
}

#[test]
fn two_balls_cross_on_the_circle_where_both_are() {
    let apart = DVec3::new(1.2, 0.1, 0.05);
    let work = both(ball(DVec3::ZERO), ball(apart));
    let surfaces = surfaces(&work, 9);
    let crossings = found(&work.network, &surfaces);
    assert!(crossings.len() >= 4, "{crossings:?}");
    // Unit balls whose centres are d apart have an angle of 2 asin(d / 2) between their normals where they meet.
    let angle = 2.0 * (apart.length() / 2.0).asin().to_degrees();
    for c in &crossings {
        assert!(c.patches[0] < 6 && c.patches[1] >= 6);
        for center in [DVec3::ZERO, apart] {
            // What a fit with nine control points leaves the ball by.
            assert!((c.place.distance(center) - 1.0).abs() < 1e-4, "{c:?}");
        }
        assert!((c.angle_deg - angle).abs() < 0.1, "{c:?} {angle}");
    }
    // A thousandth apart they do not meet, a thousandth within each other they do.
    for (way, wanted) in [(2.001, false), (1.999, true)] {
        let work = both(ball(DVec3::ZERO), ball(DVec3::new(way, 0.0, 0.0)));
        let surfaces = self::surfaces(&work, 9);
        assert_eq!(!found(&work.network, &surfaces).is_empty(), wanted, "{way}");
    }
}

/// A strip bent like the letter alpha: it comes back through itself where `t = 1` and `t = -1`, at `x = y = 0`.
fn alpha() -> Patchwork {
    let shape = |u: f64, v: f64| {
        let t = 3.0 * u - 1.5;
        DVec3::new(t * t - 1.0, v, t * (t * t - 1.0))
    };
    let network = patchworks::network(4, &[[(0, 0), (1, 0), (2, 0), (3, 0)]], |_, _| CurveKind::Boundary);
    Patchwork { network, grids: vec![grid(17, 65, shape)] }
}

#[test]
fn a_sheet_bent_through_itself_crosses_itself_on_the_line_where_it_does_and_does_not_turn_over() {
    let work = alpha();
    let surfaces = surfaces(&work, 9);
    let crossings = found(&work.network, &surfaces);
    assert_eq!(crossings.len(), 1);
    let c = crossings[0];
    assert_eq!(c.patches, [0, 0]);
    assert!(c.place.x.abs() < 1e-9 && c.place.z.abs() < 1e-9, "{c:?}");
    // The tangents at t = 1 and -1 are (2, 2) and (-2, 2) of x and z; the normals have a right angle.
    assert!((c.angle_deg - 90.0).abs() < 1e-6, "{c:?}");
    assert!(turning(&surfaces[0], &work.grids[0]).is_proven());
}

#[test]
fn a_control_point_pulled_over_its_neighbours_turns_over_where_it_is_and_nowhere_else() {
    let work = wavy([33, 33]);
    let mut surfaces = surfaces(&work, 12);
    let cols = surfaces[0].cols;
    let step = surfaces[0].control[5 * cols + 6] - surfaces[0].control[5 * cols + 5];
    surfaces[0].control[5 * cols + 5] += step * 4.0;
    let turning = turning(&surfaces[0], &work.grids[0]);
    assert!(!turning.over.is_empty());
    let at = surfaces[0].control[5 * cols + 5];
    assert!(turning.over.iter().all(|p| p.distance(at) < 5.0 * step.length()), "{turning:?}");
}

#[test]
fn a_pulled_point_is_found_to_turn_over_exactly_from_where_the_product_of_derivatives_changes_its_sign() {
    // A flat square with one inner control point moved along u by x: S_u there is 1 + x b'(u) b(v), with b the cubic B-spline of
    // even knots. In steps of the knots the least of b' is -2/3, two thirds of a step from its middle, and the greatest of b is 2/3.
    // So the square turns over where x is more than 9/4 of a step.
    let n = 11;
    let flat = grid(33, 33, |u, v| DVec3::new(u, v, 0.0));
    let plain = fit(&flat.points, 33, 33, [n, n]).unwrap();
    let step = 1.0 / (n - 3) as f64;
    for (share, wanted) in [(2.24, false), (2.26, true)] {
        let mut pulled = plain.clone();
        pulled.control[5 * n + 5].x += share * step;
        let turning = turning(&pulled, &flat);
        assert_eq!(!turning.over.is_empty(), wanted, "{share}: {turning:?}");
        assert_eq!(turning.is_proven(), !wanted, "{share}: {turning:?}");
    }
}

#[test]
fn facets_leave_a_cylinder_by_no_more_than_their_bound_and_by_no_less_than_half_of_it() {
    let arc = grid(9, 65, |u, v| DVec3::new((1.5 * u).cos(), (1.5 * u).sin(), v));
    let surface = fit(&arc.points, 9, 65, [4, 12]).unwrap();
    for cells in [8, 20, 50] {
        let bound = facet_error(&surface, [2, cells + 1]);
        // A chord of an angle h leaves a unit circle by 1 - cos(h / 2).
        let true_height = 1.0 - (1.5 / cells as f64 / 2.0).cos();
        assert!(bound > true_height * 0.999 && bound < 2.0 * true_height, "{bound} {true_height}");
    }
}

#[test]
fn crossings_are_the_same_to_the_bit_on_1_and_4_threads_and_in_other_places() {
    let work = both(ball(DVec3::ZERO), ball(DVec3::new(1.2, 0.1, 0.05)));
    let surfaces = surfaces(&work, 9);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| found(&work.network, &surfaces))
    };
    assert_eq!(on(1), on(4));
    let moved: Vec<Surface> = surfaces
        .iter()
        .map(|s| Surface { control: s.control.iter().map(|p| *p * 1e3 + DVec3::splat(1e4)).collect(), ..s.clone() })
        .collect();
    let pairs = |list: Vec<Crossing>| list.into_iter().map(|c| c.patches).collect::<Vec<_>>();
    assert_eq!(pairs(found(&work.network, &moved)), pairs(on(1)));
}
