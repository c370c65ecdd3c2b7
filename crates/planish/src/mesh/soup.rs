//! Edges of any triangle soup, for repair and diagnosis: half-edge adjacency does not exist yet (`docs/methods/mend.md`).

use super::{MeshError, NONE, TriMesh};
use rayon::prelude::*;

/// Checks that all triangles name existing vertices and that those are finite.
/// # Errors
/// [`MeshError::BadIndex`], [`MeshError::NotFinite`] for the first offending triangle.
pub fn check(mesh: &TriMesh) -> Result<(), MeshError> {
    for (triangle, t) in mesh.triangles.iter().enumerate() {
        for &vertex in t {
            match mesh.points.get(vertex as usize) {
                None => return Err(MeshError::BadIndex { triangle, vertex, count: mesh.points.len() }),
                Some(p) if !p.is_finite() => return Err(MeshError::NotFinite { vertex }),
                _ => {}
            }
        }
    }
    Ok(())
}

/// The same, and refuses a mesh without triangles.
pub(crate) fn check_some(mesh: &TriMesh) -> Result<(), MeshError> {
    check(mesh)?;
    if mesh.triangles.is_empty() { Err(MeshError::Empty) } else { Ok(()) }
}

/// All half-edges of triangles with three different vertices, sorted by undirected edge: `(edge, half-edge)`.
pub(crate) fn keyed_edges(triangles: &[[u32; 3]]) -> Vec<(u64, u32)> {
    // What is no edge is sorted to the end. One array from the start: half-edges are many in large meshes.
    let key = |h: usize| {
        let (t, k) = (&triangles[h / 3], h % 3);
        let (a, b) = (t[k], t[(k + 1) % 3]);
        let edge = ((a.min(b) as u64) << 32) | a.max(b) as u64;
        (if repeats(t) { u64::MAX } else { edge }, h as u32)
    };
    let mut keyed: Vec<(u64, u32)> = (0..3 * triangles.len()).into_par_iter().map(key).collect();
    keyed.par_sort_unstable();
    keyed.truncate(keyed.partition_point(|k| k.0 != u64::MAX));
    keyed
}

/// True if a triangle names a vertex twice.
pub(crate) fn repeats(t: &[u32; 3]) -> bool {
    t[0] == t[1] || t[1] == t[2] || t[2] == t[0]
}

/// For each half-edge the other one of its edge where exactly two triangles meet, whatever their directions.
pub(crate) fn mates(keyed: &[(u64, u32)], half_edges: usize) -> Vec<u32> {
    let mut mate = vec![NONE; half_edges];
    for run in keyed.chunk_by(|x, y| x.0 == y.0) {
        if let [(_, g), (_, h)] = *run {
            mate[g as usize] = h;
            mate[h as usize] = g;
        }
    }
    mate
}

/// Vertex at the start of half-edge `h`.
pub(crate) fn origin(triangles: &[[u32; 3]], h: u32) -> u32 {
    triangles[h as usize / 3][h as usize % 3]
}

/// Orientation of the pieces that mates connect.
pub(crate) struct Orientation {
    /// For each triangle its piece.
    pub piece: Vec<u32>,
    /// For each triangle whether it must be turned to agree with the first of its piece.
    pub turned: Vec<bool>,
    /// Number of pieces.
    pub pieces: usize,
}

/// Flood fill over mates. Half-edges of one edge should run against each other.
pub(crate) fn orient(triangles: &[[u32; 3]], mate: &[u32]) -> Orientation {
    let mut piece = vec![NONE; triangles.len()];
    let mut turned = vec![false; triangles.len()];
    let mut pieces = 0;
    let mut queue = std::collections::VecDeque::new();
    for start in 0..triangles.len() {
        if piece[start] != NONE {
            continue;
        }
        piece[start] = pieces;
        queue.push_back(start);
        while let Some(t) = queue.pop_front() {
            for h in 3 * t as u32..3 * t as u32 + 3 {
                let g = mate[h as usize];
                if g != NONE && piece[g as usize / 3] == NONE {
                    piece[g as usize / 3] = pieces;
                    turned[g as usize / 3] = turned[t] ^ (origin(triangles, g) == origin(triangles, h));
                    queue.push_back(g as usize / 3);
                }
            }
        }
        pieces += 1;
    }
    Orientation { piece, turned, pieces: pieces as usize }
}

/// For each corner `3 t + k` the least corner of the same fan: corners of neighbouring triangles at a shared
/// vertex, connected over mates.
pub(crate) fn fans(triangles: &[[u32; 3]], mate: &[u32]) -> Vec<u32> {
    let mut sets = super::sets::Sets::new(mate.len());
    for h in 0..mate.len() as u32 {
        let g = mate[h as usize];
        if g == NONE || g < h {
            continue;
        }
        let (h_end, g_end) = (super::next(h), super::next(g));
        if origin(triangles, h) == origin(triangles, g) {
            sets.join(h, g);
            sets.join(h_end, g_end);
        } else {
            sets.join(h, g_end);
            sets.join(h_end, g);
        }
    }
    (0..mate.len() as u32).map(|c| sets.root(c)).collect()
}
