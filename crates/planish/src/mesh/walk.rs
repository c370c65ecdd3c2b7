//! Moving places over a mesh: `MovePointOnSurface` and `MovePointOnCurve`.
//!
//! [K98] Krishnamurthy, *Fitting Smooth Surfaces to Dense Polygon Meshes*, appendix A, fig. A.1.
//! The point slides along the projection of the vector on its face; at an edge or vertex it steps into the next
//! face and the rest of the vector is projected there.
//!
//! Departs from [K98]: where no face takes the direction (over a ridge, at the boundary) the point slides along
//! the edge; triangles without area are stepped over.

use super::{Adjacency, FacePoint, NONE, TriMesh, next, previous};
use crate::geom::is_positive;
use crate::geom::tolerance::ON_EDGE;
use glam::DVec3;

/// A triangle whose area is below this share of its longest edge squared has no usable plane.
const NO_PLANE: f64 = 1e-13;
/// Triangles without area that are stepped over in one go.
const HOPS: usize = 16;

/// Slides `place` by `vector` (world units; only its part along the surface counts). The result is always a
/// place of the mesh. Takes at most a few steps per triangle of the mesh.
/// Source: [K98] appendix A.
pub fn move_point_on_surface(mesh: &TriMesh, adjacency: &Adjacency, place: FacePoint, vector: DVec3) -> FacePoint {
    let mut at = cleaned(place);
    let mut rest = vector;
    if !vector.is_finite() {
        return at;
    }
    for _ in 0..4 * mesh.triangles.len() + 64 {
        if rest == DVec3::ZERO {
            break;
        }
        let zeros = at.bary.iter().filter(|&&b| b == 0.0).count();
        let Some(step) = (match zeros {
            0 => inside(mesh, at, rest),
            1 => on_edge(mesh, adjacency, at, rest),
            _ => on_vertex(mesh, adjacency, at, rest),
        }) else {
            break;
        };
        let (moved, share) = advance(step.from, step.rates);
        at = moved;
        if share >= 1.0 {
            break;
        }
        rest = step.rest * (1.0 - share);
    }
    at
}

/// One straight piece of the way.
struct Step {
    from: FacePoint,
    /// Change of the barycentric weights over the whole piece.
    rates: [f64; 3],
    /// What is left of the vector at its start.
    rest: DVec3,
}

/// Gradients of the three barycentric weights; `None` for a triangle without area.
fn gradients(mesh: &TriMesh, face: u32) -> Option<([DVec3; 3], DVec3)> {
    let [a, b, c] = mesh.corners(face as usize);
    let n = (b - a).cross(c - a);
    let longest = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
    let square = n.length_squared();
    let has_plane = n.length() > NO_PLANE * longest && square != 0.0;
    if !has_plane {
        return None;
    }
    Some(([n.cross(c - b) / square, n.cross(a - c) / square, n.cross(b - a) / square], n / square.sqrt()))
}

/// Projection of `v` on the face and the change of weights along it.
fn project(mesh: &TriMesh, face: u32, v: DVec3) -> Option<(DVec3, [f64; 3])> {
    let (g, n) = gradients(mesh, face)?;
    let d = v - n * v.dot(n);
    Some((d, g.map(|g| g.dot(d))))
}

fn inside(mesh: &TriMesh, at: FacePoint, rest: DVec3) -> Option<Step> {
    if let Some((d, rates)) = project(mesh, at.face, rest) {
        return Some(Step { from: at, rates, rest: d });
    }
    // No plane: go to the nearest edge, which costs nothing as the triangle has no width.
    let p = at.position(mesh);
    let (_, near) = (0..3).map(|k| nearest_on_edge(mesh, at.face, k, p)).min_by(|x, y| x.0.total_cmp(&y.0))?;
    let from = cleaned(near);
    let k = from.bary.iter().position(|&b| b == 0.0)?;
    // Against a weight that is zero already: the step ends where it begins.
    let mut rates = [0.0; 3];
    rates[k] = -1.0;
    Some(Step { from, rates, rest })
}

fn on_edge(mesh: &TriMesh, adjacency: &Adjacency, at: FacePoint, rest: DVec3) -> Option<Step> {
    let k = at.bary.iter().position(|&b| b == 0.0)?;
    // The half-edge that the point is on.
    let h = 3 * at.face + ((k as u32) + 1) % 3;
    let mut best: Option<Step> = None;
    for candidate in [beside(mesh, adjacency, at), across(mesh, adjacency, at)] {
        best = better(mesh, best, candidate, rest);
    }
    best.or_else(|| slide(mesh, h, at, rest))
}

/// The step from `candidate` if its face takes the vector and takes more of it than `best`.
fn better(mesh: &TriMesh, best: Option<Step>, candidate: Option<FacePoint>, rest: DVec3) -> Option<Step> {
    let Some(from) = candidate else { return best };
    let Some((d, rates)) = project(mesh, from.face, rest) else { return best };
    let enters = (0..3).all(|i| from.bary[i] > 0.0 || rates[i] > 0.0);
    let longer = best.as_ref().is_none_or(|b| d.length_squared() > b.rest.length_squared());
    if enters && longer { Some(Step { from, rates, rest: d }) } else { best }
}

/// The place itself if its face has a plane, else the same place on the first face with one on that side.
fn beside(mesh: &TriMesh, adjacency: &Adjacency, at: FacePoint) -> Option<FacePoint> {
    let mut at = at;
    for _ in 0..HOPS {
        if gradients(mesh, at.face).is_some() {
            return Some(at);
        }
        // Over the nearest of the other two edges.
        let k = at.bary.iter().position(|&b| b == 0.0)?;
        let p = at.position(mesh);
        let (_, other) = [(k + 1) % 3, (k + 2) % 3]
            .into_iter()
            .map(|j| nearest_on_edge(mesh, at.face, j, p))
            .min_by(|x, y| x.0.total_cmp(&y.0))?;
        at = across_plain(adjacency, other)?;
    }
    None
}

/// The same place seen from the other side of its edge, on the first face there that has a plane.
fn across(mesh: &TriMesh, adjacency: &Adjacency, at: FacePoint) -> Option<FacePoint> {
    beside(mesh, adjacency, across_plain(adjacency, at)?)
}

/// The same place written on the neighbour over its edge.
fn across_plain(adjacency: &Adjacency, at: FacePoint) -> Option<FacePoint> {
    let k = at.bary.iter().position(|&b| b == 0.0)?;
    let h = 3 * at.face + (k as u32 + 1) % 3;
    let g = adjacency.opposite[h as usize];
    if g == NONE {
        return None;
    }
    let mut bary = [0.0; 3];
    bary[g as usize % 3] = at.bary[next(h) as usize % 3];
    bary[next(g) as usize % 3] = at.bary[h as usize % 3];
    Some(FacePoint { face: g / 3, bary })
}

/// Distance from `p` to the edge over corner `k`, and the nearest place of it.
fn nearest_on_edge(mesh: &TriMesh, face: u32, k: usize, p: DVec3) -> (f64, FacePoint) {
    let corners = mesh.corners(face as usize);
    let (i, j) = ((k + 1) % 3, (k + 2) % 3);
    let edge = corners[j] - corners[i];
    let square = edge.length_squared();
    let s = if square > 0.0 { ((p - corners[i]).dot(edge) / square).clamp(0.0, 1.0) } else { 0.0 };
    let mut bary = [0.0; 3];
    bary[i] = 1.0 - s;
    bary[j] = s;
    (p.distance(corners[i] + edge * s), FacePoint { face, bary })
}

/// Along half-edge `h`, either way.
fn slide(mesh: &TriMesh, h: u32, at: FacePoint, rest: DVec3) -> Option<Step> {
    let (p, q) = (mesh.points[mesh.origin(h) as usize], mesh.points[mesh.origin(next(h)) as usize]);
    let edge = q - p;
    let along = rest.dot(edge) / edge.length_squared();
    // The part across the edge is smaller than rounding: nothing to do.
    if !along.is_finite() || along == 0.0 {
        return None;
    }
    let mut rates = [0.0; 3];
    rates[h as usize % 3] = -along;
    rates[next(h) as usize % 3] = along;
    Some(Step { from: at, rates, rest })
}

fn on_vertex(mesh: &TriMesh, adjacency: &Adjacency, at: FacePoint, rest: DVec3) -> Option<Step> {
    let k = (0..3).max_by(|&i, &j| at.bary[i].total_cmp(&at.bary[j]))?;
    let v = mesh.triangles[at.face as usize][k];
    let mut best: Option<Step> = None;
    for h in adjacency.fan(v) {
        let Some((d, rates)) = project(mesh, h / 3, rest) else {
            // A triangle without area whose opposite edge passes through the vertex: look beyond that edge.
            let (_, near) = nearest_on_edge(mesh, h / 3, h as usize % 3, mesh.points[v as usize]);
            let beyond = (near.bary.iter().filter(|&&b| b == 0.0).count() == 1).then(|| across(mesh, adjacency, near));
            best = better(mesh, best, beyond.flatten(), rest);
            continue;
        };
        // The direction lies between the two edges at the vertex.
        let enters = rates[next(h) as usize % 3] >= 0.0 && rates[previous(h) as usize % 3] >= 0.0;
        let longer = best.as_ref().is_none_or(|b| d.length_squared() > b.rest.length_squared());
        if enters && longer && d != DVec3::ZERO {
            best = Some(Step { from: FacePoint::corner(h / 3, h as usize % 3), rates, rest: d });
        }
    }
    if best.is_some() {
        return best;
    }
    // Along the edge that takes most of the vector.
    let p = mesh.points[v as usize];
    let mut most = 0.0;
    for h in adjacency.fan(v) {
        for (edge, end) in [(h, next(h)), (previous(h), previous(h))] {
            let e = (mesh.points[mesh.origin(end) as usize] - p).normalize_or_zero();
            if e.dot(rest) > most
                && let Some(step) = slide(mesh, edge, FacePoint::corner(h / 3, h as usize % 3), rest)
            {
                most = e.dot(rest);
                best = Some(step);
            }
        }
    }
    best
}

/// Moves within a face until the end or the first weight that becomes zero. Returns the share of the way done.
fn advance(from: FacePoint, rates: [f64; 3]) -> (FacePoint, f64) {
    let mut share = 1.0;
    let mut hit = None;
    for (k, (weight, rate)) in from.bary.into_iter().zip(rates).enumerate() {
        if rate < 0.0 && weight + rate < 0.0 {
            let s = -weight / rate;
            if s < share {
                (share, hit) = (s, Some(k));
            }
        }
    }
    let mut bary: [f64; 3] = std::array::from_fn(|k| from.bary[k] + share * rates[k]);
    if let Some(k) = hit {
        bary[k] = 0.0;
    }
    for k in 0..3 {
        // On an edge and moving along it: stays on it exactly.
        if from.bary[k] == 0.0 && rates[k] == 0.0 {
            bary[k] = 0.0;
        }
    }
    (cleaned(FacePoint { face: from.face, bary }), share)
}

/// Weights without negative or tiny parts, of sum one.
fn cleaned(place: FacePoint) -> FacePoint {
    let bary = place.bary.map(|b| if b > ON_EDGE { b } else { 0.0 });
    let sum: f64 = bary.iter().sum();
    if !(sum > 0.0 && sum.is_finite()) {
        return FacePoint { face: place.face, bary: [1.0 / 3.0; 3] };
    }
    FacePoint { face: place.face, bary: bary.map(|b| b / sum) }
}

/// A place on a polyline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurvePlace {
    /// Index of the segment, from point `segment` to the one after it.
    pub segment: usize,
    /// Share of the segment, 0 to 1.
    pub share: f64,
}

impl CurvePlace {
    /// World position on `points`.
    pub fn position(&self, points: &[DVec3]) -> DVec3 {
        points[self.segment].lerp(points[(self.segment + 1) % points.len()], self.share)
    }
}

/// Moves a place along a polyline by `distance` (world units, backwards if negative). Stops at the ends of an
/// open polyline; goes round a closed one. `points` must hold at least two.
/// Source: [K98] appendix A.
pub fn move_point_on_curve(points: &[DVec3], closed: bool, place: CurvePlace, distance: f64) -> CurvePlace {
    let segments = if closed { points.len() } else { points.len() - 1 };
    let length = |s: usize| points[s].distance(points[(s + 1) % points.len()]);
    let mut rest = distance;
    if closed {
        let total: f64 = (0..segments).map(length).sum();
        if !is_positive(total) {
            return place;
        }
        rest %= total;
    }
    let mut at = place;
    // One turn at most, and the two parts of the first segment.
    for _ in 0..segments + 2 {
        let l = length(at.segment);
        let goal = at.share * l + rest;
        if goal > l {
            if !closed && at.segment + 1 == segments {
                return CurvePlace { share: 1.0, ..at };
            }
            rest = goal - l;
            at = CurvePlace { segment: (at.segment + 1) % segments, share: 0.0 };
        } else if goal < 0.0 {
            if !closed && at.segment == 0 {
                return CurvePlace { share: 0.0, ..at };
            }
            rest = goal;
            at = CurvePlace { segment: (at.segment + segments - 1) % segments, share: 1.0 };
        } else {
            return CurvePlace { share: if l > 0.0 { goal / l } else { at.share }, ..at };
        }
    }
    at
}
