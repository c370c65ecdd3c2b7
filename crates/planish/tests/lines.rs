//! Sharp lines of meshes that were made of scans: what they have that the part does not.

use planish::geom::random;
use planish::mesh::{Adjacency, FeatureTags, TriMesh, diagnose, folded_back, next, self_intersections, sharp_edges};
use planish::sharp::{ScanScale, find_lines, tidy_lines};
use planish::synthetic::shapes;
use planish::{DVec3, Silent};
use std::collections::BTreeMap;

/// The angle between normals that extraction takes for a sharp edge, radians.
const SHARP: f64 = 0.451;

/// A line that turns by more than this at a vertex, degrees, has a corner or a jog there.
const TURN_DEG: f64 = 40.0;
/// A triangle lower than this share of its longest edge is a sliver.
const SLIVER: f64 = 0.05;

/// Counts of a mesh with lines.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Census {
    /// Length of all lines, world units.
    length: f64,
    /// Vertices where three lines or more meet.
    junctions: usize,
    /// Vertices inside the surface where a line ends.
    ends: usize,
    /// Vertices where a line turns by more than [`TURN_DEG`].
    turns: usize,
    /// Triangles with a corner on a line that are lower than [`SLIVER`] of their longest edge.
    slivers: usize,
    /// Pairs of neighbours in the whole mesh that are folded back on one another.
    folded_back: usize,
}

/// Counts what lines have.
/// * `tags` - of `mesh`
fn census(mesh: &TriMesh, tags: &FeatureTags) -> Census {
    let adjacency = Adjacency::new(mesh);
    let at = |v: u32| mesh.points[v as usize];
    let mut beside: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for &[a, b] in &tags.edges {
        beside.entry(a).or_default().push(b);
        beside.entry(b).or_default().push(a);
    }
    let turns = |v: u32, others: &[u32]| match others {
        [a, b] => (at(v) - at(*a)).angle_between(at(*b) - at(v)) > TURN_DEG.to_radians(),
        _ => false,
    };
    let is_sliver = |t: usize| {
        let [a, b, c] = mesh.corners(t);
        let longest = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
        mesh.triangles[t].iter().any(|v| beside.contains_key(v)) && (b - a).cross(c - a).length() < SLIVER * longest
    };
    Census {
        length: tags.edges.iter().map(|e| at(e[0]).distance(at(e[1]))).sum(),
        junctions: beside.values().filter(|o| o.len() > 2).count(),
        ends: beside.iter().filter(|(v, o)| o.len() == 1 && !adjacency.is_boundary_vertex(**v)).count(),
        turns: beside.iter().filter(|(v, o)| turns(**v, o)).count(),
        slivers: (0..mesh.triangles.len()).filter(|&t| is_sliver(t)).count(),
        folded_back: folded_back(mesh, &adjacency).len(),
    }
}

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
fn the_edges_of_a_box_meet_at_8_corners_and_have_no_ends_turns_or_slivers() {
    let mesh = shapes::cuboid(DVec3::ONE, 4);
    let sharp = sharp_edges(&mesh, &Adjacency::new(&mesh), 40.0);
    let ends = |h: usize| [mesh.origin(h as u32), mesh.origin(next(h as u32))];
    let tags = FeatureTags::from_edges(mesh.points.len(), (0..sharp.len()).filter(|&h| sharp[h]).map(ends));
    let found = census(&mesh, &tags);
    let expected = Census { length: found.length, junctions: 8, ..Census::default() };
    assert_eq!(found, expected);
    assert!((found.length - 12.0).abs() < 1e-9);
    // Without one edge of the box: two ends at the places where corners of two lines are left.
    let most = mesh.bounds().max;
    let is_kept = |e: &&[u32; 2]| {
        e.iter().any(|&v| (mesh.points[v as usize].truncate() - most.truncate()).abs().max_element() > 1e-9)
    };
    let fewer = FeatureTags::from_edges(mesh.points.len(), tags.edges.iter().filter(is_kept).copied());
    let found = census(&mesh, &fewer);
    assert_eq!((found.junctions, found.ends, found.turns), (6, 0, 2));
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
