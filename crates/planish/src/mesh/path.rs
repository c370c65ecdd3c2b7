//! Paths along the edges of a mesh.
//!
//! [K98] Krishnamurthy, *Fitting Smooth Surfaces to Dense Polygon Meshes*, §3.2: a painted curve begins as a
//! greedy path that always steps to the neighbour nearest to the target.
//! Departs from [K98]: where the greedy path runs into a dead end, A* takes over.

use super::{Adjacency, FacePoint, NONE, TriMesh, next, previous};
use crate::geom::graph::{Dense, Reached, Search};

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

/// Distances along edges from many sources, each with the distance it starts at (Dijkstra), up to `reach`; `via` of the
/// result is the vertex before.
pub fn distances(
    mesh: &TriMesh,
    adjacency: &Adjacency,
    sources: &[(u32, f64)],
    weight: impl Fn(u32) -> f64,
    reach: f64,
) -> Dense {
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

/// * `done` - told each vertex as it is settled and its distance; true ends the search
fn search(
    mesh: &TriMesh,
    adjacency: &Adjacency,
    sources: &[(u32, f64)],
    weight: impl Fn(u32) -> f64,
    ahead: impl Fn(u32) -> f64,
    done: impl Fn(u32, f64) -> bool,
) -> Dense {
    let mut search = Search::dense(mesh.points.len());
    for &(v, distance) in sources {
        search.reach_towards(v, distance, NONE, ahead(v));
    }
    while let Some((v, distance)) = search.settle() {
        if done(v, distance) {
            break;
        }
        for (w, h) in neighbours(mesh, adjacency, v) {
            let d = distance + mesh.edge_length(h) * weight(h).max(0.0);
            search.reach_towards(w, d, v, ahead(w));
        }
    }
    search.reached
}
