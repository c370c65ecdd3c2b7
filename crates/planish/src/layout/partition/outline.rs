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
    let mesh = ground.mesh;
    let barrier = ground.barriers(label);
    let from = |h: u32| mesh.triangles[h as usize / 3][h as usize % 3];
    let kind = |h: u32| {
        if ground.adjacency.opposite[h as usize] == NONE {
            CurveKind::Boundary
        } else if ground.sharp[h as usize] {
            CurveKind::Feature
        } else {
            CurveKind::Smooth
        }
    };
    // Barrier edges at each vertex, as half-edges that leave it (or enter it, on the boundary).
    let mut degree = vec![0u32; mesh.points.len()];
    let mut kinds: Vec<[u32; 3]> = vec![[0; 3]; mesh.points.len()];
    for h in (0..barrier.len() as u32).filter(|&h| barrier[h as usize]) {
        let o = ground.adjacency.opposite[h as usize];
        if o == NONE || h < o {
            for v in [from(h), from(next(h))] {
                degree[v as usize] += 1;
                kinds[v as usize][kind(h) as usize] += 1;
            }
        }
    }
    let mut node = vec![NONE; mesh.points.len()];
    let mut complex = Complex { cells: vec![None; count], ..Complex::default() };
    let make = |v: u32, node: &mut [u32], complex: &mut Complex| {
        if node[v as usize] == NONE {
            node[v as usize] = complex.nodes.len() as u32;
            complex.nodes.push(Node { vertex: v, stays: corner[v as usize] });
        }
    };
    for v in 0..mesh.points.len() as u32 {
        let mixed = kinds[v as usize].iter().filter(|&&k| k > 0).count() > 1;
        if degree[v as usize] > 0 && (degree[v as usize] != 2 || mixed || corner[v as usize]) {
            make(v, &mut node, &mut complex);
        }
    }
    // Loops without a node get some, evenly spaced by count.
    let mut seen = vec![false; barrier.len()];
    let chain_from = |h: u32, node: &[u32]| {
        let mut chain = vec![h];
        let mut g = h;
        while node[from(next(g)) as usize] == NONE {
            g = next_around(ground.adjacency, &barrier, g);
            if g == h {
                break;
            }
            chain.push(g);
        }
        chain
    };
    for h in (0..barrier.len() as u32).filter(|&h| barrier[h as usize] && node[from(h) as usize] != NONE) {
        for g in chain_from(h, &node) {
            seen[g as usize] = true;
        }
    }
    for h in 0..barrier.len() as u32 {
        if !barrier[h as usize] || seen[h as usize] || node[from(h) as usize] != NONE {
            continue;
        }
        let chain = chain_from(h, &node);
        for i in 0..LOOP_NODES.min(chain.len()) {
            make(from(chain[i * chain.len() / LOOP_NODES.min(chain.len())]), &mut node, &mut complex);
        }
        for g in chain {
            seen[g as usize] = true;
            let o = ground.adjacency.opposite[g as usize];
            if o != NONE {
                seen[o as usize] = true;
            }
        }
    }
    // Arcs, then loops.
    let mut half_of = vec![NONE; barrier.len()];
    for h in (0..barrier.len() as u32).filter(|&h| barrier[h as usize]) {
        if node[from(h) as usize] == NONE || half_of[h as usize] != NONE {
            continue;
        }
        let chain = chain_from(h, &node);
        let a = complex.arcs.len() as u32;
        half_of[h as usize] = 2 * a;
        let last = *chain.last().expect("at least the first half-edge");
        let back = ground.adjacency.opposite[last as usize];
        let mut right = NONE;
        if back != NONE {
            half_of[back as usize] = 2 * a + 1;
            right = label[back as usize / 3];
        }
        let mut places: Vec<Place> = chain.iter().map(|&g| Place::Vertex(from(g))).collect();
        places.push(Place::Vertex(from(next(last))));
        complex.arcs.push(Some(Arc {
            nodes: [node[from(h) as usize], node[from(next(last)) as usize]],
            kind: kind(h),
            chain: places,
            cells: [label[h as usize / 3], right],
        }));
    }
    for h in 0..barrier.len() as u32 {
        let first = half_of[h as usize];
        if first == NONE {
            continue;
        }
        let c = label[h as usize / 3] as usize;
        if complex.cells[c].is_some() {
            continue;
        }
        let mut sides = Vec::new();
        let mut g = h;
        loop {
            if half_of[g as usize] != NONE {
                sides.push(half_of[g as usize]);
            }
            g = next_around(ground.adjacency, &barrier, g);
            if g == h {
                break;
            }
        }
        complex.cells[c] = Some(sides);
    }
    complex
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
