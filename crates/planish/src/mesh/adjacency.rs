//! Half-edges of a manifold triangle mesh: opposites, and one that leaves each vertex.
//!
//! Half-edge `h = 3 t + k` runs from corner `k` to corner `k + 1` of triangle `t` (Campagna, Kobbelt, Seidel, *Directed
//! Edges*, 1998).

use super::TriMesh;

pub use crate::geom::NONE;

/// Half-edge adjacency of an oriented mesh whose edges have at most two triangles.
#[derive(Clone, Debug)]
pub struct Adjacency {
    /// For each half-edge the opposite one, or [`NONE`] on the boundary.
    pub opposite: Vec<u32>,
    /// For each vertex one outgoing half-edge ([`NONE`] if unreferenced); on the boundary the one that has
    /// no half-edge before it, so that [`Adjacency::fan`] turns through all triangles.
    pub outgoing: Vec<u32>,
}

impl Adjacency {
    /// Adjacency of `mesh`. Edges with more than two triangles or two of the same direction count as
    /// boundary: mend such meshes first.
    pub fn new(mesh: &TriMesh) -> Adjacency {
        Adjacency::of(&mesh.triangles, mesh.points.len())
    }

    /// Adjacency of bare triangles over `vertex_count` vertices.
    pub fn of(triangles: &[[u32; 3]], vertex_count: usize) -> Adjacency {
        let from = |h: u32| triangles[h as usize / 3][h as usize % 3];
        let ends = |h: u32| {
            let (a, b) = (from(h), from(next(h)));
            (a.min(b), a.max(b))
        };
        // Half-edges in buckets by their lower vertex: a counting sort, then a look at a handful each.
        let count = 3 * triangles.len() as u32;
        let mut start = vec![0u32; vertex_count + 1];
        for h in 0..count {
            start[ends(h).0 as usize + 1] += 1;
        }
        for v in 0..vertex_count {
            start[v + 1] += start[v];
        }
        let mut bucket = vec![(0u32, 0u32); count as usize];
        let mut fill = start.clone();
        for h in 0..count {
            let (low, high) = ends(h);
            bucket[fill[low as usize] as usize] = (high, h);
            fill[low as usize] += 1;
        }
        let mut opposite = vec![NONE; count as usize];
        for v in 0..vertex_count {
            let edges = &mut bucket[start[v] as usize..start[v + 1] as usize];
            edges.sort_unstable();
            for run in edges.chunk_by(|x, y| x.0 == y.0) {
                if let [(_, g), (_, h)] = *run
                    && from(g) != from(h)
                {
                    opposite[g as usize] = h;
                    opposite[h as usize] = g;
                }
            }
        }
        let mut outgoing = vec![NONE; vertex_count];
        for h in 0..opposite.len() as u32 {
            let v = from(h) as usize;
            if outgoing[v] == NONE || opposite[h as usize] == NONE {
                outgoing[v] = h;
            }
        }
        Adjacency { opposite, outgoing }
    }

    /// Outgoing half-edges around vertex `v`, counter-clockwise.
    pub fn fan(&self, v: u32) -> Fan<'_> {
        Fan { adjacency: self, first: self.outgoing[v as usize], next: self.outgoing[v as usize] }
    }

    /// True if vertex `v` is on a boundary or unreferenced.
    pub fn is_boundary_vertex(&self, v: u32) -> bool {
        let h = self.outgoing[v as usize];
        h == NONE || self.opposite[h as usize] == NONE
    }
}

/// The half-edge after `h` in its triangle.
pub fn next(h: u32) -> u32 {
    if h % 3 == 2 { h - 2 } else { h + 1 }
}

/// The half-edge before `h` in its triangle.
pub fn previous(h: u32) -> u32 {
    if h.is_multiple_of(3) { h + 2 } else { h - 1 }
}

/// Iterator of [`Adjacency::fan`].
pub struct Fan<'a> {
    adjacency: &'a Adjacency,
    first: u32,
    next: u32,
}

impl Iterator for Fan<'_> {
    type Item = u32;

    fn next(&mut self) -> Option<u32> {
        let h = self.next;
        if h == NONE {
            return None;
        }
        // Counter-clockwise: the edge that enters the vertex in this triangle, seen from its other side.
        let turned = self.adjacency.opposite[previous(h) as usize];
        self.next = if turned == self.first { NONE } else { turned };
        Some(h)
    }
}
