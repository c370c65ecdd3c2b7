//! Making a layout good: quads, relaxed nodes and arcs, regular nodes.

use super::LayoutError;
use super::complex::Complex;
use super::polygon;
use super::recut::{Bench, Change, outline};
use crate::network::CurveKind;
use crate::observe::Observer;

/// Parts every cell into quads. False if some cell could not be parted.
pub(super) fn quads(bench: &mut Bench) -> bool {
    let changes = polygon::quadrangulate(bench.mesh, bench.adjacency, &bench.complex);
    bench.apply(&changes);
    bench.complex.live_cells().all(|c| bench.complex.loop_of(c).len() == 4)
}

/// Relaxes nodes and arcs in `rounds` rounds.
pub(super) fn relax(bench: &mut Bench, rounds: usize, observer: &dyn Observer) -> Result<(), LayoutError> {
    for round in 0..rounds {
        if observer.cancelled() {
            return Err(LayoutError::Cancelled);
        }
        let stars = bench.complex.stars();
        let nodes: Vec<u32> = (0..stars.len() as u32).filter(|&n| !stars[n as usize].is_empty()).collect();
        bench.sweep(&nodes, |complex, n| star_change(complex, &complex.star(n)));
        let arcs: Vec<u32> = bench.complex.live_arcs().collect();
        bench.sweep(&arcs, arc_change);
        observer.progress(0.4 + 0.6 * (round + 1) as f64 / rounds as f64);
    }
    Ok(())
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
