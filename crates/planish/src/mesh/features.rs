//! Sharp edges by their angle, boundary loops and connected pieces.
//!
//! The choice of those that bound patches is `crate::layout`'s: `docs/methods/layout.md`, step 1.

use super::{Adjacency, NONE, TriMesh, next};
use rayon::prelude::*;

/// For each half-edge whether its edge is sharp: the normals of its two triangles differ by more than
/// `angle_deg` degrees. Edges of the boundary and edges beside a triangle without area are not sharp.
pub fn sharp_edges(mesh: &TriMesh, adjacency: &Adjacency, angle_deg: f64) -> Vec<bool> {
    let limit = angle_deg.to_radians();
    let normals: Vec<_> = (0..mesh.triangles.len()).into_par_iter().map(|t| mesh.normal(t)).collect();
    (0..adjacency.opposite.len())
        .into_par_iter()
        .map(|h| {
            let g = adjacency.opposite[h];
            if g == NONE {
                return false;
            }
            let (m, n) = (normals[h / 3], normals[g as usize / 3]);
            // The arc tangent keeps small angles exact, where the arc cosine would not.
            m.cross(n).length().atan2(m.dot(n)) > limit
        })
        .collect()
}

/// The loops of boundary half-edges, each in the direction of its half-edges (the surface lies on their left),
/// beginning at the least half-edge; loops in the order of these.
pub fn boundary_loops(adjacency: &Adjacency) -> Vec<Vec<u32>> {
    let mut seen = vec![false; adjacency.opposite.len()];
    let mut loops = Vec::new();
    for start in 0..adjacency.opposite.len() as u32 {
        if adjacency.opposite[start as usize] != NONE || seen[start as usize] {
            continue;
        }
        let mut one = Vec::new();
        let mut h = start;
        while !seen[h as usize] {
            seen[h as usize] = true;
            one.push(h);
            // Turn around the head of `h` to the next open edge.
            h = next(h);
            while adjacency.opposite[h as usize] != NONE {
                h = next(adjacency.opposite[h as usize]);
            }
        }
        loops.push(one);
    }
    loops
}

/// For each triangle the number of its piece (connected over edges), and the number of pieces; pieces are
/// numbered in the order of their first triangles.
pub fn components(adjacency: &Adjacency) -> (Vec<u32>, usize) {
    let count = adjacency.opposite.len() / 3;
    let mut label = vec![NONE; count];
    let mut pieces = 0;
    let mut stack = Vec::new();
    for start in 0..count {
        if label[start] != NONE {
            continue;
        }
        label[start] = pieces;
        stack.push(start);
        while let Some(t) = stack.pop() {
            for &g in &adjacency.opposite[3 * t..3 * t + 3] {
                if g != NONE && label[g as usize / 3] == NONE {
                    label[g as usize / 3] = pieces;
                    stack.push(g as usize / 3);
                }
            }
        }
        pieces += 1;
    }
    (label, pieces as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::shapes;

    #[test]
    fn cylinder_has_its_two_rims_of_64_edges_sharp_at_40_degrees_and_nothing_else() {
        let mesh = shapes::cylinder(1.0, 2.0, 64);
        let sharp = sharp_edges(&mesh, &Adjacency::new(&mesh), 40.0);
        assert_eq!(sharp.iter().filter(|&&s| s).count(), 2 * 2 * 64);
        for h in (0..sharp.len() as u32).filter(|&h| sharp[h as usize]) {
            let p = mesh.points[mesh.origin(h) as usize];
            assert!((p.truncate().length() - 1.0).abs() < 1e-12 && (p.z * (p.z - 2.0)).abs() < 1e-12);
        }
    }

    #[test]
    fn annulus_has_two_loops_that_close_and_one_piece() {
        let mesh = shapes::annulus(1.0, 2.0, 48);
        let adjacency = Adjacency::new(&mesh);
        let loops = boundary_loops(&adjacency);
        assert_eq!(loops.len(), 2);
        for l in &loops {
            for k in 0..l.len() {
                assert_eq!(mesh.origin(next(l[k])), mesh.origin(l[(k + 1) % l.len()]));
            }
        }
        assert_eq!(components(&adjacency).1, 1);
        assert_eq!(components(&Adjacency::new(&shapes::two_spheres(1))).1, 2);
    }
}
