//! All cells that the surface passes, row by row.
//!
//! The sides of four neighbouring rows are words of bits; a cell whose eight corners are not alike is a set bit of a few
//! operations on them, 64 cells at a time. Its hits are the next ones of the eight lists of edges around the row of
//! cells, so nothing is searched (in the spirit of flying edges, Schroeder et al. 2015).

use super::cell::CROSSED;
use crate::field::{Directed, directed};

/// A cell that the surface passes.
pub struct Cell {
    /// Its least node.
    pub at: [usize; 3],
    /// Bits of the inside corners.
    pub config: u8,
    /// For each crossed edge the number of its hit in the list of the edge's direction.
    pub hit: [u32; 12],
}

/// Bits of the rows of one plane.
pub struct Plane {
    inside: Vec<u64>,
    known: Vec<u64>,
    words: usize,
}

impl Plane {
    /// The plane of nodes `(., ., k)`.
    pub fn of(field: &Directed, k: usize) -> Plane {
        let (words, ny) = (field.lattice.words(), field.lattice.nodes(1));
        let mut plane = Plane { inside: vec![0; words * ny], known: vec![0; words * ny], words };
        for j in 0..ny {
            let (a, b) = (j * words, (j + 1) * words);
            field.sides.bits(field.lattice.row(j, k), &mut plane.inside[a..b], &mut plane.known[a..b]);
        }
        plane
    }
}

/// Calls `visit` for all cells of the layers `from..to` that the surface passes, in the order of z, y, x. Cells with a
/// corner of unknown side are left out.
pub fn walk(field: &Directed, from: usize, to: usize, mut visit: impl FnMut(&Cell)) {
    let lattice = &field.lattice;
    let words = lattice.words();
    let mut low = Plane::of(field, from);
    let mut active = vec![0u64; words];
    for k in from..to {
        let high = Plane::of(field, k + 1);
        for j in 0..lattice.cells[1] {
            let row = |p: &Plane, j: usize, w: usize| p.inside.get(j * p.words + w).copied().unwrap_or(0);
            let get = |p: &Plane, j: usize, w: usize, past: u64| {
                if w < words { row(p, j, w) } else { past }
            };
            let mut any_active = 0;
            for w in 0..words {
                let mut or = 0;
                let mut and = !0u64;
                for (p, j) in [(&low, j), (&low, j + 1), (&high, j), (&high, j + 1)] {
                    let a = row(p, j, w);
                    let b = a >> 1 | get(p, j, w + 1, 0) << 63;
                    or |= a | b;
                    and &= a & b;
                }
                active[w] = or & !and;
                any_active |= active[w];
            }
            if any_active == 0 {
                continue;
            }
            if field.sides.unknown {
                for (p, j) in [(&low, j), (&low, j + 1), (&high, j), (&high, j + 1)] {
                    let known = &p.known[j * words..(j + 1) * words];
                    for w in 0..words {
                        active[w] &= known[w] & (known[w] >> 1 | known.get(w + 1).map_or(1 << 63, |n| n << 63));
                    }
                }
            }
            directed::mask_past(&mut active, lattice.cells[0]);
            row_of_cells(field, [j, k], &low, &high, &active, &mut visit);
        }
        low = high;
    }
}

fn row_of_cells(
    field: &Directed,
    [j, k]: [usize; 2],
    low: &Plane,
    high: &Plane,
    active: &[u64],
    visit: &mut impl FnMut(&Cell),
) {
    let lattice = &field.lattice;
    let row = |dj: usize, dk: usize| lattice.row(j + dj, k + dk);
    let lists: [(&[u32], usize); 8] = [
        field.axes[0].row(row(0, 0)),
        field.axes[0].row(row(1, 0)),
        field.axes[0].row(row(0, 1)),
        field.axes[0].row(row(1, 1)),
        field.axes[1].row(row(0, 0)),
        field.axes[1].row(row(0, 1)),
        field.axes[2].row(row(0, 0)),
        field.axes[2].row(row(1, 0)),
    ];
    let words = low.words;
    let sides = [
        &low.inside[j * words..(j + 1) * words],
        &low.inside[(j + 1) * words..(j + 2) * words],
        &high.inside[j * words..(j + 1) * words],
        &high.inside[(j + 1) * words..(j + 2) * words],
    ];
    let mut cursor = [0usize; 8];
    let mut cell = Cell { at: [0, j, k], config: 0, hit: [u32::MAX; 12] };
    for (w, &word) in active.iter().enumerate() {
        let mut rest = word;
        while rest != 0 {
            let i = 64 * w + rest.trailing_zeros() as usize;
            rest &= rest - 1;
            let bit = |side: &[u64], i: usize| (side[i / 64] >> (i % 64) & 1) as u8;
            let mut config = 0;
            for (s, side) in sides.iter().enumerate() {
                config |= bit(side, i) << (2 * s) | bit(side, i + 1) << (2 * s + 1);
            }
            cell.at[0] = i;
            cell.config = config;
            let crossed = CROSSED[config as usize];
            for (l, (places, first)) in lists.iter().enumerate() {
                let mut c = cursor[l];
                while c < places.len() && (places[c] as usize) < i {
                    c += 1;
                }
                cursor[l] = c;
                if l < 4 {
                    cell.hit[l] = (first + c) as u32;
                } else {
                    // y edges 4, 5 and 6, 7; z edges 8, 9 and 10, 11: at this node and at the next.
                    let e = 2 * l - 4;
                    cell.hit[e] = (first + c) as u32;
                    cell.hit[e + 1] = (first + c) as u32 + (crossed >> e & 1) as u32;
                }
            }
            visit(&cell);
        }
    }
}
