//! Gauss-Newton on a net: even spacing along every iso-curve against square cells.
//!
//! Energy: for every edge `(l / m - 1)²` with `m` the mean of its curve, what F_arc of [K98] eq. 5.1 strives for.
//! In place of F_fair, which shortens curves and so pulls them off protruding parts: for every cell a penalty of its
//! angle off square that is mild up to about 45 degrees and steep beyond, and for every node one of the sideways
//! bend of both curves. Unknowns are moves `(a, b)` in cells along the net's own tangents; points then walk over
//! the surface (MovePointOnSurface), and a move that would turn a cell over is shortened.

use super::net::{Net, cell_corners};
use super::{Fault, GridParams};
use glam::{DVec2, DVec3};

/// Part of the squareness weight that acts on the square of the angle, besides its tenth power: enough to tell
/// which of two cells near square is better.
const GENTLE_SHARE: f64 = 0.13;
/// Angle off square at which both weights are meant.
const MEANT_ANGLE: f64 = std::f64::consts::FRAC_PI_4;
/// Cells along the longer side for which the weight of bends is meant.
const MEANT_CELLS: f64 = 32.0;
/// Least damping of the moves, in cells.
const DAMPING: f64 = 0.003;
/// Largest move of a round, in cells.
const LARGEST_MOVE: f64 = 0.5;
/// Steps of conjugate gradients in a round, for a net that is far from rest.
pub const CG_STEPS: usize = 24;
/// Solves of a round, and the factor by which the damping grows from one to the next if the energy rises (as of
/// Levenberg and Marquardt).
const ATTEMPTS: usize = 4;
const DAMPING_STEP: f64 = 10.0;
/// A round that lowers the energy by less than this fraction ends the resolution.
const SETTLED: f64 = 1e-3;

/// Settles `net` in up to `rounds` rounds of `steps` steps of conjugate gradients.
pub fn settle<'a>(
    mut net: Net<'a>,
    (rounds, steps): (usize, usize),
    params: &GridParams,
    cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Net<'a>, Fault> {
    let mut energy = None;
    let mut damping = DAMPING;
    for _ in 0..rounds {
        let system = System::new(&net, params);
        let before = energy.unwrap_or_else(|| system.energy());
        let mut least = before;
        for attempt in 0..ATTEMPTS {
            let Some(moves) = system.solve(damping, steps, cancelled) else { return Err(Fault::Cancelled) };
            let trial = net.moved(true, &|k, fraction| {
                let m = moves[k].clamp_length_max(LARGEST_MOVE) * fraction;
                let [u, v] = system.tangents[k];
                net.chart.advance(net.spots[k], u * m.x + v * m.y)
            });
            let reached = energy_of(&trial, params);
            if reached < least {
                net = trial;
                least = reached;
                if attempt == 0 {
                    damping = (damping / DAMPING_STEP).max(DAMPING);
                }
                break;
            }
            damping *= DAMPING_STEP;
        }
        if least >= before * (1.0 - SETTLED) {
            break;
        }
        energy = Some(least);
    }
    Ok(net)
}

/// Residual of a cell's angle off square and its derivative by that angle.
fn angle_residual(angle: f64, squareness: f64) -> (f64, f64) {
    let x = angle / MEANT_ANGLE;
    let steep = x.powi(8);
    let root = (squareness * (GENTLE_SHARE + steep)).sqrt();
    (x * root, squareness * (GENTLE_SHARE + 5.0 * steep) / root / MEANT_ANGLE)
}

/// Mid-lines of a cell, along u and v.
fn midlines(net: &Net, c: usize) -> (DVec3, DVec3) {
    let [a, b, c, d] = cell_corners(net.cols, c).map(|k| net.points[k]);
    ((b - a + c - d) / 2.0, (d - a + c - b) / 2.0)
}

/// Least sine that the angle of a cell is taken with: keeps the energy of a collapsed cell finite.
const LEAST_SINE: f64 = 0.02;

/// Angle off square between two mid-lines, its sine and cosine.
fn off_square(e: DVec3, f: DVec3) -> (f64, f64, f64) {
    let lengths = (e.length() * f.length()).max(f64::MIN_POSITIVE);
    let sin = (e.dot(f) / lengths).clamp(-1.0, 1.0);
    (sin.asin(), sin, (1.0 - sin * sin).sqrt().max(LEAST_SINE))
}

/// Edges of the inner curves: all lines along u, then all along v, as (first node, stride, number of edges).
fn curves(net: &Net) -> impl Iterator<Item = (usize, usize, usize)> + use<> {
    let (cols, rows) = (net.cols, net.rows);
    let lines = (1..rows - 1).map(move |j| (j * cols, 1, cols - 1));
    lines.chain((1..cols - 1).map(move |i| (i, cols, rows - 1)))
}

fn energy_of(net: &Net, params: &GridParams) -> f64 {
    let mut sum = 0.0;
    let mut lengths = Vec::new();
    for (first, stride, count) in curves(net) {
        lengths.clear();
        let node = |k: usize| net.points[first + k * stride];
        lengths.extend((0..count).map(|k| node(k).distance(node(k + 1))));
        let mean = lengths.iter().sum::<f64>() / count as f64;
        sum += lengths.iter().map(|l| (l / mean - 1.0).powi(2)).sum::<f64>();
    }
    let weight = bend_weight(net, params.fairness);
    for (k, stride) in bends(net) {
        sum += bend_of(net, k, stride, weight).0.powi(2);
    }
    for c in 0..(net.cols - 1) * (net.rows - 1) {
        let (e, f) = midlines(net, c);
        sum += angle_residual(off_square(e, f).0, params.squareness).0.powi(2);
    }
    sum
}

/// Inner nodes with the stride of the curve through them, for both curves.
fn bends(net: &Net) -> impl Iterator<Item = (usize, usize)> + use<> {
    let (cols, rows) = (net.cols, net.rows);
    (1..rows - 1).flat_map(move |j| (1..cols - 1).flat_map(move |i| [(j * cols + i, 1), (j * cols + i, cols)]))
}

/// Weight of a bend: angles between edges shrink with the cells, so that the weight grows with their number.
fn bend_weight(net: &Net, fairness: f64) -> f64 {
    fairness * (net.cols - 1).max(net.rows - 1) as f64 / MEANT_CELLS
}

/// How far the curve of `stride` bends sideways at node `k`, in edges, times `weight`; and the direction it is
/// measured in, over the edge length.
fn bend_of(net: &Net, k: usize, stride: usize, weight: f64) -> (f64, DVec3) {
    let other = if stride == 1 { net.cols } else { 1 };
    let along = (net.points[k + stride] - net.points[k - stride]) / 2.0;
    let across = net.points[k + other] - net.points[k - other];
    let length = along.length().max(f64::MIN_POSITIVE);
    let unit = along / length;
    let sideways = (across - unit * across.dot(unit)).normalize_or_zero() * (weight / length);
    let second = net.points[k + stride] + net.points[k - stride] - net.points[k] * 2.0;
    (second.dot(sideways), sideways)
}

/// The linearised energy: residuals and their derivatives by the moves of the nodes.
struct System {
    cols: usize,
    rows: usize,
    /// Tangents of every node, one cell long; zero on the rim, which thereby stays.
    tangents: Vec<[DVec3; 2]>,
    /// For each curve its first node, stride and number of edges.
    curves: Vec<(usize, usize, usize)>,
    /// For each edge, curve after curve: derivatives by the moves of its two nodes, and the residual.
    edges: Vec<([DVec2; 2], f64)>,
    /// For each cell the same with four nodes.
    cells: Vec<([DVec2; 4], f64)>,
    /// For each bend its node and stride, the derivatives by the node before, itself and after, and the residual.
    bends: Vec<(usize, usize, [DVec2; 3], f64)>,
}

impl System {
    fn new(net: &Net, params: &GridParams) -> System {
        let (cols, rows) = (net.cols, net.rows);
        let tangents: Vec<[DVec3; 2]> = (0..cols * rows)
            .map(|k| match net.is_inner(k) {
                true => {
                    [(net.points[k + 1] - net.points[k - 1]) / 2.0, (net.points[k + cols] - net.points[k - cols]) / 2.0]
                }
                false => [DVec3::ZERO; 2],
            })
            .collect();
        let by = |k: usize, g: DVec3| DVec2::new(g.dot(tangents[k][0]), g.dot(tangents[k][1]));
        let curves: Vec<_> = curves(net).collect();
        let mut edges = Vec::with_capacity(2 * cols * rows);
        for &(first, stride, count) in &curves {
            let start = edges.len();
            let mut sum = 0.0;
            for k in 0..count {
                let (a, b) = (first + k * stride, first + (k + 1) * stride);
                let edge = net.points[b] - net.points[a];
                let length = edge.length();
                sum += length;
                let unit = edge / length.max(f64::MIN_POSITIVE);
                edges.push(([-by(a, unit), by(b, unit)], length));
            }
            let mean = sum / count as f64;
            for edge in &mut edges[start..] {
                edge.0 = edge.0.map(|g| g / mean);
                edge.1 = edge.1 / mean - 1.0;
            }
        }
        let cells = (0..(cols - 1) * (rows - 1))
            .map(|c| {
                let (e, f) = midlines(net, c);
                let (angle, cos, sin) = off_square(e, f);
                let (residual, slope) = angle_residual(angle, params.squareness);
                let (le, lf) = (e.length().max(f64::MIN_POSITIVE), f.length().max(f64::MIN_POSITIVE));
                let by_cos = slope / sin;
                let by_e = (f / lf - e / le * cos) * (by_cos / le / 2.0);
                let by_f = (e / le - f / lf * cos) * (by_cos / lf / 2.0);
                let [a, b, c, d] = cell_corners(cols, c);
                let g = [by(a, -by_e - by_f), by(b, by_e - by_f), by(c, by_e + by_f), by(d, by_f - by_e)];
                (g, residual)
            })
            .collect();
        let weight = bend_weight(net, params.fairness);
        let bends = bends(net)
            .map(|(k, stride)| {
                let (residual, g) = bend_of(net, k, stride, weight);
                (k, stride, [by(k - stride, g), by(k, g * -2.0), by(k + stride, g)], residual)
            })
            .collect();
        System { cols, rows, tangents, curves, edges, cells, bends }
    }

    /// The energy of the net, as [`energy_of`] sums it up.
    fn energy(&self) -> f64 {
        let mut sum = 0.0;
        let mut n = 0;
        for &(_, _, count) in &self.curves {
            sum += self.edges[n..n + count].iter().map(|e| e.1.powi(2)).sum::<f64>();
            n += count;
        }
        let sum = self.bends.iter().fold(sum, |sum, b| sum + b.3.powi(2));
        self.cells.iter().fold(sum, |sum, c| sum + c.1.powi(2))
    }

    /// `Jᵀ r` for residuals of edges and cells.
    fn transpose(&self, edge: &[f64], cell: &[f64], bend: &[f64], out: &mut [DVec2]) {
        out.fill(DVec2::ZERO);
        let mut n = 0;
        for &(first, stride, count) in &self.curves {
            for k in 0..count {
                let g = &self.edges[n].0;
                out[first + k * stride] += g[0] * edge[n];
                out[first + (k + 1) * stride] += g[1] * edge[n];
                n += 1;
            }
        }
        for (c, (g, _)) in self.cells.iter().enumerate() {
            for (k, g) in cell_corners(self.cols, c).into_iter().zip(g) {
                out[k] += *g * cell[c];
            }
        }
        for ((k, stride, g, _), r) in self.bends.iter().zip(bend) {
            out[k - stride] += g[0] * *r;
            out[*k] += g[1] * *r;
            out[k + stride] += g[2] * *r;
        }
    }

    /// `J x`, the edges of each curve without their mean: a curve may grow or shrink as a whole.
    fn apply(&self, x: &[DVec2], edge: &mut [f64], cell: &mut [f64], bend: &mut [f64]) {
        let mut n = 0;
        for &(first, stride, count) in &self.curves {
            let mut sum = 0.0;
            for k in 0..count {
                let g = &self.edges[n + k].0;
                let r = g[0].dot(x[first + k * stride]) + g[1].dot(x[first + (k + 1) * stride]);
                edge[n + k] = r;
                sum += r;
            }
            let mean = sum / count as f64;
            edge[n..n + count].iter_mut().for_each(|r| *r -= mean);
            n += count;
        }
        for (c, (g, _)) in self.cells.iter().enumerate() {
            let corners = cell_corners(self.cols, c);
            cell[c] = (0..4).map(|k| g[k].dot(x[corners[k]])).sum();
        }
        for ((k, stride, g, _), r) in self.bends.iter().zip(bend) {
            *r = g[0].dot(x[k - stride]) + g[1].dot(x[*k]) + g[2].dot(x[k + stride]);
        }
    }

    /// Moves that lower the linearised energy: conjugate gradients, preconditioned by the 2 x 2 blocks.
    fn solve(&self, damping: f64, steps: usize, cancelled: &(dyn Fn() -> bool + Sync)) -> Option<Vec<DVec2>> {
        let count = self.cols * self.rows;
        let mut edge: Vec<f64> = self.edges.iter().map(|e| e.1).collect();
        let mut cell: Vec<f64> = self.cells.iter().map(|c| c.1).collect();
        let mut bend: Vec<f64> = self.bends.iter().map(|b| b.3).collect();
        let mut blocks = vec![[damping, 0.0, damping]; count];
        let add = |block: &mut [f64; 3], g: DVec2| {
            block[0] += g.x * g.x;
            block[1] += g.x * g.y;
            block[2] += g.y * g.y;
        };
        let mut n = 0;
        for &(first, stride, edges) in &self.curves {
            for k in 0..edges {
                add(&mut blocks[first + k * stride], self.edges[n].0[0]);
                add(&mut blocks[first + (k + 1) * stride], self.edges[n].0[1]);
                n += 1;
            }
        }
        for (c, (g, _)) in self.cells.iter().enumerate() {
            for (k, g) in cell_corners(self.cols, c).into_iter().zip(g) {
                add(&mut blocks[k], *g);
            }
        }
        for (k, stride, g, _) in &self.bends {
            add(&mut blocks[k - stride], g[0]);
            add(&mut blocks[*k], g[1]);
            add(&mut blocks[k + stride], g[2]);
        }
        let precondition = |r: &[DVec2], z: &mut [DVec2]| {
            for ((z, r), [a, b, c]) in z.iter_mut().zip(r).zip(&blocks) {
                let det = (a * c - b * b).max(f64::MIN_POSITIVE);
                *z = DVec2::new(c * r.x - b * r.y, a * r.y - b * r.x) / det;
            }
        };
        let dot = |x: &[DVec2], y: &[DVec2]| x.iter().zip(y).map(|(x, y)| x.dot(*y)).sum::<f64>();
        let mut r = vec![DVec2::ZERO; count];
        self.transpose(&edge, &cell, &bend, &mut r);
        r.iter_mut().for_each(|r| *r = -*r);
        let mut x = vec![DVec2::ZERO; count];
        let mut z = vec![DVec2::ZERO; count];
        let mut q = vec![DVec2::ZERO; count];
        precondition(&r, &mut z);
        let mut p = z.clone();
        let mut rz = dot(&r, &z);
        let first = rz;
        for _ in 0..steps {
            if rz <= 1e-6 * first || cancelled() {
                break;
            }
            self.apply(&p, &mut edge, &mut cell, &mut bend);
            self.transpose(&edge, &cell, &bend, &mut q);
            q.iter_mut().zip(&p).for_each(|(q, p)| *q += damping * *p);
            let alpha = rz / dot(&p, &q);
            for k in 0..count {
                x[k] += alpha * p[k];
                r[k] -= alpha * q[k];
            }
            precondition(&r, &mut z);
            let next = dot(&r, &z);
            let beta = next / rz;
            rz = next;
            for k in 0..count {
                p[k] = z[k] + beta * p[k];
            }
        }
        (!cancelled()).then_some(x)
    }
}
