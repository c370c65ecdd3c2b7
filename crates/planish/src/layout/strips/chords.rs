//! Fewer cells by closing strips. A chord is a strip of cells, each entered by one side and left by the opposite one, up to
//! the boundary or back to its start; the sides that it crosses are its rungs. Where both ends of each rung become one node
//! all its cells are gone, and cones come on lines, or on each other.
//!
//! Daniels, Silva, Shepherd, Cohen, *Quadrilateral Mesh Simplification*, 2008 (there: polychord collapse).

use super::apart;
use crate::layout::complex::Complex;
use crate::layout::recut::{Bench, Change, Drawn, outline, replace};
use crate::layout::shape::flat_cost;
use crate::layout::slide::Slide;
use crate::mesh::NONE;
use crate::mesh::disjoint::disjoint;
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet};

/// What a patch costs, where corners that are all 45 degrees off square cost 1. Chosen: from 1.3 on a square sheet with a round hole
/// has 4 patches, each between the hole and a side, in place of 8 that are more nearly square.
pub(in crate::layout) const PATCH_COST: f64 = 2.0;

/// Cells that may meet in a node away from lines.
const VALENCES: std::ops::RangeInclusive<usize> = 3..=6;

/// A node that becomes one with another at the end of a rung.
#[derive(Clone, Copy, Debug)]
struct Contraction {
    node: u32,
    into: u32,
    /// The arc between them.
    rung: u32,
}

/// A chord that may be closed.
struct Closing {
    contractions: Vec<Contraction>,
    /// What that gains, with straight sides.
    gain: f64,
    /// Number of its cells.
    cells: usize,
    /// True if it crosses no line.
    is_ring: bool,
}

impl Closing {
    /// What it is known by.
    fn name(&self) -> Vec<u32> {
        let mut rungs: Vec<u32> = self.contractions.iter().map(|c| c.rung).collect();
        rungs.sort_unstable();
        rungs
    }
}

/// Which chords are closed first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::layout) enum Order {
    /// Those that promise to gain most.
    ByGain,
    /// Those that cross lines. Rings around bores, which cross none, stay as long as that makes others needless.
    RingsLast,
}

/// Closes chords of a complex of four-sided cells, one after the other, until none is left that makes it better. True if a ring went
/// while others waited, so that another order may end elsewhere.
/// * `fewest` - cells that are left at least
/// * `settle` - draws anew around the cells that are marked
/// * `price` - what a network costs; one that costs less is better
/// # Errors
/// Those of `settle`.
pub(in crate::layout) fn close<'a, P: PartialOrd, E>(
    bench: &mut Bench<'a>,
    (order, fewest): (Order, usize),
    settle: impl Fn(&mut Bench<'a>, Vec<bool>) -> Result<(), E>,
    price: impl Fn(&Bench) -> P,
) -> Result<bool, E> {
    let (mut has_overtaken, mut now) = (false, price(bench));
    let mut refused: BTreeSet<Vec<u32>> = BTreeSet::new();
    loop {
        let count = bench.complex.live_cells().count();
        let mut found = closings(bench);
        found.retain(|c| c.gain > 0.0 && count >= fewest + c.cells && !refused.contains(&c.name()));
        let waits = |c: &Closing| c.is_ring && order == Order::RingsLast;
        found.sort_by(|x, y| {
            waits(x).cmp(&waits(y)).then(y.gain.total_cmp(&x.gain)).then_with(|| x.name().cmp(&y.name()))
        });
        let mut next = None;
        for (k, closing) in found.iter().enumerate() {
            if let Some(mut closed) = closed(bench, closing) {
                let marked = around(&closed.complex, closing);
                settle(&mut closed, marked)?;
                let then = price(&closed);
                if then < now {
                    now = then;
                    has_overtaken |= closing.is_ring && found[k + 1..].iter().any(|other| !other.is_ring);
                    next = Some(closed);
                    break;
                }
            }
            refused.insert(closing.name());
        }
        match next {
            Some(closed) => *bench = closed,
            None => return Ok(has_overtaken),
        }
    }
}

/// The rungs of all chords that meet no cell and no node twice, as half-arcs whose cells follow each other.
fn chords(complex: &Complex) -> Vec<Vec<u32>> {
    let mut seen: BTreeSet<u32> = BTreeSet::new();
    let mut chords = Vec::new();
    for a in complex.live_arcs() {
        if seen.contains(&a) {
            continue;
        }
        let across = |rung: u32| {
            let sides = complex.loop_of(complex.cell(rung));
            let at = sides.iter().position(|&h| h == rung).expect("a side of its cell");
            sides[(at + 2) % 4] ^ 1
        };
        // Back to the boundary or around.
        let mut start = 2 * a;
        while complex.cell(start ^ 1) != NONE {
            start = across(start ^ 1) ^ 1;
            if start / 2 == a {
                break;
            }
        }
        let mut rungs = vec![start];
        while complex.cell(rungs[rungs.len() - 1]) != NONE {
            let next = across(rungs[rungs.len() - 1]);
            if next / 2 == start / 2 {
                break;
            }
            rungs.push(next);
        }
        seen.extend(rungs.iter().map(|h| h / 2));
        let cells: Vec<u32> = rungs.iter().map(|&h| complex.cell(h)).filter(|&c| c != NONE).collect();
        let nodes: Vec<u32> = rungs.iter().flat_map(|&h| [complex.from(h), complex.to(h)]).collect();
        if apart(&cells) && apart(&nodes) {
            chords.push(rungs);
        }
    }
    chords
}

/// The chords whose rungs may all be contracted.
fn closings(bench: &Bench) -> Vec<Closing> {
    let complex = &bench.complex;
    let stars = complex.stars();
    let straight = Straight::new(bench);
    let closing = |rungs: Vec<u32>| {
        let free: Vec<[bool; 2]> = (rungs.iter())
            .map(|&h| [complex.from(h), complex.to(h)].map(|n| may_go(complex, &stars[n as usize], h)))
            .collect();
        // Where either may go the nodes of one side do.
        let forced = |side: usize| free.iter().filter(|f| !f[side]).count();
        let first = usize::from(forced(0) > forced(1));
        let contractions = rungs.iter().zip(&free).map(|(&h, free)| {
            let nodes = [complex.from(h), complex.to(h)];
            let gone = [first, 1 - first].into_iter().find(|&side| free[side])?;
            let [x, y] = [nodes[gone], nodes[1 - gone]].map(|n| &stars[n as usize]);
            let is_inner = |star: &[u32]| star.iter().all(|&h| complex.arc(h).kind.is_smooth());
            // The rung goes, and on either side of it two arcs of the strip become one.
            let is_fit = !is_inner(x) || !is_inner(y) || VALENCES.contains(&(x.len() + y.len() - 4));
            is_fit.then_some(Contraction { node: nodes[gone], into: nodes[1 - gone], rung: h / 2 })
        });
        let contractions: Vec<Contraction> = contractions.collect::<Option<_>>()?;
        let cells: BTreeSet<u32> = rungs.iter().map(|&h| complex.cell(h)).filter(|&c| c != NONE).collect();
        let gain = straight.gain(&contractions, &cells)?;
        let is_ring = rungs.iter().all(|&h| complex.arc(h).kind.is_smooth());
        Some(Closing { contractions, gain, cells: cells.len(), is_ring })
    };
    chords(complex).into_iter().filter_map(closing).collect()
}

/// True if the node of `star` may become one with another along `rung`: lines keep their place and their corners.
fn may_go(complex: &Complex, star: &[u32], rung: u32) -> bool {
    let on_lines = star.iter().filter(|&&h| !complex.arc(h).kind.is_smooth());
    match on_lines.count() {
        0 => !complex.nodes[complex.from(star[0]) as usize].stays,
        _ => Slide::new(complex, star).is_some_and(|slide| slide.along.iter().any(|h| h / 2 == rung / 2)),
    }
}

/// The cells of a complex with straight sides.
struct Straight<'a> {
    complex: &'a Complex,
    place: Vec<DVec3>,
    /// Of each cell, not of length 1.
    normal: Vec<DVec3>,
    /// Cells at each node.
    cells: Vec<Vec<u32>>,
}

impl<'a> Straight<'a> {
    fn new(bench: &'a Bench) -> Straight<'a> {
        let complex = &bench.complex;
        let mesh = &bench.embedding.cut.mesh;
        let normal = |faces: &Vec<u32>| faces.iter().map(|&f| mesh.area_vector(f as usize)).sum();
        let mut cells = vec![Vec::new(); complex.nodes.len()];
        for c in complex.live_cells() {
            complex.loop_of(c).iter().for_each(|&h| cells[complex.from(h) as usize].push(c));
        }
        Straight {
            complex,
            place: complex.nodes.iter().map(|n| bench.mesh.points[n.vertex as usize]).collect(),
            normal: bench.embedding.members.iter().map(normal).collect(),
            cells,
        }
    }

    /// What the contractions gain, whose chord has `gone` for cells; `None` if a cell is left with less than four nodes.
    fn gain(&self, contractions: &[Contraction], gone: &BTreeSet<u32>) -> Option<f64> {
        let into: BTreeMap<u32, u32> = contractions.iter().map(|c| (c.node, c.into)).collect();
        let moved = |n: u32| into.get(&n).copied().unwrap_or(n);
        let touched: BTreeSet<u32> = into.keys().flat_map(|&n| self.cells[n as usize].iter().copied()).collect();
        let mut gain = 0.0;
        for &c in touched.union(gone) {
            let sides: [u32; 4] = self.complex.loop_of(c).try_into().ok()?;
            let nodes = sides.map(|h| self.complex.from(h));
            let cost = |nodes: [u32; 4]| flat_cost(nodes.map(|n| self.place[n as usize]), self.normal[c as usize]);
            gain += cost(nodes);
            if gone.contains(&c) {
                gain += PATCH_COST;
                continue;
            }
            let nodes = nodes.map(moved);
            if !apart(&nodes) {
                return None;
            }
            gain -= cost(nodes);
        }
        Some(gain)
    }
}

/// Marks the cells around the nodes that others became one with, and the cells around these.
fn around(complex: &Complex, closing: &Closing) -> Vec<bool> {
    let kept: BTreeSet<u32> = closing.contractions.iter().map(|c| c.into).collect();
    let mut marked = vec![false; complex.cells.len()];
    for c in complex.live_cells() {
        marked[c as usize] = complex.loop_of(c).iter().any(|&h| kept.contains(&complex.from(h)));
    }
    complex.with_neighbours(&marked)
}

/// A contraction, drawn.
struct Edit {
    changes: Vec<(Change, Drawn)>,
    /// The half-arcs of a line from the node that goes, of which the first leads to the node that it becomes one with.
    line: Option<[u32; 2]>,
}

/// A copy of the complex with a chord closed; `None` if it cannot be drawn.
fn closed<'a>(bench: &Bench<'a>, closing: &Closing) -> Option<Bench<'a>> {
    let mut copy = Bench::new(bench.mesh, bench.adjacency, bench.complex.clone())?;
    let mut waiting = closing.contractions.clone();
    while !waiting.is_empty() {
        let complex = &copy.complex;
        let stars = complex.stars();
        let planned = waiting.iter().map(|c| Some((*c, plan(complex, &stars[c.node as usize], c)?)));
        let planned = planned.collect::<Option<Vec<_>>>()?;
        let (now, later) = disjoint(planned, |(_, plan)| plan.cells.clone(), |(_, plan)| Some(plan));
        let draw = |change: Change| {
            let drawn = copy.embedding.draw(copy.mesh, copy.adjacency, complex, &change)?;
            Some((change, drawn))
        };
        let edit = |plan: Plan| {
            let changes = plan.changes.into_iter().map(draw).collect::<Option<_>>()?;
            Some(Edit { changes, line: plan.line })
        };
        let edits = now.into_iter().map(edit).collect::<Option<Vec<Edit>>>()?;
        let count = edits.len();
        if copy.commit(edits, put) < count {
            return None;
        }
        waiting = later.into_iter().map(|(contraction, _)| contraction).collect();
    }
    let is_square = |c: u32| {
        let sides = copy.complex.loop_of(c);
        let nodes: Vec<u32> = sides.iter().map(|&h| copy.complex.from(h)).collect();
        sides.len() == 4 && apart(&nodes)
    };
    let has_squares_alone = copy.complex.live_cells().all(is_square);
    has_squares_alone.then_some(copy)
}

/// What a contraction changes.
struct Plan {
    /// The cells at the node that goes.
    cells: Vec<u32>,
    changes: Vec<Change>,
    line: Option<[u32; 2]>,
}

/// The plan of a contraction: what ends at the node that goes ends at the other from now on. A triangle beside the rung has no
/// room left, and its two other sides become one.
fn plan(complex: &Complex, star: &[u32], &Contraction { into, rung, .. }: &Contraction) -> Option<Plan> {
    let is_rung = |h: &u32| h / 2 == rung;
    let in_triangle = |half: u32| {
        let has = |c: u32| {
            let sides = complex.loop_of(c);
            sides.len() == 3 && sides.iter().any(is_rung)
        };
        [complex.cell(half), complex.cell(half ^ 1)].into_iter().any(|c| c != NONE && has(c))
    };
    if star.iter().all(|&h| complex.arc(h).kind.is_smooth()) {
        let mut cells: Vec<u32> = star.iter().map(|&h| complex.cell(h)).collect();
        cells.sort_unstable();
        if !apart(&cells) {
            return None;
        }
        let removed = star.iter().map(|h| h / 2).collect();
        let mut change = Change { cells: cells.clone(), removed, ..Change::default() };
        let around = outline(complex, &change)?;
        let end = |half: u32| around.iter().position(|&h| h == complex.following(half));
        let to = end(*star.iter().find(|h| is_rung(h))?)?;
        let others = star.iter().filter(|&h| !is_rung(h) && !in_triangle(*h));
        change.lines = others.map(|&h| end(h).filter(|&at| at != to).map(|at| (to, at))).collect::<Option<_>>()?;
        return Some(Plan { cells, changes: vec![change], line: None });
    }
    let slide = Slide::new(complex, star)?;
    let cells = slide.cells();
    if !apart(&cells) {
        return None;
    }
    let mut changes = Vec::new();
    for flank in slide.sides.iter().filter(|flank| !flank.halves.is_empty()) {
        let around = outline(complex, &flank.change)?;
        let count = around.len();
        let before = (flank.corner + count - 1) % count;
        let to = match is_rung(&around[flank.corner]) {
            true => (flank.corner + 1) % count,
            false if is_rung(&around[before]) => before,
            false => return None,
        };
        let lines = flank.halves.iter().zip(&flank.change.lines).filter(|(h, _)| !in_triangle(**h));
        let lines = lines.map(|(_, &(_, at))| (at != to).then_some((to, at))).collect::<Option<_>>()?;
        changes.push(Change { lines, ..flank.change.clone() });
    }
    let [back, ahead] = slide.along;
    let line = if is_rung(&back) { [back, ahead] } else { [ahead, back] };
    (complex.to(line[1]) != into).then_some(Plan { cells, changes, line: Some(line) })
}

/// Makes a contraction; returns the arcs that it touched.
fn put(complex: &mut Complex, edit: &Edit) -> Vec<u32> {
    let mut touched: Vec<u32> =
        edit.changes.iter().flat_map(|(change, drawn)| replace(complex, change, drawn)).collect();
    if let Some([rung, ahead]) = edit.line {
        let cells = [complex.cell(rung ^ 1), complex.cell(rung)];
        let merged = complex.join_arcs(rung, ahead);
        for (side, [old, gone]) in [[rung ^ 1, ahead], [rung, ahead ^ 1]].into_iter().enumerate() {
            if let Some(sides) = complex.cells.get_mut(cells[side] as usize).and_then(Option::as_mut) {
                sides.retain(|&h| h != gone);
                sides.iter_mut().filter(|h| **h == old).for_each(|h| *h = 2 * merged + side as u32);
            }
        }
        touched.push(merged);
    }
    touched
}
