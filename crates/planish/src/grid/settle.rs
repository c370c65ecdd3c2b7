//! Gauss-Newton on a net: even spacing along every iso-curve against square cells.
//!
//! Energy: for every edge `(l / m - 1)²` with `m` the mean of its curve (what F_arc of [K98] eq. 5.1 strives for),
//! and for every cell a penalty of the cotangent of its angle (in place of F_fair, which shortens curves and so
//! pulls them off protruding parts). Unknowns are moves `(a, b)` in cells along the net's own tangents.

use super::net::{Net, cell_corners};
use super::{Fault, GridParams};
use glam::{DVec2, DVec3};

/// Weights of the squared and of the fourth power of the cotangent: small angles off square cost little, those
/// beyond about 45 degrees much.
const SQUARE_WEIGHT: f64 = 0.002;
const FOURTH_WEIGHT: f64 = 0.01;
/// Damping of the moves, in cells.
const DAMPING: f64 = 0.003;
/// Largest move of a round, in cells.
const LARGEST_MOVE: f64 = 0.5;
/// Steps of conjugate gradients in a round.
const CG_STEPS: usize = 24;
/// Halvings of a round that raises the energy.
const BACKTRACKS: usize = 4;
/// A round that lowers the energy by less than this fraction ends the resolution.
const SETTLED: f64 = 1e-3;

/// Settles `net` in up to `rounds` rounds.
pub fn settle<'a>(
    mut net: Net<'a>,
    rounds: usize,
    _params: &GridParams,
    cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Net<'a>, Fault> {
    let mut energy = energy_of(&net);
    for _ in 0..rounds {
        let system = System::new(&net);
        let Some(moves) = system.solve(cancelled) else { return Err(Fault::Cancelled) };
        let mut scale = 1.0;
        let before = energy;
        for _ in 0..BACKTRACKS {
            let trial = net.moved(&|k, fraction| {
                let m = moves[k].clamp_length_max(LARGEST_MOVE) * (scale * fraction);
                let [u, v] = system.tangents[k];
                net.chart.advance(net.spots[k], u * m.x + v * m.y)
            });
            let reached = energy_of(&trial);
            if reached < energy {
                net = trial;
                energy = reached;
                break;
            }
            scale *= 0.5;
        }
        if cancelled() {
            return Err(Fault::Cancelled);
        }
        if energy >= before * (1.0 - SETTLED) {
            break;
        }
    }
    Ok(net)
}

/// Residual of a cell's angle and its derivative by the cotangent.
fn angle_residual(cot: f64) -> (f64, f64) {
    let square = cot * cot;
    let root = (SQUARE_WEIGHT + FOURTH_WEIGHT * square).sqrt();
    (cot * root, (SQUARE_WEIGHT + 2.0 * FOURTH_WEIGHT * square) / root)
}

/// Mid-lines of a cell, along u and v.
fn midlines(net: &Net, c: usize) -> (DVec3, DVec3) {
    let [a, b, c, d] = cell_corners(net.cols, c).map(|k| net.points[k]);
    ((b - a + c - d) / 2.0, (d - a + c - b) / 2.0)
}

/// Least sine that the angle of a cell is taken with: keeps the energy of a collapsed cell finite.
const LEAST_SINE: f64 = 0.02;

fn cotangent(e: DVec3, f: DVec3) -> (f64, f64, f64) {
    let lengths = (e.length() * f.length()).max(f64::MIN_POSITIVE);
    let cos = (e.dot(f) / lengths).clamp(-1.0, 1.0);
    let sin = (1.0 - cos * cos).sqrt().max(LEAST_SINE);
    (cos / sin, cos, sin)
}

/// Edges of the inner curves: all lines along u, then all along v, as (first node, stride, number of edges).
fn curves(net: &Net) -> impl Iterator<Item = (usize, usize, usize)> + use<> {
    let (cols, rows) = (net.cols, net.rows);
    let lines = (1..rows - 1).map(move |j| (j * cols, 1, cols - 1));
    lines.chain((1..cols - 1).map(move |i| (i, cols, rows - 1)))
}

fn energy_of(net: &Net) -> f64 {
    let mut sum = 0.0;
    let mut lengths = Vec::new();
    for (first, stride, count) in curves(net) {
        lengths.clear();
        let node = |k: usize| net.points[first + k * stride];
        lengths.extend((0..count).map(|k| node(k).distance(node(k + 1))));
        let mean = lengths.iter().sum::<f64>() / count as f64;
        sum += lengths.iter().map(|l| (l / mean - 1.0).powi(2)).sum::<f64>();
    }
    for c in 0..(net.cols - 1) * (net.rows - 1) {
        let (e, f) = midlines(net, c);
        sum += angle_residual(cotangent(e, f).0).0.powi(2);
    }
    sum
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
}

impl System {
    fn new(net: &Net) -> System {
        let (cols, rows) = (net.cols, net.rows);
        let tangents: Vec<[DVec3; 2]> = (0..cols * rows)
            .map(|k| match net.is_inner(k) {
                true => [
                    (net.points[k + 1] - net.points[k - 1]) / 2.0,
                    (net.points[k + cols] - net.points[k - cols]) / 2.0,
                ],
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
                let (cot, cos, sin) = cotangent(e, f);
                let (residual, slope) = angle_residual(cot);
                let (le, lf) = (e.length().max(f64::MIN_POSITIVE), f.length().max(f64::MIN_POSITIVE));
                let by_cos = slope / (sin * sin * sin);
                let by_e = (f / lf - e / le * cos) * (by_cos / le / 2.0);
                let by_f = (e / le - f / lf * cos) * (by_cos / lf / 2.0);
                let [a, b, c, d] = cell_corners(cols, c);
                let g = [by(a, -by_e - by_f), by(b, by_e - by_f), by(c, by_e + by_f), by(d, by_f - by_e)];
                (g, residual)
            })
            .collect();
        System { cols, rows, tangents, curves, edges, cells }
    }

    /// `Jᵀ r` for residuals of edges and cells.
    fn transpose(&self, edge: &[f64], cell: &[f64], out: &mut [DVec2]) {
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
    }

    /// `J x`, the edges of each curve without their mean: a curve may grow or shrink as a whole.
    fn apply(&self, x: &[DVec2], edge: &mut [f64], cell: &mut [f64]) {
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
    }

    /// Moves that lower the linearised energy: conjugate gradients, preconditioned by the 2 x 2 blocks.
    fn solve(&self, cancelled: &(dyn Fn() -> bool + Sync)) -> Option<Vec<DVec2>> {
        let count = self.cols * self.rows;
        let mut edge: Vec<f64> = self.edges.iter().map(|e| e.1).collect();
        let mut cell: Vec<f64> = self.cells.iter().map(|c| c.1).collect();
        let mut blocks = vec![[DAMPING, 0.0, DAMPING]; count];
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
        let precondition = |r: &[DVec2], z: &mut [DVec2]| {
            for ((z, r), [a, b, c]) in z.iter_mut().zip(r).zip(&blocks) {
                let det = (a * c - b * b).max(f64::MIN_POSITIVE);
                *z = DVec2::new(c * r.x - b * r.y, a * r.y - b * r.x) / det;
            }
        };
        let dot = |x: &[DVec2], y: &[DVec2]| x.iter().zip(y).map(|(x, y)| x.dot(*y)).sum::<f64>();
        let mut r = vec![DVec2::ZERO; count];
        self.transpose(&edge, &cell, &mut r);
        r.iter_mut().for_each(|r| *r = -*r);
        let mut x = vec![DVec2::ZERO; count];
        let mut z = vec![DVec2::ZERO; count];
        let mut q = vec![DVec2::ZERO; count];
        precondition(&r, &mut z);
        let mut p = z.clone();
        let mut rz = dot(&r, &z);
        let first = rz;
        for _ in 0..CG_STEPS {
            if rz <= 1e-6 * first || cancelled() {
                break;
            }
            self.apply(&p, &mut edge, &mut cell);
            self.transpose(&edge, &cell, &mut q);
            q.iter_mut().zip(&p).for_each(|(q, p)| *q += DAMPING * *p);
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
