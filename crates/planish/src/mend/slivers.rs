//! Triangles without height: removed by collapsing or flipping edges, so that the surface stays whole.

use super::repairs::Repairs;
use crate::geom::{Aabb, tolerance};
use crate::mesh::{Adjacency, NONE, TriMesh, next, previous};
use crate::observe::{Cancelled, Observer};
use glam::DVec3;

/// Each pass can free only triangles that do not touch each other; clusters of them are short in practice.
const PASSES: usize = 12;

/// Removes triangles lower than the library's tolerance from an oriented manifold.
pub(super) fn remove(
    mesh: &TriMesh,
    triangles: &mut Vec<[u32; 3]>,
    source: &[u32],
    done: &mut Repairs,
    observer: &dyn Observer,
) -> Result<(), Cancelled> {
    let at = |v: u32| mesh.points[source[v as usize] as usize];
    let flat = tolerance::length(Aabb::of(&mesh.points).diagonal());
    for pass in 0..=PASSES {
        observer.check()?;
        let low: Vec<usize> = (0..triangles.len()).filter(|&t| height(triangles[t].map(at)).0 <= flat).collect();
        done.degenerate_left = low.len();
        if low.is_empty() || pass == PASSES {
            break;
        }
        let adjacency = Adjacency::of(triangles, source.len());
        let mut touched = vec![false; source.len()];
        let mut gone = vec![false; triangles.len()];
        let mut changed = false;
        for t in low {
            if !triangles[t].iter().any(|&v| touched[v as usize]) {
                changed |= mend(t, triangles, &adjacency, &at, flat, &mut touched, &mut gone, done);
            }
        }
        let mut t = 0;
        triangles.retain(|_| {
            t += 1;
            !gone[t - 1]
        });
        if !changed {
            break;
        }
    }
    Ok(())
}

/// Height over the longest edge, and the number of that edge.
fn height([a, b, c]: [DVec3; 3]) -> (f64, usize) {
    let lengths = [a.distance(b), b.distance(c), c.distance(a)];
    let longest = (0..3).fold(0, |m, k| if lengths[k] > lengths[m] { k } else { m });
    let twice = (b - a).cross(c - a).length();
    (if lengths[longest] > 0.0 { twice / lengths[longest] } else { 0.0 }, longest)
}

fn mend(
    t: usize,
    triangles: &mut [[u32; 3]],
    adjacency: &Adjacency,
    at: &impl Fn(u32) -> DVec3,
    flat: f64,
    touched: &mut [bool],
    gone: &mut [bool],
    done: &mut Repairs,
) -> bool {
    let tri = triangles[t];
    let (low, longest) = height(tri.map(at));
    let shortest = (0..3).min_by(|&i, &j| {
        let length = |k: usize| at(tri[k]).distance(at(tri[(k + 1) % 3]));
        length(i).total_cmp(&length(j))
    });
    let from = |h: u32| triangles[h as usize / 3][h as usize % 3];
    let short = (3 * t + shortest.unwrap_or(0)) as u32;
    let short_length = at(from(short)).distance(at(from(next(short))));
    if short_length <= flat {
        if let Some(around) = collapse(short, triangles, adjacency, touched, gone) {
            around.into_iter().for_each(|v| touched[v as usize] = true);
            done.collapsed_edges += 1;
            return true;
        }
        return false;
    }
    // The corner over the longest edge lies on it.
    let h = (3 * t + longest) as u32;
    let g = adjacency.opposite[h as usize];
    if g == NONE {
        gone[t] = true;
        tri.iter().for_each(|&v| touched[v as usize] = true);
        done.trimmed_faces += 1;
        return true;
    }
    let (a, b, c, d) = (from(h), from(next(h)), from(previous(h)), from(previous(g)));
    let joined = adjacency.fan(c).any(|e| from(next(e)) == d || from(previous(e)) == d);
    let other = triangles[g as usize / 3].map(at);
    let worst = height([a, d, c].map(at)).0.min(height([d, b, c].map(at)).0);
    if touched[d as usize] || c == d || joined || worst <= low.min(height(other).0) {
        return false;
    }
    triangles[t] = [a, d, c];
    triangles[g as usize / 3] = [d, b, c];
    [a, b, c, d].into_iter().for_each(|v| touched[v as usize] = true);
    done.flipped_edges += 1;
    true
}

/// Collapses the edge of half-edge `h` onto its start if the surface stays a manifold; returns the vertices
/// around.
fn collapse(
    h: u32,
    triangles: &mut [[u32; 3]],
    adjacency: &Adjacency,
    touched: &[bool],
    gone: &mut [bool],
) -> Option<Vec<u32>> {
    let from = |h: u32| triangles[h as usize / 3][h as usize % 3];
    let (a, b) = (from(h), from(next(h)));
    let neighbours = |v: u32| -> Vec<u32> {
        let mut n: Vec<u32> = adjacency.fan(v).flat_map(|e| [from(next(e)), from(previous(e))]).collect();
        n.sort_unstable();
        n.dedup();
        n
    };
    let (of_a, of_b) = (neighbours(a), neighbours(b));
    let shared = of_a.iter().filter(|v| of_b.binary_search(v).is_ok()).count();
    let inner = adjacency.opposite[h as usize] != NONE;
    let both_open = adjacency.is_boundary_vertex(a) && adjacency.is_boundary_vertex(b);
    // The link condition: only the corners over the edge are common neighbours; and an inner edge must not
    // join two boundaries; and something of each side must be left (no tetrahedron, no lone triangle).
    if shared != if inner { 2 } else { 1 } || (inner && both_open) || of_a.len() + of_b.len() < 2 * shared + 3 {
        return None;
    }
    let around: Vec<u32> = of_a.iter().chain(&of_b).copied().collect();
    if around.iter().any(|&v| touched[v as usize]) {
        return None;
    }
    let fan: Vec<u32> = adjacency.fan(b).collect();
    for e in fan {
        let tri = &mut triangles[e as usize / 3];
        if tri.contains(&a) {
            gone[e as usize / 3] = true;
        } else {
            tri[e as usize % 3] = a;
        }
    }
    Some(around)
}
