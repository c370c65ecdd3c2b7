//! Fewer cells from the same cones: a row of arcs that goes straight through regular nodes from boundary to boundary, or
//! back to its start, parts two strips of cells and may go.
//!
//! What is left when all such rows are gone is the base complex of the quads (Bommes, Lempfer, Kobbelt, *Global Structure
//! Optimization of Quadrilateral Meshes*, 2011).

pub(super) mod chords;

use super::complex::Complex;
use crate::mesh::NONE;
use std::collections::{BTreeMap, BTreeSet};

/// A row of arcs between two strips.
struct Row {
    /// Its half-arcs, from end to end.
    halves: Vec<u32>,
    /// At each of its nodes the half-arcs that leave to the left and to the right.
    across: Vec<[u32; 2]>,
}

/// Dissolves rows of arcs of a complex of four-sided cells, the cheapest first, until none is left that may go.
/// * `cost` - of a row, given the complex, the pairs of cells that would become one, and for each cell those that it was
///   joined from; `None` if it must stay
pub(super) fn join(complex: &mut Complex, cost: impl Fn(&Complex, &[[u32; 2]], &[Vec<u32>]) -> Option<f64>) {
    let mut members: Vec<Vec<u32>> = (0..complex.cells.len() as u32).map(|c| vec![c]).collect();
    loop {
        let mut best: Option<(f64, Row)> = None;
        for row in rows(complex) {
            let pairs: Vec<[u32; 2]> = row.halves.iter().map(|&h| [complex.cell(h), complex.cell(h ^ 1)]).collect();
            if let Some(price) = cost(complex, &pairs, &members)
                && best.as_ref().is_none_or(|b| price < b.0)
            {
                best = Some((price, row));
            }
        }
        let Some((_, row)) = best else { break };
        for &half in &row.halves {
            let gone = std::mem::take(&mut members[complex.cell(half ^ 1) as usize]);
            members[complex.cell(half) as usize].extend(gone);
        }
        dissolve(complex, &row);
    }
    compact(complex);
}

/// The rows that may be dissolved without harm to cones, corners and lines.
fn rows(complex: &Complex) -> Vec<Row> {
    let stars = complex.stars();
    let mut seen: BTreeSet<u32> = BTreeSet::new();
    let mut rows = Vec::new();
    for a in complex.live_arcs() {
        if seen.contains(&a) || !complex.arc(2 * a).kind.is_smooth() {
            continue;
        }
        let row = row_of(complex, &stars, a);
        seen.insert(a);
        if let Some(row) = row {
            seen.extend(row.halves.iter().map(|h| h / 2));
            rows.push(row);
        }
    }
    rows
}

/// The half-arc straight ahead at the end of `half`, if there is one, and those to the left and right; `None` if the node
/// is not regular or stays.
fn ahead(complex: &Complex, stars: &[Vec<u32>], half: u32) -> Option<(Option<u32>, [u32; 2])> {
    let node = complex.to(half);
    let star = &stars[node as usize];
    let i = star.iter().position(|&h| h == half ^ 1)?;
    let open = star.iter().any(|&h| complex.cell(h) == NONE);
    let kinds = |a: u32, b: u32| complex.arc(a).kind == complex.arc(b).kind;
    let inner = star.len() == 4 && !open;
    let rim = star.len() == 3 && open && i == 1;
    if complex.nodes[node as usize].stays || !(inner || rim) {
        return None;
    }
    // Counter-clockwise from the way back: right, ahead, left.
    let (right, straight, left) = match inner {
        true => (star[(i + 1) % 4], Some(star[(i + 2) % 4]), star[(i + 3) % 4]),
        false => (star[2], None, star[0]),
    };
    kinds(left, right).then_some((straight, [left, right]))
}

/// The row through arc `a`, if it may go.
fn row_of(complex: &Complex, stars: &[Vec<u32>], a: u32) -> Option<Row> {
    // Back to its start, which is the arc itself if the row is closed.
    let mut half = 2 * a;
    let closed = loop {
        match ahead(complex, stars, half ^ 1)?.0 {
            Some(h) if h ^ 1 == 2 * a => break true,
            Some(h) if h == 2 * a => return None, // meets itself
            Some(h) => half = h ^ 1,
            None => break false,
        }
        if half == 2 * a + 1 {
            return None;
        }
    };
    let start = if closed { 2 * a } else { half };
    let mut row = Row { halves: vec![start], across: Vec::new() };
    if !closed {
        let [left, right] = ahead(complex, stars, start ^ 1)?.1;
        row.across.push([right, left]); // seen the other way
    }
    loop {
        let (next, across) = ahead(complex, stars, row.halves[row.halves.len() - 1])?;
        row.across.push(across);
        match next {
            Some(h) if h != start => row.halves.push(h),
            _ => break,
        }
    }
    let arcs: Vec<u32> = row.halves.iter().map(|h| h / 2).chain(row.across.iter().flatten().map(|h| h / 2)).collect();
    let cells: Vec<u32> = row.halves.iter().flat_map(|&h| [complex.cell(h), complex.cell(h ^ 1)]).collect();
    let smooth = row.halves.iter().all(|&h| complex.arc(h).kind.is_smooth());
    // A strip as wide as its way around would get sides from a node to itself.
    let ends = row.across.iter().all(|&[left, right]| complex.to(left) != complex.to(right));
    (smooth && ends && apart(&arcs) && apart(&cells)).then_some(row)
}

/// True if none of these is there twice.
fn apart(list: &[u32]) -> bool {
    list.iter().collect::<BTreeSet<_>>().len() == list.len()
}

/// Takes a row out: the arcs across it and the cells on both sides become one each.
fn dissolve(complex: &mut Complex, row: &Row) {
    let mut name: BTreeMap<u32, u32> = BTreeMap::new();
    for &[left, right] in &row.across {
        let merged = complex.join_arcs(left, right);
        for (old, new) in [(left ^ 1, 0), (right, 0), (left, 1), (right ^ 1, 1)] {
            name.insert(old, 2 * merged + new);
        }
    }
    for &half in &row.halves {
        let [kept, gone] = [complex.cell(half), complex.cell(half ^ 1)];
        let sides = |cell: u32, first: u32| {
            let mut sides = complex.loop_of(cell).to_vec();
            let at = sides.iter().position(|&h| h == first).unwrap_or(0);
            sides.rotate_left(at);
            sides
        };
        let (own, other) = (sides(kept, half), sides(gone, half ^ 1));
        let of = |h: u32| name.get(&h).copied().unwrap_or(h);
        let around = vec![of(own[1]), of(own[2]), of(own[3]), of(other[2])];
        complex.cells[gone as usize] = None;
        for &h in &around {
            if let Some(arc) = &mut complex.arcs[h as usize / 2] {
                arc.cells[h as usize % 2] = kept;
            }
        }
        complex.cells[kept as usize] = Some(around);
    }
    row.halves.iter().for_each(|h| complex.arcs[*h as usize / 2] = None);
}

/// Gives nodes, arcs and cells new numbers without gaps.
fn compact(complex: &mut Complex) {
    let mut node = vec![NONE; complex.nodes.len()];
    let mut nodes = Vec::new();
    let mut arc = vec![NONE; complex.arcs.len()];
    let mut arcs = Vec::new();
    for a in complex.live_arcs().collect::<Vec<_>>() {
        let mut old = complex.arc(2 * a).clone();
        for n in &mut old.nodes {
            if node[*n as usize] == NONE {
                node[*n as usize] = nodes.len() as u32;
                nodes.push(complex.nodes[*n as usize]);
            }
            *n = node[*n as usize];
        }
        arc[a as usize] = arcs.len() as u32;
        arcs.push(old);
    }
    let mut cells: Vec<Option<Vec<u32>>> = Vec::new();
    for c in complex.live_cells() {
        let sides: Vec<u32> = complex.loop_of(c).iter().map(|h| 2 * arc[*h as usize / 2] + h % 2).collect();
        sides.iter().for_each(|&h| arcs[h as usize / 2].cells[h as usize % 2] = cells.len() as u32);
        cells.push(Some(sides));
    }
    *complex = Complex { nodes, arcs: arcs.into_iter().map(Some).collect(), cells };
}
