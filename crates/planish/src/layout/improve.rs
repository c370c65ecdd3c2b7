//! Making a layout good: quads, relaxed nodes and arcs, regular nodes, even sizes.
//!
//! The connectivity changes where that lowers an energy: squareness and size of every cell ([`super::shape`]), and the number of
//! cells in every sector. A change refills the union of two cells or of the cells around a node; drawn lines
//! stay inside it. See `docs/methods/layout.md`, steps 6 and 7.

use super::LayoutError;
use super::complex::{Complex, Node};
use super::fill::{Footing, Gain, Scale};
use super::fitness;
use super::partition::polygon;
use super::recut::{Bench, Change, outline};
use super::slide::{self, Slide};
use crate::mesh::disjoint::disjoint;
use crate::observe::Observer;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// A change must lower the energy by this, so that none is made for rounding; and by this factor more in every
/// round, for what relaxing undoes would otherwise go back and forth.
const LEAST_GAIN: f64 = 0.2;
const GAIN_GROWTH: f64 = 1.25;

/// The same for drawing anew, where nothing undoes it.
pub(super) const LEAST_SETTLING: f64 = 0.02;

/// Rounds of changing the connectivity; most meshes settle earlier.
const CHANGE_ROUNDS: usize = 20;

/// Rounds of drawing anew around changes before the next ones.
const SETTLING_AROUND_CHANGES: usize = 3;

/// Parts every cell into quads. False if some cell could not be parted.
pub(super) fn quads(bench: &mut Bench) -> bool {
    let changes = polygon::quadrangulate(bench.mesh, bench.adjacency, &bench.complex);
    bench.apply(&changes);
    bench.complex.live_cells().all(|c| bench.complex.loop_of(c).len() == 4)
}

/// Relaxes all nodes and arcs once.
pub(super) fn relax(bench: &mut Bench, observer: &dyn Observer) -> Result<(), LayoutError> {
    let cancelled = || observer.check();
    let nodes: Vec<u32> = (0..bench.complex.nodes.len() as u32).collect();
    cancelled()?;
    bench.sweep(&nodes, |complex, stars, n| star_change(complex, &stars[n as usize]));
    straighten(bench, observer)?;
    cancelled()?;
    slide::slide_across(bench, &nodes);
    Ok(())
}

/// Draws all smooth arcs anew, straight in the map of their two cells.
pub(super) fn straighten(bench: &mut Bench, observer: &dyn Observer) -> Result<(), LayoutError> {
    observer.check()?;
    let arcs: Vec<u32> = bench.complex.live_arcs().collect();
    bench.sweep(&arcs, |complex, _, a| arc_change(complex, a));
    Ok(())
}

/// Changes the connectivity until nothing gets better, towards `patches` patches.
pub(super) fn improve(bench: &mut Bench, patches: usize, observer: &dyn Observer) -> Result<(), LayoutError> {
    let cells = bench.complex.cells.len();
    let (mut filled, mut drawn) = (Known::but(vec![true; cells]), Known::but(vec![false; cells]));
    for round in 0..CHANGE_ROUNDS {
        observer.progress(0.3 + 0.5 * round as f64 / CHANGE_ROUNDS as f64);
        let least = LEAST_GAIN * GAIN_GROWTH.powi(round as i32);
        let scale = Scale::new(bench, patches);
        let nodes = |change: &Change| nodes_of(&bench.complex, &change.cells);
        let chosen = choose(unions(&bench.complex), least, &mut filled, |union| scale.best(union), nodes);
        if chosen.is_empty() {
            break;
        }
        let mut touched = cells_of(&bench.complex, &chosen);
        bench.apply(&chosen);
        touched.resize(bench.complex.cells.len(), true);
        // Until now nobody looked at what is away from changes.
        drawn.forget(&bench.complex.with_neighbours(&touched));
        let scale = (patches, Footing::Ignored);
        let settled = settle_some(bench, scale, SETTLING_AROUND_CHANGES, &mut drawn, observer)?;
        touched.iter_mut().zip(settled).for_each(|(touched, settled)| *touched |= settled);
        // The sectors of a node are those of all cells around it.
        filled.forget(&bench.complex.with_neighbours(&touched));
    }
    Ok(())
}

/// Draws nodes and arcs anew where that makes cells better, as measured, in up to `rounds` rounds. Their connectivity
/// stays, and no round makes anything worse.
pub(super) fn settle(
    bench: &mut Bench,
    patches: usize,
    rounds: usize,
    observer: &dyn Observer,
) -> Result<(), LayoutError> {
    let mut known = Known::but(vec![true; bench.complex.cells.len()]);
    settle_some(bench, (patches, Footing::Ignored), rounds, &mut known, observer).map(|_| ())
}

/// The same, and nodes inside lines slide along these.
pub(super) fn settle_along_lines(
    bench: &mut Bench,
    patches: usize,
    rounds: usize,
    observer: &dyn Observer,
) -> Result<(), LayoutError> {
    let fresh = vec![true; bench.complex.cells.len()];
    settle_along_lines_around(bench, (patches, rounds), fresh, observer)
}

/// The same around the cells in `fresh`, for a number of patches and in so many rounds.
pub(super) fn settle_along_lines_around(
    bench: &mut Bench,
    (patches, rounds): (usize, usize),
    fresh: Vec<bool>,
    observer: &dyn Observer,
) -> Result<(), LayoutError> {
    let mut known = Known::but(fresh);
    for _ in 0..rounds {
        let mut fresh = known.fresh.clone();
        let drawn = settle_some(bench, (patches, Footing::Ignored), 1, &mut known, observer)?;
        fresh.iter_mut().zip(&drawn).for_each(|(fresh, drawn)| *fresh |= drawn);
        let slid = slide(bench, patches, &fresh);
        if !drawn.contains(&true) && !slid.contains(&true) {
            break;
        }
        known.forget(&slid);
    }
    Ok(())
}

/// As [`settle`] around the cells that a grid would not cover well, and corners come on flat ground.
pub(super) fn settle_uncovered(bench: &mut Bench, rounds: usize, observer: &dyn Observer) -> Result<(), LayoutError> {
    let mut fresh = vec![false; bench.complex.cells.len()];
    let cells: Vec<u32> = bench.complex.live_cells().collect();
    for (&c, _) in cells.iter().zip(fitness::covers(bench)).filter(|(_, cover)| !cover.is_good()) {
        fresh[c as usize] = true;
    }
    let mut known = Known::but(bench.complex.with_neighbours(&fresh));
    settle_some(bench, (cells.len(), Footing::Counts), rounds, &mut known, observer).map(|_| ())
}

/// As [`settle`] where not all is `known`. Marks the cells that were drawn anew.
fn settle_some(
    bench: &mut Bench,
    (patches, footing): (usize, Footing),
    rounds: usize,
    known: &mut Known,
    observer: &dyn Observer,
) -> Result<Vec<bool>, LayoutError> {
    let mut all = vec![false; bench.complex.cells.len()];
    for _ in 0..rounds {
        observer.check()?;
        let complex = &bench.complex;
        let arcs = complex.live_arcs().filter_map(|a| arc_change(complex, a));
        let stars = complex.stars().into_iter().filter_map(|s| star_change(complex, &s));
        let unions: Vec<Change> = arcs.chain(stars).collect();
        let scale = Scale::new(bench, patches);
        let cells = |change: &Change| change.cells.clone();
        let redrawn = |union: &Change| scale.redrawn(union, footing);
        let chosen = choose(unions, LEAST_SETTLING, known, redrawn, cells);
        if chosen.is_empty() {
            break;
        }
        let drawn = cells_of(&bench.complex, &chosen);
        bench.apply(&chosen);
        known.forget(&drawn);
        all.iter_mut().zip(drawn).for_each(|(all, drawn)| *all |= drawn);
    }
    Ok(all)
}

/// Slides nodes inside lines, with a cell in `fresh`, to where that makes cells better, in a batch of disjoint
/// ones. Marks the cells that were drawn anew.
fn slide(bench: &mut Bench, patches: usize, fresh: &[bool]) -> Vec<bool> {
    let complex = &bench.complex;
    let scale = Scale::new(bench, patches);
    let slides = complex.stars().into_iter().filter_map(|star| Slide::new(complex, &star));
    let slides: Vec<Slide> = slides.filter(|slide| slide.cells().into_iter().any(|c| fresh[c as usize])).collect();
    let gains: Vec<Option<(f64, usize)>> = slides.par_iter().map(|slide| scale.slid(slide)).collect();
    let mut found: Vec<(f64, (Slide, usize))> = (slides.into_iter().zip(gains))
        .filter_map(|(slide, gain)| gain.filter(|g| g.0 > LEAST_SETTLING).map(|(gain, at)| (gain, (slide, at))))
        .collect();
    found.sort_by(|x, y| y.0.total_cmp(&x.0).then(x.1.0.node.cmp(&y.1.0.node)));
    let (now, _) = disjoint(found, |(_, (slide, _))| slide.cells(), |(_, slide)| Some(slide));
    slide::apply(bench, &now);
    let mut slid = vec![false; fresh.len()];
    now.iter().flat_map(|(slide, _)| slide.cells()).for_each(|c| slid[c as usize] = true);
    slid
}

/// The nodes of some cells.
fn nodes_of(complex: &Complex, cells: &[u32]) -> Vec<u32> {
    cells.iter().flat_map(|&c| complex.loop_of(c)).map(|&h| complex.from(h)).collect()
}

/// Marks the cells of `changes`.
fn cells_of(complex: &Complex, changes: &[Change]) -> Vec<bool> {
    let mut marked = vec![false; complex.cells.len()];
    changes.iter().flat_map(|change| &change.cells).for_each(|&c| marked[c as usize] = true);
    marked
}

/// What the best change of each union is.
struct Known {
    /// By the arcs that it removes; a union that is not here is left as it is.
    best: BTreeMap<Vec<u32>, Option<Gain>>,
    /// Marks the cells whose unions have to be looked at anew.
    fresh: Vec<bool>,
}

impl Known {
    /// All unions are good as they are but for those with a cell in `fresh`.
    fn but(fresh: Vec<bool>) -> Known {
        Known { best: BTreeMap::new(), fresh }
    }

    /// Cells have changed, or have come.
    fn forget(&mut self, changed: &[bool]) {
        self.fresh.resize(changed.len(), true);
        self.fresh.iter_mut().zip(changed).for_each(|(fresh, changed)| *fresh |= changed);
    }
}

/// The unions worth filling anew: pairs of cells, and the cells around a node.
fn unions(complex: &Complex) -> Vec<Change> {
    let pairs = complex.live_arcs().filter(|&a| {
        let arc = complex.arc(2 * a);
        arc.kind.is_smooth() && arc.cells[0] != arc.cells[1]
    });
    let pairs =
        pairs.map(|a| Change { cells: complex.arc(2 * a).cells.to_vec(), removed: vec![a], ..Change::default() });
    let stars = complex.stars().into_iter().filter(|s| s.len() >= 2).filter_map(|s| star_change(complex, &s));
    pairs.chain(stars).collect()
}

/// The changes of `unions` that gain most by `best`, and more than `least`, such that no two touch the same (`touches`).
/// Afterwards all of `unions` are known.
fn choose(
    unions: Vec<Change>,
    least: f64,
    known: &mut Known,
    best: impl Fn(&Change) -> Option<Gain> + Sync,
    touches: impl Fn(&Change) -> Vec<u32>,
) -> Vec<Change> {
    let gain = |union: &Change| match union.cells.iter().any(|&c| known.fresh[c as usize]) {
        true => best(union).filter(|gain| gain.0 > least),
        false => known.best.get(&union.removed).cloned().flatten(),
    };
    let gains: Vec<Option<Gain>> = unions.par_iter().map(gain).collect();
    known.best = unions.into_iter().map(|u| u.removed).zip(gains.iter().cloned()).collect();
    known.fresh.fill(false);
    let mut found: Vec<Gain> = gains.into_iter().flatten().filter(|g| g.0 > least).collect();
    // Ties by the cells, so that the order does not depend on how candidates were found.
    found.sort_by(|x, y| y.0.total_cmp(&x.0).then_with(|| x.1.cells.cmp(&y.1.cells)));
    disjoint(found, |gain| touches(&gain.1), |gain| Some(gain.1)).0
}

/// The change that places the node of `star` anew and redraws its arcs; `None` for a fixed node.
pub(super) fn star_change(complex: &Complex, star: &[u32]) -> Option<Change> {
    let node = complex.from(*star.first()?);
    if star.iter().any(|&h| !complex.arc(h).kind.is_smooth()) {
        return None;
    }
    let mut cells: Vec<u32> = star.iter().map(|&h| complex.cell(h)).collect();
    cells.sort_unstable();
    let count = cells.len();
    cells.dedup();
    if cells.len() != count {
        return None;
    }
    let Node { vertex, stays } = complex.nodes[node as usize];
    let mut change = Change {
        cells,
        removed: star.iter().map(|h| h / 2).collect(),
        center: Some(node),
        pin: stays.then_some(vertex),
        stays,
        ..Change::default()
    };
    let around = outline(complex, &change)?;
    for &h in star {
        change.spokes.push(around.iter().position(|&g| g == complex.following(h))?);
    }
    change.spokes.sort_unstable();
    Some(change)
}

/// The change that redraws arc `a`.
pub(super) fn arc_change(complex: &Complex, a: u32) -> Option<Change> {
    let arc = complex.arc(2 * a);
    if !arc.kind.is_smooth() || arc.cells[0] == arc.cells[1] {
        return None;
    }
    let mut change = Change { cells: arc.cells.to_vec(), removed: vec![a], ..Change::default() };
    let around = outline(complex, &change)?;
    let at = |h: u32| around.iter().position(|&g| g == h);
    change.lines.push((at(complex.following(2 * a + 1))?, at(complex.following(2 * a))?));
    Some(change)
}

#[cfg(test)]
mod tests {
    use super::super::partition::{Ground, outline};
    use super::*;
    use crate::mesh::Adjacency;
    use crate::observe::Silent;
    use crate::synthetic::shapes;
    use glam::DVec3;

    #[test]
    fn a_curve_across_a_sheet_twice_as_long_as_wide_slides_from_an_eighth_of_its_length_to_the_middle() {
        let (cols, rows) = (40, 20);
        let mesh = shapes::rectangle(2.0, 1.0, cols, rows);
        let adjacency = Adjacency::new(&mesh);
        let (low, high) = (mesh.bounds().min, mesh.bounds().max);
        let is_left = |f: usize| mesh.corners(f).iter().map(|p| p.x - low.x).sum::<f64>() < 3.0 / 4.0;
        let label: Vec<u32> = (0..mesh.triangles.len()).map(|f| u32::from(!is_left(f))).collect();
        let is_corner = |x: f64, y: f64| [low.x, high.x].contains(&x) && [low.y, high.y].contains(&y);
        let corner: Vec<bool> = mesh.points.iter().map(|p| is_corner(p.x, p.y)).collect();
        let lines = vec![false; adjacency.opposite.len()];
        let complex = outline::outline(&Ground::new(&mesh, &adjacency, &lines), &label, 2, &corner);
        let mut bench = Bench::new(&mesh, &adjacency, complex).expect("two cells");
        let ends = |bench: &Bench| -> Vec<f64> {
            let arc = bench.complex.live_arcs().find(|&a| bench.complex.arc(2 * a).kind.is_smooth());
            let nodes = bench.complex.arc(2 * arc.expect("the curve")).nodes;
            nodes.map(|n| mesh.points[bench.complex.nodes[n as usize].vertex as usize].x - low.x).to_vec()
        };
        assert!(ends(&bench).iter().all(|x| (x - 0.25).abs() < 1e-9), "{:?}", ends(&bench));
        settle_along_lines(&mut bench, 2, 24, &Silent).unwrap();
        assert!(ends(&bench).iter().all(|x| (x - 1.0).abs() < 0.11), "{:?}", ends(&bench));
    }

    #[test]
    fn a_corner_of_four_cells_leaves_a_wall_where_its_ground_counts_and_stays_on_it_where_it_does_not() {
        // Two flat halves, with a wall of .1 up to x = .5 + .02.
        let place = |u: f64, v: f64| DVec3::new(u, v, ((u - 0.48) / 0.04).clamp(0.0, 1.0) * 0.1);
        let mesh = shapes::sheet(51, 51, false, false, place);
        let adjacency = Adjacency::new(&mesh);
        let quarter = |f: usize| {
            let middle = mesh.corners(f).into_iter().sum::<DVec3>() / 3.0;
            2 * u32::from(middle.x > 0.5) + u32::from(middle.y > 0.5)
        };
        let label: Vec<u32> = (0..mesh.triangles.len()).map(quarter).collect();
        let corner: Vec<bool> =
            mesh.points.iter().map(|p| [0.0, 1.0].contains(&p.x) && [0.0, 1.0].contains(&p.y)).collect();
        let lines = vec![false; adjacency.opposite.len()];
        let off = |footing: Footing| {
            let complex = outline::outline(&Ground::new(&mesh, &adjacency, &lines), &label, 4, &corner);
            let mut bench = Bench::new(&mesh, &adjacency, complex).expect("four cells");
            let mut known = Known::but(vec![true; bench.complex.cells.len()]);
            settle_some(&mut bench, (4, footing), 24, &mut known, &Silent).unwrap();
            let inner = bench.complex.stars().into_iter().find(|star| star_change(&bench.complex, star).is_some());
            let node = bench.complex.from(inner.expect("a corner inside")[0]);
            (mesh.points[bench.complex.nodes[node as usize].vertex as usize].x - 0.5).abs()
        };
        let [counts, ignored] = [Footing::Counts, Footing::Ignored].map(off);
        assert!(ignored < 0.021 && counts > 0.06, "{counts} {ignored}");
    }
}
