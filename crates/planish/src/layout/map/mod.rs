//! Seamless maps: every triangle has its own chart in the plane, and neighbouring charts differ by quarter turns.
//!
//! 1. the field becomes charts with cones and a cut ([`cones`]);
//! 2. the equations of the seams are solved by substitution, so that they hold exactly ([`seams`], [`eliminate`]);
//! 3. the map that follows the field best is one sparse solve ([`energy`]);
//! 4. flipped triangles are turned back ([`untangle`]), and exact arithmetic certifies that none is left.
//!
//! Bommes, Zimmer, Kobbelt, *Mixed-Integer Quadrangulation*, 2009, for charts, cut and energy; `docs/methods/layout.md`,
//! steps 3 and 4.

mod carry;
mod cones;
mod conformal;
mod effort;
mod eliminate;
mod energy;
mod newton;
#[cfg(test)]
pub(in crate::layout) mod polycube;
mod room;
mod seams;
mod untangle;

pub(super) use cones::{Charts, ConeCare};
pub(super) use effort::Effort;

use crate::geom::predicates::orient2d;
use crate::mesh::{Adjacency, NONE, TriMesh, next};
use crate::observe::{Cancelled, Observer};
use carry::Carried;
use energy::Maps;
use glam::DVec2;
use planish_sparse::SparseCholesky;
use seams::{Held, Seams};
use std::f64::consts::FRAC_PI_2;

/// Steps of the lattice that a certified map lies on, in parts of its size: eight digits are left for sums.
const LATTICE_BITS: i32 = 40;

/// Softness of the barrier at the start of an attempt to untangle a map, against determinants of 1: what the first does
/// not untangle the second may.
const SOFTNESS: [f64; 2] = [0.1, 0.01];

/// How often a map with whole numbers takes the stretches that it has come to for those that it should have.
const STRETCHES: usize = 2;

/// A map of a mesh to the plane, triangle by triangle.
///
/// Seen from both of its triangles an edge has the same length, and the same direction but for quarter turns: with `d`
/// the edge vector of half-edge `h` in its own triangle, the same edge, run the same way, is
/// `quarter_turn(d, jump[h])` in the triangle of the opposite half-edge. Sharp lines and boundaries run along an axis.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct SeamlessMap {
    /// Place of each corner of each triangle, in the chart of the triangle.
    pub uv: Vec<[DVec2; 3]>,
    /// For each half-edge the quarter turns, counter-clockwise, from its triangle's chart to that of the opposite
    /// half-edge: 0 to 3; 0 on the boundary. Opposite half-edges have opposite turns.
    pub jump: Vec<u8>,
}

/// `v` turned counter-clockwise by `turns` quarters; exact.
pub(super) fn quarter_turn(v: DVec2, turns: u8) -> DVec2 {
    match turns % 4 {
        0 => v,
        1 => DVec2::new(-v.y, v.x),
        2 => -v,
        _ => DVec2::new(v.y, -v.x),
    }
}

/// What became of a map.
#[derive(Clone, Debug)]
pub(super) struct Mapped {
    pub map: SeamlessMap,
    /// Faces that are flipped or without area in the map: an injective map has none.
    pub flipped: Vec<u32>,
    /// Vertices whose faces go around them by another angle than the charts say: an injective map has none.
    pub wound: Vec<u32>,
    /// Mean angle between the isolines and the field, degrees.
    pub deviation_deg: f64,
    /// The free unknowns.
    free: Vec<f64>,
}

impl Mapped {
    /// True if the map is one-to-one around every vertex.
    pub fn is_injective(&self) -> bool {
        self.flipped.is_empty() && self.wound.is_empty()
    }

    pub fn faults(&self) -> usize {
        self.flipped.len() + self.wound.len()
    }
}

/// The map of least distortion that follows `charts`, in world units.
/// # Errors
/// `Cancelled`.
pub(super) fn seamless(
    mesh: &TriMesh,
    adjacency: &Adjacency,
    lines: &[bool],
    charts: &Charts,
    observer: &dyn Observer,
) -> Result<Option<Mapped>, Cancelled> {
    let Some(mut seams) = Seams::new(mesh, adjacency, lines, charts, Held::Origin) else { return Ok(None) };
    if Maps::new(mesh, charts, &seams, 1.0, true).is_too_large() {
        let Some(sparse) = Seams::sparse(mesh, adjacency, lines, charts) else { return Ok(None) };
        seams = sparse;
    }
    let maps = Maps::new(mesh, charts, &seams, 1.0, true);
    let Some(straight) = maps.follow(&vec![1.0; charts.scale.len()]) else { return Ok(None) };
    observer.check()?;
    let straight = certified((mesh, adjacency), &maps, charts, straight);
    if straight.is_injective() {
        return Ok(Some(straight));
    }
    let Some(laplacian) = maps.laplacian() else { return Ok(None) };
    // Where a boundary is ragged the stretches may be beyond all numbers.
    let starts: Vec<Vec<f64>> = maps.follow(&charts.scale).into_iter().chain([straight.free]).collect();
    untangled((mesh, adjacency), &maps, &laplacian, charts, &starts, observer).map(Some)
}

/// The first untangled map without faults, from these starts; else that with the fewest.
fn untangled(
    ground: (&TriMesh, &Adjacency),
    maps: &Maps,
    laplacian: &SparseCholesky,
    charts: &Charts,
    starts: &[Vec<f64>],
    observer: &dyn Observer,
) -> Result<Mapped, Cancelled> {
    let mut best: Option<Mapped> = None;
    for (softness, start) in SOFTNESS.into_iter().flat_map(|s| starts.iter().map(move |start| (s, start))) {
        let mut free = start.clone();
        untangle::untangle(maps, laplacian, &mut free, softness, observer)?;
        let mapped = certified(ground, maps, charts, free);
        let done = mapped.is_injective();
        if best.as_ref().is_none_or(|b| mapped.faults() < b.faults()) {
            best = Some(mapped);
        }
        if done || maps.is_spent() {
            break;
        }
    }
    best.ok_or(Cancelled)
}

/// The smoothest integer map with the integers of `whole` (corners of patches, lines and translations), which has the jumps
/// of `charts`; else the triangles that do not allow it.
/// * `from` - an injective seamless map of the same charts
/// # Errors
/// `Cancelled`.
pub(super) fn smooth_integers(
    mesh: &TriMesh,
    adjacency: &Adjacency,
    lines: &[bool],
    charts: &Charts,
    (from, whole): (&[[DVec2; 3]], &[[DVec2; 3]]),
    observer: &dyn Observer,
) -> Result<Result<Mapped, Vec<u32>>, Cancelled> {
    let area = |uv: &[[DVec2; 3]]| uv.iter().map(|[a, b, c]| (*b - *a).perp_dot(*c - *a) / 2.0).sum::<f64>();
    let growth = (area(whole) / area(from)).sqrt();
    let from: Vec<[DVec2; 3]> = from.iter().map(|corners| corners.map(|c| growth * c)).collect();
    let [from, whole] = [&from, whole].map(|uv| joined(mesh, adjacency, charts, uv));
    let seams = |held| Seams::new(mesh, adjacency, lines, charts, held);
    let (Some(start), Some(seams)) = (seams(Held::At(&from)), seams(Held::Whole(&whole))) else {
        return Ok(Err(Vec::new()));
    };
    let world: f64 = (0..mesh.triangles.len()).map(|f| mesh.area(f)).sum();
    let scale = (area(&whole) / world).sqrt();
    let maps = Maps::new(mesh, charts, &seams, scale, false);
    let (Some(laplacian), Some(free)) = (maps.laplacian(), start.read(&from)) else {
        return Ok(Err(Vec::new()));
    };
    let mut free = match carry::carry(&maps, (&start, free), observer)? {
        Carried::There(free) => free,
        Carried::Stuck(faces) => {
            // The thinned mesh has been stretched to these numbers already; what that turns over may be untangled.
            let Some(start) = seams.read(&whole) else { return Ok(Err(faces)) };
            let maps = Maps::new(mesh, charts, &seams, scale, true);
            let best = untangled((mesh, adjacency), &maps, &laplacian, charts, &[start], observer)?;
            return Ok(if best.is_injective() { Ok(best) } else { Err(faces) });
        }
    };
    untangle::untangle(&maps, &laplacian, &mut free, 0.0, observer)?;
    // Whole numbers make cells oblong: a map that holds on to squares would shear them.
    for _ in 0..STRETCHES {
        let stretch = maps.stretches(&seams.coordinates(&free));
        let stretched = Maps::new(mesh, charts, &seams, scale, false).stretched(&stretch);
        untangle::untangle(&stretched, &laplacian, &mut free, 0.0, observer)?;
    }
    Ok(Ok(certified((mesh, adjacency), &maps, charts, free)))
}

/// The same map with the charts that are not cut apart put next to each other, and one corner of each component at an
/// integer place.
fn joined(mesh: &TriMesh, adjacency: &Adjacency, charts: &Charts, uv: &[[DVec2; 3]]) -> Vec<[DVec2; 3]> {
    let mut moved: Vec<Option<DVec2>> = vec![None; uv.len()];
    let at = |h: u32| uv[h as usize / 3][h as usize % 3];
    let corner = charts.corners();
    for root in 0..uv.len() {
        if moved[root].is_some() {
            continue;
        }
        moved[root] = Some(-at(3 * root as u32));
        let mut faces = vec![root as u32];
        let mut i = 0;
        while i < faces.len() {
            let f = faces[i];
            i += 1;
            for h in 3 * f..3 * f + 3 {
                let o = adjacency.opposite[h as usize];
                if o != NONE && !charts.cut[h as usize] && moved[o as usize / 3].is_none() {
                    moved[o as usize / 3] = moved[f as usize].map(|m| m + at(h) - at(next(o)));
                    faces.push(o / 3);
                }
            }
        }
        let anchor = faces.iter().flat_map(|&f| 3 * f..3 * f + 3).find(|&h| corner[mesh.origin(h) as usize]);
        if let Some(h) = anchor {
            let place = at(h) + moved[h as usize / 3].unwrap_or_default();
            faces.iter().for_each(|&f| moved[f as usize] = moved[f as usize].map(|m| m - (place - place.round())));
        }
    }
    uv.iter().zip(moved).map(|(corners, m)| corners.map(|c| c + m.unwrap_or_default())).collect()
}

/// The map on a lattice of binary fractions, so that its equations hold without rounding, and its flipped faces by exact
/// arithmetic.
fn certified((mesh, adjacency): (&TriMesh, &Adjacency), maps: &Maps, charts: &Charts, mut free: Vec<f64>) -> Mapped {
    let size = maps.seams.coordinates(&free).iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let step = 2f64.powi(size.max(f64::MIN_POSITIVE).log2().ceil() as i32 - LATTICE_BITS);
    free.iter_mut().for_each(|v| *v = (*v / step).round() * step);
    let uv = maps.seams.corners(&free);
    let flipped = (0..uv.len() as u32).filter(|&f| {
        let [a, b, c] = uv[f as usize];
        orient2d(a, b, c) <= 0.0
    });
    let flipped = flipped.collect();
    let deviation_deg = maps.deviation_deg(&maps.seams.coordinates(&free));
    let angle = |h: u32| {
        let (f, k) = (h as usize / 3, h as usize % 3);
        (uv[f][(k + 1) % 3] - uv[f][k]).angle_to(uv[f][(k + 2) % 3] - uv[f][k])
    };
    let winds = |v: &u32| {
        let whole = if adjacency.is_boundary_vertex(*v) { 2 } else { 4 };
        let quarters = (adjacency.fan(*v).map(angle).sum::<f64>() / FRAC_PI_2).round() as i32;
        adjacency.outgoing[*v as usize] != NONE && whole - quarters != charts.index[*v as usize]
    };
    let wound = (0..mesh.points.len() as u32).filter(winds).collect();
    Mapped { map: SeamlessMap { uv, jump: charts.jump.clone() }, flipped, wound, deviation_deg, free }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::field::{FieldParams, field};
    use crate::observe::Silent;
    use crate::synthetic::shapes;
    use glam::{DMat2, DQuat, DVec3};

    const PARAMS: FieldParams = FieldParams { curvature: 1.0, smoothing: 1.0, radius: 0.1, pair_distance: 1.0 };

    fn charts(mesh: &TriMesh, lines: &[bool]) -> Charts {
        let adjacency = Adjacency::new(mesh);
        let field = field(mesh, &adjacency, lines, &PARAMS, &Silent).unwrap();
        Charts::new(mesh, &adjacency, lines, &field, ConeCare::default())
    }

    fn mapped(mesh: &TriMesh, lines: &[bool]) -> (Charts, Mapped) {
        let charts = charts(mesh, lines);
        let mapped = seamless(mesh, &Adjacency::new(mesh), lines, &charts, &Silent).unwrap().unwrap();
        (charts, mapped)
    }

    fn sharp(mesh: &TriMesh) -> Vec<bool> {
        crate::mesh::sharp_edges(mesh, &Adjacency::new(mesh), 40.0)
    }

    /// Euler number of a mesh without loose vertices.
    fn euler(mesh: &TriMesh) -> i32 {
        let adjacency = Adjacency::new(mesh);
        let edges = (0..adjacency.opposite.len()).filter(|&h| adjacency.opposite[h] > h as u32).count();
        mesh.points.len() as i32 - edges as i32 + mesh.triangles.len() as i32
    }

    #[test]
    fn indices_sum_to_four_times_the_euler_number_with_and_without_boundaries() {
        for (mesh, number) in [
            (shapes::sphere(1.0, 3), 2),
            (shapes::torus(1.0, 0.4, 40, 20), 0),
            (shapes::double_torus(24), -2),
            (shapes::cuboid(DVec3::new(1.0, 2.0, 3.0), 6), 2),
            (shapes::rectangle(3.0, 2.0, 9, 6), 1),
            (shapes::annulus(0.5, 1.0, 40), 0),
        ] {
            assert_eq!(euler(&mesh), number);
            assert_eq!(charts(&mesh, &sharp(&mesh)).index.iter().sum::<i32>(), 4 * number);
        }
    }

    #[test]
    fn a_box_has_8_cones_at_its_corners_and_a_map_without_any_distortion() {
        let mesh = shapes::cuboid(DVec3::new(1.0, 2.0, 3.0), 6);
        let (charts, mapped) = mapped(&mesh, &sharp(&mesh));
        let corners = charts.corners();
        for (v, p) in mesh.points.iter().enumerate() {
            let is_corner = (p.abs() - DVec3::new(0.5, 1.0, 1.5)).abs().max_element() < 1e-9;
            assert_eq!(corners[v], is_corner, "{p}");
        }
        assert!(mapped.flipped.is_empty() && mapped.deviation_deg < 1e-6);
        for (f, [a, b, c]) in mapped.map.uv.iter().enumerate() {
            assert!(((b - a).perp_dot(c - a) / 2.0 - mesh.area(f)).abs() < 1e-9);
        }
    }

    #[test]
    fn seams_hold_to_the_last_bit_and_no_face_is_flipped() {
        for mesh in [
            shapes::sphere(1.0, 3),
            shapes::torus(1.0, 0.4, 40, 20),
            shapes::double_torus(24),
            shapes::cylinder(0.5, 1.0, 48),
            shapes::annulus(0.5, 1.0, 40),
        ] {
            let adjacency = Adjacency::new(&mesh);
            let (_, Mapped { map, flipped, wound, .. }) = mapped(&mesh, &sharp(&mesh));
            assert!(flipped.is_empty(), "{} of {}", flipped.len(), mesh.triangles.len());
            assert!(wound.is_empty(), "{wound:?}");
            let edge = |h: u32| {
                let k = h as usize % 3;
                map.uv[h as usize / 3][(k + 1) % 3] - map.uv[h as usize / 3][k]
            };
            for h in 0..adjacency.opposite.len() as u32 {
                let o = adjacency.opposite[h as usize];
                if o == NONE {
                    assert!(edge(h).x == 0.0 || edge(h).y == 0.0, "boundaries run along an axis");
                } else {
                    assert_eq!(quarter_turn(edge(h), map.jump[h as usize]), -edge(o));
                }
            }
        }
    }

    #[test]
    fn a_ball_has_eight_cones_of_three_patches_wherever_it_is_turned_to() {
        let ball = shapes::sphere(1.0, 4);
        for turn in [DQuat::IDENTITY, DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 1.1, -0.7)] {
            let points = ball.points.iter().map(|&p| turn * p * 3.0 + DVec3::splat(5.0)).collect();
            let index =
                charts(&TriMesh::new(points, ball.triangles.clone()), &vec![false; 3 * ball.triangles.len()]).index;
            assert_eq!((index.iter().filter(|i| **i == 1).count(), index.iter().filter(|i| **i != 0).count()), (8, 8));
        }
    }

    #[test]
    fn a_wedge_of_15_degrees_keeps_a_quarter_turn_between_its_faces() {
        // A prism over a triangle with a corner of 15 degrees: without the opening the ends of the wedge have no angle.
        let (sin, cos) = 15f64.to_radians().sin_cos();
        let mesh = prism(&[[0.0, 0.0], [2.0, 0.0], [2.0 * cos, 2.0 * sin]], 1.0, 5);
        let (charts, mapped) = mapped(&mesh, &sharp(&mesh));
        assert!(charts.sectors.iter().all(|s| s.1 >= 1));
        assert!(mapped.flipped.is_empty(), "{}", mapped.flipped.len());
    }

    #[test]
    fn a_map_stretched_as_the_field_asks_winds_around_a_cone_of_five_patches_once() {
        // A regular pentagon: five corners of a quarter turn each leave one cone of five patches in its middle.
        let corners: Vec<[f64; 2]> =
            (0..5).map(|i| (1.256_637 * f64::from(i)).sin_cos()).map(|(s, c)| [c, s]).collect();
        let mesh = prism(&corners, 1.0, 3);
        let lines = sharp(&mesh);
        let (adjacency, charts) = (Adjacency::new(&mesh), charts(&mesh, &lines));
        let five: Vec<u32> = (0..charts.index.len() as u32).filter(|&v| charts.index[v as usize] < 0).collect();
        assert_eq!(five.len(), 2);
        let seams = Seams::new(&mesh, &adjacency, &lines, &charts, Held::Origin).unwrap();
        let maps = Maps::new(&mesh, &charts, &seams, 1.0, true);
        let mapped = certified((&mesh, &adjacency), &maps, &charts, maps.follow(&charts.scale).unwrap());
        assert!(five.iter().all(|v| !mapped.wound.contains(v)), "{:?}", mapped.wound);
    }

    #[test]
    fn a_rim_that_runs_in_steps_is_mapped_without_running_back() {
        // A stair of seven steps, seen from the side: a rim with a corner at each end of each.
        let steps = 7;
        let cells: Vec<[i32; 2]> = (0..steps).flat_map(|i| (0..=i).map(move |j| [i, j])).collect();
        let mut mesh = polycube::flat(&cells, 3).mesh;
        // Leaning over, the corners are no right angles.
        mesh.points.iter_mut().for_each(|p| *p = DVec3::new(p.x + 0.3 * p.y, p.y + 0.3 * p.x, 0.0));
        let (_, mapped) = mapped(&mesh, &vec![false; 3 * mesh.triangles.len()]);
        assert!(mapped.is_injective(), "{} faults", mapped.faults());
    }

    #[test]
    fn an_injective_map_is_carried_to_whole_numbers_without_a_fault() {
        let mesh = shapes::cuboid(DVec3::new(1.0, 2.0, 3.0), 6);
        let lines = sharp(&mesh);
        let (charts, mapped) = mapped(&mesh, &lines);
        // The box of 1 x 2 x 3 is stretched to one of 2 x 2 x 3.
        let adjacency = Adjacency::new(&mesh);
        let whole: Vec<[DVec2; 3]> = (0..mesh.triangles.len())
            .map(|f| {
                let [a, b, c] = mesh.corners(f);
                let uv = mapped.map.uv[f];
                // Which axis of the chart runs along x of the box, if any does.
                let by_uv = DMat2::from_cols(uv[1] - uv[0], uv[2] - uv[0]).inverse();
                let by = |d: DVec2| ((b - a) * d.x + (c - a) * d.y).x.abs();
                let scale = DVec2::new(1.0 + by(by_uv.x_axis).round(), 1.0 + by(by_uv.y_axis).round());
                uv.map(|p| p * scale)
            })
            .collect();
        let carried = smooth_integers(&mesh, &adjacency, &lines, &charts, (&mapped.map.uv, &whole), &Silent);
        let carried = carried.unwrap().unwrap();
        assert!(carried.is_injective());
        for (corners, wanted) in carried.map.uv.iter().zip(&whole) {
            for k in 0..3 {
                let off = (corners[(k + 1) % 3] - corners[k]) - (wanted[(k + 1) % 3] - wanted[k]);
                assert!(off.length() < 1e-6, "{off}");
            }
        }
    }

    #[test]
    fn what_is_free_follows_what_is_held_with_a_gradient_left_that_falls_as_the_square_of_the_step() {
        let mesh = shapes::sphere(1.0, 3);
        let (adjacency, lines) = (Adjacency::new(&mesh), vec![false; 3 * mesh.triangles.len()]);
        let (charts, mapped) = mapped(&mesh, &lines);
        let uv = joined(&mesh, &adjacency, &charts, &mapped.map.uv);
        let held_at = |times: f64| {
            let uv: Vec<[DVec2; 3]> = uv.iter().map(|corners| corners.map(|c| times * c)).collect();
            Seams::new(&mesh, &adjacency, &lines, &charts, Held::At(&uv)).unwrap()
        };
        let seams = held_at(1.0);
        // Faces of four times the area have a convex energy.
        let maps = Maps::new(&mesh, &charts, &seams, 0.5, false);
        let newton = newton::Newton::new(&maps, &Silent).unwrap().unwrap();
        let hessian = |free: &[f64]| newton.at(&seams.coordinates(free), &Silent).unwrap().unwrap();
        let left = |seams: &Seams, free: &[f64]| {
            let gradient = maps.barrier(&seams.coordinates(free), 0.0).1;
            gradient.iter().map(|g| g * g).sum::<f64>().sqrt()
        };
        let mut free = seams.read(&uv).unwrap();
        for _ in 0..12 {
            let step = hessian(&free).step(&maps.barrier(&seams.coordinates(&free), 0.0).1);
            free.iter_mut().zip(&step).for_each(|(x, s)| *x += s);
        }
        assert!(left(&seams, &free) < 1e-12, "{}", left(&seams, &free));
        let after = |by: f64| {
            let to = held_at(1.0 + by);
            let follow = hessian(&free).following(&seams.moved(&to));
            left(&to, &free.iter().zip(&follow).map(|(x, s)| x + s).collect::<Vec<_>>())
        };
        let fall = after(1e-2) / after(5e-3);
        assert!((3.5..4.5).contains(&fall), "{fall}");
    }

    /// A prism over a convex polygon around its middle, each triangle and wall split `level` times.
    fn prism(polygon: &[[f64; 2]], height: f64, level: usize) -> TriMesh {
        let n = polygon.len() as u32;
        let at = |p: &[f64; 2], z: f64| DVec3::new(p[0], p[1], z);
        let mut points: Vec<DVec3> = polygon.iter().map(|p| at(p, 0.0)).collect();
        points.extend(polygon.iter().map(|p| at(p, height)));
        let mut triangles = Vec::new();
        let middle: DVec3 = points.iter().sum::<DVec3>() / f64::from(2 * n);
        points.extend([DVec3::new(middle.x, middle.y, 0.0), DVec3::new(middle.x, middle.y, height)]);
        for i in 0..n {
            let j = (i + 1) % n;
            triangles.extend([[2 * n, j, i], [2 * n + 1, n + i, n + j]]);
        }
        for i in 0..n {
            let j = (i + 1) % n;
            triangles.extend([[i, j, n + j], [i, n + j, n + i]]);
        }
        let mut mesh = TriMesh::new(points, triangles);
        for _ in 0..level {
            mesh = split(&mesh);
        }
        mesh
    }

    /// Every triangle in four.
    fn split(mesh: &TriMesh) -> TriMesh {
        let mut points = mesh.points.clone();
        let mut middle = std::collections::HashMap::new();
        let mut triangles = Vec::new();
        for &[a, b, c] in &mesh.triangles {
            let [ab, bc, ca] = [[a, b], [b, c], [c, a]].map(|[a, b]| {
                *middle.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                    points.push(points[a as usize].midpoint(points[b as usize]));
                    points.len() as u32 - 1
                })
            });
            triangles.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        TriMesh::new(points, triangles)
    }
}
