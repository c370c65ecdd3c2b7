//! From labelled faces to the complex: where nodes lie and how arcs run.
//!
//! See `docs/methods/layout.md`, step 2.

use super::{Ground, next_around};
use crate::layout::complex::{Arc, Complex, Node};
use crate::mesh::{NONE, next};
use crate::network::CurveKind;
use crate::network::imprint::Place;
use std::collections::HashMap;

/// A sharp line or boundary that turns by more than this over a quarter of a patch side has a corner there.
const CORNER_TURN_DEG: f64 = 50.0;

/// One that turns by more than this has a corner there however near others end: no side of a patch follows it back.
const SHARP_TURN_DEG: f64 = 100.0;

/// Nodes put on a closed line that meets no other.
const LOOP_NODES: usize = 4;

/// Vertices where a sharp line or the boundary has a corner. `reach` is the length over which the turn is
/// measured.
pub(in crate::layout) fn corners(ground: &Ground, reach: f64) -> Vec<bool> {
    let mesh = ground.mesh;
    let from = |h: u32| mesh.triangles[h as usize / 3][h as usize % 3];
    let mut around: HashMap<u32, Vec<u32>> = HashMap::new();
    for h in 0..ground.sharp.len() as u32 {
        let o = ground.adjacency.opposite[h as usize];
        if o == NONE || (ground.sharp[h as usize] && h < o) {
            let (a, b) = (from(h), from(next(h)));
            around.entry(a).or_default().push(b);
            around.entry(b).or_default().push(a);
        }
    }
    let mut corner = vec![false; mesh.points.len()];
    let mut turn: HashMap<u32, f64> = HashMap::new();
    let walk = |v: u32, first: u32| {
        let (mut before, mut at, mut left) = (v, first, reach);
        let mut seen = vec![first];
        loop {
            left -= mesh.points[before as usize].distance(mesh.points[at as usize]);
            match around[&at][..] {
                [x, y] if left > 0.0 && at != v => {
                    let ahead = if x == before { y } else { x };
                    before = at;
                    at = ahead;
                    seen.push(at);
                }
                _ => return (at, seen),
            }
        }
    };
    for (&v, list) in &around {
        let [x, y] = list[..] else {
            corner[v as usize] = true;
            continue;
        };
        let p = mesh.points[v as usize];
        let arms = [x, y].map(|w| (mesh.points[walk(v, w).0 as usize] - p).normalize_or_zero());
        turn.insert(v, (-arms[0].dot(arms[1])).clamp(-1.0, 1.0).acos().to_degrees());
    }
    for (&v, &angle) in &turn {
        if angle < CORNER_TURN_DEG {
            continue;
        }
        let near = around[&v].iter().flat_map(|&w| walk(v, w).1);
        let beaten = near.filter(|&w| w != v).any(|w| {
            corner[w as usize] && around[&w].len() != 2 && angle < SHARP_TURN_DEG
                || turn.get(&w).is_some_and(|&other| (other, std::cmp::Reverse(w)) > (angle, std::cmp::Reverse(v)))
        });
        if !beaten {
            corner[v as usize] = true;
        }
    }
    corner
}

/// The complex of the cells that `label` names.
pub(in crate::layout) fn outline(ground: &Ground, label: &[u32], count: usize, corner: &[bool]) -> Complex {
    let mut outline = Outline {
        ground,
        label,
        barrier: ground.barriers(label),
        node: vec![NONE; ground.mesh.points.len()],
        complex: Complex { cells: vec![None; count], ..Complex::default() },
    };
    outline.make_nodes(corner);
    outline.part_loops(corner);
    let half_of = outline.make_arcs();
    outline.make_cells(&half_of);
    outline.complex
}

/// The complex of a partition while it is made.
struct Outline<'a> {
    ground: &'a Ground<'a>,
    label: &'a [u32],
    /// For each half-edge whether it parts two cells, or lies on a line or the boundary.
    barrier: Vec<bool>,
    /// For each vertex its node.
    node: Vec<u32>,
    complex: Complex,
}

impl Outline<'_> {
    fn from(&self, h: u32) -> u32 {
        self.ground.mesh.origin(h)
    }

    fn node_of(&self, v: u32) -> u32 {
        self.node[v as usize]
    }

    fn barriers(&self) -> Vec<u32> {
        (0..self.barrier.len() as u32).filter(|&h| self.barrier[h as usize]).collect()
    }

    fn kind(&self, h: u32) -> CurveKind {
        if self.ground.adjacency.opposite[h as usize] == NONE {
            CurveKind::Boundary
        } else if self.ground.sharp[h as usize] {
            CurveKind::Feature
        } else {
            CurveKind::Smooth
        }
    }

    fn make_node(&mut self, v: u32, corner: &[bool]) {
        if self.node_of(v) == NONE {
            self.node[v as usize] = self.complex.nodes.len() as u32;
            self.complex.nodes.push(Node { vertex: v, stays: corner[v as usize] });
        }
    }

    /// Nodes at corners, and where barriers meet, end or change their kind.
    fn make_nodes(&mut self, corner: &[bool]) {
        let points = self.ground.mesh.points.len();
        let mut kinds: Vec<[u32; 3]> = vec![[0; 3]; points];
        for h in self.barriers() {
            let o = self.ground.adjacency.opposite[h as usize];
            if o == NONE || h < o {
                for v in [self.from(h), self.from(next(h))] {
                    kinds[v as usize][self.kind(h) as usize] += 1;
                }
            }
        }
        for v in 0..points as u32 {
            let degree: u32 = kinds[v as usize].iter().sum();
            let is_mixed = kinds[v as usize].iter().filter(|&&k| k > 0).count() > 1;
            if degree > 0 && (degree != 2 || is_mixed || corner[v as usize]) {
                self.make_node(v, corner);
            }
        }
    }

    /// The barriers from a half-edge to the next node, or once around.
    fn chain_from(&self, h: u32) -> Vec<u32> {
        let mut chain = vec![h];
        let mut g = h;
        while self.node_of(self.from(next(g))) == NONE {
            g = next_around(self.ground.adjacency, &self.barrier, g);
            if g == h {
                break;
            }
            chain.push(g);
        }
        chain
    }

    /// Loops without a node get some, evenly spaced by count.
    fn part_loops(&mut self, corner: &[bool]) {
        let mut seen = vec![false; self.barrier.len()];
        for h in self.barriers() {
            if self.node_of(self.from(h)) != NONE {
                self.chain_from(h).into_iter().for_each(|g| seen[g as usize] = true);
            }
        }
        for h in self.barriers() {
            if seen[h as usize] || self.node_of(self.from(h)) != NONE {
                continue;
            }
            let chain = self.chain_from(h);
            let count = LOOP_NODES.min(chain.len());
            for i in 0..count {
                self.make_node(self.from(chain[i * chain.len() / count]), corner);
            }
            for g in chain {
                seen[g as usize] = true;
                let o = self.ground.adjacency.opposite[g as usize];
                if o != NONE {
                    seen[o as usize] = true;
                }
            }
        }
    }

    /// The arcs from node to node; returns for the half-edges that they begin with, from either end, their half-arc.
    fn make_arcs(&mut self) -> Vec<u32> {
        let mut half_of = vec![NONE; self.barrier.len()];
        for h in self.barriers() {
            if self.node_of(self.from(h)) == NONE || half_of[h as usize] != NONE {
                continue;
            }
            let chain = self.chain_from(h);
            let a = self.complex.arcs.len() as u32;
            half_of[h as usize] = 2 * a;
            let last = *chain.last().expect("at least the first half-edge");
            let back = self.ground.adjacency.opposite[last as usize];
            let mut right = NONE;
            if back != NONE {
                half_of[back as usize] = 2 * a + 1;
                right = self.label[back as usize / 3];
            }
            let end = self.from(next(last));
            let mut places: Vec<Place> = chain.iter().map(|&g| Place::Vertex(self.from(g))).collect();
            places.push(Place::Vertex(end));
            self.complex.arcs.push(Some(Arc {
                nodes: [self.node_of(self.from(h)), self.node_of(end)],
                kind: self.kind(h),
                chain: places,
                cells: [self.label[h as usize / 3], right],
            }));
        }
        half_of
    }

    /// The sides of each cell in order.
    fn make_cells(&mut self, half_of: &[u32]) {
        for h in (0..half_of.len() as u32).filter(|&h| half_of[h as usize] != NONE) {
            let cell = self.label[h as usize / 3] as usize;
            if self.complex.cells[cell].is_some() {
                continue;
            }
            let mut sides = Vec::new();
            let mut g = h;
            loop {
                if half_of[g as usize] != NONE {
                    sides.push(half_of[g as usize]);
                }
                g = next_around(self.ground.adjacency, &self.barrier, g);
                if g == h {
                    break;
                }
            }
            self.complex.cells[cell] = Some(sides);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::lines::tests::mark;
    use crate::mesh::Adjacency;
    use crate::synthetic::shapes;

    #[test]
    fn a_line_that_turns_back_by_135_degrees_beside_a_fork_has_a_corner_and_one_of_90_has_none() {
        let mesh = shapes::rectangle(1.0, 1.0, 10, 10);
        let low = mesh.bounds().min;
        let at = |i: usize, j: usize| (low.x + i as f64 / 10.0, low.y + j as f64 / 10.0);
        let adjacency = Adjacency::new(&mesh);
        let mut sharp = vec![false; adjacency.opposite.len()];
        // Three lines from (5, 5): one turns back at (7, 5), one turns up and right at (5, 7).
        mark(&mesh, &adjacency, &mut sharp, &[at(5, 5), at(6, 5), at(7, 5), at(6, 4), at(5, 3), at(4, 2)]);
        mark(&mesh, &adjacency, &mut sharp, &[at(5, 5), at(5, 6), at(5, 7), at(6, 7), at(7, 7), at(8, 7)]);
        mark(&mesh, &adjacency, &mut sharp, &[at(5, 5), at(4, 5), at(3, 5), at(2, 5)]);
        let corner = corners(&Ground::new(&mesh, &adjacency, &sharp), 0.25);
        let is = |i, j| {
            let (x, y) = at(i, j);
            let near = |p: &glam::DVec3| p.truncate().distance(glam::DVec2::new(x, y)) < 1e-9;
            corner[mesh.points.iter().position(near).expect("a vertex there")]
        };
        assert!(is(5, 5) && is(7, 5) && !is(5, 7));
    }
}
