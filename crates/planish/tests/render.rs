//! Pictures: what is seen, what hides it, the numbers on the scale bar, stripes, and the same bytes always.

use planish::DVec3;
use planish::mesh::TriMesh;
use planish::render::{Camera, Image, Line, Look, Paint, render};
use planish::synthetic::shapes;

const SIDE: usize = 240;
const WHITE: [u8; 3] = [255, 255, 255];
const RED: [u8; 3] = [255, 0, 0];

/// A unit sphere of `rings` x `2 rings` quads around the origin.
fn sphere(rings: usize) -> TriMesh {
    let around = 2 * rings;
    let mut points = vec![DVec3::Z];
    for r in 1..rings {
        let (ring, height) = (std::f64::consts::PI * r as f64 / rings as f64).sin_cos();
        points.extend((0..around).map(|k| {
            let (sin, cos) = (std::f64::consts::TAU * k as f64 / around as f64).sin_cos();
            DVec3::new(ring * cos, ring * sin, height)
        }));
    }
    points.push(-DVec3::Z);
    let last = points.len() as u32 - 1;
    let at = |r: usize, k: usize| match r {
        0 => 0,
        r if r == rings => last,
        r => (1 + (r - 1) * around + k % around) as u32,
    };
    let quads = (0..rings).flat_map(|r| (0..around).map(move |k| (r, k)));
    let halves = quads.flat_map(|(r, k)| {
        let (a, b, c, d) = (at(r, k), at(r + 1, k), at(r + 1, k + 1), at(r, k + 1));
        [[a, b, c], [a, c, d]]
    });
    let triangles = halves.filter(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0]).collect();
    TriMesh::new(points, triangles)
}

/// A camera on the x axis, `away` from the origin, z up.
fn from_x(away: f64) -> Camera {
    Camera { eye: DVec3::X * away, right: DVec3::Y, up: DVec3::Z, forward: -DVec3::X, slope: 0.25 }
}

fn draw(mesh: &TriMesh, look: &Look) -> Image {
    render(mesh, look, &from_x(6.0), SIDE, SIDE).unwrap()
}

fn pixel(image: &Image, x: usize, y: usize) -> [u8; 4] {
    std::array::from_fn(|k| image.rgba[4 * (y * image.width + x) + k])
}

fn is_red(p: [u8; 4]) -> bool {
    p[0] > 200 && p[1] < 60 && p[2] < 60
}

#[test]
fn silhouette_of_a_unit_sphere_6_away_covers_its_disk_within_1_percent() {
    let image = draw(&sphere(64), &Look { background: None, ..Look::default() });
    let covered: f64 = image.rgba.iter().skip(3).step_by(4).map(|&a| a as f64 / 255.0).sum();
    // The tangent cone: sin a = 1/6; at slope 0.25 the picture's half is tan a = 0.25.
    let radius = (1.0f64 / 6.0).asin().tan() / 0.25 * SIDE as f64 / 2.0;
    let disk = std::f64::consts::PI * radius * radius;
    assert!((covered / disk - 1.0).abs() < 0.01, "{covered} of {disk} pixels");
    assert_eq!(pixel(&image, 0, 0)[3], 0);
    assert_eq!(pixel(&image, SIDE / 2, SIDE / 2)[3], 255);
}

#[test]
fn a_line_behind_the_sphere_is_hidden_and_one_before_it_is_not() {
    let line =
        |x: f64| Line { points: vec![DVec3::new(x, -1.4, 0.0), DVec3::new(x, 1.4, 0.0)], color: RED, width: 2.0 };
    let red = |image: &Image| (0..SIDE).filter(|&x| is_red(pixel(image, x, SIDE / 2))).collect::<Vec<_>>();
    let image = |x: f64| draw(&sphere(48), &Look { lines: vec![line(x)], ..Look::default() });
    let (before, behind) = (red(&image(1.5)), red(&image(-1.5)));
    assert!(before.contains(&(SIDE / 2)) && before.len() > SIDE / 2, "{} pixels", before.len());
    // At depth 7.5 the line's ends are at 1.4 / 7.5 of slope 0.25; the sphere hides up to tan(asin(1/6)).
    assert!(behind.iter().all(|&x| x.abs_diff(SIDE / 2) > 78), "{behind:?}");
    assert!(behind.len() >= 12, "{} pixels beside the sphere", behind.len());
}

#[test]
fn the_scale_bar_stands_at_the_right_rim_and_its_label_above_it() {
    let mesh = sphere(16);
    let values: Vec<f64> = mesh.points.iter().map(|p| p.z).collect();
    let image = |label: &str| {
        let paint = Paint::Field { values: &values, range: [-1.0, 1.0], label };
        render(&mesh, &Look { paint, ..Look::default() }, &from_x(12.0), 480, 360).unwrap()
    };
    let (mm, inch) = (image("mm"), image("in"));
    let changed: Vec<usize> =
        (0..480 * 360).filter(|&i| mm.rgba[4 * i..4 * i + 4] != inch.rgba[4 * i..4 * i + 4]).collect();
    // The bar takes the middle three fifths of the height.
    assert!(!changed.is_empty() && changed.iter().all(|i| i / 480 < 360 / 5 && i % 480 > 360), "{}", changed.len());
    let inked = (360..480).filter(|&x| pixel(&mm, x, 180)[..3] != WHITE).count();
    assert!(inked >= 9, "the bar is {inked} pixels wide");
}

#[test]
fn zebra_stripes_on_a_sphere_turn_from_dark_to_light_symmetrically() {
    let look = Look { paint: Paint::Zebra { stripes: 8.0 }, hollows: 0.0, crease_deg: 60.0, ..Look::default() };
    let image = draw(&sphere(96), &look);
    let row: Vec<bool> = (SIDE / 2 - 60..SIDE / 2 + 60).map(|x| pixel(&image, x, SIDE / 2)[1] > 100).collect();
    let turns = row.windows(2).filter(|w| w[0] != w[1]).count();
    // Towards +-60 of 81 pixels the mirrored ray turns by more than a quarter each way: 4 stripes and more a side.
    assert!((8..=40).contains(&turns), "{turns} turns");
    let bent = TriMesh { triangles: sphere(96).triangles.iter().map(|t| [t[0], t[2], t[1]]).collect(), ..sphere(96) };
    // Seen from its back a surface has its stripes at the same places.
    let back = draw(&bent, &look);
    let same = (SIDE / 2 - 60..SIDE / 2 + 60)
        .filter(|&x| (pixel(&back, x, SIDE / 2)[1] > 60) == (pixel(&image, x, SIDE / 2)[1] > 100))
        .count();
    assert!(same > 110, "{same} of 120");
}

#[test]
fn a_picture_has_the_same_bytes_on_1_and_4_threads() {
    let mesh = shapes::two_spheres(3);
    let camera = Camera::fit(&mesh.bounds(), DVec3::new(1.0, -0.6, 0.5), DVec3::Z, 1.0);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| render(&mesh, &Look { background: Some(WHITE), ..Look::default() }, &camera, 160, 160).unwrap())
    };
    assert_eq!(on(1), on(4));
}

#[test]
fn stripes_follow_normals_that_a_surface_has_of_its_own_and_not_its_facets() {
    // Two halves of a flat square, small, so that all rays are alike. Normals turned by 3 degrees to the right mirror the view 84
    // degrees from the right: with 9 stripes over the half circle stripe 8 of steps of 10 degrees, dark; to the left 96: bright.
    let size = 0.1;
    let corner = |y: f64, z: f64| DVec3::new(0.0, y * size, z * size);
    let half = |from: f64| [corner(from, -1.0), corner(from + 1.0, -1.0), corner(from + 1.0, 1.0), corner(from, 1.0)];
    let points = [half(-1.0), half(0.0)].concat();
    let mesh = TriMesh::new(points, vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]]);
    let (sin, cos) = 3f64.to_radians().sin_cos();
    let normals: Vec<DVec3> = [[DVec3::new(cos, sin, 0.0); 4], [DVec3::new(cos, -sin, 0.0); 4]].concat();
    let look = Look { paint: Paint::Zebra { stripes: 9.0 }, hollows: 0.0, ..Look::default() };
    let middle = SIDE / 2;
    let bright = |image: &Image, x: usize| pixel(image, x, middle)[1] > 120;
    let own = draw(&mesh, &Look { normals: Some(&normals), ..look.clone() });
    assert!(!bright(&own, middle - 4) && bright(&own, middle + 4));
    let flat = draw(&mesh, &look);
    assert_eq!(pixel(&flat, middle - 4, middle), pixel(&flat, middle - 5, middle));
    assert_ne!(own, flat);
    let few = render(&mesh, &Look { normals: Some(&normals[1..]), ..look }, &from_x(6.0), SIDE, SIDE);
    assert!(few.unwrap_err().to_string().contains("7 colours, numbers or normals for 8 vertices"));
}
