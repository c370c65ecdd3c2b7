//! Smooth seams around corners of any number of patches, to the tolerance of the angle.

mod patchworks;

use glam::DVec3;
use patchworks::*;
use planish::Silent;
use planish::network::CurveKind;
use planish::surface::{self, Continuity, Exact, FitParams, Resolution, SeamQuality, StitchParams, Surface};

fn params(control: usize, continuity: Continuity) -> FitParams {
    let resolution = Resolution::Control([control, control]);
    FitParams { resolution, cells_per_span: 1.0, smoothing: 0.0, continuity, ..FitParams::default() }
}

/// The surfaces as fitted, and with smooth seams.
fn both(work: &Patchwork, fit: &FitParams, stitch: &StitchParams) -> [Vec<Surface>; 2] {
    let before = surface::fit_network(&work.network, &work.grids, fit, &Silent).unwrap();
    let after = surface::stitch(&work.network, &work.grids, &before, stitch, &Silent).unwrap();
    [before, after]
}

fn seams(work: &Patchwork, surfaces: &[Surface]) -> Vec<SeamQuality> {
    let mut seams = surface::measure_seams(&work.network, surfaces, &Silent).unwrap();
    seams.retain(|s| s.kind.is_smooth());
    seams
}

/// RMS and largest angle over the length of all smooth seams, and the angle that 95 of 100 of it do not exceed, degrees.
fn angles(work: &Patchwork, surfaces: &[Surface]) -> [f64; 3] {
    let all = seams(work, surfaces);
    let length: f64 = all.iter().map(|s| s.length).sum();
    let rms = (all.iter().map(|s| s.length * s.angle_rms_deg.powi(2)).sum::<f64>() / length).sqrt();
    let most = all.iter().map(|s| s.regular_angle_max_deg).fold(0.0, f64::max);
    let mut places = surface::seam_angles(&work.network, surfaces, length / 5000.0);
    places.retain(|p| work.network.curves[p.curve as usize].kind.is_smooth());
    places.sort_by(|a, b| a.angle_deg.total_cmp(&b.angle_deg));
    let p95 = places[places.len() * 95 / 100].angle_deg;
    [rms, most, p95]
}

/// An uneven ball from a double pyramid over a polygon, every triangle parted into three patches: corners of 3, 4 and
/// `sides` patches, at uneven angles.
fn ball(sides: usize, nodes: usize) -> Patchwork {
    let rim = |k: usize| {
        let a = std::f64::consts::TAU * (k % sides) as f64 / sides as f64;
        DVec3::new((a + 0.1 * (2.0 * a).sin()).cos(), (a + 0.1 * (2.0 * a).sin()).sin(), 0.1 * (3.0 * a).cos())
    };
    let mut corners: Vec<DVec3> = vec![DVec3::Z, -DVec3::Z];
    corners.extend((0..sides).map(rim));
    let mut middles = std::collections::BTreeMap::new();
    let mut quads: Vec<[usize; 4]> = Vec::new();
    for k in 0..sides {
        let (a, b) = (2 + k, 2 + (k + 1) % sides);
        for [p, q, r] in [[0, a, b], [1, b, a]] {
            let centre = corners.len();
            corners.push((corners[p] + corners[q] + corners[r]) / 3.0);
            let mut middle = |x: usize, y: usize| {
                *middles.entry((x.min(y), x.max(y))).or_insert_with(|| {
                    corners.push((corners[x] + corners[y]) / 2.0);
                    corners.len() - 1
                })
            };
            let [pq, qr, rp] = [middle(p, q), middle(q, r), middle(r, p)];
            quads.extend([[p, pq, centre, rp], [q, qr, centre, pq], [r, rp, centre, qr]]);
        }
    }
    let shape = |p: DVec3| {
        let n = p.normalize();
        n * (1.0 + 0.08 * (2.0 * n.x + 0.4).sin() * (2.0 * n.y).cos() + 0.05 * n.z * n.x)
    };
    let patches: Vec<[(u32, u32); 4]> = quads.iter().map(|q| q.map(|k| (k as u32, 0))).collect();
    let network = network(corners.len(), &patches, |_, _| CurveKind::Smooth);
    let mut grids: Vec<_> = quads
        .iter()
        .map(|q| {
            let [a, b, c, d] = q.map(|k| corners[k].normalize());
            grid(nodes, nodes, |u, v| shape(a.lerp(b, u).lerp(d.lerp(c, u), v)))
        })
        .collect();
    share_boundaries(&network, &mut grids);
    Patchwork { network, grids }
}

#[test]
fn seams_of_uneven_balls_with_corners_of_3_to_8_patches_are_smooth_within_a_tenth_of_a_degree_for_a_tenth_of_the_fit() {
    for sides in [5, 6, 8] {
        let work = ball(sides, 33);
        let [before, after] = both(&work, &params(9, Continuity::G1), &StitchParams::default());
        let was = angles(&work, &before);
        let [rms, most, p95] = angles(&work, &after);
        assert!(rms <= 0.02 && most <= 0.1 && p95 <= 0.05, "{sides}: {was:?} to {rms} {most} {p95} degrees");
        let (was, is) = (surface::deviation(&before, &work.grids).rms, surface::deviation(&after, &work.grids).rms);
        assert!(is <= 1.1 * was, "{sides}: RMS {was:e} to {is:e}");
    }
}

#[test]
fn points_of_a_network_of_bicubic_surfaces_come_back_to_rounding() {
    let cubic = |x: f64, y: f64| {
        DVec3::new(x + 0.05 * y * y, y - 0.04 * x * x * y, 0.3 * x * x * x - 0.2 * x * y * y + 0.1 * y * y * y * x)
    };
    let work = sheet(3, 2, [false, false], [21, 17], |x, y| cubic(x / 2.0, y / 2.0));
    for continuity in [Continuity::G1, Continuity::G1Double] {
        let [_, after] = both(&work, &params(6, continuity), &StitchParams::default());
        assert!(surface::deviation(&after, &work.grids).max < 1e-12);
        let [_, most, _] = angles(&work, &after);
        assert!(most < 1e-6, "{most} degrees");
    }
}

#[test]
fn a_smaller_tolerance_of_the_angle_is_met_where_the_fit_can_afford_it() {
    let work = cube(41, CurveKind::Smooth, to_sphere);
    for tolerance in [0.1, 0.05, 0.01] {
        let stitch = StitchParams { angle_tolerance: tolerance, ..StitchParams::default() };
        let [_, after] = both(&work, &params(18, Continuity::G1), &stitch);
        let [_, most, _] = angles(&work, &after);
        assert!(most <= tolerance, "{most} degrees for {tolerance}");
    }
}

#[test]
fn the_fit_loses_no_more_than_it_may_however_small_the_tolerance_of_the_angle() {
    let work = cube(41, CurveKind::Smooth, blob);
    let mut last = f64::INFINITY;
    for fit_loss in [0.02, 0.1, 0.5] {
        let stitch = StitchParams { angle_tolerance: 1e-3, fit_loss, ..StitchParams::default() };
        let [before, after] = both(&work, &params(8, Continuity::G1), &stitch);
        let (was, is) = (surface::deviation(&before, &work.grids).rms, surface::deviation(&after, &work.grids).rms);
        // Corners come into their planes beforehand.
        assert!(is <= (1.05 + fit_loss) * was, "RMS {was:e} to {is:e} where {fit_loss} may go");
        let [rms, _, _] = angles(&work, &after);
        assert!(rms < last, "{rms} degrees RMS after {last}");
        last = rms;
    }
}

#[test]
fn double_knots_stand_in_chords_that_end_in_corners_of_other_than_four_patches() {
    use surface::basis::Knots;
    let all = |work: &Patchwork, continuity, knots: Knots| {
        let [_, after] = both(work, &params(8, continuity), &StitchParams::default());
        after.iter().flat_map(|s| [&s.knots_u, &s.knots_v]).all(|list| Knots::of(list) == knots)
    };
    let (cube, torus) = (cube(33, CurveKind::Smooth, blob), torus(17));
    assert!(all(&cube, Continuity::G1Double, Knots::double(8)));
    assert!(all(&cube, Continuity::G1, Knots::uniform(8)));
    assert!(all(&torus, Continuity::G1Double, Knots::uniform(8)));
}

#[test]
fn with_double_knots_the_angle_around_corners_of_three_patches_falls_below_2_thousandths_of_a_degree() {
    let work = cube(81, CurveKind::Smooth, to_sphere);
    let stitch = StitchParams { angle_tolerance: 2e-3, fit_loss: 0.3, ..StitchParams::default() };
    let [before, after] = both(&work, &params(26, Continuity::G1Double), &stitch);
    let [rms, most, _] = angles(&work, &after);
    assert!(most <= 2e-3 && rms <= 1e-3, "{rms} {most} degrees");
    let (was, is) = (surface::deviation(&before, &work.grids).rms, surface::deviation(&after, &work.grids).rms);
    assert!(is <= 1.15 * was, "RMS {was:e} to {is:e}");
}

#[test]
fn a_corner_of_more_than_180_degrees_has_no_normal_and_its_seam_is_no_fold() {
    // A flat sheet whose middle curve leaves its lower end outwards by a little: one patch has more than 180 degrees there.
    let work = sheet(2, 1, [false, false], [33, 33], |x, y| DVec3::new(x, y, 0.0));
    let mut surfaces = surface::fit_network(&work.network, &work.grids, &params(8, Continuity::C0), &Silent).unwrap();
    let beside = DVec3::new(1.02, -0.0005, 0.0);
    surfaces[0].control[8 + 7] = beside;
    surfaces[1].control[8] = beside;
    let all = seams(&work, &surfaces);
    let [seam] = &all[..] else { panic!("one seam, not {}", all.len()) };
    assert_eq!(seam.odd_ends, [true, false]);
    assert!(seam.angle_max_deg < 1e-6, "{seam:?}");
}

/// Two sheets that meet along `x = 1`, rising from it by `slope(y)` on both sides.
fn valley(slope: impl Fn(f64) -> f64) -> (Patchwork, Vec<Surface>) {
    let work = sheet(2, 1, [false, false], [33, 33], |x, y| DVec3::new(x, y, (x - 1.0).abs() * slope(y)));
    let surfaces = surface::fit_network(&work.network, &work.grids, &params(9, Continuity::C0), &Silent).unwrap();
    (work, surfaces)
}

#[test]
fn the_bound_on_the_angle_of_a_valley_of_constant_slope_is_its_angle_to_1e_6_degrees() {
    for slope in [0.0, 1e-4, 0.3, 0.9] {
        let (work, surfaces) = valley(|_| slope);
        let seam = &seams(&work, &surfaces)[0];
        let exact = 2.0 * f64::atan(slope).to_degrees();
        let bound = seam.regular_angle_bound_deg.unwrap();
        assert!((bound - exact).abs() <= 1e-6, "{bound} for {exact} degrees");
    }
}

#[test]
fn no_angle_between_samples_exceeds_the_bound_and_the_bound_is_within_a_fiftieth_of_the_largest() {
    let (work, surfaces) = valley(|y| 1e-3 * (9.0 * y).sin() + 5e-4);
    let seam = &seams(&work, &surfaces)[0];
    let places = surface::seam_angles(&work.network, &surfaces, seam.length / 20_000.0);
    let most = places.iter().filter(|p| p.curve == seam.curve).map(|p| p.angle_deg).fold(0.0, f64::max);
    let bound = seam.regular_angle_bound_deg.unwrap();
    assert!(most > 0.1 && seam.regular_angle_max_deg <= bound, "{seam:?}");
    assert!(most <= bound && bound <= 1.021 * most, "{most} {bound} degrees");
}

#[test]
fn a_gap_between_samples_is_bounded_by_the_steps_between_control_points() {
    let (work, mut surfaces) = valley(|_| 0.1);
    assert!(seams(&work, &surfaces)[0].gap_bound < 1e-15);
    // The last control point of a row of the first sheet lies on the seam.
    surfaces[0].control[4 * 9 + 8].z += 0.25;
    let seam = &seams(&work, &surfaces)[0];
    assert!(seam.gap_max > 0.1 && seam.gap_max <= seam.gap_bound && seam.gap_bound <= 0.25, "{seam:?}");
}

#[test]
fn seams_of_every_direction_and_valence_keep_their_bound() {
    for work in [ball(5, 17), torus(17), cube(17, CurveKind::Smooth, blob)] {
        let [_, after] = both(&work, &params(8, Continuity::G1), &StitchParams::default());
        for seam in seams(&work, &after) {
            let bound = seam.regular_angle_bound_deg.unwrap();
            assert!(seam.regular_angle_max_deg <= bound * (1.0 + 1e-9) + 1e-6, "{seam:?}");
            assert!(bound <= 1.1 * seam.regular_angle_max_deg + 1e-3, "{seam:?}");
            assert!(seam.gap_bound < 1e-12);
        }
    }
}

#[test]
fn moves_that_cost_their_bends_bend_a_fifth_as_much_and_seams_keep_the_tolerance_in_the_rms() {
    let work = cube(41, CurveKind::Smooth, rough_blob);
    let fit = FitParams { smoothing: 0.01, ..params(10, Continuity::G1) };
    let found = [0.0, 0.01].map(|smoothing| {
        let [before, after] = both(&work, &fit, &StitchParams { smoothing, ..StitchParams::default() });
        let bends: f64 = before.iter().zip(&after).map(|(b, a)| bends(b, a)).sum();
        (bends, angles(&work, &after))
    });
    assert!(found[1].0 < 0.2 * found[0].0, "{found:?}");
    assert!(found[1].1[0] < 0.05, "{found:?}");
}

#[test]
fn patches_that_lost_more_than_their_share_do_not_take_the_smoothness_of_others() {
    // A wavy sheet of 8 x 2 patches; rough waves rise in its last two columns.
    let rough = |x: f64, y: f64| 0.1 * (12.0 * x).sin() * (10.8 * y).cos() * (x - 6.0).max(0.0).powi(2);
    let height = |x: f64, y: f64| 0.05 * (8.0 * x + 0.3).sin() * (6.4 * y).cos() + rough(x, y);
    let work = sheet(8, 2, [false, false], [33, 33], |x, y| DVec3::new(x, y, height(x, y)));
    let is_away = |s: &SeamQuality| {
        let beside = work.network.patches.iter().enumerate();
        beside.filter(|(_, p)| p.sides.iter().any(|side| side.curve == s.curve)).all(|(p, _)| p % 8 < 5)
    };
    let stitch = StitchParams { fit_loss: 0.01, ..StitchParams::default() };
    let most = both(&work, &params(8, Continuity::G1), &stitch).map(|surfaces| {
        let away = seams(&work, &surfaces).into_iter().filter(is_away);
        away.map(|s| s.angle_max_deg).fold(0.0, f64::max)
    });
    assert!(most[0] > 2.0 && most[1] <= 0.05, "{most:?} degrees");
}

/// Sum of the squares of the second differences of what control points moved, along rows and columns.
fn bends(before: &Surface, after: &Surface) -> f64 {
    let (m, n) = (before.cols, before.rows);
    let moved = |i: usize, j: usize| after.at(i, j) - before.at(i, j);
    let mut sum = 0.0;
    for j in 0..n {
        for i in 0..m {
            if i > 0 && i + 1 < m {
                sum += (moved(i - 1, j) - 2.0 * moved(i, j) + moved(i + 1, j)).length_squared();
            }
            if j > 0 && j + 1 < n {
                sum += (moved(i, j - 1) - 2.0 * moved(i, j) + moved(i, j + 1)).length_squared();
            }
        }
    }
    sum
}

/// Two wavy sheets that meet along `x = 1` at an angle of `2 atan(slope)`, along a seam that is called smooth.
fn hidden_edge(slope: f64) -> Patchwork {
    let wave = |x: f64, y: f64| 0.02 * (11.0 * x).sin() * (9.0 * y).cos();
    sheet(2, 1, [false, false], [33, 33], |x, y| DVec3::new(x, y, wave(x, y) - slope * (x - 1.0).abs()))
}

#[test]
fn a_seam_called_smooth_on_an_edge_of_62_degrees_keeps_its_angle_and_its_fit_and_is_told() {
    let work = hidden_edge(0.6);
    let [before, after] = both(&work, &params(11, Continuity::G1), &StitchParams::default());
    let mean = |surfaces: &[Surface]| seams(&work, surfaces)[0].angle_mean_deg;
    assert!((mean(&after) - 61.9).abs() < 1.0, "{} degrees", mean(&after));
    let (was, is) = (surface::deviation(&before, &work.grids), surface::deviation(&after, &work.grids));
    assert!(is.rms <= 1.1 * was.rms && is.max <= 1.5 * was.max, "{was:?} to {is:?}");
    let edges = surface::edges_in_seams(&work.network, &work.grids, &after);
    let [edge] = &edges[..] else { panic!("one piece, not {edges:?}") };
    assert!(edge.range == [0.0, 1.0] && (edge.angle_deg - 61.9).abs() < 2.0, "{edge:?}");
    // What is no edge counts as before.
    let all = surface::measure_seams_apart(&work.network, &after, &edges, &Silent).unwrap();
    assert_eq!((all[0].regular_angle_max_deg, all[0].regular_angle_bound_deg), (0.0, Some(0.0)));
    assert!(all[0].angle_max_deg > 60.0);
}

#[test]
fn a_seam_across_a_bend_of_20_degrees_is_no_edge() {
    let work = hidden_edge(0.176);
    let [before, after] = both(&work, &params(11, Continuity::G1), &StitchParams::default());
    assert!(surface::edges_in_seams(&work.network, &work.grids, &before).is_empty());
    assert!(surface::edges_in_seams(&work.network, &work.grids, &after).is_empty());
}

#[test]
fn an_edge_of_62_degrees_that_a_person_calls_smooth_is_rounded_whatever_that_costs_the_fit() {
    let mut work = hidden_edge(0.6);
    work.network.curves.iter_mut().filter(|c| c.kind == CurveKind::Smooth).for_each(|c| c.kind = CurveKind::Rounded);
    let [before, after] = both(&work, &params(11, Continuity::G1), &StitchParams::default());
    assert!(surface::edges_in_seams(&work.network, &work.grids, &after).is_empty());
    let seam = &surface::measure_seams(&work.network, &after, &Silent).unwrap()[0];
    assert!(seam.angle_max_deg < 0.1, "{seam:?}");
    // An arc within a knot span on either side, half of it outside and half inside.
    let bound = 1.08 * 0.125 / 8.0;
    let (was, is) = (surface::deviation(&before, &work.grids), surface::deviation(&after, &work.grids));
    assert!(is.max < bound, "{was:?} to {is:?} for {bound}");
}

/// A sheet of four patches that bends by 80 degrees about their middle curve, on an arc of 1.3 knot spans of 9 control points, and
/// waves along it.
fn rounded_ridge() -> Patchwork {
    let (bend, radius) = (80f64.to_radians(), 0.16);
    let profile = |s: f64| {
        // By arc length from the ridge.
        let turned = (s.abs() / radius).min(bend / 2.0);
        let straight = s.abs() - radius * turned;
        let way = radius * turned.sin() + straight * turned.cos();
        (way * s.signum(), radius * (turned.cos() - 1.0) - straight * turned.sin())
    };
    sheet(2, 2, [false, false], [33, 33], |x, y| {
        let (way, height) = profile(y - 1.0);
        DVec3::new(x, way, height + 0.01 * (5.0 * x).sin())
    })
}

#[test]
fn a_seam_along_a_narrow_ridge_is_smooth_within_what_the_tolerance_of_the_fit_leaves() {
    let work = rounded_ridge();
    let smoothing = FitParams::default().smoothing;
    let fit = FitParams { smoothing, ..params(9, Continuity::G1) };
    let at = |tolerance: f64| {
        let [_, after] = both(&work, &fit, &StitchParams { tolerance, smoothing, ..StitchParams::default() });
        (angles(&work, &after)[1], surface::deviation(&after, &work.grids).rms, after)
    };
    let (bent, ..) = at(0.0);
    let tolerance = 0.005;
    let (smooth, rms, after) = at(tolerance);
    assert!(bent > 1.0 && smooth <= 0.05 && rms <= tolerance, "{bent} and {smooth} degrees, RMS {rms}");
    // The corner on the ridge goes inwards with it, in all four patches.
    let corner = work.grids[0].points[33 * 33 - 1];
    let nearest = |s: &Surface| {
        let ends = [0, s.cols - 1].into_iter().flat_map(|i| [0, s.rows - 1].map(|j| s.at(i, j)));
        ends.min_by(|a, b| a.distance(corner).total_cmp(&b.distance(corner))).unwrap() - corner
    };
    let moves: Vec<DVec3> = after.iter().map(nearest).collect();
    assert!(moves.iter().all(|way| *way == moves[0]) && moves[0].z < -1e-4, "{moves:?}");
}

#[test]
fn after_an_edit_of_one_patch_only_those_that_share_a_corner_with_it_are_solved_again() {
    let mut work = ball(6, 17);
    let fit = params(8, Continuity::G1);
    let stitch = StitchParams { fit_loss: 0.3, ..StitchParams::default() };
    let [_, before] = both(&work, &fit, &stitch);
    // A bump inside patch 0: its boundary stays.
    for j in 1..16 {
        for i in 1..16 {
            let [u, v] = [i, j].map(|k| (k as f64 / 16.0 * std::f64::consts::PI).sin().powi(2));
            work.grids[0].points[j * 17 + i] *= 1.0 + 0.02 * u * v;
        }
    }
    let fitted = surface::fit_network(&work.network, &work.grids, &fit, &Silent).unwrap();
    let near = |changed: &[usize]| {
        surface::stitch_near(&work.network, &work.grids, (&fitted, &before), changed, &stitch, &Silent).unwrap()
    };
    let after = near(&[0]);
    let corners = |p: usize| work.network.patches[p].sides.map(|s| work.network.curves[s.curve as usize].corners);
    let own: Vec<u32> = corners(0).concat();
    let beside = |p: usize| corners(p).concat().iter().any(|c| own.contains(c));
    let count = (0..after.len()).filter(|&p| beside(p)).count();
    assert!(count < after.len() / 2, "{count} of {}", after.len());
    assert!((0..after.len()).all(|p| beside(p) || after[p] == before[p]));
    assert!(after[0] != before[0]);
    let [_, most, p95] = angles(&work, &after);
    assert!(most <= 0.1 && p95 <= 0.05, "{most} {p95} degrees");
    assert!(seams(&work, &after).iter().all(|s| s.gap_max < 2e-15));
    // As near to the grids as when all is solved, and that to the bit when all has changed.
    let all: Vec<usize> = (0..after.len()).collect();
    let whole = surface::stitch(&work.network, &work.grids, &fitted, &stitch, &Silent).unwrap();
    assert!(near(&all) == whole);
    let (one, full) = (surface::deviation(&after, &work.grids).rms, surface::deviation(&whole, &work.grids).rms);
    assert!(one <= 1.1 * full, "RMS {one:e} and {full:e}");
    assert!(near(&[]) == before);
}

/// The surfaces as fitted, with smooth seams, and with exact ones.
fn exact(work: &Patchwork, control: usize) -> ([Vec<Surface>; 2], Exact) {
    let stitch = StitchParams { tolerance: 0.01, ..StitchParams::default() };
    let [fitted, smooth] = both(work, &params(control, Continuity::G1Exact), &stitch);
    let exact = surface::exact(&work.network, &work.grids, &smooth, &stitch, &Silent).unwrap();
    ([fitted, smooth], exact)
}

/// What no angle along the smooth seams exceeds, degrees.
fn bound(work: &Patchwork, surfaces: &[Surface]) -> f64 {
    let seams = seams(work, surfaces);
    assert!(seams.iter().all(|s| s.gap_max < 1e-14));
    seams.iter().map(|s| s.angle_max_deg.max(s.regular_angle_bound_deg.unwrap())).fold(0.0, f64::max)
}

#[test]
fn exact_seams_around_corners_of_three_patches_cost_the_fit_a_fifth_at_most() {
    for (shape, loss) in [(to_sphere as fn(DVec3) -> DVec3, 1.2), (blob, 1.0)] {
        let work = cube(41, CurveKind::Smooth, shape);
        let ([fitted, smooth], exact) = exact(&work, 14);
        assert!(exact.kept.is_empty() && exact.seams.len() == 12);
        let bound = bound(&work, &exact.surfaces);
        assert!(bound <= 1e-3 && angles(&work, &smooth)[1] > 0.01, "{bound} degrees");
        let [was, is] = [&fitted, &exact.surfaces].map(|s| surface::normal_rms(s, &work.grids));
        assert!(is <= loss * was, "RMS {was:e} to {is:e}");
    }
}

#[test]
fn exact_seams_of_uneven_balls_with_corners_of_3_to_8_patches_bend_by_a_thousandth_of_a_degree_at_most() {
    // What it costs the fit grows with how uneven the corners are.
    for (sides, loss) in [(5, 1.5), (6, 16.0), (8, 90.0)] {
        let work = ball(sides, 33);
        let ([fitted, _], exact) = exact(&work, 14);
        assert!(exact.kept.is_empty(), "{:?}", exact.kept);
        let bound = bound(&work, &exact.surfaces);
        let [was, is] = [&fitted, &exact.surfaces].map(|s| surface::normal_rms(s, &work.grids));
        assert!(bound <= 1e-3, "{sides}: {bound} degrees");
        assert!(is <= loss * was, "{sides}: RMS {was:e} to {is:e}");
    }
}

#[test]
fn exact_seams_of_a_torus_are_as_near_as_smooth_ones() {
    let work = torus(33);
    let ([_, smooth], exact) = exact(&work, 10);
    let bound = bound(&work, &exact.surfaces);
    let [was, is] = [&smooth, &exact.surfaces].map(|s| surface::normal_rms(s, &work.grids));
    assert!(exact.kept.is_empty() && bound <= 1e-3, "{bound} degrees");
    assert!(is <= was, "RMS {was:e} to {is:e}");
}

#[test]
fn a_box_of_sharp_edges_stays_bit_for_bit() {
    let work = cube(17, CurveKind::Feature, |p| p);
    let ([_, smooth], exact) = exact(&work, 8);
    assert!(exact.surfaces == smooth && exact.seams.is_empty() && exact.kept.is_empty());
}

#[test]
fn exact_seams_of_an_open_sheet_leave_the_corners_on_its_border_where_they_are() {
    let work = wavy([33, 33]);
    let ([fitted, smooth], exact) = exact(&work, 10);
    assert!(exact.kept.is_empty() && bound(&work, &exact.surfaces) <= 1e-3);
    let [was, is] = [&fitted, &exact.surfaces].map(|s| surface::normal_rms(s, &work.grids));
    assert!(is <= 1.1 * was, "RMS {was:e} to {is:e}");
    for (before, after) in smooth.iter().zip(&exact.surfaces) {
        for [i, j] in [[0, 0], [9, 0], [9, 9], [0, 9]] {
            // The corner inside may move.
            let on_border = |p: DVec3| p.x < 1e-9 || p.x > 2.0 - 1e-9 || p.y < 1e-9 || p.y > 3.0 - 1e-9;
            assert!(!on_border(before.at(i, j)) || before.at(i, j) == after.at(i, j));
        }
    }
}

/// A wavy sheet of 3 x 2 patches with a crease of 62 degrees along `x = 1`.
fn creased(kind: CurveKind) -> (Patchwork, Vec<u32>) {
    let height = |x: f64, y: f64| 0.03 * (3.0 * x).sin() * (2.5 * y).cos() - 0.6 * (x - 1.0).abs();
    let mut work = sheet(3, 2, [false, false], [33, 33], |x, y| DVec3::new(x, y, height(x, y)));
    let crease = [0, 3].map(|p| work.network.patches[p].sides[1].curve);
    crease.iter().for_each(|&c| work.network.curves[c as usize].kind = kind);
    (work, crease.to_vec())
}

#[test]
fn exact_seams_meet_a_sharp_curve_that_keeps_its_place_and_its_angle() {
    let (work, crease) = creased(CurveKind::Feature);
    let ([fitted, _], exact) = exact(&work, 10);
    let most = bound(&work, &exact.surfaces);
    assert!(exact.kept.is_empty() && exact.seams.len() == 5 && most <= 1e-3, "{:?} {most}", exact.kept);
    let all = surface::measure_seams(&work.network, &exact.surfaces, &Silent).unwrap();
    for seam in all.iter().filter(|s| crease.contains(&s.curve)) {
        assert!((seam.angle_mean_deg - 61.9).abs() < 1.0, "{seam:?}");
    }
    let off = |s: &Surface| (0..=64).map(|k| (s.point(1.0, k as f64 / 64.0).x - 1.0).abs()).fold(0.0, f64::max);
    assert!(off(&exact.surfaces[0]) < 1e-5, "{}", off(&exact.surfaces[0]));
    let [was, is] = [&fitted, &exact.surfaces].map(|s| surface::normal_rms(s, &work.grids));
    assert!(is <= 1.5 * was, "RMS {was:e} to {is:e}");
}

#[test]
fn a_seam_on_an_edge_is_told_and_all_others_are_exact() {
    let (work, crease) = creased(CurveKind::Smooth);
    let (_, exact) = exact(&work, 10);
    assert_eq!(exact.kept, crease);
    let others = seams(&work, &exact.surfaces).into_iter().filter(|s| exact.seams.contains(&s.curve));
    let most = others.map(|s| s.angle_max_deg).fold(0.0, f64::max);
    assert!(exact.seams.len() == 5 && most <= 1e-3, "{most} degrees");
}

#[test]
fn seams_beside_a_flat_corner_keep_their_angle_and_all_others_are_exact() {
    // One of the corners inside is the tip of a wedge of 3.8 degrees on either side.
    let work = sheet(3, 2, [false, false], [33, 33], |x, y| {
        let tip = 15.0 * (1.0 - (y - 1.0).abs()) * x.min(2.0 - x).max(0.0);
        let place = 20.0 * x - tip;
        DVec3::new(place, y, 0.5 * (0.1 * place).sin() * y.cos())
    });
    let ([_, smooth], exact) = exact(&work, 10);
    assert!(exact.seams.len() == 3 && exact.kept.len() == 4, "{exact:?}");
    for (before, after) in seams(&work, &smooth).iter().zip(seams(&work, &exact.surfaces)) {
        if exact.seams.contains(&after.curve) {
            assert!(after.angle_max_deg <= 1e-3, "{after:?}");
        } else {
            assert!(after.angle_rms_deg <= 1.2 * before.angle_rms_deg + 0.05, "{before:?} to {after:?}");
        }
    }
}

/// A wavy sheet of 7 x 2 patches. Patch 2 has its nodes crowded on the middle of its side at `x = 3`, by `crowd` (1: without end).
fn crowded(crowd: f64) -> Patchwork {
    let height = |x: f64, y: f64| 0.1 * (1.3 * x + 0.5 * y).sin() * (y - 0.3).cos();
    let mut work = sheet(7, 2, [false, false], [33, 33], |x, y| DVec3::new(x, y, height(x, y)));
    work.grids[2] = grid(33, 33, |u, v| {
        let (off, share) = (1.0 - u, crowd * (std::f64::consts::PI * v).sin().powi(2));
        let x = 3.0 - off * (1.0 - share + share * off * off);
        DVec3::new(x, v, height(x, v))
    });
    share_boundaries(&work.network, &mut work.grids);
    work
}

#[test]
fn a_patch_that_would_turn_over_stays_with_its_boundary_and_the_seams_of_all_others_are_exact() {
    let (_, all) = exact(&crowded(0.8), 10);
    assert!(all.kept.is_empty() && all.seams.len() == 19);
    let work = crowded(0.98);
    let ([_, smooth], exact) = exact(&work, 10);
    let own = work.network.patches[2].sides.map(|side| side.curve);
    let is_own = |c: &u32| own.contains(c);
    assert!(exact.kept.iter().all(is_own) && exact.kept.len() == 3 && exact.seams.len() == 16, "{exact:?}");
    assert!((0..14).all(|p| (exact.surfaces[p] == smooth[p]) == (p == 2)));
    assert!(exact.surfaces.iter().zip(&work.grids).all(|(s, g)| surface::folds(s, g) == 0));
    for (before, after) in seams(&work, &smooth).iter().zip(seams(&work, &exact.surfaces)) {
        assert!(after.gap_max < 1e-14, "{after:?}");
        let most = if is_own(&after.curve) { before.angle_max_deg * 1.1 + 0.05 } else { 1e-3 };
        assert!(after.angle_max_deg.max(after.regular_angle_bound_deg.unwrap()) <= most, "{before:?} to {after:?}");
    }
}

#[test]
fn exact_seams_are_bitwise_equal_on_1_and_2_threads() {
    let work = ball(5, 17);
    let made = [1, 2].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| exact(&work, 8).1)
    });
    assert!(made[0] == made[1] && !made[0].seams.is_empty());
}
