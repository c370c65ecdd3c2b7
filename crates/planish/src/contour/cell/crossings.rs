//! What a directed field says of one cell: its values at the corners, where its edges are crossed, and which inside corners
//! of an ambiguous face are joined.
//!
//! See `docs/methods/contour.md`, steps 1 and 6.

use super::{EDGES, joined_by_hits, joined_by_values};
use crate::contour::walk::Cell;
use crate::field::Directed;
use glam::DVec3;

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
                let t = |from: usize, to: usize| {
                    let e = EDGES.iter().position(|e| e == &[from, to]).unwrap_or(0);
                    field.axes[e / 4].hits[cell.hit[e] as usize].t
                };
                let t = [
                    t(corner(0, 0), corner(1, 0)),
                    t(corner(0, 1), corner(1, 1)),
                    t(corner(0, 0), corner(0, 1)),
                    t(corner(1, 0), corner(1, 1)),
                ];
                joined_by_hits(t, cell.config >> corner(0, 0) & 1 != 0)
            }
        };
        joined |= (yes as u8) << f;
    }
    joined
}

/// The point at `t` on edge `e` of a cell.
pub fn edge_point(field: &Directed, cell: &Cell, e: usize, t: f64) -> DVec3 {
    let c = EDGES[e][0];
    let mut p = field.lattice.node(cell.at[0] + (c & 1), cell.at[1] + (c >> 1 & 1), cell.at[2] + (c >> 2 & 1));
    p[e / 4] += t * field.lattice.step[e / 4];
    p
}
