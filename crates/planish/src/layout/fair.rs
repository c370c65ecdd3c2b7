//! Fair arcs: each smooth arc becomes the curve near it that bends least, and leaves its nodes at even angles.
//!
//! A line that is straight in the map of two cells follows the form, but is jagged where triangles are poor, and near its
//! nodes it goes by the map of single triangles. So it is smoothed in space: of places `y` at even steps along the arc, drawn
//! at `x`, those are taken that minimise `sum |y - x|² + lambda sum |D y|²`, with `D` the second difference. The ends stay, and
//! their `D` is taken against directions that part the sectors around the node evenly. The curve is brought back to the
//! closest places of the two cells beside the arc, so that arcs do not cross; an arc whose curve leaves them
//! stays. See `docs/methods/layout.md`, step 8.

use super::complex::{Arc, Complex};
use super::improve::{LEAST_SETTLING, arc_change};
use super::recut::{Bench, Change};
use crate::geom::{Bvh, Triangles, polyline};
use crate::linalg::{Banded, BandedCholesky};
use crate::mesh::NONE;
use crate::mesh::disjoint::disjoint;
use crate::network::imprint::{self, Place};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Steps of a curve: eight for each quarter of its length, the shortest bend that keeps some of its height.
const CURVE_STEPS: usize = 32;

/// Steps from a node to the place that tells the direction of an arc: half of such a bend.
const DIRECTION_STEPS: usize = 4;

/// How far an arc may be turned at its node, radians; chosen: a little more than half of a right angle.
const GREATEST_TURN: f64 = 0.9;

/// Places at even steps along a curve, ends included.
type Samples = Vec<DVec3>;

/// Makes every smooth arc fair, but for those that cannot be drawn so or would make the cells beside them worse.
pub(super) fn fair(bench: &mut Bench) {
    let curves = curves(bench);
    let mut waiting: Vec<u32> = bench.complex.live_arcs().collect();
    while !waiting.is_empty() {
        let planned = waiting.iter().filter_map(|&a| Some((a, arc_change(&bench.complex, a)?)));
        let (now, later) = disjoint(planned, |(_, change)| change.cells.clone(), Some);
        let draw = |(a, change): &(u32, Change)| Some((*a, draw(bench, change, curves[*a as usize].as_ref()?)?));
        let drawn: Vec<(u32, Vec<Place>)> = now.par_iter().filter_map(draw).collect();
        let mut back: Vec<(u32, Vec<Place>)> =
            drawn.iter().map(|(a, _)| (*a, bench.complex.arc(2 * a).chain.clone())).collect();
        let before = costs(bench);
        bench.commit(drawn, put);
        let now = costs(bench);
        let rise = |a: u32| -> f64 {
            bench.complex.arc(2 * a).cells.iter().map(|&c| now[c as usize] - before[c as usize]).sum()
        };
        back.retain(|(a, _)| rise(*a) > LEAST_SETTLING);
        bench.commit(back, put);
        waiting = later.into_iter().map(|x| x.0).collect();
    }
}

/// Puts the chain of an arc into the complex; returns the arc.
fn put(complex: &mut Complex, (a, chain): &(u32, Vec<Place>)) -> Vec<u32> {
    complex.arcs[*a as usize].as_mut().expect("a live arc").chain.clone_from(chain);
    vec![*a]
}

/// What each cell costs.
fn costs(bench: &Bench) -> Vec<f64> {
    let shapes = bench.shapes();
    let areas = shapes.iter().flatten().map(|s| s.area);
    let mean = areas.sum::<f64>() / bench.complex.live_cells().count().max(1) as f64;
    shapes.iter().map(|s| s.as_ref().map_or(0.0, |s| s.cost(mean))).collect()
}

/// The curve that each smooth arc should be.
fn curves(bench: &Bench) -> Vec<Option<Samples>> {
    let complex = &bench.complex;
    let is_smooth = |a: usize| complex.arcs[a].as_ref().is_some_and(|arc| arc.kind.is_smooth());
    let sampled = |arc: &Arc| {
        let points: Vec<DVec3> = arc.chain.iter().map(|p| p.position(bench.mesh)).collect();
        sampled(&points)
    };
    let drawn: Vec<Option<Samples>> = complex.arcs.iter().map(|arc| arc.as_ref().map(sampled)).collect();
    let free = |(a, x): (usize, &Option<Samples>)| match x {
        Some(x) if is_smooth(a) => smoothed(x, [None, None]),
        x => x.clone(),
    };
    let free: Vec<Option<Samples>> = drawn.par_iter().enumerate().map(free).collect();
    let mut leaves: Vec<Option<DVec3>> = vec![None; 2 * drawn.len()];
    for star in complex.stars() {
        for (h, direction) in directions(complex, &star, |h| outward(free[h as usize / 2].as_ref()?, h)) {
            leaves[h as usize] = Some(direction);
        }
    }
    let fair = |(a, x): (usize, &Option<Samples>)| {
        let x = x.as_ref().filter(|_| is_smooth(a))?;
        smoothed(x, [leaves[2 * a], leaves[2 * a + 1]])
    };
    drawn.par_iter().enumerate().map(fair).collect()
}

/// Places at even steps along a polyline of two points or more.
fn sampled(points: &[DVec3]) -> Samples {
    let mut along = polyline::Along::new(points.iter().copied());
    let length = along.length();
    let place = |k: usize| {
        let (i, t) = along.advance(length * k as f64 / CURVE_STEPS as f64);
        points[i].lerp(points[i + 1], t)
    };
    (0..=CURVE_STEPS).map(place).collect()
}

/// The vector from the start of a half-arc to a place on it; `None` if it has no length.
fn outward(samples: &Samples, half: u32) -> Option<DVec3> {
    let [from, to] = match half % 2 {
        0 => [0, DIRECTION_STEPS],
        _ => [CURVE_STEPS, CURVE_STEPS - DIRECTION_STEPS],
    };
    let vector = samples[to] - samples[from];
    (vector.length() > 0.0).then_some(vector)
}

/// The curve near `x` that bends least: of a wave half as long as the curve half of the height is left.
/// * `leaves` - unit vectors in which it is to leave its ends
fn smoothed(x: &Samples, leaves: [Option<DVec3>; 2]) -> Option<Samples> {
    let n = x.len() - 1;
    let step = polyline::length(x.iter().copied()) / n as f64;
    // The second difference of a wave of n/2 steps is so many times the wave.
    let lambda = (2.0 * (TAU / n as f64).sin()).powi(-4);
    let mut matrix = Banded::zero(n - 1, 2);
    let mut rhs: Vec<DVec3> = x[1..n].to_vec();
    (0..n - 1).for_each(|i| matrix.add(i, i, 1.0));
    // Adds weight |sum of parts - given|² to what is minimised.
    let mut add = |weight: f64, parts: &[(usize, f64)], given: DVec3| {
        let is_end = |i: usize| i == 0 || i == n;
        let fixed = parts.iter().filter(|p| is_end(p.0)).map(|&(i, part)| x[i] * part).sum::<DVec3>() - given;
        for &(i, part) in parts.iter().filter(|p| !is_end(p.0)) {
            rhs[i - 1] -= fixed * (weight * part);
            for &(j, other) in parts.iter().filter(|p| !is_end(p.0) && p.0 <= i) {
                matrix.add(i - 1, j - 1, weight * part * other);
            }
        }
    };
    for i in 1..n {
        add(lambda, &[(i - 1, 1.0), (i, -2.0), (i + 1, 1.0)], DVec3::ZERO);
    }
    for (end, inner, leaves) in [(0, 1, leaves[0]), (n, n - 1, leaves[1])] {
        if let Some(direction) = leaves {
            // With a place on the other side of the end, which the direction tells, its second difference is twice this;
            // half of its square belongs to the curve.
            add(2.0 * lambda, &[(inner, 1.0), (end, -1.0)], direction * step);
        }
    }
    BandedCholesky::factor(matrix)?.solve(&mut rhs);
    Some([x[0]].into_iter().chain(rhs).chain([x[n]]).collect())
}

/// Unit vectors in which the smooth half-arcs of a star should leave its node: they part the sectors between lines, or the whole
/// angle where there is none, evenly. Sectors whose half-arcs are out of order are left out.
/// * `star` - as [`Complex::star`]
/// * `outward` - the vector in which a half-arc goes
fn directions(complex: &Complex, star: &[u32], outward: impl Fn(u32) -> Option<DVec3>) -> Vec<(u32, DVec3)> {
    let n = star.len();
    let Some(ways) = star.iter().map(|&h| outward(h)).collect::<Option<Vec<DVec3>>>() else { return Vec::new() };
    let fixed: Vec<usize> = (0..n).filter(|&i| !complex.arc(star[i]).kind.is_smooth()).collect();
    let Some(&first) = fixed.first() else {
        let around: Vec<DVec3> = ways.iter().chain(ways.first()).copied().collect();
        return even(&around, true).map_or_else(Vec::new, |even| star.iter().copied().zip(even).collect());
    };
    let mut found = Vec::new();
    for (k, &from) in fixed.iter().enumerate() {
        let to = fixed.get(k + 1).map_or(first + n, |&to| to);
        // Beyond the last half-arc of a boundary there is no surface.
        if complex.cell(star[from]) == NONE {
            continue;
        }
        let sector: Vec<DVec3> = (from..=to).map(|i| ways[i % n]).collect();
        let inner = (from + 1..to).map(|i| star[i % n]);
        found.extend(inner.zip(even(&sector, false).into_iter().flatten().skip(1)));
    }
    found
}

/// Vectors of a sector, counter-clockwise from border to border, turned in its plane so that they part it evenly, as far as
/// that turns none too far; all but the last, of unit length. `None` if they are not in order.
/// * `is_closed` - the last vector is the first again, so that there are no borders
fn even(vectors: &[DVec3], is_closed: bool) -> Option<Vec<DVec3>> {
    let unit: Vec<DVec3> = vectors.iter().map(|v| v.normalize_or_zero()).collect();
    let normal = unit.windows(2).map(|v| v[0].cross(v[1])).sum::<DVec3>().try_normalize()?;
    let flat: Vec<DVec3> =
        unit.iter().map(|&v| v.reject_from_normalized(normal).try_normalize()).collect::<Option<_>>()?;
    let angle = |v: &[DVec3]| normal.dot(v[0].cross(v[1])).atan2(v[0].dot(v[1])).rem_euclid(TAU);
    let gaps: Vec<f64> = flat.windows(2).map(angle).collect();
    let total: f64 = gaps.iter().sum();
    if total > TAU * (1.0 + f64::EPSILON.sqrt()) {
        return None;
    }
    // The even angle of each less its own, from the first on.
    let mut at = 0.0;
    let mut off = Vec::with_capacity(gaps.len());
    for (k, gap) in gaps.iter().enumerate() {
        off.push(total * k as f64 / gaps.len() as f64 - at);
        at += gap;
    }
    let mean = if is_closed { off.iter().sum::<f64>() / off.len() as f64 } else { 0.0 };
    let most = off.iter().map(|x| (x - mean).abs()).fold(0.0, f64::max);
    // All by the same part, so that their order stays.
    let share = (GREATEST_TURN / most.max(f64::MIN_POSITIVE)).min(1.0);
    let turned = |(v, x): (&DVec3, f64)| {
        let (sin, cos) = ((x - mean) * share).sin_cos();
        *v * cos + normal.cross(*v) * sin
    };
    Some(flat.iter().zip(off).map(turned).collect())
}

/// The places of an arc along a curve, brought to the two cells beside it; `None` if that cannot be drawn.
fn draw(bench: &Bench, change: &Change, curve: &Samples) -> Option<Vec<Place>> {
    let embedding = &bench.embedding;
    let union = embedding.map(&bench.complex, change)?;
    let (disk, uv) = (&union.disk, &union.uv);
    let points: Vec<DVec3> = disk.vertices.iter().map(|&v| embedding.cut.mesh.points[v as usize]).collect();
    let tree = Bvh::new(Triangles { points: &points, triangles: &disk.triangles });
    let in_map = |&p: &DVec3| -> Option<DVec2> {
        let place = tree.closest(p).place;
        // A curve that leaves both cells would touch what bounds them, and pinch one.
        if imprint::place_of(&disk.adjacency, &disk.triangles, &place).is_on_boundary(&disk.adjacency) {
            return None;
        }
        let corners = disk.triangles[place.face as usize].map(|v| uv[v as usize]);
        Some(corners.into_iter().zip(place.bary).map(|(corner, weight)| corner * weight).sum())
    };
    let via: Vec<DVec2> = curve[1..curve.len() - 1].iter().map(in_map).collect::<Option<_>>()?;
    let &(from, to) = change.lines.first()?;
    let ends = [from, to].map(|i| disk.boundary[union.corners[i]]);
    embedding.polyline((bench.mesh, bench.adjacency), (disk, uv), ends, &via)
}

#[cfg(test)]
mod tests {
    use super::super::map::polycube;
    use super::super::partition::{Ground, outline};
    use super::*;
    use crate::mesh::Adjacency;
    use std::f64::consts::PI;

    /// What is drawn of the fair curve of a strip along the inner walls of an L, so many squares of 1/32 wide.
    fn drawn_around_an_inner_corner(width: i32) -> Option<Vec<Place>> {
        let fine = 32;
        let mesh = polycube::flat(&[[0, 0], [1, 0], [0, 1]], fine).mesh;
        let adjacency = Adjacency::new(&mesh);
        let inner = 1.0 - f64::from(width) / f64::from(fine);
        let middle = |f: usize| mesh.corners(f).into_iter().sum::<DVec3>() / 3.0;
        let is_strip = |f: usize| middle(f).truncate().cmpgt(DVec2::splat(inner)).all();
        let label: Vec<u32> = (0..mesh.triangles.len()).map(|f| u32::from(is_strip(f))).collect();
        let lines = vec![false; adjacency.opposite.len()];
        let corner = vec![false; mesh.points.len()];
        let complex = outline::outline(&Ground::new(&mesh, &adjacency, &lines), &label, 2, &corner);
        let bench = Bench::new(&mesh, &adjacency, complex).expect("two cells");
        let arc = bench.complex.live_arcs().find(|&a| bench.complex.arc(2 * a).kind.is_smooth()).expect("the curve");
        let change = arc_change(&bench.complex, arc).expect("two cells beside it");
        draw(&bench, &change, curves(&bench)[arc as usize].as_ref().expect("a fair curve"))
    }

    #[test]
    fn a_fair_curve_is_drawn_where_it_stays_within_its_cells_and_not_where_it_cuts_an_inner_corner() {
        assert!(drawn_around_an_inner_corner(16).is_some());
        assert_eq!(drawn_around_an_inner_corner(1), None);
    }

    fn sampled_from(place: impl Fn(f64) -> DVec3) -> Samples {
        (0..=CURVE_STEPS).map(|k| place(k as f64 / CURVE_STEPS as f64)).collect()
    }

    #[test]
    fn a_straight_curve_stays_within_1e_12_and_so_does_one_that_is_to_leave_its_ends_along_itself() {
        let x = sampled_from(|t| DVec3::new(3.0 * t, 4.0 * t, 1.0));
        let along = DVec3::new(0.6, 0.8, 0.0);
        for leaves in [[None, None], [Some(along), Some(-along)]] {
            let y = smoothed(&x, leaves).expect("a curve");
            let off = x.iter().zip(&y).map(|(x, y)| x.distance(*y)).fold(0.0, f64::max);
            assert!(off < 1e-12, "{off}");
        }
    }

    #[test]
    fn of_a_wave_half_as_long_as_the_curve_half_is_left_and_of_one_an_eighth_as_long_less_than_a_hundredth() {
        // Sines with nodes at both ends are the free vibrations, so each keeps its shape.
        for (waves, least, most) in [(2.0, 0.499_999, 0.500_001), (8.0, 0.0, 0.01)] {
            let x = sampled_from(|t| DVec3::new(0.0, (waves * TAU * t).sin(), 0.0));
            let y = smoothed(&x, [None, None]).expect("a curve");
            let height = |s: &Samples| s.iter().map(|p| p.y.abs()).fold(0.0, f64::max);
            let left = height(&y) / height(&x);
            assert!(left >= least && left <= most, "{waves} waves: {left}");
        }
    }

    #[test]
    fn a_curve_that_is_to_leave_its_end_at_30_degrees_does_so_by_more_than_half() {
        let x = sampled_from(|t| DVec3::new(t, 0.0, 0.0));
        let (sin, cos) = (PI / 6.0).sin_cos();
        let y = smoothed(&x, [Some(DVec3::new(cos, sin, 0.0)), None]).expect("a curve");
        let angle = (y[1] - y[0]).y.atan2((y[1] - y[0]).x).to_degrees();
        assert!(angle > 15.0 && angle < 30.0, "{angle}");
        assert_eq!((y[0], y[CURVE_STEPS]), (x[0], x[CURVE_STEPS]));
    }

    /// Vectors at angles in a tilted plane, and their angles after evening, in degrees.
    fn evened(angles: &[f64], is_closed: bool) -> Option<Vec<f64>> {
        let (e, f) = (DVec3::new(0.0, 0.6, 0.8), DVec3::new(1.0, 0.0, 0.0));
        let vector = |a: &f64| e * a.to_radians().cos() + f * a.to_radians().sin();
        let even = even(&angles.iter().map(vector).collect::<Vec<_>>(), is_closed)?;
        Some(even.iter().map(|v| v.dot(f).atan2(v.dot(e)).to_degrees().rem_euclid(360.0)).collect())
    }

    #[test]
    fn vectors_at_20_and_160_degrees_turn_towards_even_sectors_and_keep_their_order() {
        let turned = evened(&[0.0, 20.0, 180.0, 200.0, 0.0], true).expect("in order");
        for k in 0..4 {
            let gap = (turned[(k + 1) % 4] - turned[k]).rem_euclid(360.0);
            assert!((gap - 90.0).abs() < 1e-9, "sector {k}: {turned:?}");
        }
        assert_eq!(evened(&[0.0, 100.0, 50.0, 200.0, 0.0], true), None);
    }

    #[test]
    fn between_borders_at_30_and_150_degrees_vectors_at_40_and_80_come_to_70_and_110() {
        let turned = evened(&[30.0, 40.0, 80.0, 150.0], false).expect("in order");
        for (found, want) in turned.iter().zip([30.0, 70.0, 110.0]) {
            assert!((found - want).abs() < 1e-9, "{turned:?}");
        }
    }
}
