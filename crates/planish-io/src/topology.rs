//! Who meets whom: control rows of curves, places of corners, connected components.

use crate::{Place, WriteError};
use planish::DVec3;
use planish::geom::{Aabb, tolerance};
use planish::network::Network;
use planish::surface::Surface;

/// What the edges of the file are made of.
pub(crate) struct Topology {
    /// For each curve its spline, in the curve's own direction; none if no patch uses it.
    pub curves: Vec<Option<Row>>,
    /// For each corner its place; none if no patch uses it.
    pub corners: Vec<Option<DVec3>>,
    /// Patches joined by curves, in the order of their first patch.
    pub components: Vec<Component>,
    /// Largest distance between equal control points of two patches, input units.
    pub gap_max: f64,
}

/// Patches joined by curves.
pub(crate) struct Component {
    /// Their numbers, rising.
    pub patches: Vec<usize>,
    /// True if every curve has two sides or is a point.
    pub closed: bool,
}

/// A boundary row of a surface: a clamped cubic spline.
#[derive(Clone)]
pub(crate) struct Row {
    /// Control points, in its direction.
    pub control: Vec<DVec3>,
    /// Knots, four more.
    pub knots: Vec<f64>,
    /// True if all of it is one point.
    pub collapsed: bool,
}

impl Row {
    /// Row of side `k` in the direction of the side (see [`planish::network::Patch`]).
    fn of(surface: &Surface, k: usize) -> Row {
        let (rows, cols) = (surface.rows, surface.cols);
        let at = |i: usize, j: usize| surface.control[j * cols + i];
        let along_u = k.is_multiple_of(2);
        let control = match k {
            0 => (0..cols).map(|i| at(i, 0)).collect(),
            1 => (0..rows).map(|j| at(cols - 1, j)).collect(),
            2 => (0..cols).map(|i| at(i, rows - 1)).collect(),
            _ => (0..rows).map(|j| at(0, j)).collect(),
        };
        let knots = if along_u { surface.knots_u.clone() } else { surface.knots_v.clone() };
        let row = Row { control, knots, collapsed: false };
        if k < 2 { row } else { row.reversed() }
    }

    fn reversed(mut self) -> Row {
        self.control.reverse();
        let (low, high) = (self.knots[0], self.knots[self.knots.len() - 1]);
        self.knots = self.knots.iter().rev().map(|&t| low + (high - t)).collect();
        self
    }

    /// True if it ends where it begins.
    pub fn is_closed(&self) -> bool {
        self.control.first() == self.control.last()
    }
}

/// Whether opposite sides of a surface coincide, along `u` and along `v`.
pub(crate) fn closed(surface: &Surface) -> (bool, bool) {
    let same = |a: usize, b: usize| Row::of(surface, a).control == Row::of(surface, b).reversed().control;
    (same(1, 3), same(0, 2))
}

fn inconsistent(what: String, place: Place) -> WriteError {
    WriteError::Inconsistent { what, place }
}

impl Topology {
    pub fn new(network: &Network, surfaces: &[Surface]) -> Result<Topology, WriteError> {
        if surfaces.is_empty() {
            return Err(WriteError::Nothing("the model has no surfaces"));
        }
        check(network, surfaces)?;
        let same_place = tolerance::length(Aabb::of(surfaces.iter().flat_map(|s| &s.control)).diagonal());
        let mut topology = Topology {
            curves: Vec::new(),
            corners: vec![None; network.corners.len()],
            components: Vec::new(),
            gap_max: 0.0,
        };
        for (c, uses) in network.uses().into_iter().enumerate() {
            let place = || Place::Item("curve", c);
            let mut found: Option<(Row, bool)> = None;
            for (p, k) in uses {
                let reversed = network.patches[p as usize].sides[k as usize].reversed;
                let row = Row::of(&surfaces[p as usize], k as usize);
                let row = if reversed { row.reversed() } else { row };
                match &mut found {
                    None => found = Some((row, reversed)),
                    Some((first, other)) => {
                        if *other == reversed {
                            let what = "two patches run along the curve in the same direction";
                            return Err(inconsistent(what.into(), place()));
                        }
                        if row.control.len() != first.control.len() {
                            let (a, b) = (first.control.len(), row.control.len());
                            let what = format!("the two patches along the curve have {a} and {b} control points there");
                            return Err(inconsistent(what, place()));
                        }
                        let gap = first.control.iter().zip(&row.control).map(|(a, b)| a.distance(*b));
                        topology.gap_max = gap.fold(topology.gap_max, f64::max);
                    }
                }
            }
            topology.curves.push(found.map(|(mut row, _)| {
                for (end, corner) in [(0, 0), (row.control.len() - 1, 1)] {
                    let slot = &mut topology.corners[network.curves[c].corners[corner] as usize];
                    let place = *slot.get_or_insert(row.control[end]);
                    topology.gap_max = topology.gap_max.max(place.distance(row.control[end]));
                }
                row.collapsed = row.control.iter().all(|p| p.distance(row.control[0]) <= same_place);
                row
            }));
        }
        let collapsed: Vec<bool> = topology.curves.iter().map(|c| c.as_ref().is_some_and(|c| c.collapsed)).collect();
        topology.components = components(network, &collapsed);
        Ok(topology)
    }
}

/// Refuses surfaces that are not whole and networks that name what is not there or use a curve too often.
fn check(network: &Network, surfaces: &[Surface]) -> Result<(), WriteError> {
    if surfaces.len() != network.patches.len() {
        let what = format!("there are {} patches and {} surfaces", network.patches.len(), surfaces.len());
        return Err(inconsistent(what, Place::Item("patch", surfaces.len().min(network.patches.len()))));
    }
    for (p, surface) in surfaces.iter().enumerate() {
        let place = || Place::Item("patch", p);
        let knots = |knots: &[f64], count: usize| {
            knots.len() == count + 4 && knots.iter().all(|t| t.is_finite()) && knots.is_sorted()
        };
        let (rows, cols) = (surface.rows, surface.cols);
        let whole = rows >= 4
            && cols >= 4
            && surface.control.len() == rows * cols
            && knots(&surface.knots_u, cols)
            && knots(&surface.knots_v, rows);
        if !whole {
            return Err(inconsistent("control points and knots of the surface do not agree".into(), place()));
        }
        if let Some(p) = surface.control.iter().find(|p| !p.is_finite()) {
            let hint = "fit the patch again";
            return Err(WriteError::Value { value: format!("control point {p}"), place: place(), hint });
        }
        if network.patches[p].sides.iter().any(|side| side.curve as usize >= network.curves.len()) {
            return Err(inconsistent("the patch names a curve that is not there".into(), place()));
        }
    }
    for (c, curve) in network.curves.iter().enumerate() {
        if curve.corners.iter().any(|&corner| corner as usize >= network.corners.len()) {
            return Err(inconsistent("the curve names a corner that is not there".into(), Place::Item("curve", c)));
        }
    }
    if let Some(c) = network.uses().iter().position(|uses| uses.len() > 2) {
        return Err(inconsistent("the curve has more than two sides".into(), Place::Item("curve", c)));
    }
    Ok(())
}

/// * `collapsed` - the curves that are a point: they close with one side
fn components(network: &Network, collapsed: &[bool]) -> Vec<Component> {
    let uses = network.uses();
    let mut number = vec![usize::MAX; network.patches.len()];
    let mut components = Vec::new();
    for first in 0..network.patches.len() {
        if number[first] != usize::MAX {
            continue;
        }
        let (mut open, mut closed) = (vec![first], true);
        let mut patches = Vec::new();
        number[first] = components.len();
        while let Some(p) = open.pop() {
            patches.push(p);
            for side in &network.patches[p].sides {
                let uses = &uses[side.curve as usize];
                closed &= uses.len() == 2 || collapsed[side.curve as usize];
                for &(q, _) in uses {
                    if number[q as usize] == usize::MAX {
                        number[q as usize] = components.len();
                        open.push(q as usize);
                    }
                }
            }
        }
        patches.sort_unstable();
        components.push(Component { patches, closed });
    }
    components
}
