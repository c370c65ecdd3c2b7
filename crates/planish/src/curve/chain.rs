//! The surface curve: a chain of face points ([K98] §3.1).
//!
//! Departs from [K98]: two neighbours may lie any number of faces apart (`strip` finds the faces between).

use super::CurveError;
use super::strip::{connect, vertex_of};
use crate::geom::polyline::{self, Along};
use crate::geom::tolerance::ON_EDGE;
use crate::mesh::{Adjacency, FacePoint, TriMesh};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// A chain of places on a mesh.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SurfaceCurve {
    /// Its places in order. Neighbours may lie any number of faces apart.
    pub points: Vec<FacePoint>,
    /// True if the last place is followed by the first.
    pub closed: bool,
}

impl SurfaceCurve {
    /// An open curve.
    pub fn open(points: Vec<FacePoint>) -> SurfaceCurve {
        SurfaceCurve { points, closed: false }
    }

    /// Positions of its places, world units; a closed curve does not repeat the first.
    pub fn positions(&self, mesh: &TriMesh) -> Vec<DVec3> {
        self.points.iter().map(|p| p.position(mesh)).collect()
    }

    /// Length of the polyline through its places, world units.
    pub fn length(&self, mesh: &TriMesh) -> f64 {
        let p = self.positions(mesh);
        let wrap = if self.closed && p.len() > 1 { p[p.len() - 1].distance(p[0]) } else { 0.0 };
        polyline::length(p) + wrap
    }

    /// Checks that every place is on the mesh.
    /// # Errors
    /// `NoSuchFace`, or `TooFewPoints` for fewer than two places.
    pub fn check(&self, mesh: &TriMesh) -> Result<(), CurveError> {
        let faces = mesh.triangles.len();
        if self.points.len() < 2 {
            return Err(CurveError::TooFewPoints { found: self.points.len(), needed: 2 });
        }
        match self.points.iter().find(|p| p.face as usize >= faces) {
            Some(p) => Err(CurveError::NoSuchFace { face: p.face, faces }),
            None => Ok(()),
        }
    }

    /// The same curve with a place wherever it crosses an edge: neighbours share a face. A closed curve ends with
    /// its first place.
    /// # Errors
    /// `NoWay` if two neighbours lie on different pieces of the mesh.
    pub fn trace(&self, mesh: &TriMesh, adjacency: &Adjacency) -> Result<Vec<FacePoint>, CurveError> {
        self.check(mesh)?;
        let count = self.points.len();
        let mut chain = vec![self.points[0]];
        for k in 1..count + self.closed as usize {
            let way = connect(mesh, adjacency, chain[chain.len() - 1], self.points[k % count])?;
            chain.extend_from_slice(&way[1..]);
        }
        without_repeats(mesh, &mut chain);
        Ok(chain)
    }

    /// The curve with `count` places at equal arc length along its trace. A closed one starts where it started.
    /// # Errors
    /// As [`SurfaceCurve::trace`]; `TooFewPoints` for a count below 2 (3 if closed).
    pub fn resampled(&self, mesh: &TriMesh, adjacency: &Adjacency, count: usize) -> Result<SurfaceCurve, CurveError> {
        let needed = if self.closed { 3 } else { 2 };
        if count < needed {
            return Err(CurveError::TooFewPoints { found: count, needed });
        }
        let chain = self.trace(mesh, adjacency)?;
        let mut points = sample(mesh, adjacency, &chain, count + self.closed as usize);
        if self.closed {
            points.pop();
        }
        Ok(SurfaceCurve { points, closed: self.closed })
    }

    /// The curve with places about `spacing` (world units) apart, evenly.
    /// # Errors
    /// As [`SurfaceCurve::resampled`].
    pub fn spaced(&self, mesh: &TriMesh, adjacency: &Adjacency, spacing: f64) -> Result<SurfaceCurve, CurveError> {
        let chain = SurfaceCurve::open(self.trace(mesh, adjacency)?);
        let length = chain.length(mesh);
        // Far more places than any curve has uses for: a spacing of nothing must not take all memory.
        const MOST: f64 = 1e6;
        let steps = if spacing > 0.0 { (length / spacing).round().clamp(1.0, MOST) as usize } else { 1 };
        let count = if self.closed { steps.max(8) } else { steps + 1 };
        self.resampled(mesh, adjacency, count)
    }
}

/// Two places of one edge nearer than this share of it are the same: rounding, seen from its two faces.
const SAME_ON_EDGE: f64 = 1e-10;

/// A place by what it lies on: a vertex, an edge by its vertices (lower first) with the share of the way, or a face.
#[derive(Clone, Copy, Debug)]
enum Lies {
    Vertex(u32),
    Edge(u32, u32, f64),
    Face(FacePoint),
}

fn lies(mesh: &TriMesh, p: &FacePoint) -> Lies {
    let t = mesh.triangles[p.face as usize];
    let near: Vec<usize> = (0..3).filter(|&k| p.bary[k] > ON_EDGE).collect();
    match near[..] {
        [k] => Lies::Vertex(t[k]),
        [i, j] => {
            let (i, j) = if t[i] < t[j] { (i, j) } else { (j, i) };
            Lies::Edge(t[i], t[j], p.bary[j] / (p.bary[i] + p.bary[j]))
        }
        _ => Lies::Face(*p),
    }
}

/// How far along an edge (lower vertex first) a place of it lies.
fn along(lies: &Lies, edge: (u32, u32)) -> Option<f64> {
    match *lies {
        Lies::Vertex(v) if v == edge.0 => Some(0.0),
        Lies::Vertex(v) if v == edge.1 => Some(1.0),
        Lies::Edge(a, b, t) if (a, b) == edge => Some(t),
        _ => None,
    }
}

/// True if a chain that comes from `a` to `b` on an edge turns back there, to `c` on the same edge.
fn turns_back(mesh: &TriMesh, [a, b, c]: [&FacePoint; 3]) -> bool {
    let all = [a, b, c].map(|p| lies(mesh, p));
    let edge = all.iter().find_map(|l| match *l {
        Lies::Edge(a, b, _) => Some((a, b)),
        _ => None,
    });
    let edge = edge.or(match all {
        [Lies::Vertex(v), Lies::Vertex(w), _] => Some((v.min(w), v.max(w))),
        _ => None,
    });
    match edge.map(|e| [0, 1, 2].map(|k| along(&all[k], e))) {
        Some([Some(r), Some(s), Some(t)]) => (s - r) * (t - s) < 0.0,
        _ => false,
    }
}

/// Takes away places that repeat the one before, and places beyond which the chain goes back in the edge that it came
/// along; the last place is kept.
pub(crate) fn without_repeats(mesh: &TriMesh, chain: &mut Vec<FacePoint>) {
    let same = |a: &FacePoint, b: &FacePoint| match (lies(mesh, a), lies(mesh, b)) {
        (Lies::Vertex(v), Lies::Vertex(w)) => v == w,
        (Lies::Edge(a, b, s), Lies::Edge(c, d, t)) => (a, b) == (c, d) && (s - t).abs() < SAME_ON_EDGE,
        (Lies::Face(p), Lies::Face(q)) => p == q,
        _ => false,
    };
    let last = chain.last().copied();
    let mut kept: Vec<FacePoint> = Vec::with_capacity(chain.len());
    for place in chain.drain(..) {
        while let [.., a, b] = &kept[..]
            && turns_back(mesh, [a, b, &place])
        {
            kept.pop();
        }
        if kept.last().is_none_or(|p| !same(p, &place)) {
            kept.push(place);
        }
    }
    *chain = kept;
    if let (Some(last), Some(end)) = (last, chain.last_mut()) {
        *end = last;
    }
}

/// Takes away what a chain goes there and back around the place `joint`: a way that is drawn to something comes to a
/// pick and leaves it by the same places. At most half of either side goes.
pub(crate) fn without_spur(mesh: &TriMesh, chain: &mut Vec<FacePoint>, joint: usize) {
    let most = joint.min(chain.len() - 1 - joint) / 2;
    let place = |p: &FacePoint| p.position(mesh);
    let spur = (1..=most).take_while(|&k| place(&chain[joint - k]) == place(&chain[joint + k])).count();
    chain.drain(joint - spur..joint + spur);
}

/// `count` places at equal arc length along a chain whose neighbours share a face; the ends are kept.
pub(crate) fn sample(mesh: &TriMesh, adjacency: &Adjacency, chain: &[FacePoint], count: usize) -> Vec<FacePoint> {
    let mut along = Along::new(chain.iter().map(|p| p.position(mesh)));
    let total = along.length();
    (0..count)
        .map(|k| {
            if k == 0 || chain.len() < 2 {
                return chain[0];
            }
            if k + 1 == count {
                return chain[chain.len() - 1];
            }
            let target = total * k as f64 / (count - 1) as f64;
            let (s, t) = along.advance(target);
            between(mesh, adjacency, &chain[s], &chain[s + 1], t)
        })
        .collect()
}

/// The place `t` of the way between two places that share a face.
pub(crate) fn between(mesh: &TriMesh, adjacency: &Adjacency, a: &FacePoint, b: &FacePoint, t: f64) -> FacePoint {
    let faces = |p: &FacePoint| -> Vec<u32> {
        let zero: Vec<usize> = (0..3).filter(|&k| p.bary[k] == 0.0).collect();
        match zero[..] {
            [k] => {
                let o = adjacency.opposite[3 * p.face as usize + (k + 1) % 3];
                if o == crate::mesh::NONE { vec![p.face] } else { vec![p.face, o / 3] }
            }
            [_, _] => vertex_of(mesh, p).map_or(vec![p.face], |v| adjacency.fan(v).map(|h| h / 3).collect()),
            _ => vec![p.face],
        }
    };
    let shared = if a.face == b.face {
        Some(a.face)
    } else {
        let other = faces(b);
        faces(a).into_iter().find(|f| other.contains(f))
    };
    let Some(face) = shared else {
        // A place beside an edge by rounding is on it.
        return match (weight_beside(adjacency, a, b.face), weight_beside(adjacency, b, a.face)) {
            (Some((u, k)), Some((w, _))) if u <= w => between(mesh, adjacency, &on_edge(a, k), b, t),
            (_, Some((_, k))) => between(mesh, adjacency, a, &on_edge(b, k), t),
            _ if t < 0.5 => *a,
            _ => *b,
        };
    };
    let (x, y) = (a.weights_on(mesh, face), b.weights_on(mesh, face));
    let bary = std::array::from_fn(|k| x[k] + (y[k] - x[k]) * t);
    FacePoint { face, bary }
}

/// The weight that keeps a place off the edge to the face `other`, and its index.
fn weight_beside(adjacency: &Adjacency, p: &FacePoint, other: u32) -> Option<(f64, usize)> {
    let apart = |k: &usize| {
        let o = adjacency.opposite[3 * p.face as usize + (k + 1) % 3];
        o != crate::mesh::NONE && o / 3 == other
    };
    (0..3).find(apart).map(|k| (p.bary[k], k))
}

/// A place moved on to the edge where weight `k` is zero.
fn on_edge(p: &FacePoint, k: usize) -> FacePoint {
    let mut bary = p.bary;
    bary[k] = 0.0;
    let sum: f64 = bary.iter().sum();
    FacePoint { face: p.face, bary: bary.map(|b| b / sum) }
}
