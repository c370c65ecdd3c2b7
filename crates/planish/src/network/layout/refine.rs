//! The working mesh of a layout: the input with long edges split, so that curves have room to move.

use crate::mesh::{Adjacency, FacePoint, NONE, TriMesh, next};
use std::collections::HashMap;

/// Rounds of splitting; each halves an edge, so this reaches a 4096th of the longest edge.
const ROUNDS: usize = 12;

/// The refined mesh with the way back.
pub(super) struct Refined {
    pub mesh: TriMesh,
    /// For each triangle the input face, and its corners as barycentric coordinates of that face.
    pub parent: Vec<(u32, [[f64; 3]; 3])>,
}

/// Splits every edge longer than `longest` at its middle until none is left.
pub(super) fn refine(mesh: &TriMesh, longest: f64) -> Refined {
    let unit = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let mut out = Refined {
        mesh: TriMesh::new(mesh.points.clone(), mesh.triangles.clone()),
        parent: (0..mesh.triangles.len() as u32).map(|f| (f, unit)).collect(),
    };
    for _ in 0..ROUNDS {
        let adjacency = Adjacency::new(&out.mesh);
        let mut middle: HashMap<u32, u32> = HashMap::new();
        let mut points = std::mem::take(&mut out.mesh.points);
        for h in 0..adjacency.opposite.len() as u32 {
            let tri = out.mesh.triangles[h as usize / 3];
            let (a, b) = (tri[h as usize % 3] as usize, tri[next(h) as usize % 3] as usize);
            let o = adjacency.opposite[h as usize];
            if (o == NONE || h < o) && points[a].distance(points[b]) > longest {
                let m = points.len() as u32;
                // From the lower vertex, so that the place does not depend on the face.
                let (a, b) = (a.min(b), a.max(b));
                points.push(points[a].midpoint(points[b]));
                middle.insert(h, m);
                if o != NONE {
                    middle.insert(o, m);
                }
            }
        }
        let mut triangles = Vec::with_capacity(out.mesh.triangles.len());
        let mut parent = Vec::with_capacity(out.parent.len());
        for (f, (&tri, &(face, bary))) in out.mesh.triangles.iter().zip(&out.parent).enumerate() {
            let mids: [Option<u32>; 3] = std::array::from_fn(|k| middle.get(&(3 * f as u32 + k as u32)).copied());
            let half = |k: usize| -> [f64; 3] { std::array::from_fn(|i| (bary[k][i] + bary[(k + 1) % 3][i]) / 2.0) };
            // Corners 0..3 are the triangle's, 3..6 the middles of its edges.
            let names =
                [tri[0], tri[1], tri[2], mids[0].unwrap_or(NONE), mids[1].unwrap_or(NONE), mids[2].unwrap_or(NONE)];
            let places = [bary[0], bary[1], bary[2], half(0), half(1), half(2)];
            let split: Vec<usize> = (0..3).filter(|&k| mids[k].is_some()).collect();
            let pieces: Vec<[usize; 3]> = match split[..] {
                [] => vec![[0, 1, 2]],
                [k] => vec![[k, 3 + k, (k + 2) % 3], [3 + k, (k + 1) % 3, (k + 2) % 3]],
                [_, _] => {
                    let k = (0..3).find(|&k| mids[k].is_none()).expect("one edge is whole");
                    let (a, b, c) = (k, (k + 1) % 3, (k + 2) % 3);
                    let (m, n) = (3 + b, 3 + c); // on b-c and c-a
                    let at = |i: usize| points[names[i] as usize];
                    if at(a).distance(at(m)) <= at(b).distance(at(n)) {
                        vec![[m, c, n], [a, b, m], [a, m, n]]
                    } else {
                        vec![[m, c, n], [a, b, n], [b, m, n]]
                    }
                }
                _ => vec![[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]],
            };
            for piece in pieces {
                triangles.push(piece.map(|i| names[i]));
                parent.push((face, piece.map(|i| places[i])));
            }
        }
        out.mesh = TriMesh::new(points, triangles);
        out.parent = parent;
        if middle.is_empty() {
            break;
        }
    }
    out
}

impl Refined {
    /// The place of barycentric `bary` in refined face `f`, as a face point of the input mesh.
    pub fn to_input(&self, f: u32, bary: [f64; 3]) -> FacePoint {
        let (face, corners) = self.parent[f as usize];
        let weights = std::array::from_fn(|i| (0..3).map(|k| bary[k] * corners[k][i]).sum());
        FacePoint { face, bary: weights }
    }
}
