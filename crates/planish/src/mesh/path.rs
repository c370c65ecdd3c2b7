//! Paths along the edges of a mesh.
//!
//! [K98] Krishnamurthy, *Fitting Smooth Surfaces to Dense Polygon Meshes*, §3.2: a painted curve begins as a
//! greedy path that always steps to the neighbour nearest to the target.
//! Departs from [K98]: where the greedy path runs into a dead end, A* takes over.

use super::{Adjacency, FacePoint, NONE, TriMesh, next, previous};
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Neighbours of vertex `v` as `(vertex, half-edge of the edge)`, counter-clockwise.
pub fn neighbours<'a>(mesh: &'a TriMesh, adjacency: &'a Adjacency, v: u32) -> impl Iterator<Item = (u32, u32)> + 'a {
    adjacency.fan(v).flat_map(move |h| {
        let incoming = previous(h);
        // At the boundary the last edge of the fan has no outgoing half-edge.
        let last = (adjacency.opposite[incoming as usize] == NONE).then(|| (mesh.origin(incoming), incoming));
        std::iter::once((mesh.origin(next(h)), h)).chain(last)
    })
}

/// The chain of vertices from `from` to `to` that always steps to the neighbour nearest to the target; where
/// that would not come nearer, the rest is the shortest path. `None` if there is no way.
/// Source: [K98] §3.3.
pub fn greedy(mesh: &TriMesh, adjacency: &Adjacency, from: u32, to: u32) -> Option<Vec<u32>> {
    let goal = mesh.points[to as usize];
    let away = |v: u32| mesh.points[v as usize].distance(goal);
    let mut chain = vec![from];
    let mut v = from;
    while v != to {
        let nearest = neighbours(mesh, adjacency, v).map(|(w, _)| w).min_by(|&a, &b| {
            // The target itself wins over another vertex at the same place.
            (a != to).cmp(&(b != to)).then(away(a).total_cmp(&away(b))).then(a.cmp(&b))
        })?;
        if nearest != to && away(nearest) >= away(v) {
            chain.extend(shortest(mesh, adjacency, v, to, |_| 1.0, 1.0)?.into_iter().skip(1));
            return Some(chain);
        }
        v = nearest;
        chain.push(v);
    }
    Some(chain)
}

/// The shortest chain of vertices from `from` to `to` (A*), an edge costing its length times `weight(half-edge)`.
/// * `least` - a lower bound of all weights, at least 0; 0 turns the search into Dijkstra's.
///
/// `None` if there is no way.
pub fn shortest(
    mesh: &TriMesh,
    adjacency: &Adjacency,
    from: u32,
    to: u32,
    weight: impl Fn(u32) -> f64,
    least: f64,
) -> Option<Vec<u32>> {
    let goal = mesh.points[to as usize];
    let ahead = |v: u32| least * mesh.points[v as usize].distance(goal);
    let field = search(mesh, adjacency, &[(from, 0.0)], weight, ahead, |v, _| v == to);
    field.distance[to as usize].is_finite().then(|| {
        let mut chain = field.chain(to);
        chain.reverse();
        chain
    })
}

/// Distances along edges from a set of sources.
#[derive(Clone, Debug)]
pub struct EdgeDistance {
    /// For each vertex its distance, infinite where not reached.
    pub distance: Vec<f64>,
    /// For each vertex the one before it on the way from a source ([`NONE`] at sources and where not reached).
    pub before: Vec<u32>,
}

impl EdgeDistance {
    /// The chain of vertices from `v` back to its source.
    pub fn chain(&self, v: u32) -> Vec<u32> {
        let mut chain = vec![v];
        let mut at = v;
        while self.before[at as usize] != NONE {
            at = self.before[at as usize];
            chain.push(at);
        }
        chain
    }
}

/// Distances along edges from many sources, each with the distance it starts at (Dijkstra), up to `reach`.
pub fn distances(
    mesh: &TriMesh,
    adjacency: &Adjacency,
    sources: &[(u32, f64)],
    weight: impl Fn(u32) -> f64,
    reach: f64,
) -> EdgeDistance {
    search(mesh, adjacency, sources, weight, |_| 0.0, |_, d| d > reach)
}

/// The chain as places; each but the last lies on a face that the next vertex belongs to.
pub fn places(mesh: &TriMesh, adjacency: &Adjacency, chain: &[u32]) -> Vec<FacePoint> {
    let corner = |v: u32, h: u32| {
        // The half-edge may run towards `v`: its face has `v` all the same.
        let face = h / 3;
        let k = mesh.triangles[face as usize].iter().position(|&w| w == v).unwrap_or(0);
        FacePoint::corner(face, k)
    };
    (0..chain.len())
        .filter_map(|i| {
            let v = chain[i];
            let other = chain.get(i + 1).or(if i > 0 { chain.get(i - 1) } else { None });
            let edge = neighbours(mesh, adjacency, v).find(|(w, _)| Some(w) == other);
            edge.map(|(_, h)| h).or_else(|| adjacency.fan(v).next()).map(|h| corner(v, h))
        })
        .collect()
}

/// A vertex waiting in the heap; the nearest comes out first, ties by index.
struct Waiting {
    estimate: f64,
    distance: f64,
    vertex: u32,
}

impl PartialEq for Waiting {
    fn eq(&self, other: &Waiting) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Waiting {}
impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Waiting) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Waiting {
    fn cmp(&self, other: &Waiting) -> Ordering {
        other.estimate.total_cmp(&self.estimate).then(other.vertex.cmp(&self.vertex))
    }
}

fn search(
    mesh: &TriMesh,
    adjacency: &Adjacency,
    sources: &[(u32, f64)],
    weight: impl Fn(u32) -> f64,
    ahead: impl Fn(u32) -> f64,
    done: impl Fn(u32, f64) -> bool,
) -> EdgeDistance {
    let n = mesh.points.len();
    let mut field = EdgeDistance { distance: vec![f64::INFINITY; n], before: vec![NONE; n] };
    let mut heap = BinaryHeap::new();
    for &(vertex, distance) in sources {
        if distance < field.distance[vertex as usize] {
            field.distance[vertex as usize] = distance;
            heap.push(Waiting { estimate: distance + ahead(vertex), distance, vertex });
        }
    }
    while let Some(Waiting { distance, vertex: v, .. }) = heap.pop() {
        if distance > field.distance[v as usize] {
            continue;
        }
        if done(v, distance) {
            break;
        }
        for (w, h) in neighbours(mesh, adjacency, v) {
            let d = distance + mesh.points[v as usize].distance(mesh.points[w as usize]) * weight(h).max(0.0);
            if d < field.distance[w as usize] {
                field.distance[w as usize] = d;
                field.before[w as usize] = v;
                heap.push(Waiting { estimate: d + ahead(w), distance: d, vertex: w });
            }
        }
    }
    field
}
