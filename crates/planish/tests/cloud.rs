//! Scans to samples and fields: closed form first, then invariants, then input that is none.

use glam::{DQuat, DVec3};
use planish::Silent;
use planish::cloud::{self, CleanParams, Cloud, CloudError, ProjectParams, Samples};
use planish::contour::ContourParams;
use planish::field::{Field, SampleField};
use planish::geom::{Aabb, random};
use planish::mesh::{TriMesh, diagnose};
use planish::pipeline::{ScanMeshed, ScanParams, mesh_scan};
use planish::synthetic::shapes;

/// A normally distributed number.
fn normal(seed: u64, n: u64) -> f64 {
    random::normal(random::unit(seed, 2 * n), random::unit(seed, 2 * n + 1))
}

/// Points of a mesh, evenly by area, with noise in all directions.
fn scan_of(mesh: &TriMesh, count: u64, noise: f64, seed: u64) -> Vec<DVec3> {
    let mut total = 0.0;
    let sums: Vec<f64> = (0..mesh.triangles.len())
        .map(|t| {
            total += mesh.area(t);
            total
        })
        .collect();
    (0..count)
        .map(|i| {
            let [pick, r, s] = [0, 1, 2].map(|k| random::unit(seed, 3 * i + k));
            let t = sums.partition_point(|&x| x <= pick * total).min(sums.len() - 1);
            let [a, b, c] = mesh.corners(t);
            let r = r.sqrt();
            let p = a * (1.0 - r) + b * (r * (1.0 - s)) + c * (r * s);
            p + noise * DVec3::from_array([0, 1, 2].map(|k| normal(seed + 1, 3 * i + k)))
        })
        .collect()
}

/// Points on the unit sphere, evenly spread.
fn sphere(count: usize) -> Vec<DVec3> {
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    (0..count)
        .map(|k| {
            let z = 1.0 - (2 * k + 1) as f64 / count as f64;
            let (s, c) = (k as f64 * golden).sin_cos();
            let r = (1.0 - z * z).sqrt();
            DVec3::new(r * c, r * s, z)
        })
        .collect()
}

fn clean(points: Vec<DVec3>) -> Samples {
    cloud::clean(&Cloud::new(points), &CleanParams::default(), &Silent).unwrap()
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values.fold((0.0, 0.0), |(s, n), x| (s + x * x, n + 1.0));
    f64::sqrt(sum / n)
}

#[test]
fn a_noise_free_sphere_of_20_000_points_is_met_within_1e_6_and_its_curvatures_within_1e_3() {
    let samples = clean(sphere(20_000));
    assert!(samples.noise < 1e-4, "{}", samples.noise);
    let off = samples.samples.iter().map(|s| (s.center.length() - 1.0).abs()).fold(0.0, f64::max);
    assert!(off < 1e-6, "{off}");
    for s in &samples.samples {
        let (gauss, mean) = s.quadric.curvature(s.center);
        assert!((mean - 1.0).abs() < 1e-3 && (gauss - 1.0).abs() < 2e-3, "{mean} {gauss}");
        assert!(s.normal.dot(s.center) > 0.999_999);
    }
}

#[test]
fn noise_of_a_plane_and_a_sphere_is_estimated_within_8_percent() {
    for noise in [0.002, 0.01] {
        let points = scan_of(&shapes::sphere(1.0, 5), 30_000, noise, 3);
        let estimated = clean(points).noise;
        assert!((estimated / noise - 1.0).abs() < 0.08, "{estimated} for {noise}");
    }
}

#[test]
fn points_of_a_sphere_with_noise_of_half_the_spacing_are_moved_to_within_0_075_spacings_rms_and_0_4_at_most() {
    let points = scan_of(&shapes::sphere(1.0, 6), 50_000, 0.5 * (4.0 * std::f64::consts::PI / 50_000.0f64).sqrt(), 5);
    let samples = clean(points.clone());
    let spacing = (4.0 * std::f64::consts::PI / 50_000.0f64).sqrt();
    let made = cloud::project(&Cloud::new(points), &samples, 4.0, &ProjectParams::default(), &Silent).unwrap();
    let off = rms(made.cloud.points.iter().map(|p| p.length() - 1.0)) / spacing;
    assert!(off < 0.075, "{off} spacings");
    let most = made.cloud.points.iter().map(|p| (p.length() - 1.0).abs()).fold(0.0, f64::max) / spacing;
    assert!(most < 0.4, "{most} spacings");
    assert_eq!(samples.closed, [true]);
}

#[test]
fn noise_of_one_percent_shrinks_a_sphere_by_less_than_a_quarter_of_what_it_blurs() {
    let noise = 0.0346;
    let points: Vec<DVec3> = sphere(50_000)
        .into_iter()
        .zip(0u64..)
        .map(|(p, i)| p + noise * DVec3::from_array([0, 1, 2].map(|k| normal(3, 3 * i + k))))
        .collect();
    let samples = clean(points.clone());
    let made = cloud::project(&Cloud::new(points), &samples, 4.0, &ProjectParams::default(), &Silent).unwrap();
    let off = made.cloud.points.iter().map(|p| p.length() - 1.0).sum::<f64>() / made.cloud.points.len() as f64;
    // By the square of the noise over the radius.
    assert!(off.abs() < 0.25 * noise * noise, "{off}");
}

#[test]
fn all_samples_of_a_closed_shape_point_outward() {
    for mesh in [shapes::sphere(1.0, 5), shapes::torus(1.0, 0.35, 96, 48)] {
        let diagonal = mesh.bounds().diagonal();
        let bvh = planish::geom::Bvh::new(&mesh);
        let samples = clean(scan_of(&mesh, 30_000, 0.0025 * diagonal, 9));
        let wrong = samples
            .samples
            .iter()
            .filter(|s| s.normal.dot(mesh.normal(bvh.closest(s.center).place.face as usize)) < 0.0)
            .count();
        assert_eq!(wrong, 0, "of {}", samples.samples.len());
    }
}

#[test]
fn a_cavity_inside_a_ball_points_into_the_cavity() {
    let outer = scan_of(&shapes::sphere(1.0, 5), 30_000, 0.002, 1);
    let inner = scan_of(&shapes::sphere(0.5, 5), 8_000, 0.002, 2);
    let samples = clean(outer.into_iter().chain(inner).collect());
    assert_eq!(samples.closed.len(), 2);
    for s in &samples.samples {
        let along = s.normal.dot(s.center.normalize());
        assert!(if s.center.length() > 0.75 { along > 0.9 } else { along < -0.9 }, "{along} at {}", s.center);
    }
}

#[test]
fn two_balls_half_a_radius_apart_are_two_segments_that_point_outward() {
    let shape = shapes::sphere(1.0, 5);
    let mut points = scan_of(&shape, 15_000, 0.004, 1);
    points.extend(scan_of(&shape, 15_000, 0.004, 7).into_iter().map(|p| p + DVec3::X * 2.5));
    let samples = clean(points);
    assert_eq!(samples.closed, [true, true]);
    for s in &samples.samples {
        let center = if s.center.x < 1.25 { DVec3::ZERO } else { DVec3::X * 2.5 };
        assert!(s.normal.dot(s.center - center) > 0.9);
    }
}

#[test]
fn two_balls_that_touch_or_have_a_gap_of_two_noise_levels_are_two_segments() {
    let shape = shapes::sphere(1.0, 5);
    let noise = 0.005;
    for gap in [0.0, 2.0 * noise] {
        let mut points = scan_of(&shape, 20_000, noise, 1);
        points.extend(scan_of(&shape, 20_000, noise, 7).into_iter().map(|p| p + DVec3::X * (2.0 + gap)));
        let samples = clean(points);
        assert_eq!(samples.closed, [true, true], "gap {gap}");
        // Where they are closer than six noise levels nobody knows whose a sample is, and at the rim of that a few lie across.
        let clear = samples.samples.iter().filter(|s| (s.center.x - 1.0 - gap / 2.0).abs() > 3.0 * noise);
        let apart: Vec<bool> = clear.map(|s| (s.segment == 1) == (s.center.x > 1.0 + gap / 2.0)).collect();
        let agreed = apart.iter().filter(|a| **a).count() as f64 / apart.len() as f64;
        assert!((agreed - 0.5).abs() > 0.49, "gap {gap}: {agreed} of the samples are in the segment of their ball");
    }
}

#[test]
fn no_box_with_both_signs_is_left_out_of_a_field_of_two_scales() {
    // The wide supports of the large ball say nothing of distances beside the small one.
    let mut points = sphere(8000);
    points.extend(sphere(8000).into_iter().map(|p| p * 0.02 + DVec3::X * 1.5));
    let samples = clean(points.clone());
    let field = SampleField::new(&samples, true);
    let (mut both, mut missed) = (0, 0);
    for i in 0..4000u64 {
        let random = |k: u64| DVec3::from_array([0, 1, 2].map(|a| random::unit(5, 30 * i + 3 * k + a)));
        let at = points[(i as usize * 397) % points.len()];
        let half = if at.x > 1.2 { 0.02 } else { 0.1 };
        let center = at + half * (2.0 * random(0) - DVec3::ONE);
        let aabb = Aabb { min: center - DVec3::splat(half), max: center + DVec3::splat(half) };
        let values: Vec<f64> = (1..9).map(|k| field.value(center + half * (2.0 * random(k) - DVec3::ONE))).collect();
        if values.iter().any(|v| *v < 0.0) && values.iter().any(|v| *v >= 0.0) {
            both += 1;
            missed += usize::from(!field.crosses(&aabb));
        }
    }
    assert!(both > 2000 && missed == 0, "{missed} of {both}");
}

#[test]
fn a_terrain_points_up() {
    let points: Vec<DVec3> = (0..20_000u64)
        .map(|i| {
            let (x, y) = (random::unit(1, 2 * i) * 10.0, random::unit(1, 2 * i + 1) * 10.0);
            DVec3::new(x, y, 0.3 * (x * 0.9).sin() * (y * 0.7).cos() + 0.005 * normal(4, i))
        })
        .collect();
    let samples = clean(points);
    assert!(samples.samples.iter().all(|s| s.normal.z > 0.5));
    assert_eq!(samples.closed, [false]);
}

#[test]
fn one_scanner_decides_the_side_of_an_open_scan() {
    let points: Vec<DVec3> = (0..8_000u64)
        .map(|i| DVec3::new(random::unit(1, 2 * i), random::unit(1, 2 * i + 1), 0.001 * normal(4, i)))
        .collect();
    let scan = Cloud { scanners: vec![DVec3::new(0.5, 0.5, -3.0)], ..Cloud::new(points) };
    let samples = cloud::clean(&scan, &CleanParams::default(), &Silent).unwrap();
    assert!(samples.samples.iter().all(|s| s.normal.z < -0.9));
}

#[test]
fn samples_do_not_depend_on_the_order_of_points_nor_on_the_number_of_threads() {
    let points = scan_of(&shapes::cuboid(DVec3::new(1.0, 0.7, 0.5), 4), 12_000, 0.002, 1);
    let all = clean(points.clone());
    let turned = clean(points.iter().rev().copied().collect());
    assert_eq!(all.samples, turned.samples);
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert_eq!(pool.install(|| clean(points.clone())).samples, all.samples, "{threads} threads");
    }
}

#[test]
fn estimates_scale_with_the_scan_and_stay_under_rigid_motion() {
    let points = scan_of(&shapes::torus(1.0, 0.4, 64, 32), 15_000, 0.004, 1);
    let base = clean(points.clone());
    // A power of two changes no rounding.
    let large = clean(points.iter().map(|p| *p * 1024.0).collect());
    assert_eq!(large.samples.len(), base.samples.len());
    assert!((large.noise / base.noise - 1024.0).abs() < 1e-6 * 1024.0);
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 0.9);
    let moved = clean(points.iter().map(|p| turn * *p + DVec3::new(3.0, -2.0, 1.0)).collect());
    assert!((moved.noise / base.noise - 1.0).abs() < 0.02, "{} {}", moved.noise, base.noise);
    assert!((moved.spacing / base.spacing - 1.0).abs() < 0.05);
}

#[test]
fn a_box_with_noise_gives_one_watertight_manifold_mesh() {
    let shape = shapes::cuboid(DVec3::new(1.0, 0.8, 0.6), 4);
    let scan = Cloud::new(scan_of(&shape, 40_000, 0.0014, 1));
    let params = ScanParams {
        clean: CleanParams::default(),
        contour: ContourParams::default(),
        points: Default::default(),
        cells: Some(planish::field::Spacing::Resolution(64)),
        memory: 1 << 30,
        close: None,
    };
    let made = mesh_scan(&scan, &params, &Silent).unwrap();
    let facts = diagnose(&made.meshed.extracted.mesh);
    assert!(made.closed && facts.watertight && facts.manifold, "{facts:?}");
    assert_eq!((facts.components, facts.euler), (1, 2));
    let volume = facts.volume.unwrap();
    assert!((volume / 0.48 - 1.0).abs() < 0.01, "{volume}");
}

#[test]
fn outliers_are_flagged_and_left_out() {
    let mut points = scan_of(&shapes::sphere(1.0, 5), 20_000, 0.003, 1);
    let strays = 400;
    points.extend((0..strays).map(|i| DVec3::from_array([0, 1, 2].map(|k| 2.4 * random::unit(5, 3 * i + k) - 1.2))));
    let scan = Cloud::new(points);
    let samples = cloud::clean(&scan, &CleanParams::default(), &Silent).unwrap();
    let kept = cloud::project(&scan, &samples, 4.0, &ProjectParams::default(), &Silent).unwrap();
    let far = kept.cloud.points.iter().filter(|p| (p.length() - 1.0).abs() > 0.05).count();
    assert!(far < strays as usize / 50, "{far} strays are left");
    assert!(kept.cloud.points.len() > 19_800, "{} points are kept", kept.cloud.points.len());
}

#[test]
fn strays_all_around_a_box_change_its_mesh_by_less_than_a_noise_level() {
    let shape = shapes::cuboid(DVec3::new(1.0, 0.8, 0.6), 4);
    let noise = 0.0014;
    let mut points = scan_of(&shape, 30_000, noise, 1);
    points.extend((0..600).map(|i| DVec3::from_array([0, 1, 2].map(|k| 2.0 * random::unit(5, 3 * i + k) - 0.6))));
    let mesh = meshed(points, None);
    let facts = diagnose(&mesh);
    assert!(facts.watertight && facts.manifold && facts.components == 1, "{facts:?}");
    let found = planish::mesh::compare(&shape, &mesh, &Default::default(), &Silent).unwrap();
    assert!(found.both.rms < noise, "{}", found.both.rms);
}

#[test]
fn a_plate_four_noise_levels_thick_has_two_sides_that_look_away_from_each_other() {
    let points: Vec<DVec3> = (0..60_000u64)
        .map(|i| {
            let (x, y) = (random::unit(1, 2 * i), random::unit(1, 2 * i + 1));
            let side = if i % 2 == 0 { 0.004 } else { -0.004 };
            DVec3::new(x, y, 0.1 * (4.0 * x).sin() + side)
                + 0.002 * DVec3::from_array([0, 1, 2].map(|k| normal(4, 3 * i + k)))
        })
        .collect();
    let samples = clean(points);
    assert!((samples.noise / 0.002 - 1.0).abs() < 0.15, "{}", samples.noise);
    // Within a rim of the width of a ball a side may miss.
    let inner =
        samples.samples.iter().filter(|s| (s.center - DVec3::new(0.5, 0.5, 0.0)).truncate().abs().max_element() < 0.45);
    let (mut count, mut wrong, mut aside) = (0, 0, 0);
    for s in inner {
        let above = s.center.z - 0.1 * (4.0 * s.center.x).sin();
        aside += usize::from((above.abs() - 0.004).abs() > 0.002);
        count += 1;
        wrong += usize::from(s.normal.z * above < 0.0);
    }
    assert!(count > 500 && wrong * 100 < count && aside * 50 < count, "{wrong} wrong, {aside} aside of {count}");
}

#[test]
fn views_of_a_ball_that_lie_aside_of_each_other_are_one_surface_that_points_outward() {
    let ball = sphere(30_000);
    let noise = |seed, i: usize| 0.002 * DVec3::from_array([0, 1, 2].map(|k| normal(seed, (3 * i + k) as u64)));
    // The second view covers a third of the ball and lies five noise levels farther in.
    let first = ball.iter().enumerate().map(|(i, p)| *p + noise(3, i));
    let second = ball.iter().enumerate().filter(|(_, p)| p.x > 0.35).map(|(i, p)| {
        let turned = DQuat::from_rotation_x(0.01) * *p;
        0.99 * turned + noise(5, i)
    });
    let samples = clean(first.chain(second).collect());
    let wrong = samples.samples.iter().filter(|s| s.normal.dot(s.center) < 0.5).count();
    assert!(wrong * 500 < samples.samples.len(), "{wrong} of {}", samples.samples.len());
    assert!(samples.gap.is_infinite(), "{}", samples.gap);
}

#[test]
fn a_hole_in_a_sphere_is_closed_within_a_tenth_of_the_radius_or_left_open() {
    let points: Vec<DVec3> =
        scan_of(&shapes::sphere(1.0, 5), 20_000, 0.002, 1).into_iter().filter(|p| p.z < 0.9).collect();
    let closed = meshed(points.clone(), Some(true));
    let facts = diagnose(&closed);
    assert!(facts.watertight && facts.manifold && facts.components == 1, "{facts:?}");
    let top = closed.points.iter().map(|p| p.z).fold(0.0, f64::max);
    assert!((0.85..1.03).contains(&top), "{top}");
    assert!(closed.points.iter().all(|p| p.length() < 1.03 && p.length() > 0.85));
    let open = meshed(points, Some(false));
    let facts = diagnose(&open);
    assert!(!facts.watertight && facts.boundary_loops == 1, "{facts:?}");
}

/// Points of the sheet `z = .1 sin(4 x)` over the unit square, without those within `radius` of the middles of 25 squares.
fn holed_sheet(radius: f64) -> Vec<DVec3> {
    let points = (0..60_000u64).map(|i| {
        let (x, y) = (random::unit(1, 2 * i), random::unit(1, 2 * i + 1));
        DVec3::new(x, y, 0.1 * (4.0 * x).sin() + 0.0005 * normal(4, i))
    });
    let off = |x: f64| (5.0 * x).fract() - 0.5;
    points.filter(|p| off(p.x).hypot(off(p.y)) > 5.0 * radius).collect()
}

#[test]
fn small_holes_of_an_open_sheet_are_closed_within_2_thousandths_and_stay_when_asked_for() {
    // Eleven spacings wide, with their rims 8 % of the diagonal around.
    let points = holed_sheet(0.025);
    let made = scanned(points.clone(), None);
    let mesh = made.meshed.extracted.mesh;
    let facts = diagnose(&mesh);
    assert!(!made.closed && facts.manifold, "{facts:?}");
    assert_eq!((facts.components, facts.boundary_loops), (1, 1), "{} lids", made.lids);
    let off = mesh.points.iter().map(|p| (p.z - 0.1 * (4.0 * p.x).sin()).abs()).fold(0.0, f64::max);
    assert!(off < 0.002, "{off}");
    assert_eq!(made.meshed.extracted.tags.vertices.len(), mesh.points.len());
    assert_eq!(diagnose(&meshed(points, Some(false))).boundary_loops, 26);
}

#[test]
fn an_open_sheet_ends_within_four_spacings_of_its_points_and_large_holes_stay() {
    // 16 % of the diagonal around.
    let points = holed_sheet(0.04);
    let mesh = meshed(points.clone(), None);
    assert_eq!(diagnose(&mesh).boundary_loops, 26);
    let tree = planish::geom::KdTree::new(&points);
    let far = planish::geom::nearest_distances(&tree, &mesh.points).into_iter().fold(0.0, f64::max);
    // 48 000 points on a square of side 1.
    assert!(far < 4.0 / 48_000f64.sqrt(), "{far}");
    // No rim is lost, and none lies two and a half spacings beyond the points: those of the square and of 25 holes.
    let area = 1.044 - 25.0 * std::f64::consts::PI * 0.04 * 0.04;
    let rims = 4.0 + 25.0 * std::f64::consts::TAU * 0.04;
    let found = diagnose(&mesh).area;
    assert!(found > area && found < area + rims * 2.5 / 48_000f64.sqrt(), "{found} for {area}");
}

#[test]
fn a_step_whose_wall_has_no_points_is_upright_within_a_third_of_their_distance() {
    // A roof that slopes down to an edge, and a floor below that begins there; points are .045 apart.
    let (noise, deep, slope) = (1e-3, 0.03, 0.4);
    let place = |i: u64| {
        let r = |k: u64| 2.0 * random::unit(21, 2 * i + k) - 1.0;
        let p = DVec3::new(r(0), r(1), if r(0) > 0.0 { -deep } else { -slope * r(0) });
        p + noise * DVec3::from_array([0, 1, 2].map(|k| normal(22, 3 * i + k)))
    };
    let samples = clean((0..2_000).map(place).collect());
    let field = SampleField::new(&samples, false);
    let side = |x: f64| {
        let values = (-80..=80).map(|k| field.value(DVec3::new(x, 0.01 * f64::from(k), -deep / 2.0)));
        values.filter(|value| value.signum() == x.signum()).count()
    };
    // Inside below the roof, outside above the floor.
    let [inside, outside] = [-0.015, 0.015].map(side);
    assert!(inside.min(outside) >= 157, "{inside} and {outside} of 161");
}

/// The mesh of a scan with default parameters.
fn meshed(points: Vec<DVec3>, close: Option<bool>) -> TriMesh {
    scanned(points, close).meshed.extracted.mesh
}

/// The same with what was found on the way.
fn scanned(points: Vec<DVec3>, close: Option<bool>) -> ScanMeshed {
    let params = ScanParams {
        clean: CleanParams::default(),
        contour: ContourParams::default(),
        points: Default::default(),
        cells: None,
        memory: 1 << 30,
        close,
    };
    mesh_scan(&Cloud::new(points), &params, &Silent).unwrap()
}

#[test]
fn a_thinned_cloud_keeps_its_distance() {
    let scan = Cloud::new(scan_of(&shapes::sphere(1.0, 5), 20_000, 0.003, 1));
    let samples = cloud::clean(&scan, &CleanParams::default(), &Silent).unwrap();
    let params = ProjectParams { spacing: 0.1, ..ProjectParams::default() };
    let kept = cloud::project(&scan, &samples, 4.0, &params, &Silent).unwrap().cloud;
    let tree = planish::geom::KdTree::new(&kept.points);
    let mut near = Vec::new();
    for &p in &kept.points {
        tree.nearest(p, 2, &mut near);
        assert!(near[1].0.sqrt() > 0.1);
    }
    assert!(kept.points.len() > 500, "{}", kept.points.len());
}

#[test]
fn the_field_is_negative_inside_positive_outside_and_unknown_far_away() {
    let samples = clean(scan_of(&shapes::sphere(1.0, 5), 20_000, 0.002, 1));
    let field = SampleField::new(&samples, false);
    assert!(field.value(DVec3::X * 0.98) < 0.0 && field.value(DVec3::X * 1.02) > 0.0);
    assert!(field.value(DVec3::X * 2.5).is_nan() && field.value(DVec3::ZERO).is_nan());
    let closed = SampleField::new(&samples, true);
    assert!(closed.value(DVec3::ZERO) < 0.0 && closed.value(DVec3::X * 2.5) > 0.0);
    assert!((field.value(DVec3::Y * 1.01) - 0.01).abs() < 5e-4);
    assert!(field.gradient(DVec3::Y).dot(DVec3::Y) > 0.999);
}

#[test]
fn input_that_is_no_surface_gives_a_clear_error_and_never_a_panic() {
    let run = |points: Vec<DVec3>| cloud::clean(&Cloud::new(points), &CleanParams::default(), &Silent);
    assert!(matches!(run(vec![]), Err(CloudError::TooFew { distinct: 0, .. })));
    assert!(matches!(run(vec![DVec3::ONE; 5000]), Err(CloudError::TooFew { distinct: 1, .. })));
    assert!(matches!(run(vec![DVec3::ZERO, DVec3::X, DVec3::Y]), Err(CloudError::TooFew { distinct: 3, .. })));
    assert!(matches!(run(vec![DVec3::NAN; 100]), Err(CloudError::TooFew { distinct: 0, .. })));
    let line = (0..500).map(|i| DVec3::new(1.0, 2.0, 3.0) * i as f64).collect();
    assert!(matches!(run(line), Err(CloudError::Collinear { points: 500 })));
    // Planes, repeats, some NaN and two scales are scans.
    let mut plane: Vec<DVec3> =
        (0..3000u64).map(|i| DVec3::new(random::unit(1, 2 * i), random::unit(1, 2 * i + 1), 0.0)).collect();
    plane.extend_from_within(..500);
    plane.push(DVec3::NAN);
    plane.push(DVec3::new(f64::INFINITY, 0.0, 0.0));
    let samples = run(plane).unwrap();
    assert!(samples.samples.iter().all(|s| s.center.z.abs() < 1e-9 && s.normal.z > 0.999));
    let mut mixed = sphere(8000);
    mixed.extend(sphere(8000).into_iter().map(|p| p * 1e-3 + DVec3::X * 5.0));
    let samples = run(mixed).unwrap();
    assert_eq!(samples.closed.len(), 2);
}

#[test]
fn a_cancelled_cleaning_ends_as_cancelled() {
    struct Stop;
    impl planish::Observer for Stop {
        fn progress(&self, _: f64) {}
        fn cancelled(&self) -> bool {
            true
        }
    }
    let result = cloud::clean(&Cloud::new(sphere(5000)), &CleanParams::default(), &Stop);
    assert_eq!(result.unwrap_err(), CloudError::Cancelled(planish::observe::Cancelled));
}

/// A frame of a depth camera that looks at a ball of radius 3: 240 x 180 points, depths in whole steps. `noise` in steps.
fn depth_frame(step: f64, noise: f64) -> Vec<DVec3> {
    let (wide, high, middle) = (240u64, 180u64, 5.0);
    let pixel = |i: u64| {
        let [u, v] = [(i % wide, wide), (i / wide, high)].map(|(k, n)| (k as f64 + 0.5 - n as f64 / 2.0) / 240.0);
        let ray = DVec3::new(u, v, 1.0);
        // Where the ray meets the ball.
        let (a, b, c) = (ray.length_squared(), middle, middle * middle - 9.0);
        let depth = (b - (b * b - a * c).sqrt()) / a;
        ray * ((depth / step + noise * normal(31, i)).round() * step)
    };
    (0..wide * high).map(pixel).collect()
}

#[test]
fn depths_in_whole_steps_have_noise_of_a_step_over_root_12_within_20_percent_and_no_sharp_edges() {
    let step = 0.01;
    for (noise, turn) in [(0.0, 0.0), (0.6, 0.0), (0.0, 0.7)] {
        let turn = DQuat::from_axis_angle(DVec3::new(0.3, -0.5, 0.8).normalize(), turn);
        let points = depth_frame(step, noise).into_iter().map(|p| turn * p).collect();
        let made = mesh_scan(&Cloud::new(points), &ScanParams::default(), &Silent).unwrap();
        let honest = step * (1.0 / 12.0 + noise * noise).sqrt();
        assert!((made.samples.noise / honest - 1.0).abs() < 0.2, "{} for {honest}", made.samples.noise);
        let contour = &made.meshed.extracted;
        let facts = diagnose(&contour.mesh);
        assert!(contour.tags.edges.is_empty(), "{} sharp edges", contour.tags.edges.len());
        assert!(facts.components == 1 && facts.boundary_loops == 1, "{facts:?}");
        let off = |p: &DVec3| ((turn.inverse() * *p).distance(DVec3::new(0.0, 0.0, 5.0)) - 3.0).abs();
        let off = rms(contour.mesh.points.iter().map(off));
        assert!(off < honest, "{off} for {honest}");
    }
}

/// A comb: fins on a base, all in spacings of its points.
struct Comb {
    fins: usize,
    wall: f64,
    gap: f64,
}

impl Comb {
    const HIGH: f64 = 10.0;
    const LONG: f64 = 30.0;
    const BASE: f64 = 6.0;

    fn wide(&self) -> f64 {
        self.fins as f64 * (self.wall + self.gap) - self.gap
    }

    fn holds(&self, p: DVec3) -> bool {
        let high = if p.x.rem_euclid(self.wall + self.gap) < self.wall { Comb::HIGH } else { 0.0 };
        p.x > 0.0 && p.x < self.wide() && p.y > 0.0 && p.y < Comb::LONG && p.z > -Comb::BASE && p.z < high
    }

    /// Its faces: a corner and two edges each.
    fn faces(&self) -> Vec<[DVec3; 3]> {
        let (x, y, z) = (self.wide() * DVec3::X, Comb::LONG * DVec3::Y, Comb::BASE * DVec3::Z);
        let mut faces = vec![[-z, x, y], [-z, y, z], [x - z, y, z], [-z, x, z], [y - z, x, z]];
        for k in 0..self.fins {
            let left = k as f64 * (self.wall + self.gap) * DVec3::X;
            let (wall, gap, high) = (self.wall * DVec3::X, self.gap * DVec3::X, Comb::HIGH * DVec3::Z);
            faces.extend([[left, y, high], [left + wall, y, high], [left + high, wall, y]]);
            faces.extend([[left, wall, high], [left + y, wall, high]]);
            if k + 1 < self.fins {
                faces.push([left + wall, gap, y]);
            }
        }
        faces
    }

    /// One point per unit of area, with noise of a quarter.
    fn scan(&self, seed: u64) -> Vec<DVec3> {
        let faces = self.faces();
        let mut total = 0.0;
        let sums: Vec<f64> = faces
            .iter()
            .map(|f| {
                total += f[1].cross(f[2]).length();
                total
            })
            .collect();
        let place = |i: u64| {
            let [pick, r, s] = [0, 1, 2].map(|k| random::unit(seed, 3 * i + k));
            let [corner, a, b] = faces[sums.partition_point(|&x| x <= pick * total).min(faces.len() - 1)];
            corner + r * a + s * b + 0.25 * DVec3::from_array([0, 1, 2].map(|k| normal(seed + 1, 3 * i + k)))
        };
        (0..total as u64).map(place).collect()
    }
}

#[test]
fn of_the_samples_of_combs_with_walls_and_gaps_of_two_and_a_half_to_three_spacings_1_percent_looks_the_wrong_way() {
    for (seed, wall, gap) in [(1, 3.0, 2.5), (2, 2.5, 3.0)] {
        let comb = Comb { fins: 6, wall, gap };
        let samples = clean(comb.scan(seed)).samples;
        let step = wall.min(gap) / 3.0;
        let wrong =
            |s: &&cloud::Sample| comb.holds(s.center + step * s.normal) && !comb.holds(s.center - step * s.normal);
        let share = samples.iter().filter(wrong).count() as f64 / samples.len() as f64;
        assert!(share < 0.01, "{share} of {} with walls of {wall}", samples.len());
    }
}
