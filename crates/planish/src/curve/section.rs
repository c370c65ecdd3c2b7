//! Curves that nobody paints: cuts by a plane, projections ([K98] §3.3.1 attracts a space curve), boundaries and sharp lines.

use super::chain::{SurfaceCurve, without_repeats};
use super::{CurveError, attract::sample_polyline};
use crate::geom::Bvh;
use crate::geom::polyline;
use crate::geom::tolerance::AT_VERTEX;
use crate::mesh::{Adjacency, FacePoint, NONE, TriMesh, boundary_loops, next, path, previous};
use glam::DVec3;

/// The cut of the surface by a plane through `point` with `normal`, followed from the face `start` (which the plane
/// must meet or touch) both ways until it closes or ends at a boundary. Looks at the faces along the cut only; neighbours of
/// the curve share a face.
/// # Errors
/// `NothingMet` if the plane misses the face.
pub fn cut_plane(
    mesh: &TriMesh,
    adjacency: &Adjacency,
    point: DVec3,
    normal: DVec3,
    start: u32,
) -> Result<SurfaceCurve, CurveError> {
    let faces = mesh.triangles.len();
    if start as usize >= faces {
        return Err(CurveError::NoSuchFace { face: start, faces });
    }
    let unit = normal.normalize_or_zero();
    // A vertex on the plane counts as above: every face then has no crossed edge or two.
    let height = |v: u32| (mesh.points[v as usize] - point).dot(unit);
    let above = |v: u32| height(v) >= 0.0;
    let crossed = |h: u32| above(mesh.origin(h)) != above(mesh.origin(next(h)));
    let place = |h: u32| {
        let (a, b) = (mesh.origin(h), mesh.origin(next(h)));
        // The same bits from both sides of the edge.
        let (low, high) = (a.min(b), a.max(b));
        let t = match (height(low) / (height(low) - height(high))).clamp(0.0, 1.0) {
            t if t < AT_VERTEX => 0.0,
            t if t > 1.0 - AT_VERTEX => 1.0,
            t => t,
        };
        let t = if a == low { t } else { 1.0 - t };
        let mut bary = [0.0; 3];
        bary[h as usize % 3] = 1.0 - t;
        bary[next(h) as usize % 3] = t;
        FacePoint { face: h / 3, bary }
    };
    // The plane may run along an edge of the face or touch a corner: then a face beside it is crossed.
    let beside = mesh.triangles[start as usize].into_iter().flat_map(|v| adjacency.fan(v).map(|h| h / 3));
    let met = std::iter::once(start).chain(beside).find_map(|face| {
        let out: Vec<u32> = (3 * face..3 * face + 3).filter(|&h| crossed(h)).collect();
        <[u32; 2]>::try_from(out).ok()
    });
    let Some([first, second]) = met else {
        return Err(CurveError::NothingMet { place: "by the plane at the face picked" });
    };
    // From one crossed edge on to the next, until back at the start or at a boundary.
    let follow = |h: u32| {
        let (mut places, mut h) = (vec![place(h)], h);
        for _ in 0..faces {
            let g = adjacency.opposite[h as usize];
            if g == NONE {
                return (places, false);
            }
            h = if crossed(next(g)) { next(g) } else { previous(g) };
            if h == second || h == first {
                return (places, true);
            }
            places.push(place(h));
        }
        (places, false)
    };
    let (ahead, closed) = follow(first);
    let mut points = ahead;
    if closed {
        points.push(place(second));
    } else {
        points.reverse();
        points.extend(follow(second).0);
    }
    without_repeats(mesh, &mut points);
    if closed && points.len() > 1 && points[0].position(mesh) == points[points.len() - 1].position(mesh) {
        points.pop();
    }
    Ok(SurfaceCurve { points, closed })
}

/// A polyline brought onto the surface, with places about `spacing` apart (world units): along `direction` to the
/// first place met, or to the nearest place if that is zero. Neighbours share a face.
/// # Errors
/// `NothingMet` where a ray meets no surface, `TooFewPoints`, `NoWay`.
pub fn project(
    mesh: &TriMesh,
    adjacency: &Adjacency,
    bvh: &Bvh,
    polyline: &[DVec3],
    direction: DVec3,
    spacing: f64,
) -> Result<SurfaceCurve, CurveError> {
    if polyline.len() < 2 {
        return Err(CurveError::TooFewPoints { found: polyline.len(), needed: 2 });
    }
    let length = polyline::length(polyline.iter().copied());
    // Far more places than any curve has uses for.
    const MOST: f64 = 1e6;
    let count = if spacing > 0.0 { (length / spacing).ceil().clamp(1.0, MOST) as usize + 1 } else { polyline.len() };
    let unit = direction.normalize_or_zero();
    let mut places = Vec::with_capacity(count);
    for p in sample_polyline(polyline, count) {
        let place = if unit == DVec3::ZERO {
            bvh.closest(p).place
        } else {
            let hit = bvh
                .first_hit(p, unit, f64::INFINITY)
                .ok_or(CurveError::NothingMet { place: "along the direction of projection" })?;
            place_on(mesh, hit.face, p + unit * hit.distance)
        };
        places.push(place);
    }
    Ok(SurfaceCurve::open(SurfaceCurve::open(places).trace(mesh, adjacency)?))
}

/// The place of a face at a position in its plane.
fn place_on(mesh: &TriMesh, face: u32, p: DVec3) -> FacePoint {
    let [a, b, c] = mesh.corners(face as usize);
    let n = (b - a).cross(c - a);
    let weights = [(c - b).cross(p - b), (a - c).cross(p - c), (b - a).cross(p - a)].map(|w| w.dot(n).max(0.0));
    let sum: f64 = weights.iter().sum();
    if sum > 0.0 { FacePoint { face, bary: weights.map(|w| w / sum) } } else { FacePoint::corner(face, 0) }
}

/// The boundaries of the mesh as closed curves along its edges, in the order of [`boundary_loops`].
pub fn boundaries(mesh: &TriMesh, adjacency: &Adjacency) -> Vec<SurfaceCurve> {
    let corner = |&h: &u32| FacePoint::corner(h / 3, h as usize % 3);
    debug_assert_eq!(adjacency.opposite.len(), 3 * mesh.triangles.len());
    boundary_loops(adjacency)
        .iter()
        .map(|l| SurfaceCurve { points: l.iter().map(corner).collect(), closed: true })
        .collect()
}

/// The marked half-edges as curves along edges: from junction or end to the next, and closed ones; in the order of
/// their first half-edges.
pub fn lines(mesh: &TriMesh, adjacency: &Adjacency, marked: &[bool]) -> Vec<SurfaceCurve> {
    let on = |h: u32| marked[h as usize];
    let arms = |v: u32| -> Vec<u32> {
        path::neighbours(mesh, adjacency, v)
            .filter(|&(_, h)| on(h) || (adjacency.opposite[h as usize] != NONE && on(adjacency.opposite[h as usize])))
            .map(|(w, _)| w)
            .collect()
    };
    let mut used = std::collections::BTreeSet::new();
    let key = |a: u32, b: u32| (a.min(b), a.max(b));
    let mut found = Vec::new();
    // Lines with ends first, then what is left: loops.
    for ends in [true, false] {
        for h in (0..marked.len() as u32).filter(|&h| marked[h as usize]) {
            for (a, b) in [(mesh.origin(h), mesh.origin(next(h))), (mesh.origin(next(h)), mesh.origin(h))] {
                if used.contains(&key(a, b)) || (ends && arms(a).len() == 2) {
                    continue;
                }
                let mut chain = vec![a, b];
                used.insert(key(a, b));
                loop {
                    let (before, at) = (chain[chain.len() - 2], chain[chain.len() - 1]);
                    let ahead = arms(at);
                    let [x, y] = ahead[..] else { break };
                    let w = if x == before { y } else { x };
                    if at == a || !used.insert(key(at, w)) {
                        break;
                    }
                    chain.push(w);
                }
                let closed = chain.len() > 3 && chain[0] == chain[chain.len() - 1];
                if closed {
                    chain.pop();
                }
                found.push(SurfaceCurve { points: path::places(mesh, adjacency, &chain), closed });
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::sharp_edges;
    use crate::synthetic::shapes;

    #[test]
    fn a_plane_cuts_a_sphere_in_a_closed_curve_of_the_girth_within_half_a_percent() {
        let mesh = shapes::sphere(1.0, 4);
        let adjacency = Adjacency::new(&mesh);
        let (point, normal) = (DVec3::new(0.0, 0.0, 0.3), DVec3::new(0.1, 0.2, 1.0));
        let bvh = Bvh::new(&mesh);
        let unit = normal.normalize();
        let d = point.dot(unit);
        let on = (unit.cross(DVec3::X).normalize() * (1.0 - d * d).sqrt()) + unit * d;
        let curve = cut_plane(&mesh, &adjacency, point, normal, bvh.closest(on).place.face).unwrap();
        assert!(curve.closed);
        let girth = std::f64::consts::TAU * (1.0 - d * d).sqrt();
        assert!((curve.length(&mesh) / girth - 1.0).abs() < 0.005);
        for p in curve.positions(&mesh) {
            assert!((p - point).dot(unit).abs() < 1e-12);
        }
    }

    #[test]
    fn a_plane_cuts_a_sheet_from_boundary_to_boundary_through_its_vertices_too() {
        let mesh = shapes::rectangle(2.0, 1.0, 20, 10);
        let adjacency = Adjacency::new(&mesh);
        let bounds = mesh.bounds();
        let middle = (bounds.min + bounds.max) / 2.0;
        let bvh = Bvh::new(&mesh);
        let curve = cut_plane(&mesh, &adjacency, middle, DVec3::X, bvh.closest(middle + DVec3::X * 1e-9).place.face);
        let curve = curve.unwrap_or_else(|_| {
            cut_plane(&mesh, &adjacency, middle, DVec3::X, bvh.closest(middle - DVec3::X * 1e-9).place.face).unwrap()
        });
        assert!(!curve.closed);
        assert!((curve.length(&mesh) - 1.0).abs() < 1e-12, "{}", curve.length(&mesh));
    }

    #[test]
    fn the_sharp_edges_of_a_cuboid_are_12_lines_and_those_of_a_cylinder_two_loops() {
        let cuboid = shapes::cuboid(DVec3::new(1.0, 2.0, 3.0), 5);
        let adjacency = Adjacency::new(&cuboid);
        let found = lines(&cuboid, &adjacency, &sharp_edges(&cuboid, &adjacency, 40.0));
        assert_eq!(found.len(), 12);
        let total: f64 = found.iter().map(|c| c.length(&cuboid)).sum();
        assert!((total - 24.0).abs() < 1e-9);
        let cylinder = shapes::cylinder(1.0, 2.0, 64);
        let adjacency = Adjacency::new(&cylinder);
        let found = lines(&cylinder, &adjacency, &sharp_edges(&cylinder, &adjacency, 40.0));
        assert!(found.len() == 2 && found.iter().all(|c| c.closed && c.points.len() == 64));
    }
}
