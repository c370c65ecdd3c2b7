//! A grid that follows its patch through a small edit: the grid before the edit, its nodes carried along with the sides
//! of the patch, settled again at its own resolution.
//!
//! The grid before is a map from its indices to the surface. Where on that map the nodes of the new sides lie is found
//! by Newton's method; in between the shifts of the indices are blended from the four sides (Coons), and every node
//! goes to where the old map has its shifted indices. So lines that were evenly spaced stay so, whatever the shape, and
//! what is left for [`settle`] is small. The chart is made anew, for it is what tells exactly whether a cell turns
//! over.
//!
//! Goes beyond [K98], §5.10: there sections of a grid are relaxed again from where they are.

use super::chart::locate::Spot;
use super::chart::{Chart, flatten};
use super::net::catch::catch;
use super::net::fold::{folded_cells, open_folds};
use super::net::settle::settle;
use super::net::{Net, smooth_turned, turns_over};
use super::{CAUGHT, Fault, Grid, GridError, GridParams, SideStops, laid, relax_patch, rim_node, side};
use crate::geom::polyline;
use crate::mesh::{NONE, TriMesh};
use crate::network::PatchMesh;
use crate::observe::Observer;
use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// Rounds of Gauss-Newton and steps of conjugate gradients in each, on every [`COARSE_LINES`]-th line and then on all: the
/// net as a whole comes to rest on the few lines, and what is left is a little from node to node.
const COARSE_EFFORT: (usize, usize) = (4, 24);
const FINE_EFFORT: (usize, usize) = (1, 8);
/// One line of the coarse net per this many; nets of no more points across than twice its square have none.
const COARSE_LINES: usize = 4;
/// A side that moves by more than this share of the cells across it is no small edit: the grid is made from nothing.
const FARTHEST_SIDE: f64 = 0.5;
/// Steps of Newton's method, each this many cells at most, until a step is shorter than the last number.
const NEWTON_STEPS: usize = 60;
const NEWTON_REACH: f64 = 4.0;
const NEWTON_REST: f64 = 1e-6;
/// Steps straight over the surface from a near node to a place.
const WALKS: usize = 2;
/// A side has gone out of the patch as it was by more than this many cells, and by no more than this share of all.
const GROWN: f64 = 0.1;
const FARTHEST_OUT: f64 = 0.05;
/// Part of a cell to which places are found.
const NEAR_ENOUGH: f64 = 1e-3;

/// Resamples patches whose curves were moved a little, from the grids that they had before.
///
/// * `input` - the mesh that places refer to
/// * `patches` - the patches as they are now
/// * `before` - for each the grid that it had; the new one has as many rows and columns
///
/// Nodes on the sides are those that [`relax`](super::relax) would put there, bit for bit. Where a grid cannot follow
/// (its sides moved far, or folds would be left) it is made from nothing.
/// # Errors
/// As [`relax`](super::relax).
pub fn follow(
    input: &TriMesh,
    patches: &[PatchMesh],
    before: &[Grid],
    params: &GridParams,
    observer: &dyn Observer,
) -> Result<Vec<Grid>, GridError> {
    if patches.len() != before.len() {
        return Err(GridError::SizeCount { patches: patches.len(), sizes: before.len() });
    }
    let caught = CAUGHT * params.miss * input.bounds().diagonal();
    let made: Vec<Result<Grid, GridError>> = patches
        .par_iter()
        .zip(before)
        .enumerate()
        .with_max_len(1)
        .map(|(k, (patch, old))| {
            let (cols, rows) = (old.cols, old.rows);
            if cols < 2 || rows < 2 || old.points.len() != cols * rows || old.places.len() != cols * rows {
                return Err(GridError::TooSmall { patch: k, cols, rows });
            }
            follow_patch(input, patch, old, params, caught, observer).map_err(|f| f.of_patch(k))
        })
        .collect();
    made.into_iter().collect()
}

fn follow_patch(
    input: &TriMesh,
    patch: &PatchMesh,
    old: &Grid,
    params: &GridParams,
    caught: f64,
    observer: &dyn Observer,
) -> Result<Grid, Fault> {
    let (cols, rows, stops) = (old.cols, old.rows, SideStops::default());
    let chart = flatten(input, patch, &stops, [cols, rows], observer)?;
    let from_nothing = || relax_patch((input, patch), (cols, rows), &stops, params, caught, observer);
    let Some(net) = carried(&chart, patch, old) else { return from_nothing() };
    let net = settled_coarsely(net, params, observer)?;
    let mut net = settle(net, FINE_EFFORT, params, observer)?;
    catch(&mut net, caught, observer)?;
    if !open_folds(&mut net, false, observer)? && !folded_cells(&net).is_empty() {
        return from_nothing();
    }
    Ok(laid(&chart, &net.spots, patch, (cols, rows), &stops))
}

/// The net with the moves that bring its coarse net to rest, blended between the coarse nodes.
fn settled_coarsely<'a>(net: Net<'a>, params: &GridParams, observer: &dyn Observer) -> Result<Net<'a>, Fault> {
    let (cols, rows) = (net.cols, net.rows);
    if cols.min(rows) <= 2 * COARSE_LINES * COARSE_LINES {
        return Ok(net);
    }
    let fewer = |n: usize| (n - 1).div_ceil(COARSE_LINES) + 1;
    let before = net.resampled(fewer(cols), fewer(rows));
    let after = settle(before.clone(), COARSE_EFFORT, params, observer)?;
    let moves: Vec<DVec2> = before.uv.iter().zip(&after.uv).map(|(a, b)| *b - *a).collect();
    let cell = |k: usize, n: usize, m: usize| {
        let x = k as f64 * (m - 1) as f64 / (n - 1) as f64;
        let i = (x as usize).min(m - 2);
        (i, x - i as f64)
    };
    let goal = |k: usize| {
        let ((x, s), (y, t)) = (cell(k % cols, cols, before.cols), cell(k / cols, rows, before.rows));
        let at = |x: usize, y: usize| moves[y * before.cols + x];
        at(x, y).lerp(at(x + 1, y), s).lerp(at(x, y + 1).lerp(at(x + 1, y + 1), s), t)
    };
    Ok(net.moved(true, &|k, fraction| net.chart.locate(net.uv[k] + goal(k) * fraction, net.spots[k].triangle)))
}

/// The grid before as a map from indices to space, bilinear in the cells. Beyond its sides it goes on straight, in the
/// mean direction of the cells there.
struct Map<'a>(&'a Grid);

/// Cells over which the direction at a side is taken.
const DIRECTION_CELLS: usize = 8;

impl Map<'_> {
    /// True for indices on the grid.
    fn holds(&self, x: DVec2) -> bool {
        let last = DVec2::new((self.0.cols - 1) as f64, (self.0.rows - 1) as f64);
        x.x >= 0.0 && x.y >= 0.0 && x.x <= last.x && x.y <= last.y
    }

    /// Direction in indices out of side `k`, and the mean length of the cells that lie behind `node` that way.
    fn outward(&self, k: usize, node: usize) -> (DVec2, f64) {
        let Grid { cols, rows, points, .. } = self.0;
        let (out, back, across) = match k {
            0 => (-DVec2::Y, *cols as isize, *rows),
            1 => (DVec2::X, -1, *cols),
            2 => (DVec2::Y, -(*cols as isize), *rows),
            _ => (-DVec2::X, 1, *cols),
        };
        let count = DIRECTION_CELLS.min(across - 1);
        let place = |n: usize| points[(node as isize + n as isize * back) as usize];
        (out, (0..count).map(|n| place(n).distance(place(n + 1))).sum::<f64>() / count as f64)
    }

    /// Position at indices `x` and its derivatives along both.
    fn at(&self, x: DVec2) -> (DVec3, DVec3, DVec3) {
        let last = DVec2::new((self.0.cols - 1) as f64, (self.0.rows - 1) as f64);
        let on = x.clamp(DVec2::ZERO, last);
        let (mut p, mut along, mut across) = self.inside(on);
        let over = x - on;
        let toward = |end: f64, over: f64, n: usize| {
            if over < 0.0 { (DIRECTION_CELLS.min(n - 1)) as f64 } else { end - DIRECTION_CELLS.min(n - 1) as f64 }
        };
        if over.x != 0.0 {
            let back = DVec2::new(toward(last.x, over.x, self.0.cols), on.y);
            along = (self.inside(back).0 - p) / (back.x - on.x);
        }
        if over.y != 0.0 {
            let back = DVec2::new(on.x, toward(last.y, over.y, self.0.rows));
            across = (self.inside(back).0 - p) / (back.y - on.y);
        }
        p += along * over.x + across * over.y;
        (p, along, across)
    }

    fn inside(&self, x: DVec2) -> (DVec3, DVec3, DVec3) {
        let cell = |x: f64, n: usize| (x.floor().max(0.0) as usize).min(n - 2);
        let (i, j) = (cell(x.x, self.0.cols), cell(x.y, self.0.rows));
        let (s, t) = (x.x - i as f64, x.y - j as f64);
        let k = j * self.0.cols + i;
        let p = &self.0.points;
        let (a, b, c, d) = (p[k], p[k + 1], p[k + self.0.cols], p[k + self.0.cols + 1]);
        let (low, high) = (b - a, d - c);
        let along = low + (high - low) * t;
        let across = (c - a) + (high - low) * s;
        (a + low * s + (c - a) * t + (high - low) * (s * t), along, across)
    }

    /// Indices of the place nearest to `p`, from `start`.
    fn indices(&self, p: DVec3, start: DVec2) -> Option<DVec2> {
        let mut x = start;
        for _ in 0..NEWTON_STEPS {
            let (at, u, v) = self.at(x);
            let (d, uu, uv, vv) = (p - at, u.dot(u), u.dot(v), v.dot(v));
            let det = uu * vv - uv * uv;
            let is_regular = det > 1e-9 * uu * vv;
            if !is_regular {
                return None;
            }
            let (du, dv) = (d.dot(u), d.dot(v));
            let step = DVec2::new(vv * du - uv * dv, uu * dv - uv * du) / det;
            x += step.clamp_length_max(NEWTON_REACH);
            if step.length() < NEWTON_REST {
                break;
            }
        }
        Some(x)
    }
}

/// The net of `old` carried to the new sides; nothing where it cannot be without cells that turn over.
fn carried<'a>(chart: &'a Chart, patch: &PatchMesh, old: &Grid) -> Option<Net<'a>> {
    let carry = Carry::new(chart, old);
    let Grid { cols, rows, .. } = *old;
    let shift = carry.sides(patch)?;
    let goals = carry.goals(&shift);
    let mut spots = carry.inside(&goals);
    let mut uv = carry.grown(&goals, &mut spots)?;
    let spots: Vec<Spot> = spots.into_iter().collect::<Option<_>>()?;
    let turned = |uv: &[DVec2]| (0..(cols - 1) * (rows - 1)).any(|c| turns_over(uv, cols, c));
    if !turned(&uv) {
        let points = spots.iter().map(|&s| chart.position(s)).collect();
        return Some(Net { chart, cols, rows, uv, spots, points });
    }
    smooth_turned(&mut uv, cols, rows);
    (!turned(&uv)).then(|| Net::new(chart, cols, rows, uv))
}

/// Where a node is to go: its indices on the old grid, and the place there.
type Goal = (DVec2, DVec3);

/// A grid on its way to the new sides of its patch.
struct Carry<'a> {
    chart: &'a Chart,
    map: Map<'a>,
    /// Where the nodes lie on the chart, for those whose face is whole there.
    known: Vec<Option<Spot>>,
    /// Places are known to this length, a small part of a cell.
    rest: f64,
}

impl<'a> Carry<'a> {
    fn new(chart: &'a Chart, old: &'a Grid) -> Carry<'a> {
        let owners = Owners::new(chart);
        let known = old.places.iter().map(|p| owners.spot(p.face, p.bary)).collect();
        let length = polyline::length(old.points.iter().copied());
        Carry { chart, map: Map(old), known, rest: NEAR_ENOUGH * length / old.points.len() as f64 }
    }

    fn size(&self) -> (usize, usize) {
        (self.map.0.cols, self.map.0.rows)
    }

    /// Indices of a node.
    fn at(&self, k: usize) -> DVec2 {
        let (cols, _) = self.size();
        DVec2::new((k % cols) as f64, (k / cols) as f64)
    }

    /// Where a node of the sides lies on the square.
    fn rim_uv(&self, k: usize) -> DVec2 {
        let (cols, rows) = self.size();
        self.at(k) / DVec2::new((cols - 1) as f64, (rows - 1) as f64)
    }

    fn is_inner(&self, k: usize) -> bool {
        let (cols, rows) = self.size();
        let (i, j) = (k % cols, k / cols);
        i > 0 && j > 0 && i + 1 < cols && j + 1 < rows
    }

    /// Shifts of the nodes of the sides, in indices of the old grid; nothing where one goes too far.
    fn sides(&self, patch: &PatchMesh) -> Option<Vec<DVec2>> {
        let ((cols, rows), old) = (self.size(), self.map.0);
        let mut shift = vec![DVec2::ZERO; cols * rows];
        for (k, chain) in patch.sides.iter().enumerate() {
            let count = if k % 2 == 0 { cols } else { rows };
            let points: Vec<DVec3> = chain.iter().map(|&v| patch.mesh.points[v as usize]).collect();
            let samples = side::resample_at(&points, count, &side::Stops::new());
            let mut last = DVec2::ZERO;
            let mut hint = 0;
            for (n, &p) in samples.points.iter().enumerate() {
                let node = rim_node(k, n, cols, rows);
                if p == old.points[node] {
                    last = DVec2::ZERO;
                    continue;
                }
                last = self.map.indices(p, self.at(node) + last)? - self.at(node);
                shift[node] = last;
                // Where the patch has grown there is no map: the way over the surface tells how many cells went in.
                let (out, cell) = self.map.outward(k, node);
                if last.dot(out) > GROWN {
                    shift[node] += out * (self.way_out(node, p, &mut hint) / cell - last.dot(out));
                }
                let far = shift[node].abs() / DVec2::new((cols - 1) as f64, (rows - 1) as f64);
                let is_small = far.max_element() <= FARTHEST_SIDE;
                if !is_small || far.dot(out.abs()) > FARTHEST_OUT && shift[node].dot(out) > 0.0 {
                    return None;
                }
            }
        }
        Some(shift)
    }

    /// Length of the way over the surface from where a node of a side was to where it goes, `p`.
    /// * `hint` - a triangle near the side, led on
    fn way_out(&self, node: usize, p: DVec3, hint: &mut u32) -> f64 {
        let (chart, old, goal) = (self.chart, self.map.0, self.rim_uv(node));
        let spot = chart.locate(goal, *hint);
        *hint = spot.triangle;
        let from = walk(chart, self.known[node].unwrap_or(spot), old.points[node], self.rest);
        let from = walk(chart, from, old.points[node], self.rest);
        let (mut length, mut before) = (0.0, chart.position(from));
        chart.trace(chart.uv_of(from), from.triangle, goal, &mut |_, x| {
            length += before.distance(x);
            before = x;
        });
        length + before.distance(p)
    }

    /// Goals of all nodes: the shifts of the sides blended over the inside.
    fn goals(&self, shift: &[DVec2]) -> Vec<Goal> {
        let (cols, rows) = self.size();
        let blended = |k: usize| {
            let (i, j) = (k % cols, k / cols);
            let (s, t) = (i as f64 / (cols - 1) as f64, j as f64 / (rows - 1) as f64);
            let node = |i: usize, j: usize| shift[j * cols + i];
            let (right, top) = (cols - 1, rows - 1);
            let corners = (node(0, 0) * (1.0 - s) + node(right, 0) * s) * (1.0 - t)
                + (node(0, top) * (1.0 - s) + node(right, top) * s) * t;
            node(i, 0) * (1.0 - t) + node(i, top) * t + node(0, j) * (1.0 - s) + node(right, j) * s - corners
        };
        let goal = |k: usize| {
            let x = self.at(k) + blended(k);
            (x, self.map.at(x).0)
        };
        (0..cols * rows).map(goal).collect()
    }

    /// Places of the nodes with goals on the old grid. The sides lie evenly on those of the square; an inner node is
    /// walked to from the old node nearest to its goal, or from a neighbour that is there already.
    fn inside(&self, goals: &[Goal]) -> Vec<Option<Spot>> {
        let ((cols, rows), chart, rest) = (self.size(), self.chart, self.rest);
        let mut spots: Vec<Option<Spot>> = (0..cols * rows)
            .into_par_iter()
            .map(|k| {
                let (x, p) = goals[k];
                let near = |x: f64, n: usize| (x.round().max(0.0) as usize).min(n - 1);
                let start = self.known[near(x.y, rows) * cols + near(x.x, cols)];
                if self.is_inner(k) && self.map.holds(x) { start.map(|s| walk(chart, s, p, rest)) } else { None }
            })
            .collect();
        let mut hint = 0;
        for k in (0..cols * rows).filter(|&k| !self.is_inner(k)) {
            let spot = chart.locate(self.rim_uv(k), hint);
            hint = spot.triangle;
            spots[k] = Some(spot);
        }
        // Nodes with goals on the old grid whose own face was cut, from a neighbour; again until there are none.
        let missing = |k: &usize| spots[*k].is_none() && self.map.holds(goals[*k].0);
        let mut waiting: Vec<usize> = (0..cols * rows).filter(missing).collect();
        loop {
            let before = waiting.len();
            waiting.retain(|&k| {
                let near = [k - 1, k - cols, k + 1, k + cols].into_iter().find_map(|n| spots[n]);
                if let Some(start) = near {
                    spots[k] = Some(walk(chart, walk(chart, start, goals[k].1, rest), goals[k].1, rest));
                }
                near.is_none()
            });
            if waiting.len() == before {
                return spots;
            }
        }
    }

    /// Places of the other nodes, which lie where the patch has grown: evenly between those that are placed, in the
    /// square. Returns where all nodes lie on it.
    fn grown(&self, goals: &[Goal], spots: &mut [Option<Spot>]) -> Option<Vec<DVec2>> {
        let ((cols, rows), chart) = (self.size(), self.chart);
        let place = |k: usize| match spots[k] {
            Some(spot) if self.is_inner(k) => chart.uv_of(spot),
            _ => self.rim_uv(k),
        };
        let mut uv: Vec<DVec2> = (0..cols * rows).map(place).collect();
        for k in (0..cols * rows).filter(|&k| spots[k].is_none()) {
            let x = goals[k].0;
            let (i, j) = (k % cols, k / cols);
            let over_u = x.x < 0.0 || x.x > (cols - 1) as f64;
            let (first, stride, n, m) = if over_u { (j * cols, 1, cols, i) } else { (i, cols, rows, j) };
            let placed = |m: &usize| spots[first + m * stride].is_some();
            let (low, high) = ((0..m).rfind(placed)?, (m + 1..n).find(placed)?);
            let (a, b) = (uv[first + low * stride], uv[first + high * stride]);
            uv[k] = a.lerp(b, (m - low) as f64 / (high - low) as f64);
        }
        for k in 0..cols * rows {
            if spots[k].is_none() {
                let hint = spots[k - 1].or(spots[k - cols]).map_or(0, |s| s.triangle);
                spots[k] = Some(chart.locate(uv[k], hint));
            }
        }
        Some(uv)
    }
}

/// Walks over the surface to the foot of `goal`, in a few straight steps along the tangent plane, until it is nearer
/// than `rest`.
fn walk(chart: &Chart, start: Spot, goal: DVec3, rest: f64) -> Spot {
    let mut spot = start;
    for _ in 0..WALKS {
        let n = chart.normal(spot);
        let step = goal - chart.position(spot);
        let flat = step - n * step.dot(n);
        if flat.length_squared() < rest * rest {
            break;
        }
        spot = chart.advance(spot, flat);
    }
    spot
}

/// Which triangle of a chart is a face of the input, for faces that are in one piece.
struct Owners {
    first: u32,
    triangles: Vec<u32>,
    turns: Vec<[u8; 3]>,
}

impl Owners {
    fn new(chart: &Chart) -> Owners {
        let faces = || chart.frames.iter().map(|f| f.0);
        let (first, last) = (faces().min().unwrap_or(0), faces().max().unwrap_or(0));
        let mut triangles = vec![NONE; (last - first) as usize + 1];
        let mut turns = vec![[0; 3]; triangles.len()];
        for (t, (face, corners)) in chart.frames.iter().enumerate() {
            let k = (face - first) as usize;
            let whole = corners.map(|c| (0..3).find(|&j| c[j] == 1.0));
            if let [Some(a), Some(b), Some(c)] = whole {
                (triangles[k], turns[k]) = (t as u32, [a as u8, b as u8, c as u8]);
            }
        }
        Owners { first, triangles, turns }
    }

    fn spot(&self, face: u32, bary: [f64; 3]) -> Option<Spot> {
        let k = face.checked_sub(self.first)? as usize;
        let &triangle = self.triangles.get(k).filter(|t| **t != NONE)?;
        Some(Spot { triangle, bary: self.turns[k].map(|j| bary[j as usize]) })
    }
}
