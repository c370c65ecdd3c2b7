//! What a directed field says of one cell: its values at the corners, where its edges are crossed, and which inside corners
//! of an ambiguous face are joined.
//!
//! See `docs/methods/contour.md`, steps 1 and 6.

use super::{EDGES, joined_by_hits, joined_by_values};
use crate::contour::walk::Cell;
use crate::field::Directed;
use glam::{DVec2, DVec3};
use std::cmp::Ordering;

/// Values of a scalar grid at the corners of a cell.
pub fn values(field: &Directed, cell: &Cell) -> Option<[f64; 8]> {
    let levels = field.values.as_ref()?;
    let corner = |c: usize| [cell.at[0] + (c & 1), cell.at[1] + (c >> 1 & 1), cell.at[2] + (c >> 2 & 1)];
    Some(std::array::from_fn(|c| levels.at(corner(c))))
}

/// Bits of the ambiguous faces in which the inside corners are joined.
pub fn joined(field: &Directed, cell: &Cell, ambiguous: u8) -> u8 {
    let values = values(field, cell);
    let mut joined = 0;
    for f in (0..6).filter(|f| ambiguous >> f & 1 != 0) {
        let axis = f / 2;
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let corner = |a: usize, b: usize| (f & 1) << axis | a << u | b << v;
        let yes = match &values {
            Some(values) => {
                joined_by_values([corner(0, 0), corner(1, 0), corner(0, 1), corner(1, 1)].map(|c| values[c]))
            }
            None => {
                let hit = |from: usize, to: usize| {
                    let e = EDGES.iter().position(|e| e == &[from, to]).unwrap_or(0);
                    let hit = &field.axes[e / 4].hits[cell.hit[e] as usize];
                    let p = edge_point(field, cell, e, hit.t);
                    (hit.t, [p, hit.normal].map(|x| DVec2::new(x[u], x[v])))
                };
                let hits = [
                    hit(corner(0, 0), corner(1, 0)),
                    hit(corner(0, 1), corner(1, 1)),
                    hit(corner(0, 0), corner(0, 1)),
                    hit(corner(1, 0), corner(1, 1)),
                ];
                let origin_inside = cell.config >> corner(0, 0) & 1 != 0;
                let by_normals =
                    if field.noise_deg == 0.0 { joined_by_normals(hits.map(|h| h.1), origin_inside) } else { None };
                by_normals.unwrap_or_else(|| joined_by_hits(hits.map(|h| h.0), origin_inside))
            }
        };
        joined |= (yes as u8) << f;
    }
    joined
}

/// How far two normals of a face are from square to the segment between their hits: 0 if they are square to it, 2 if along it.
/// * `ends` - places and normals of the hit by which the body is entered on a walk around the face from its first axis to its second
///   clockwise, and of that by which it is left
pub fn off_square(ends: [[DVec2; 2]; 2]) -> f64 {
    let [[enter, _], [leave, _]] = ends;
    // The body is to the left.
    let out = -(leave - enter).perp().normalize_or_zero();
    ends.iter().map(|[_, n]| 1.0 - n.normalize_or_zero().dot(out)).sum()
}

/// In a face with alternating corners: true if the inside corners are joined, by the normals; `None` if they do not tell.
/// * `hits` - places and normals on the edges u at v = 0, u at v = 1, v at u = 0, v at u = 1
fn joined_by_normals([u0, u1, v0, v1]: [[DVec2; 2]; 4], origin_inside: bool) -> Option<bool> {
    // Around the first and the last corner, or around the two others; clockwise the edges are v0, u1, v1, u0.
    let around_first = [[u0, v0], [u1, v1]];
    let around_others = [[v0, u1], [v1, u0]];
    // A walk enters the body by the first of two edges around a corner that is inside.
    let turned =
        |pairs: [[[DVec2; 2]; 2]; 2], is_inside: bool| if is_inside { pairs } else { pairs.map(|[a, b]| [b, a]) };
    let off = |pairs: [[[DVec2; 2]; 2]; 2]| pairs.into_iter().map(off_square).sum::<f64>();
    let first = off(turned(around_first, origin_inside));
    let others = off(turned(around_others, !origin_inside));
    match first.total_cmp(&others) {
        Ordering::Equal => None,
        less => Some((less == Ordering::Greater) == origin_inside),
    }
}

/// The point at `t` on edge `e` of a cell.
pub fn edge_point(field: &Directed, cell: &Cell, e: usize, t: f64) -> DVec3 {
    let c = EDGES[e][0];
    let mut p = field.lattice.node(cell.at[0] + (c & 1), cell.at[1] + (c >> 1 & 1), cell.at[2] + (c >> 2 & 1));
    p[e / 4] += t * field.lattice.step[e / 4];
    p
}
