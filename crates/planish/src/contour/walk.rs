//! All cells that the surface passes, row by row.
//!
//! The sides of four neighbouring rows are words of bits; a cell whose eight corners are not alike is a set bit of a few
//! operations on them, 64 cells at a time. Its hits are the next ones of the eight lists of edges around the row of
//! cells, so nothing is searched (in the spirit of flying edges, Schroeder et al. 2015).

use super::cell::CROSSED;
use crate::field::{Directed, directed};

/// A cell that the surface passes.
#[derive(Clone)]
pub struct Cell {
    /// Its least node.
    pub at: [usize; 3],
    /// Bits of the inside corners.
    pub config: u8,
    /// For each crossed edge the number of its hit in the list of the edge's direction.
    pub hit: [u32; 12],
}

/// Bits of the rows of one plane.
struct Plane {
    inside: Vec<u64>,
    known: Vec<u64>,
    words: usize,
}

impl Plane {
    fn new(field: &Directed) -> Plane {
        let (words, ny) = (field.lattice.words(), field.lattice.nodes(1));
        Plane { inside: vec![0; words * ny], known: vec![0; words * ny], words }
    }

    /// Becomes the plane of nodes `(., ., k)`.
    fn read(&mut self, field: &Directed, k: usize) {
        let rows = self.inside.chunks_exact_mut(self.words).zip(self.known.chunks_exact_mut(self.words));
        rows.enumerate().for_each(|(j, (inside, known))| field.sides.bits(field.lattice.row(j, k), inside, known));
    }

    fn inside(&self, j: usize) -> &[u64] {
        &self.inside[j * self.words..(j + 1) * self.words]
    }

    fn known(&self, j: usize) -> &[u64] {
        &self.known[j * self.words..(j + 1) * self.words]
    }
}

/// Calls `visit` for all cells of the layers `from..to` that the surface passes, in the order of z, y, x. Cells with a
/// corner of unknown side are left out.
pub fn walk(field: &Directed, from: usize, to: usize, mut visit: impl FnMut(&Cell)) {
    let lattice = &field.lattice;
    let (mut low, mut high) = (Plane::new(field), Plane::new(field));
    low.read(field, from);
    for k in from..to {
        high.read(field, k + 1);
        for j in 0..lattice.cells[1] {
            let rows = [(j, k), (j + 1, k), (j, k + 1), (j + 1, k + 1)].map(|(j, k)| lattice.row(j, k));
            // A row begins outside: where no side changes all is outside.
            if rows.iter().any(|&r| field.sides.start[r] != field.sides.start[r + 1]) {
                row_of_cells(field, [j, k], rows, &low, &high, &mut visit);
            }
        }
        std::mem::swap(&mut low, &mut high);
    }
}

fn row_of_cells(
    field: &Directed,
    [j, k]: [usize; 2],
    rows: [usize; 4],
    low: &Plane,
    high: &Plane,
    visit: &mut impl FnMut(&Cell),
) {
    let sides = [low.inside(j), low.inside(j + 1), high.inside(j), high.inside(j + 1)];
    let known = [low.known(j), low.known(j + 1), high.known(j), high.known(j + 1)];
    // Next hit on the edges along x of the four rows, and along y and z between them.
    let lists = [(0, 0), (0, 1), (0, 2), (0, 3), (1, 0), (1, 2), (2, 0), (2, 1)];
    let lists = lists.map(|(axis, row): (usize, usize)| (&field.axes[axis], rows[row]));
    let mut next = lists.map(|(hits, row)| hits.start[row]);
    let mut cell = Cell { at: [0, j, k], config: 0, hit: [u32::MAX; 12] };
    let past = |bits: &[u64], w: usize, end: u64| bits[w] >> 1 | bits.get(w + 1).map_or(end, |b| b << 63);
    for w in 0..low.words {
        // Bits of the corners of 64 cells, in their order.
        let mut corners = [0; 8];
        let (mut or, mut and) = (0, !0);
        for (s, side) in sides.iter().enumerate() {
            (corners[2 * s], corners[2 * s + 1]) = (side[w], past(side, w, 0));
            or |= corners[2 * s] | corners[2 * s + 1];
            and &= corners[2 * s] & corners[2 * s + 1];
        }
        let mut rest = or & !and & directed::below(field.lattice.cells[0], w);
        if rest != 0 && field.sides.unknown {
            rest = known.iter().fold(rest, |rest, known| rest & known[w] & past(known, w, 1 << 63));
        }
        while rest != 0 {
            let b = rest.trailing_zeros();
            let i = 64 * w + b as usize;
            rest &= rest - 1;
            cell.at[0] = i;
            cell.config = 0;
            for (c, bits) in corners.iter().enumerate() {
                cell.config |= ((bits >> b & 1) as u8) << c;
            }
            let crossed = CROSSED[cell.config as usize] as u32;
            if field.sides.unknown {
                // Cells may have been left out, with their hits.
                for ((hits, row), next) in lists.iter().zip(&mut next) {
                    while *next < hits.start[row + 1] && (hits.at[*next as usize] as usize) < i {
                        *next += 1;
                    }
                }
            }
            cell.hit[..4].copy_from_slice(&next[..4]);
            for (e, next) in next[..4].iter_mut().enumerate() {
                *next += crossed >> e & 1;
            }
            // Edges 4 and 5, 6 and 7, 8 and 9, 10 and 11 lie in one list: at this node and at the next.
            for (pair, next) in next[4..].iter_mut().enumerate() {
                let e = 4 + 2 * pair;
                cell.hit[e] = *next;
                *next += crossed >> e & 1;
                cell.hit[e + 1] = *next;
            }
            visit(&cell);
        }
    }
}
