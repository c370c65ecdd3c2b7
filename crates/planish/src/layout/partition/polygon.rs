//! From many-sided cells to four-sided ones.
//!
//! 1. A disk with an even number of sides parts into quads without inner nodes; one with an odd number does
//!    not. Odd cells are paired by paths through the cells, and every arc that a path crosses gets a node in
//!    its middle: both its cells change parity, so only the ends of the path do in the end.
//! 2. Each even cell is parted by the cheapest set of lines, found by dynamic programming; cheap are square
//!    corners and nodes where four cells meet.
//!
//! See `docs/methods/layout.md`, step 3.

use crate::geom::graph::{Reached, Search};
use crate::geom::polyline;
use crate::layout::complex::Complex;
use crate::layout::recut::Change;
use crate::layout::shape::flat_cost;
use crate::mesh::{Adjacency, NONE, TriMesh, previous};
use crate::network::imprint::{Place, half_edge};
use glam::DVec3;
use std::collections::BTreeMap;

/// Cost of a cell too many or too few around a node, against a quad whose corners are all 45 degrees off.
pub(in crate::layout) const VALENCE_COST: f64 = 1.5;

/// Cost of a cell corner of 180 degrees or more, where a patch has no normal of its own.
const FLAT_COST: f64 = 16.0;

/// Cost of a quad that must not be, finite so that there is always a best choice.
const IMPOSSIBLE: f64 = 1e6;

/// Rounds over all cells; each sees the choices of its neighbours.
const CHOICE_ROUNDS: usize = 6;

/// What a path pays for each arc it splits, against an arc of the mean length divided by its own.
const SPLIT_COST: f64 = 1.0;

/// Gives every cell an even number of sides, at least four. False if an arc that must be split has no inner
/// vertex (the working mesh is too coarse there).
pub(in crate::layout) fn make_even(mesh: &TriMesh, complex: &mut Complex) -> bool {
    let length = |complex: &Complex, a: u32| -> f64 {
        let chain = &complex.arc(2 * a).chain;
        polyline::length(chain.iter().map(|p| p.position(mesh)))
    };
    let splittable = |complex: &Complex, a: u32| complex.arc(2 * a).chain.len() > 2;
    for c in 0..complex.cells.len() as u32 {
        while complex.cells[c as usize].is_some() && complex.loop_of(c).len() < 3 {
            let sides = complex.loop_of(c).to_vec();
            let longest = sides
                .iter()
                .map(|h| h / 2)
                .filter(|&a| splittable(complex, a))
                .max_by(|&a, &b| length(complex, a).total_cmp(&length(complex, b)).then(b.cmp(&a)));
            let Some(a) = longest else { return false };
            split_middle(mesh, complex, a);
        }
    }
    let mean = {
        let arcs: Vec<u32> = complex.live_arcs().collect();
        arcs.iter().map(|&a| length(complex, a)).sum::<f64>() / arcs.len().max(1) as f64
    };
    let cost: Vec<f64> = (0..complex.arcs.len() as u32)
        .map(|a| {
            if complex.arcs[a as usize].is_none() || !splittable(complex, a) {
                return f64::INFINITY;
            }
            let fixed = !complex.arc(2 * a).kind.is_smooth();
            (SPLIT_COST + mean / length(complex, a)) * if fixed { 1.5 } else { 1.0 }
        })
        .collect();
    let mut chosen = vec![false; complex.arcs.len()];
    let mut odd: Vec<bool> =
        complex.cells.iter().map(|c| c.as_ref().is_some_and(|sides| sides.len() % 2 == 1)).collect();
    // The outside is one more cell that may stay odd; it is where paths over the boundary end.
    let outside = odd.len();
    for c in 0..outside {
        if !odd[c] {
            continue;
        }
        let Some(path) = cheapest(complex, &cost, &chosen, c, |d| d == outside || (odd[d] && d != c)) else {
            return false;
        };
        for &(a, d) in &path {
            chosen[a as usize] ^= true;
            if d == path.last().expect("not empty").1 && d != outside {
                odd[d] = false;
            }
        }
        odd[c] = false;
    }
    for a in 0..chosen.len() as u32 {
        if chosen[a as usize] {
            split_middle(mesh, complex, a);
        }
    }
    // Splits may cancel: whoever is left with fewer than four sides gets two more at once.
    for c in 0..complex.cells.len() as u32 {
        if complex.cells[c as usize].is_some() && complex.loop_of(c).len() < 4 {
            return false;
        }
    }
    true
}

/// The cheapest path of arcs from cell `start` to a cell that `ends` accepts, as `(arc, cell entered)`.
fn cheapest(
    complex: &Complex,
    cost: &[f64],
    chosen: &[bool],
    start: usize,
    ends: impl Fn(usize) -> bool,
) -> Option<Vec<(u32, usize)>> {
    let outside = complex.cells.len();
    let name = |cell: u32| if cell == NONE { outside } else { cell as usize };
    let mut search = Search::dense(outside + 1);
    search.reach(start as u32, 0.0, NONE);
    while let Some((c, so_far)) = search.settle() {
        let c = c as usize;
        if c != start && ends(c) {
            let mut path = Vec::new();
            let mut at = c;
            while at != start {
                let a = search.reached.via(at as u32);
                path.push((a, at));
                let [left, right] = [2 * a, 2 * a + 1].map(|h| name(complex.cell(h)));
                at = if left == at { right } else { left };
            }
            path.reverse();
            return Some(path);
        }
        for &h in complex.loop_of(c as u32) {
            let d = name(complex.cell(h ^ 1));
            let a = h / 2;
            // Crossing a chosen arc again takes its node away.
            let step = if chosen[a as usize] { 0.1 } else { cost[a as usize] };
            if d != c {
                search.reach(d as u32, so_far + step, a);
            }
        }
    }
    None
}

/// Splits an arc at the inner vertex nearest to its middle by length.
fn split_middle(mesh: &TriMesh, complex: &mut Complex, a: u32) {
    let chain = &complex.arc(2 * a).chain;
    let along = polyline::arc_lengths(chain.iter().map(|p| p.position(mesh)));
    let half = along[along.len() - 1] / 2.0;
    let at = (1..chain.len() - 1)
        .min_by(|&i, &j| (along[i] - half).abs().total_cmp(&(along[j] - half).abs()))
        .expect("an inner vertex");
    complex.split_arc(a, at);
}

/// The sectors around the nodes: fans of cells between fixed arcs, each with the number of cells it should
/// have and the number it has.
pub(in crate::layout) struct Sectors {
    /// For each half-arc the sector of the cell corner where it starts.
    pub of: Vec<u32>,
    pub ideal: Vec<f64>,
    pub count: Vec<f64>,
}

impl Sectors {
    pub fn new(mesh: &TriMesh, adjacency: &Adjacency, complex: &Complex) -> Sectors {
        let mut sectors = Sectors { of: vec![NONE; 2 * complex.arcs.len()], ideal: Vec::new(), count: Vec::new() };
        let beside = fixed_neighbours(complex);
        for star in complex.stars() {
            if star.is_empty() {
                continue;
            }
            let fixed = |h: u32| !complex.arc(h).kind.is_smooth();
            let begin = star.iter().position(|&h| fixed(h));
            let s = star.len();
            match begin {
                None => {
                    for &h in &star {
                        sectors.of[h as usize] = sectors.ideal.len() as u32;
                    }
                    sectors.ideal.push(4.0);
                    sectors.count.push(s as f64);
                }
                Some(begin) => {
                    for i in 0..s {
                        let h = star[(begin + i) % s];
                        if fixed(h) && complex.cell(h) != NONE {
                            let angle = sector_angle(mesh, adjacency, complex, &beside, h);
                            sectors.ideal.push((angle / std::f64::consts::FRAC_PI_2).round().max(1.0));
                            sectors.count.push(0.0);
                        }
                        if complex.cell(h) != NONE {
                            sectors.of[h as usize] = sectors.ideal.len() as u32 - 1;
                            *sectors.count.last_mut().expect("a sector begins at a fixed arc") += 1.0;
                        }
                    }
                }
            }
        }
        sectors
    }

    /// Cost of sector `s` holding `more` cells than now.
    pub fn cost(&self, s: u32, more: f64) -> f64 {
        let (count, ideal) = (self.count[s as usize] + more, self.ideal[s as usize]);
        let flat = if ideal >= 2.0 * count { FLAT_COST } else { 0.0 };
        VALENCE_COST * (count - ideal).powi(2) + flat
    }
}

/// Surface angle (radians) at the start of fixed half-arc `h`, to its left up to the next fixed edge.
fn sector_angle(
    mesh: &TriMesh,
    adjacency: &Adjacency,
    complex: &Complex,
    beside: &BTreeMap<u32, Vec<u32>>,
    h: u32,
) -> f64 {
    let arc = complex.arc(h);
    let chain = &arc.chain;
    let (first, second) =
        if h.is_multiple_of(2) { (chain[0], chain[1]) } else { (chain[chain.len() - 1], chain[chain.len() - 2]) };
    let (Place::Vertex(v), Place::Vertex(w)) = (first, second) else { return std::f64::consts::PI };
    let fixed = beside.get(&v).map_or(&[][..], |f| f);
    let Some(mut e) = half_edge(&mesh.triangles, adjacency, v, w) else { return std::f64::consts::PI };
    let p = mesh.points[v as usize];
    let mut angle = 0.0;
    loop {
        let b = mesh.triangles[e as usize / 3][previous(e) as usize % 3];
        let a = mesh.triangles[e as usize / 3][crate::mesh::next(e) as usize % 3];
        angle += (mesh.points[a as usize] - p).angle_between(mesh.points[b as usize] - p);
        if fixed.contains(&b) {
            return angle;
        }
        e = adjacency.opposite[previous(e) as usize];
        if e == NONE || angle > 20.0 {
            return angle;
        }
    }
}

/// For each vertex where fixed arcs end the vertices next to it along them.
fn fixed_neighbours(complex: &Complex) -> BTreeMap<u32, Vec<u32>> {
    let mut found: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for arc in complex.arcs.iter().flatten().filter(|a| !a.kind.is_smooth()) {
        let n = arc.chain.len();
        for (end, beside) in [(arc.chain[0], arc.chain[1]), (arc.chain[n - 1], arc.chain[n - 2])] {
            if let (Place::Vertex(v), Place::Vertex(w)) = (end, beside) {
                found.entry(v).or_default().push(w);
            }
        }
    }
    found
}

/// Newell normal of a polygon.
fn polygon_normal(corners: &[DVec3]) -> DVec3 {
    let n = corners.len();
    (0..n).map(|i| corners[i].cross(corners[(i + 1) % n])).sum::<DVec3>().normalize_or_zero()
}

/// The lines that part every cell into quads.
pub(in crate::layout) fn quadrangulate(mesh: &TriMesh, adjacency: &Adjacency, complex: &Complex) -> Vec<Change> {
    let mut sectors = Sectors::new(mesh, adjacency, complex);
    let cells: Vec<u32> = complex.live_cells().filter(|&c| complex.loop_of(c).len() > 4).collect();
    let mut lines: Vec<Vec<(usize, usize)>> = vec![Vec::new(); cells.len()];
    for _ in 0..CHOICE_ROUNDS {
        for (i, &c) in cells.iter().enumerate() {
            let sides = complex.loop_of(c);
            for &(a, b) in &lines[i] {
                sectors.count[sectors.of[sides[a] as usize] as usize] -= 1.0;
                sectors.count[sectors.of[sides[b] as usize] as usize] -= 1.0;
            }
            lines[i] = part(mesh, complex, sides, &sectors);
            for &(a, b) in &lines[i] {
                sectors.count[sectors.of[sides[a] as usize] as usize] += 1.0;
                sectors.count[sectors.of[sides[b] as usize] as usize] += 1.0;
            }
        }
    }
    cells.iter().zip(lines).map(|(&c, lines)| Change { cells: vec![c], lines, ..Change::default() }).collect()
}

/// The cheapest parting of one even cell into quads.
fn part(mesh: &TriMesh, complex: &Complex, sides: &[u32], sectors: &Sectors) -> Vec<(usize, usize)> {
    let at: Vec<DVec3> =
        sides.iter().map(|&h| mesh.points[complex.nodes[complex.from(h) as usize].vertex as usize]).collect();
    let extra: Vec<f64> = sides
        .iter()
        .map(|&h| {
            let s = sectors.of[h as usize];
            sectors.cost(s, 1.0) - sectors.cost(s, 0.0)
        })
        .collect();
    let normal = polygon_normal(&at);
    let cost = |quad: [usize; 4]| {
        if swallows(sides, quad) { IMPOSSIBLE } else { flat_cost(quad.map(|i| at[i]), normal) }
    };
    part_polygon(at.len(), cost, &extra)
}

/// True if a quad between corners of an outline has both sides of one arc: the arc would end inside it.
pub(in crate::layout) fn swallows(outline: &[u32], quad: [usize; 4]) -> bool {
    let n = outline.len();
    let next = |k: usize| quad[(k + 1) % 4];
    let along = |k: usize| quad[k] < n && next(k) == (quad[k] + 1) % n;
    (0..4).any(|k| {
        let l = (k + 1) % 4;
        along(k) && along(l) && outline[quad[k]] ^ 1 == outline[quad[l]]
    })
}

/// The cheapest lines that part a polygon with an even number `n` of corners into quads; `quad` is what one costs,
/// `extra` what another cell at a corner costs.
pub(in crate::layout) fn part_polygon(
    n: usize,
    quad: impl Fn([usize; 4]) -> f64,
    extra: &[f64],
) -> Vec<(usize, usize)> {
    let mut best = vec![vec![(f64::INFINITY, 0, 0); n]; n];
    for (i, row) in best.iter_mut().enumerate().take(n - 1) {
        row[i + 1] = (0.0, 0, 0);
    }
    for span in (3..n).step_by(2) {
        for i in 0..n - span {
            let j = i + span;
            let mut least = (f64::INFINITY, 0, 0);
            for k in (i + 1..j).step_by(2) {
                for l in (k + 1..j).step_by(2) {
                    let mut cost = quad([i, k, l, j]).min(IMPOSSIBLE) + best[i][k].0 + best[k][l].0 + best[l][j].0;
                    for (a, b) in [(i, k), (k, l), (l, j)] {
                        if b > a + 1 {
                            cost += extra[a] + extra[b];
                        }
                    }
                    if cost < least.0 {
                        least = (cost, k, l);
                    }
                }
            }
            best[i][j] = least;
        }
    }
    let mut lines = Vec::new();
    let mut stack = vec![(0, n - 1)];
    while let Some((i, j)) = stack.pop() {
        if j <= i + 1 {
            continue;
        }
        let (_, k, l) = best[i][j];
        for (a, b) in [(i, k), (k, l), (l, j)] {
            if b > a + 1 {
                lines.push((a, b));
                stack.push((a, b));
            }
        }
    }
    lines
}
