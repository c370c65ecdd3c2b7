//! The rings of a face in the parameters of its surface.
//!
//! Parameters repeat around a cylinder and have no value at a pole. A ring is followed point by point, each taken as near to the
//! last as its period allows. At a pole it goes along the side of the parameters that the pole is, so that the face stays on its
//! left. A ring that does not come back to where it began winds around the surface: two such rings bound one region between
//! them, and one alone bounds it up to a pole.

use super::edges::{Fineness, Points, parameters_between};
use super::shape::Surface;
use crate::ReadError;

/// Share of a period, or of the range of a surface, within which two parameters are one.
pub(super) const SAME_PARAMETER: f64 = 1e-6;

/// A point of a ring: its parameters, and the point of the mesh.
pub(super) type Node = ([f64; 2], u32);

/// A ring in parameters, and by how many periods its end is off its start.
struct Walk {
    nodes: Vec<Node>,
    winding: [f64; 2],
}

/// How far places may be apart that are one, and how fine the mesh is to be.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    pub tolerance: f64,
    pub fineness: Fineness,
}

/// The rings of a face; what they enclose an odd number of times belongs to it. `None` if they do not bound a region.
///
/// * `rings` - points around the face, which is on their left seen from where the surface's own normal points
pub(super) fn rings(
    surface: &Surface,
    rings: &[Vec<u32>],
    points: &mut Points,
    limits: Limits,
) -> Result<Option<Vec<Vec<Node>>>, ReadError> {
    let walks: Vec<Walk> = rings.iter().filter_map(|ring| walk(surface, ring, points, limits.tolerance)).collect();
    let (mut winding, mut closed): (Vec<Walk>, Vec<Walk>) = walks.into_iter().partition(|w| w.winding != [0.0; 2]);
    let outer = match (winding.pop(), winding.pop()) {
        (None, _) if closed.is_empty() => whole(surface, points, limits)?,
        (None, _) => Some(Vec::new()),
        (Some(only), None) => to_pole(surface, only, points, limits)?,
        (Some(second), Some(first)) => joined(surface, [first, second], points, limits)?,
    };
    let Some(outer) = outer.filter(|_| winding.is_empty()) else { return Ok(None) };
    let mut found: Vec<Vec<Node>> = if outer.is_empty() { Vec::new() } else { vec![outer] };
    // The largest first: the others lie in it, as many periods away as that takes.
    let size = |w: &Walk| area(&w.nodes).abs();
    closed.sort_by(|a, b| size(b).total_cmp(&size(a)));
    for Walk { nodes, .. } in closed {
        let moved = |by: [f64; 2]| [0, 1].map(|k| nodes[0].0[k] + by[k]);
        let by = found.first().and_then(|outer| shifts(surface).into_iter().find(|by| is_in(outer, moved(*by))));
        let by = by.unwrap_or_default();
        found.push(nodes.into_iter().map(|(uv, point)| ([0, 1].map(|k| uv[k] + by[k]), point)).collect());
    }
    Ok(Some(found))
}

/// Sums of up to two periods each way, small ones first.
fn shifts(surface: &Surface) -> Vec<[f64; 2]> {
    let periods = surface.periods();
    let steps = |k: usize| match periods[k] {
        Some(period) => [0.0, 1.0, -1.0, 2.0, -2.0].map(|n| n * period).to_vec(),
        None => vec![0.0],
    };
    let (us, vs) = (steps(0), steps(1));
    us.iter().flat_map(|&u| vs.iter().map(move |&v| [u, v])).collect()
}

fn walk(surface: &Surface, ring: &[u32], points: &Points, tolerance: f64) -> Option<Walk> {
    let periods = surface.periods();
    let mut last = None;
    let raw: Vec<([f64; 2], Option<usize>)> = ring
        .iter()
        .map(|&p| {
            let uv = surface.parameters(points.all[p as usize], last);
            let undefined = surface.undefined(uv, tolerance);
            last = undefined.is_none().then_some(uv);
            (uv, undefined)
        })
        .collect();
    let first = raw.iter().position(|(_, undefined)| undefined.is_none())?;
    let near = |k: usize, t: f64, to: f64| periods[k].map_or(t, |period| t + ((to - t) / period).round() * period);
    let start = raw[first].0;
    let mut nodes = vec![(start, ring[first])];
    // The direction that had no value at the last point, and on which side of the point before it lay.
    let mut pole: Option<(usize, bool)> = None;
    for k in 1..=ring.len() {
        let i = (first + k) % ring.len();
        let (uv, undefined) = raw[i];
        let (at, _) = nodes[nodes.len() - 1];
        if let Some(axis) = undefined {
            let mut here = at;
            here[1 - axis] = near(1 - axis, uv[1 - axis], at[1 - axis]);
            pole.get_or_insert((axis, here[1 - axis] > at[1 - axis]));
            nodes.push((here, ring[i]));
            continue;
        }
        let mut next = [0, 1].map(|k| near(k, uv[k], at[k]));
        if let Some((axis, is_high)) = pole.take() {
            if let Some(period) = periods[axis] {
                // The face is on the left: along a high v towards lower u, along a high u towards higher v.
                let sign = if is_high == (axis == 0) { -1.0 } else { 1.0 };
                let turn = (sign * (uv[axis] - at[axis])).rem_euclid(period);
                let is_all = turn < SAME_PARAMETER * period || turn > (1.0 - SAME_PARAMETER) * period;
                next[axis] = at[axis] + sign * if is_all { period } else { turn };
            }
            let mut along = at;
            along[axis] = next[axis];
            nodes.push((along, nodes[nodes.len() - 1].1));
        }
        nodes.push((next, ring[i]));
    }
    let (end, _) = nodes[nodes.len() - 1];
    let winding = [0, 1].map(|k| periods[k].map_or(0.0, |period| ((end[k] - start[k]) / period).round()));
    if winding == [0.0; 2] {
        nodes.pop();
    }
    (nodes.len() >= 3).then_some(Walk { nodes, winding })
}

/// A line of parameters that no edge runs along, cut for the mesh: points that both of its sides share.
struct Cut {
    nodes: Vec<Node>,
}

impl Cut {
    /// From one place to another along `axis`; the ends are left out.
    fn new(
        surface: &Surface,
        [from, to]: [[f64; 2]; 2],
        points: &mut Points,
        fineness: Fineness,
    ) -> Result<Cut, ReadError> {
        let uv = |t: f64| [0, 1].map(|k| from[k] + (to[k] - from[k]) * t);
        let mut nodes = Vec::new();
        for t in parameters_between(&|t| surface.at(uv(t)), [0.0, 1.0], fineness) {
            nodes.push((uv(t), points.add(surface.at(uv(t)))?));
        }
        Ok(Cut { nodes })
    }

    fn there(&self) -> impl Iterator<Item = Node> {
        self.nodes.iter().copied()
    }

    /// The way back, so far away in parameters.
    fn back(&self, by: [f64; 2]) -> impl Iterator<Item = Node> {
        self.nodes.iter().rev().map(move |&(uv, point)| ([uv[0] + by[0], uv[1] + by[1]], point))
    }
}

/// The region between a ring that winds and the pole on its left.
fn to_pole(surface: &Surface, walk: Walk, points: &mut Points, limits: Limits) -> Result<Option<Vec<Node>>, ReadError> {
    let axis = usize::from(walk.winding[0] == 0.0);
    let rises = walk.winding[axis] > 0.0;
    // Left of rising u is higher v, left of rising v is lower u.
    let is_high = rises == (axis == 0);
    let mut nodes = walk.nodes;
    let ((start, _), (end, _)) = (nodes[0], nodes[nodes.len() - 1]);
    let Some(across) = pole_of(surface, axis, is_high, end) else { return Ok(None) };
    let at = |t: f64| if axis == 0 { [t, across] } else { [across, t] };
    let pole = at(end[axis]);
    if surface.undefined(pole, limits.tolerance) != Some(axis) {
        return Ok(None);
    }
    let cut = Cut::new(surface, [end, pole], points, limits.fineness)?;
    let tip = points.add(surface.at(pole))?;
    nodes.extend(cut.there());
    nodes.extend([(pole, tip), (at(start[axis]), tip)]);
    nodes.extend(cut.back([start[0] - end[0], start[1] - end[1]]));
    Ok(Some(nodes))
}

/// Where a surface has a pole beside a ring along `axis`.
fn pole_of(surface: &Surface, axis: usize, is_high: bool, beside: [f64; 2]) -> Option<f64> {
    let here = beside[1 - axis];
    match surface {
        Surface::Cone { radius, slope, .. } if axis == 0 => {
            let tip = -radius / slope;
            ((tip > here) == is_high && tip.is_finite()).then_some(tip)
        }
        Surface::Torus { .. } | Surface::Revolution { .. } | Surface::Spline { .. } => {
            let end = surface.ranges()[1 - axis][usize::from(is_high)];
            end.is_finite().then_some(end)
        }
        _ => None,
    }
}

/// The region between two rings that wind in opposite directions, cut open from the end of one to the start of the other.
fn joined(
    surface: &Surface,
    [first, second]: [Walk; 2],
    points: &mut Points,
    limits: Limits,
) -> Result<Option<Vec<Node>>, ReadError> {
    let axis = usize::from(first.winding[0] == 0.0);
    let Some(period) = surface.periods()[axis].filter(|_| (0..2).all(|k| first.winding[k] == -second.winding[k]))
    else {
        return Ok(None);
    };
    let ((start, _), (end, _)) = (first.nodes[0], first.nodes[first.nodes.len() - 1]);
    // The other ring from its node nearest to that end on.
    let around = &second.nodes[..second.nodes.len() - 1];
    let off = |uv: [f64; 2]| {
        let away = uv[axis] - end[axis];
        away - (away / period).round() * period
    };
    let from =
        (0..around.len()).min_by(|&a, &b| off(around[a].0).abs().total_cmp(&off(around[b].0).abs())).unwrap_or(0);
    let turn = second.winding[axis] * period;
    let base = end[axis] + off(around[from].0) - around[from].0[axis];
    let other: Vec<Node> = (from..=from + around.len())
        .map(|k| {
            let (mut uv, point) = around[k % around.len()];
            uv[axis] += base + if k >= around.len() { turn } else { 0.0 };
            (uv, point)
        })
        .collect();
    let cut = Cut::new(surface, [end, other[0].0], points, limits.fineness)?;
    let mut nodes = first.nodes;
    nodes.extend(cut.there());
    nodes.extend(other);
    nodes.extend(cut.back([start[0] - end[0], start[1] - end[1]]));
    Ok(Some(nodes))
}

/// The whole of a surface that has no boundary.
fn whole(surface: &Surface, points: &mut Points, limits: Limits) -> Result<Option<Vec<Node>>, ReadError> {
    let [[a, b], [c, d]] = surface.ranges();
    let periods = surface.periods();
    let is_point = |v: f64| surface.undefined([a, v], limits.tolerance) == Some(0);
    let is_closed = [a, b, c, d].iter().all(|t| t.is_finite()) && periods[0].is_some();
    if !is_closed || !(periods[1].is_some() || is_point(c) && is_point(d)) {
        return Ok(None);
    }
    let side = Cut::new(surface, [[b, c], [b, d]], points, limits.fineness)?;
    let low = points.add(surface.at([a, c]))?;
    let mut nodes = vec![([a, c], low)];
    if periods[1].is_some() {
        let along = Cut::new(surface, [[a, c], [b, c]], points, limits.fineness)?;
        nodes.extend(along.there());
        nodes.push(([b, c], low));
        nodes.extend(side.there());
        nodes.push(([b, d], low));
        nodes.extend(along.back([0.0, d - c]));
        nodes.push(([a, d], low));
    } else {
        let high = points.add(surface.at([a, d]))?;
        nodes.push(([b, c], low));
        nodes.extend(side.there());
        nodes.extend([([b, d], high), ([a, d], high)]);
    }
    nodes.extend(side.back([a - b, 0.0]));
    Ok(Some(nodes))
}

fn area(nodes: &[Node]) -> f64 {
    (0..nodes.len())
        .map(|k| {
            let (a, b) = (nodes[k].0, nodes[(k + 1) % nodes.len()].0);
            a[0] * b[1] - a[1] * b[0]
        })
        .sum::<f64>()
        / 2.0
}

/// True if a ring encloses a place.
fn is_in(ring: &[Node], [u, v]: [f64; 2]) -> bool {
    let crosses = |k: usize| {
        let (a, b) = (ring[k].0, ring[(k + 1) % ring.len()].0);
        (a[1] > v) != (b[1] > v) && u < a[0] + (b[0] - a[0]) * (v - a[1]) / (b[1] - a[1])
    };
    (0..ring.len()).filter(|&k| crosses(k)).count() % 2 == 1
}
