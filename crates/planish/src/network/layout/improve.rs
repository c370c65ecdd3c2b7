//! Making a layout good: quads, relaxed nodes and arcs, regular nodes, even sizes.
//!
//! The connectivity changes where that lowers an energy: squareness and size of every cell, and the number of
//! cells in every sector. A change refills the union of two cells or of the cells around a node; drawn lines
//! stay inside it.

use super::LayoutError;
use super::complex::Complex;
use super::polygon::{self, Sectors, badness, polygon_normal};
use super::recut::{Bench, Change, outline, outline_with_cells};
use super::slide;
use crate::network::CurveKind;
use crate::observe::Observer;
use glam::DVec3;
use std::collections::BTreeMap;

/// Weight of the squared logarithm of a cell's area over the mean, against the badness of its shape.
const SIZE_COST: f64 = 0.4;

/// Weight of the squared logarithm of a cell's area over that of the flat quad between its corners: a cell around
/// the end of a limb is large where its corners do not show it.
const BULGE_COST: f64 = 2.0;

/// Area against the flat quad that costs nothing: a cell of ordinary curvature and relief.
const BULGE_FREE: f64 = 1.4;

/// Pressure on the number of patches: what one patch too many costs when there are a tenth too many.
const COUNT_COST: f64 = 2.0;

/// A change must lower the energy by this, so that none is made for rounding or back and forth.
const LEAST_GAIN: f64 = 0.2;

/// Rounds of changing the connectivity; most meshes settle earlier.
const CHANGE_ROUNDS: usize = 20;

/// Batches of relaxing between two rounds of changes: most neighbours of a change fit into the first few.
const RELAX_BATCHES: usize = 1000;

/// Parts every cell into quads. False if some cell could not be parted.
pub(super) fn quads(bench: &mut Bench) -> bool {
    let changes = polygon::quadrangulate(bench.mesh, bench.adjacency, &bench.complex);
    bench.apply(&changes);
    bench.complex.live_cells().all(|c| bench.complex.loop_of(c).len() == 4)
}

/// Relaxes all nodes and arcs in `rounds` rounds.
pub(super) fn relax(bench: &mut Bench, rounds: usize, observer: &dyn Observer) -> Result<(), LayoutError> {
    for _ in 0..rounds {
        let nodes: Vec<u32> = (0..bench.complex.nodes.len() as u32).collect();
        relax_some(bench, &nodes, usize::MAX, observer)?;
    }
    Ok(())
}

/// Relaxes `nodes` and the arcs at them once, each kind in at most `batches` batches.
fn relax_some(bench: &mut Bench, nodes: &[u32], batches: usize, observer: &dyn Observer) -> Result<(), LayoutError> {
    let cancelled = || if observer.cancelled() { Err(LayoutError::Cancelled) } else { Ok(()) };
    cancelled()?;
    bench.sweep(nodes, batches, |complex, n| star_change(complex, &complex.star(n)));
    cancelled()?;
    let mut wanted = vec![false; bench.complex.nodes.len()];
    for &n in nodes {
        wanted[n as usize] = true;
    }
    let arcs: Vec<u32> = bench
        .complex
        .live_arcs()
        .filter(|&a| bench.complex.arc(2 * a).nodes.iter().any(|&n| wanted[n as usize]))
        .collect();
    bench.sweep(&arcs, batches, arc_change);
    cancelled()?;
    slide::slide(bench, nodes, batches);
    Ok(())
}

/// Changes the connectivity until nothing gets better, towards `patches` patches.
pub(super) fn improve(bench: &mut Bench, patches: usize, observer: &dyn Observer) -> Result<(), LayoutError> {
    for round in 0..CHANGE_ROUNDS {
        observer.progress(0.3 + 0.5 * round as f64 / CHANGE_ROUNDS as f64);
        let chosen = choose(bench, patches);
        if chosen.is_empty() {
            break;
        }
        let mut nodes: Vec<u32> = Vec::new();
        for change in &chosen {
            for &c in &change.cells {
                nodes.extend(bench.complex.loop_of(c).iter().map(|&h| bench.complex.from(h)));
            }
        }
        let before = bench.complex.nodes.len() as u32;
        bench.apply(&chosen);
        nodes.extend(before..bench.complex.nodes.len() as u32);
        nodes.sort_unstable();
        nodes.dedup();
        relax_some(bench, &nodes, RELAX_BATCHES, observer)?;
    }
    Ok(())
}

/// The changes that gain most, on disjoint sets of nodes.
fn choose(bench: &Bench, patches: usize) -> Vec<Change> {
    let complex = &bench.complex;
    let trial = Trial::new(bench, patches);
    let mut found: Vec<(f64, Change)> = Vec::new();
    for a in complex.live_arcs() {
        let arc = complex.arc(2 * a);
        if arc.kind != CurveKind::Smooth || arc.cells[0] == arc.cells[1] {
            continue;
        }
        let pair = Change { cells: arc.cells.to_vec(), removed: vec![a], ..Change::default() };
        found.extend(trial.refill(&pair, &[]));
        for first in 0..2 {
            found.extend(trial.with_node(&pair, first));
        }
    }
    for star in complex.stars() {
        if star.len() < 2 {
            continue;
        }
        if let Some(change) = star_change(complex, &star) {
            let node = change.center;
            let change = Change { spokes: Vec::new(), center: None, ..change };
            found.extend(trial.refill(&change, &node.into_iter().collect::<Vec<_>>()));
        }
    }
    found.retain(|x| x.0 > LEAST_GAIN);
    // Ties by the cells, so that the order does not depend on how candidates were found.
    found.sort_by(|x, y| y.0.total_cmp(&x.0).then_with(|| x.1.cells.cmp(&y.1.cells)));
    let mut taken = vec![false; complex.nodes.len()];
    let mut chosen = Vec::new();
    for (_, change) in found {
        let nodes: Vec<u32> = change.cells.iter().flat_map(|&c| complex.loop_of(c)).map(|&h| complex.from(h)).collect();
        if nodes.iter().any(|&n| taken[n as usize]) {
            continue;
        }
        for n in nodes {
            taken[n as usize] = true;
        }
        chosen.push(change);
    }
    chosen
}

/// What changes would gain.
struct Trial<'a> {
    bench: &'a Bench<'a>,
    sectors: Sectors,
    extents: Vec<(f64, DVec3)>,
    mean_area: f64,
    /// What another patch costs.
    another: f64,
}

impl<'a> Trial<'a> {
    fn new(bench: &'a Bench<'a>, patches: usize) -> Trial<'a> {
        let extents = bench.embedding.extents();
        let count = bench.complex.live_cells().count();
        let mean_area = extents.iter().map(|e| e.0).sum::<f64>() / patches.max(1) as f64;
        let sectors = Sectors::new(bench.mesh, bench.adjacency, &bench.complex);
        let another = COUNT_COST * 10.0 * (count as f64 / patches.max(1) as f64).ln();
        Trial { bench, sectors, extents, mean_area, another }
    }

    fn at(&self, half: u32) -> DVec3 {
        let complex = &self.bench.complex;
        self.bench.mesh.points[complex.nodes[complex.from(half) as usize].vertex as usize]
    }

    fn cell_cost(&self, corners: [DVec3; 4], normal: DVec3, area: f64) -> f64 {
        let size = (area / self.mean_area).max(1e-6);
        let flat = (corners[2] - corners[0]).cross(corners[3] - corners[1]).length() / 2.0;
        let bulge = (area / flat.max(1e-6 * area) / BULGE_FREE).max(1.0).ln();
        // By area where a cell is too large, or parting it would never pay.
        badness(corners, normal) + SIZE_COST * size.max(1.0) * size.ln().powi(2) + BULGE_COST * bulge * bulge
    }

    /// Energy of the cells of a change as they are, and their area and centroid.
    fn before(&self, change: &Change, gone: &[u32]) -> Option<(f64, f64, DVec3)> {
        let (mut cost, mut area, mut sum) = (0.0, 0.0, DVec3::ZERO);
        for &c in &change.cells {
            let sides = self.bench.complex.loop_of(c);
            let [a, b, d, e] = sides[..] else { return None };
            let corners = [a, b, d, e].map(|h| self.at(h));
            let (own, centroid) = self.extents[c as usize];
            cost += self.cell_cost(corners, polygon_normal(&corners), own);
            area += own;
            sum += centroid * own;
        }
        for &node in gone {
            let half = self.bench.complex.star(node)[0];
            cost += self.sectors.cost(self.sectors.of[half as usize], 0.0);
        }
        Some((cost, area, sum / area))
    }

    /// Energy of new cells over corners `at` (positions; one past the last is `middle`), sharing `area`.
    fn after(&self, at: &[DVec3], cells: &[[usize; 4]], area: f64) -> f64 {
        let normal = polygon_normal(&at[..at.len() - 1]);
        let flat: Vec<f64> = cells
            .iter()
            .map(|c| {
                let p = c.map(|i| at[i]);
                ((p[2] - p[0]).cross(p[3] - p[1]).dot(normal)).abs().max(f64::MIN_POSITIVE)
            })
            .collect();
        let total: f64 = flat.iter().sum();
        cells.iter().zip(&flat).map(|(c, f)| self.cell_cost(c.map(|i| at[i]), normal, area * f / total)).sum()
    }

    /// What the sectors at the outline gain when corner `i` goes from `cells[i]` cells to `now[i]`.
    fn sector_gain(&self, around: &[(u32, usize)], now: &[usize]) -> f64 {
        let mut more: BTreeMap<u32, f64> = BTreeMap::new();
        for (&(h, was), &now) in around.iter().zip(now) {
            *more.entry(self.sectors.of[h as usize]).or_default() += now as f64 - was as f64;
        }
        more.iter().map(|(&s, &m)| self.sectors.cost(s, 0.0) - self.sectors.cost(s, m)).sum()
    }

    /// The best filling of a change without inner node; `gone` are the nodes that vanish.
    fn refill(&self, change: &Change, gone: &[u32]) -> Option<(f64, Change)> {
        let around = outline_with_cells(&self.bench.complex, change)?;
        let n = around.len();
        if n < 4 || n % 2 == 1 {
            return None;
        }
        let (before, area, _) = self.before(change, gone)?;
        let mut at: Vec<DVec3> = around.iter().map(|&(h, _)| self.at(h)).collect();
        let extra: Vec<f64> = around
            .iter()
            .map(|&(h, was)| {
                let s = self.sectors.of[h as usize];
                let base = 1.0 - was as f64;
                self.sectors.cost(s, base + 1.0) - self.sectors.cost(s, base)
            })
            .collect();
        let lines = polygon::part_polygon(&at, &extra);
        let mut now = vec![1; n];
        for &(i, j) in &lines {
            now[i] += 1;
            now[j] += 1;
        }
        if gone.is_empty() && around.iter().zip(&now).all(|(a, &b)| a.1 == b) {
            return None; // as it is
        }
        let cells = cells_between(n, &lines);
        let fewer = change.cells.len() as f64 - cells.len() as f64;
        at.push(DVec3::ZERO);
        let after = self.after(&at, &cells, area);
        let gain = before - after + self.sector_gain(&around, &now) + fewer * self.another;
        Some((gain, Change { lines, ..change.clone() }))
    }

    /// The filling of a pair of cells by three around a new node, joined to the corners `first`, `first` + 2 ...
    fn with_node(&self, change: &Change, first: usize) -> Option<(f64, Change)> {
        let around = outline_with_cells(&self.bench.complex, change)?;
        let n = around.len();
        if n != 6 {
            return None;
        }
        let (before, area, middle) = self.before(change, &[])?;
        let mut at: Vec<DVec3> = around.iter().map(|&(h, _)| self.at(h)).collect();
        at.push(middle);
        let spokes: Vec<usize> = (first..n).step_by(2).collect();
        let cells: Vec<[usize; 4]> = spokes.iter().map(|&i| [i, (i + 1) % n, (i + 2) % n, n]).collect();
        let now: Vec<usize> = (0..n).map(|i| 1 + usize::from(i % 2 == first)).collect();
        let node = polygon::VALENCE_COST; // three cells where four should be
        let gain = before - self.after(&at, &cells, area) + self.sector_gain(&around, &now) - node - self.another;
        Some((gain, Change { spokes, ..change.clone() }))
    }
}

/// The quads that `lines` part a polygon of `n` corners into.
fn cells_between(n: usize, lines: &[(usize, usize)]) -> Vec<[usize; 4]> {
    let mut faces: Vec<Vec<usize>> = vec![(0..n).collect()];
    for &(i, j) in lines {
        let k = faces.iter().position(|f| f.contains(&i) && f.contains(&j)).expect("lines do not cross");
        let mut face = faces.swap_remove(k);
        let start = face.iter().position(|&x| x == i).expect("found above");
        face.rotate_left(start);
        let middle = face.iter().position(|&x| x == j).expect("found above");
        let mut rest = face.split_off(middle);
        face.push(j);
        rest.push(i);
        faces.push(face);
        faces.push(rest);
    }
    faces.into_iter().map(|f| [f[0], f[1], f[2], f[3]]).collect()
}

/// The change that places the node of `star` anew and redraws its arcs; `None` for a fixed node.
fn star_change(complex: &Complex, star: &[u32]) -> Option<Change> {
    let node = complex.from(*star.first()?);
    if star.iter().any(|&h| complex.arc(h).kind != CurveKind::Smooth) {
        return None;
    }
    let mut cells: Vec<u32> = star.iter().map(|&h| complex.cell(h)).collect();
    cells.sort_unstable();
    let count = cells.len();
    cells.dedup();
    if cells.len() != count {
        return None;
    }
    let mut change =
        Change { cells, removed: star.iter().map(|h| h / 2).collect(), center: Some(node), ..Change::default() };
    let around = outline(complex, &change)?;
    for &h in star {
        change.spokes.push(around.iter().position(|&g| g == complex.following(h))?);
    }
    change.spokes.sort_unstable();
    Some(change)
}

/// The change that redraws arc `a`.
fn arc_change(complex: &Complex, a: u32) -> Option<Change> {
    let arc = complex.arc(2 * a);
    if arc.kind != CurveKind::Smooth || arc.cells[0] == arc.cells[1] {
        return None;
    }
    let mut change = Change { cells: arc.cells.to_vec(), removed: vec![a], ..Change::default() };
    let around = outline(complex, &change)?;
    let at = |h: u32| around.iter().position(|&g| g == h);
    change.lines.push((at(complex.following(2 * a + 1))?, at(complex.following(2 * a))?));
    Some(change)
}
