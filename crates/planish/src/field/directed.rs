//! The directed distance field: sides of the nodes of a lattice, and a hit on every edge whose ends differ.
//!
//! [K01] §3: the distance along an axis is exact where the distance to the surface in any direction is not. Only
//! edges between an inside and an outside node matter, so those are all that is kept, row by row: a
//! row is the line of nodes `(., j, k)` along x and owns the edges that leave its nodes along +x, +y and +z. Sides
//! are kept as the nodes where they change. Memory grows with the surface (plus one word per row and table).

use super::levels::Levels;
use super::{Lattice, Side};
use glam::DVec3;
use rayon::prelude::*;

/// Hits stay this fraction of an edge away from its ends: no triangle shrinks to a point, and what moves is far
/// below any tolerance.
pub const CLEARANCE: f64 = 1.0 / (1u64 << 28) as f64;

/// Where the surface passes an edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Place on the edge, as the fraction from its lower node; `CLEARANCE..=1 - CLEARANCE`.
    pub t: f64,
    /// Unit normal of the surface there, outward.
    pub normal: DVec3,
}

/// A hit with its place: what sources collect, in any order.
#[derive(Clone, Copy, Debug)]
pub struct Placed {
    /// Row of the edge's lower node.
    pub row: u32,
    /// Place of that node in its row.
    pub at: u32,
    /// The hit.
    pub hit: Hit,
}

/// The hits on the edges of one direction, row after row.
#[derive(Clone, Debug, Default)]
pub struct Hits {
    /// First hit of each row, and their number at the end.
    pub start: Vec<u32>,
    /// Place in its row of the lower node of each hit's edge, ascending in each row.
    pub at: Vec<u32>,
    /// The hits.
    pub hits: Vec<Hit>,
}

/// Sides and hits on a lattice.
#[derive(Clone, Debug)]
pub struct Directed {
    /// The lattice.
    pub lattice: Lattice,
    /// Hits on edges along x, y and z.
    pub axes: [Hits; 3],
    /// Hits on edges between two nodes of one side that the surface passes there and back, where the source can tell: two on each,
    /// along it.
    pub twice: [Hits; 3],
    /// Where sides change along the rows.
    pub sides: Sides,
    /// Angle by which the normals are off, degrees ([`super::Field::noise_deg`]).
    pub noise_deg: f64,
    /// Values at the nodes where the source is a scalar grid: what its interpolant does inside cells.
    pub values: Option<Levels>,
    /// Hits that had to be guessed because no source gave one between two sides.
    pub mended: usize,
    /// What is too thin for the lattice, where the source can tell.
    pub thin: Thin,
}

/// Walls and gaps that pass between two nodes of the lattice unseen.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Thin {
    /// Edges of the lattice that the surface passes more than once.
    pub edges: usize,
    /// Those of them of which passes are left out: all but one, or all but two where it passes there and back.
    pub lost: usize,
    /// Share of these in all edges that it passes.
    pub lost_share: f64,
    /// Median width between two passes, along the edge, world units.
    pub width: f64,
}

/// The sides of all nodes: for each row the nodes where a new side begins.
#[derive(Clone, Debug, Default)]
pub struct Sides {
    /// First change of each row, and their number at the end. A row begins outside.
    pub start: Vec<u32>,
    /// `node << 2 | side` with the code of [`code`].
    pub changes: Vec<u32>,
    /// True if any node is unknown.
    pub unknown: bool,
}

/// A side as two bits.
pub fn code(side: Side) -> u32 {
    match side {
        Side::Outside => 0,
        Side::Inside => 1,
        Side::Unknown => 2,
    }
}

impl Sides {
    /// The sides of rows that are given one after the other as changes `(node, side code)`.
    pub fn from_rows(rows: impl IntoIterator<Item = Vec<u32>>) -> Sides {
        let mut sides = Sides { start: vec![0], ..Sides::default() };
        for row in rows {
            sides.changes.extend(row);
            sides.start.push(sides.changes.len() as u32);
        }
        sides.unknown = sides.changes.iter().any(|c| c & 3 == 2);
        sides
    }

    /// Rows of parts, one part after the other.
    pub fn joined(parts: Vec<Sides>) -> Sides {
        let mut all = Sides { start: vec![0], ..Sides::default() };
        for part in parts {
            let first = all.changes.len() as u32;
            all.start.extend(part.start[1..].iter().map(|s| first + s));
            all.changes.extend(part.changes);
            all.unknown |= part.unknown;
        }
        all
    }

    /// Adds a row from its bits.
    pub fn push(&mut self, inside: &[u64], known: &[u64], nodes: usize) {
        let mut last = 0;
        for (w, (&inside, &known)) in inside.iter().zip(known).enumerate() {
            // Bits of a node that differs from the one before.
            let before = |bits: u64, last: bool| bits << 1 | last as u64;
            let unlike = (inside ^ before(inside, last == 1)) & known | (known ^ before(known, last != 2));
            let mut rest = unlike & below(nodes, w);
            while rest != 0 {
                let b = rest.trailing_zeros();
                rest &= rest - 1;
                let now = if known >> b & 1 == 0 { 2 } else { (inside >> b & 1) as u32 };
                if now != last {
                    self.changes.push((64 * w as u32 + b) << 2 | now);
                    last = now;
                }
            }
            self.unknown |= !known & below(nodes, w) != 0;
        }
        self.start.push(self.changes.len() as u32);
    }

    /// Side of node `at` of row `row`, as a [`code`].
    pub fn at(&self, row: usize, at: usize) -> u32 {
        let changes = &self.changes[self.start[row] as usize..self.start[row + 1] as usize];
        let before = changes.partition_point(|c| (c >> 2) as usize <= at);
        if before == 0 { 0 } else { changes[before - 1] & 3 }
    }

    /// Bits of row `row`: inside, and known.
    /// * `inside`, `known` - [`Lattice::words`] words each; bits past the last node are not defined
    pub fn bits(&self, row: usize, inside: &mut [u64], known: &mut [u64]) {
        inside.fill(0);
        known.fill(!0);
        let changes = &self.changes[self.start[row] as usize..self.start[row + 1] as usize];
        for (n, &change) in changes.iter().enumerate() {
            let from = (change >> 2) as usize;
            let to = changes.get(n + 1).map_or(inside.len() * 64, |c| (c >> 2) as usize);
            match change & 3 {
                1 => fill(inside, from, to, true),
                2 => fill(known, from, to, false),
                _ => {}
            }
        }
    }
}

/// Sets bits `from..to`.
fn fill(words: &mut [u64], from: usize, to: usize, value: bool) {
    let to = to.min(words.len() * 64);
    let mut at = from;
    while at < to {
        let (word, bit) = (at / 64, at % 64);
        let count = (64 - bit).min(to - at);
        let mask = if count == 64 { !0 } else { ((1u64 << count) - 1) << bit };
        if value {
            words[word] |= mask
        } else {
            words[word] &= !mask
        }
        at += count;
    }
}

/// Changes of one row from its bits.
pub fn changes_of(inside: &[u64], known: &[u64], nodes: usize) -> Vec<u32> {
    let mut sides = Sides::default();
    sides.push(inside, known, nodes);
    sides.changes
}

impl Hits {
    /// Hits sorted into rows.
    pub fn sorted(rows: usize, placed: Vec<Placed>) -> Hits {
        let mut start = vec![0u32; rows + 1];
        for p in &placed {
            start[p.row as usize + 1] += 1;
        }
        for r in 0..rows {
            start[r + 1] += start[r];
        }
        // A counting sort by row keeps the order that most sources have within a row already.
        let (mut order, mut next) = (vec![0u32; placed.len()], start.clone());
        for (n, p) in placed.iter().enumerate() {
            let at = &mut next[p.row as usize];
            order[*at as usize] = n as u32;
            *at += 1;
        }
        let at = |n: &u32| placed[*n as usize].at;
        for ends in start.windows(2) {
            let row = &mut order[ends[0] as usize..ends[1] as usize];
            if !row.is_sorted_by_key(at) {
                row.sort_by_key(at);
            }
        }
        Hits {
            at: order.iter().map(at).collect(),
            hits: order.iter().map(|&n| placed[n as usize].hit).collect(),
            start,
        }
    }

    /// Rows of parts, one part after the other.
    pub fn joined(parts: Vec<Hits>) -> Hits {
        let count = parts.iter().map(Hits::len).sum();
        let mut all = Hits { start: vec![0], at: Vec::with_capacity(count), hits: Vec::with_capacity(count) };
        for part in parts {
            let first = all.at.len() as u32;
            all.start.extend(part.start[1..].iter().map(|s| first + s));
            all.at.extend(part.at);
            all.hits.extend(part.hits);
        }
        all
    }

    /// The places and number of the first hit of a row.
    pub fn row(&self, row: usize) -> (&[u32], usize) {
        let (a, b) = (self.start[row] as usize, self.start[row + 1] as usize);
        (&self.at[a..b], a)
    }

    /// The hit on the edge that leaves node `at` of `row`.
    pub fn find(&self, row: usize, at: usize) -> Option<Hit> {
        let (places, first) = self.row(row);
        places.binary_search(&(at as u32)).ok().map(|n| self.hits[first + n])
    }

    /// Number of hits.
    pub fn len(&self) -> usize {
        self.at.len()
    }

    /// True if there is none.
    pub fn is_empty(&self) -> bool {
        self.at.is_empty()
    }
}

/// A fraction kept clear of the ends of its edge.
pub fn clear(t: f64) -> f64 {
    // What is no number becomes the middle.
    if t.is_nan() { 0.5 } else { t.clamp(CLEARANCE, 1.0 - CLEARANCE) }
}

/// The hits of a row for which a source gave none: on the edge along an axis from a node of the row.
pub type Missing<'a> = Box<dyn FnMut(usize, usize) -> Hit + 'a>;

impl Directed {
    /// Number of hits on all axes.
    pub fn hit_count(&self) -> usize {
        self.axes.iter().map(Hits::len).sum()
    }

    /// Name of the first hit of each axis where hits are numbered axis after axis.
    pub fn first_names(&self) -> [u32; 3] {
        let [x, y, _] = [0, 1, 2].map(|a| self.axes[a].len() as u32);
        [0, x, x + y]
    }

    /// Number of hits on edges that the surface passes there and back.
    pub fn twice_count(&self) -> usize {
        self.twice.iter().map(Hits::len).sum()
    }

    /// Name of the first of [`Directed::twice`] of each axis: they come after all other hits.
    pub fn first_twice_names(&self) -> [u32; 3] {
        let first = self.hit_count() as u32;
        let [x, y, _] = [0, 1, 2].map(|a| self.twice[a].len() as u32);
        [first, first + x, first + x + y]
    }

    /// Normal of a hit by its name; `None` for other names.
    pub fn normal(&self, name: u32) -> Option<DVec3> {
        let all = self.first_names().into_iter().zip(&self.axes);
        let all = all.chain(self.first_twice_names().into_iter().zip(&self.twice));
        let (base, hits) = all.rev().find(|(base, _)| *base <= name)?;
        hits.hits.get((name - base) as usize).map(|h| h.normal)
    }

    /// Position of hit number `n` of `axis`, which lies in `row`.
    pub fn position(&self, axis: usize, row: usize, n: usize) -> DVec3 {
        self.place(axis, row, &self.axes[axis], n)
    }

    /// Position of number `n` of some hits of `axis`, which lies in `row`.
    pub fn place(&self, axis: usize, row: usize, hits: &Hits, n: usize) -> DVec3 {
        let (j, k) = (row % self.lattice.nodes(1), row / self.lattice.nodes(1));
        let mut p = self.lattice.node(hits.at[n] as usize, j, k);
        p[axis] += hits.hits[n].t * self.lattice.step[axis];
        p
    }

    /// Puts sides and hits together: hits on edges whose ends do not differ are left out, and where two ends differ
    /// without a hit `missing(axis, [i, j, k])` is asked for one.
    ///
    /// * `axes` - hits in rows, at most one on an edge
    ///
    /// The result holds exactly one hit on each edge between inside and outside: what the extractor relies on.
    pub fn assemble(
        lattice: Lattice,
        sides: Sides,
        axes: [Hits; 3],
        missing: &(dyn Fn(usize, [usize; 3]) -> Hit + Sync),
    ) -> Directed {
        let row = |j: usize, k: usize| -> Missing { Box::new(move |axis, i| missing(axis, [i, j, k])) };
        Directed::assemble_rows(lattice, sides, axes, &row)
    }

    /// [`Directed::assemble`] for sources that answer faster row by row: `missing(j, k)` is asked once for each row.
    pub fn assemble_rows<'a>(
        lattice: Lattice,
        sides: Sides,
        axes: [Hits; 3],
        missing: &(dyn Fn(usize, usize) -> Missing<'a> + Sync),
    ) -> Directed {
        let words = lattice.words();
        let (ny, nz) = (lattice.nodes(1), lattice.nodes(2));
        // Per plane: edges that change side, from the bits of each row and the next two, compared with the hits given.
        let planes: Vec<[Plane; 3]> = (0..nz)
            .into_par_iter()
            .map(|k| {
                let mut out: [Plane; 3] = Default::default();
                let mut bits = [(); 3].map(|()| (vec![0; words], vec![0; words]));
                let mut crossing = vec![0u64; words];
                for j in 0..ny {
                    let row = lattice.row(j, k);
                    let next = [Some(row), (j + 1 < ny).then(|| row + 1), (k + 1 < nz).then(|| lattice.row(j, k + 1))];
                    if next.iter().flatten().all(|&row| sides.start[row] == sides.start[row + 1]) {
                        // All is outside.
                        out.iter_mut().for_each(|plane| plane.counts.push(0));
                        continue;
                    }
                    for (&row, (inside, known)) in next.iter().zip(&mut bits) {
                        if let Some(row) = row {
                            sides.bits(row, inside, known);
                        }
                    }
                    let mut missing = missing(j, k);
                    let [(a, known_a), others @ ..] = &bits;
                    for w in 0..words {
                        let shifted = |words: &[u64]| words[w] >> 1 | words.get(w + 1).map_or(0, |n| n << 63);
                        crossing[w] = (a[w] ^ shifted(a)) & known_a[w] & shifted(known_a);
                    }
                    mask_past(&mut crossing, lattice.cells[0]);
                    out[0].take(&axes[0], row, &crossing, |i| missing(0, i));
                    for (axis, (b, known_b)) in (1..).zip(others) {
                        for w in 0..words {
                            let both = if next[axis].is_some() { known_a[w] & known_b[w] } else { 0 };
                            crossing[w] = (a[w] ^ b[w]) & both;
                        }
                        mask_past(&mut crossing, lattice.nodes(0));
                        out[axis].take(&axes[axis], row, &crossing, |i| missing(axis, i));
                    }
                }
                out
            })
            .collect();
        drop(axes);
        let mended = planes.iter().flatten().map(|p| p.mended).sum();
        let axes = [0, 1, 2].map(|axis| {
            let mut all = Hits { start: vec![0], ..Hits::default() };
            for plane in &planes {
                let part = &plane[axis];
                for &count in &part.counts {
                    all.start.push(all.start[all.start.len() - 1] + count);
                }
                all.at.extend(&part.at);
                all.hits.extend(&part.hits);
            }
            all
        });
        let twice = Default::default();
        Directed { lattice, axes, twice, sides, noise_deg: 0.0, values: None, mended, thin: Thin::default() }
    }
}

/// The hits of the rows of one plane.
#[derive(Default)]
struct Plane {
    counts: Vec<u32>,
    at: Vec<u32>,
    hits: Vec<Hit>,
    mended: usize,
}

impl Plane {
    fn take(&mut self, given: &Hits, row: usize, crossing: &[u64], mut missing: impl FnMut(usize) -> Hit) {
        let before = self.at.len();
        let (places, first) = given.row(row);
        let mut n = 0;
        for (w, &word) in crossing.iter().enumerate() {
            let mut rest = word;
            while rest != 0 {
                let i = 64 * w + rest.trailing_zeros() as usize;
                rest &= rest - 1;
                while n < places.len() && (places[n] as usize) < i {
                    n += 1;
                }
                let hit = if n < places.len() && places[n] as usize == i {
                    given.hits[first + n]
                } else {
                    self.mended += 1;
                    missing(i)
                };
                self.at.push(i as u32);
                self.hits.push(hit);
            }
        }
        self.counts.push((self.at.len() - before) as u32);
    }
}

/// Clears bits from `count` on.
pub fn mask_past(words: &mut [u64], count: usize) {
    words.iter_mut().enumerate().for_each(|(w, word)| *word &= below(count, w));
}

/// Bits of word `w` of a row that stand for places below `count`.
pub fn below(count: usize, w: usize) -> u64 {
    match count.saturating_sub(64 * w) {
        0 => 0,
        n if n >= 64 => !0,
        n => (1 << n) - 1,
    }
}
