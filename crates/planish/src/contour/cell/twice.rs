//! Cells with edges that the surface passes there and back: thin walls, gaps and the tips of sharp edges.
//!
//! A face has up to eight hits on its sides then, by which a walk around it enters the body and leaves it in turn. Joined in
//! pairs by segments that do not cross, they part the face rightly whatever the pairs are; those are taken along which the normals
//! of the hits are most nearly square to the segments. A pair on one edge is the tip of something, and has a face point always, or
//! its segment would lie in two faces. All is told by the face alone, so the loops of neighbours fit.

use super::crossings::{edge_point, joined, off_square};
use super::{AMBIGUOUS, EDGE_FACES, EDGES, FACES, links};
use crate::contour::walk::Cell;
use crate::field::Directed;
use crate::field::directed::Hits;
use glam::{DVec2, DVec3};
use std::collections::HashMap;

/// A hit on an edge of a cell.
#[derive(Clone, Copy, Debug)]
pub struct Pass {
    /// Its name.
    pub id: u32,
    /// The edge of the cell.
    pub edge: u8,
    /// Position.
    pub p: DVec3,
    /// Normal.
    pub n: DVec3,
}

/// All cells with edges that are passed twice.
#[derive(Default)]
pub struct TwicePassed {
    /// For the least node of each cell its edges and the names of the first hits on them.
    cells: HashMap<[u32; 3], Vec<(u8, u32)>>,
}

/// The hits of a cell, and its loops over them.
pub struct Passes {
    /// The hits.
    pub hits: Vec<Pass>,
    /// For each hit that which follows in its loop, and the face in which the segment to it lies.
    pub next: Vec<(usize, u8)>,
}

/// A segment of a face: the hit by which a walk around it enters the body, seen against its axis from outside, and that by which
/// it leaves.
type Segment = [usize; 2];

impl TwicePassed {
    /// Those of a field.
    pub fn new(field: &Directed) -> TwicePassed {
        let mut cells: HashMap<[u32; 3], Vec<(u8, u32)>> = HashMap::new();
        let lattice = &field.lattice;
        for (axis, first) in field.first_twice_names().into_iter().enumerate() {
            let Hits { start, at, .. } = &field.twice[axis];
            for row in 0..start.len().saturating_sub(1) {
                let (j, k) = (row % lattice.nodes(1), row / lattice.nodes(1));
                for n in (start[row]..start[row + 1]).step_by(2) {
                    let node = [at[n as usize] as usize, j, k];
                    for (edge, ends) in (4 * axis..4 * axis + 4).map(|e| (e as u8, EDGES[e])) {
                        // The cell of which this is that edge.
                        let place = [0, 1, 2].map(|a| node[a].checked_sub(ends[0] >> a & 1));
                        if let [Some(x), Some(y), Some(z)] = place
                            && [x, y, z].iter().zip(&lattice.cells).all(|(at, cells)| at < cells)
                        {
                            cells.entry([x, y, z].map(|x| x as u32)).or_default().push((edge, first + n));
                        }
                    }
                }
            }
        }
        TwicePassed { cells }
    }

    /// True if the cell has such an edge.
    pub fn contains(&self, at: [usize; 3]) -> bool {
        !self.cells.is_empty() && self.cells.contains_key(&at.map(|x| x as u32))
    }

    /// All of the cells that are known, in the order of z, y, x.
    pub fn cells(&self, field: &Directed) -> Vec<Cell> {
        let mut places: Vec<[u32; 3]> = self.cells.keys().copied().collect();
        places.sort_unstable_by_key(|at| [at[2], at[1], at[0]]);
        places.into_iter().filter_map(|at| cell(field, at.map(|x| x as usize))).collect()
    }

    /// The hits of a cell on its edges, those that are passed twice in the order along them.
    pub fn hits(&self, field: &Directed, cell: &Cell) -> Vec<Pass> {
        let own = self.cells.get(&cell.at.map(|x| x as u32)).map_or(&[][..], Vec::as_slice);
        let (base, twice) = (field.first_names(), field.first_twice_names());
        let mut found = Vec::with_capacity(12);
        for (e, ends) in EDGES.iter().enumerate() {
            let axis = e / 4;
            let mut add = |id: u32, hits: &Hits, n: u32| {
                let hit = &hits.hits[n as usize];
                found.push(Pass { id, edge: e as u8, p: edge_point(field, cell, e, hit.t), n: hit.normal });
            };
            if cell.config >> ends[0] & 1 != cell.config >> ends[1] & 1 {
                add(base[axis] + cell.hit[e], &field.axes[axis], cell.hit[e]);
            } else if let Some(&(_, name)) = own.iter().find(|(edge, _)| *edge as usize == e) {
                [name, name + 1].into_iter().for_each(|id| add(id, &field.twice[axis], id - twice[axis]));
            }
        }
        found
    }

    /// The hits of a cell with its loops.
    pub fn passes(&self, field: &Directed, cell: &Cell) -> Passes {
        let hits = self.hits(field, cell);
        let mut next = vec![(usize::MAX, 0); hits.len()];
        for face in 0..6 {
            for [enter, leave] in segments(field, cell, &hits, face) {
                // Seen from the other side a walk around the face goes the other way.
                let [from, to] = if face % 2 == 0 { [enter, leave] } else { [leave, enter] };
                next[from] = (to, face as u8);
            }
        }
        Passes { hits, next }
    }
}

/// A cell by its least node; `None` if a corner is of unknown side.
fn cell(field: &Directed, at: [usize; 3]) -> Option<Cell> {
    let node = |c: usize| [0, 1, 2].map(|a| at[a] + (c >> a & 1));
    let mut cell = Cell { at, config: 0, hit: [u32::MAX; 12] };
    for c in 0..8 {
        let [i, j, k] = node(c);
        match field.sides.at(field.lattice.row(j, k), i) {
            0 => {}
            1 => cell.config |= 1 << c,
            _ => return None,
        }
    }
    for (e, ends) in EDGES.iter().enumerate() {
        if cell.config >> ends[0] & 1 != cell.config >> ends[1] & 1 {
            let [i, j, k] = node(ends[0]);
            let (places, first) = field.axes[e / 4].row(field.lattice.row(j, k));
            cell.hit[e] = (first + places.binary_search(&(i as u32)).ok()?) as u32;
        }
    }
    Some(cell)
}

/// The segments in a face of a cell.
fn segments(field: &Directed, cell: &Cell, hits: &[Pass], face: usize) -> Vec<Segment> {
    let (axis, far) = (face / 2, face & 1);
    let corners = FACES[2 * axis].map(|c| c | far << axis);
    let is_inside = |c: usize| cell.config >> c & 1 != 0;
    // The hits in their order around the face, and whether the body is entered there.
    let mut around: Vec<(usize, bool)> = Vec::with_capacity(8);
    let mut inside = is_inside(corners[0]);
    let mut is_twice = false;
    for m in 0..4 {
        let (from, to) = (corners[m], corners[(m + 1) % 4]);
        let e = EDGES.iter().position(|ends| *ends == [from.min(to), from.max(to)]).unwrap_or(0);
        let mut on_edge: Vec<usize> = (0..hits.len()).filter(|&h| hits[h].edge as usize == e).collect();
        if from > to {
            on_edge.reverse();
        }
        is_twice |= on_edge.len() == 2;
        for h in on_edge {
            around.push((h, !inside));
            inside = !inside;
        }
    }
    if !is_twice {
        // As of any other cell.
        let ambiguous = AMBIGUOUS[cell.config as usize] & 1 << face;
        let chain = links(cell.config, if ambiguous == 0 { 0 } else { joined(field, cell, ambiguous) });
        let of = |h: usize| -> Option<Segment> {
            let e = hits[h].edge as usize;
            let to = hits.iter().position(|other| other.edge == chain.next[e])?;
            let is_here = chain.face[e] as usize == face && chain.next[e] < 12 && EDGE_FACES[e] >> face & 1 != 0;
            is_here.then_some(if far == 0 { [h, to] } else { [to, h] })
        };
        return around.iter().filter_map(|&(h, _)| of(h)).collect();
    }
    let flat = |p: DVec3| DVec2::new(p[(axis + 1) % 3], p[(axis + 2) % 3]);
    let segment =
        |i: usize, j: usize| if around[i].1 { [around[i].0, around[j].0] } else { [around[j].0, around[i].0] };
    let off = |i: usize, j: usize| off_square(segment(i, j).map(|h| [flat(hits[h].p), flat(hits[h].n)]));
    let n = around.len();
    let off: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| if i == j { 0.0 } else { off(i, j) }).collect()).collect();
    paired(&off, 0, n).1.into_iter().map(|(i, j)| segment(i, j)).collect()
}

/// The pairs of neighbours `from..to` around a face that do not cross and cost least together, with their cost.
fn paired(cost: &[Vec<f64>], from: usize, to: usize) -> (f64, Vec<(usize, usize)>) {
    let mut best = (f64::INFINITY, Vec::new());
    if from >= to {
        return (0.0, Vec::new());
    }
    for other in (from + 1..to).step_by(2) {
        let (inner, outer) = (paired(cost, from + 1, other), paired(cost, other + 1, to));
        let sum = cost[from][other] + inner.0 + outer.0;
        if sum < best.0 {
            best = (sum, [vec![(from, other)], inner.1, outer.1].concat());
        }
    }
    best
}

/// The segments in the face at the least node of a cell along `axis`.
pub fn low_segments(field: &Directed, cell: &Cell, hits: &[Pass], axis: usize) -> Vec<[Pass; 2]> {
    segments(field, cell, hits, 2 * axis).into_iter().map(|s| s.map(|h| hits[h])).collect()
}
