//! Gauss-Newton on a net: even spacing along every iso-curve against square cells.
//!
//! Energy: for every edge `(l / m - 1)²` with `m` the mean of its curve, whose rest is that of F_arc in [K98] eq.
//! 5.1; for every cell a penalty of its angle off square that is mild up to about 45 degrees and steep beyond; for
//! every node one of the sideways bend of both curves. Unknowns are moves `(a, b)` in cells along the net's own
//! tangents; points then walk over the surface (MovePointOnSurface), and a move that would turn a cell over is
//! shortened.
//!
//! Departs from [K98] §5.5: its fairness force (eq. 5.3) shortens curves and so pulls them off protruding parts; angle and bend
//! take its place. Its weights change over the relaxation (eq. 5.4); one energy needs no schedule.

use super::{Net, PARALLEL_LENGTH};
use crate::grid::{Fault, GridParams};
use crate::observe::{Cancelled, Observer};
use glam::{DVec2, DVec3};
use rayon::prelude::*;

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
pub const LARGEST_MOVE: f64 = 0.5;
/// Steps of conjugate gradients in a round, for a net that is far from rest.
pub const CG_STEPS: usize = 24;
/// Solves of a round, and the factor by which the damping grows from one to the next if the energy rises (as of
/// Levenberg and Marquardt).
const ATTEMPTS: usize = 4;
const DAMPING_STEP: f64 = 10.0;
/// A round that lowers the energy by less than this fraction ends the resolution.
const LEAST_ENERGY_DROP: f64 = 1e-3;
/// Conjugate gradients rest where the square of the preconditioned residual has fallen to this share.
const CG_REST: f64 = 1e-6;

/// Settles `net` in up to `rounds` rounds of `steps` steps of conjugate gradients.
pub fn settle<'a>(
    mut net: Net<'a>,
    (rounds, steps): (usize, usize),
    params: &GridParams,
    observer: &dyn Observer,
) -> Result<Net<'a>, Fault> {
    let mut known = None;
    let mut damping = DAMPING;
    for _ in 0..rounds {
        let system = System::new(&Terms::new(&net, params));
        let before = known.unwrap_or_else(|| system.energy());
        let mut least = before;
        for attempt in 0..ATTEMPTS {
            let moves = system.solve(damping, steps, observer)?;
            let trial = net.moved(true, &|k, fraction| {
                let m = moves[k].clamp_length_max(LARGEST_MOVE) * fraction;
                let [u, v] = system.tangents[k];
                net.chart.advance(net.spots[k], u * m.x + v * m.y)
            });
            let reached = Terms::new(&trial, params).energy();
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
        if least >= before * (1.0 - LEAST_ENERGY_DROP) {
            break;
        }
        known = Some(least);
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

/// Mid-lines of the cell above and to the right of node `k`, along u and v.
fn midlines(points: &[DVec3], cols: usize, k: usize) -> (DVec3, DVec3) {
    let [a, b, c, d] = [k, k + 1, k + 1 + cols, k + cols].map(|k| points[k]);
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

/// How far the curve of `stride` bends sideways at node `k`, in edges, times `weight`; and the direction it is
/// measured in, over the edge length.
fn bend(net: &Net, k: usize, stride: usize, weight: f64) -> (f64, DVec3) {
    let other = if stride == 1 { net.cols } else { 1 };
    let along = (net.points[k + stride] - net.points[k - stride]) / 2.0;
    let across = net.points[k + other] - net.points[k - other];
    let length = along.length().max(f64::MIN_POSITIVE);
    let unit = along / length;
    let sideways = (across - unit * across.dot(unit)).normalize_or_zero() * (weight / length);
    let second = net.points[k + stride] + net.points[k - stride] - net.points[k] * 2.0;
    (second.dot(sideways), sideways)
}

/// What belongs to a node, for the curve along u through it and the one along v: the edges that leave it, the cell
/// between them, and the bends in it. Zero where there is none; edges and bends of the boundary do not count.
#[derive(Clone, Copy, Default)]
struct AtNode<T, C> {
    edges: [T; 2],
    cell: C,
    bends: [T; 2],
}

type Residuals = AtNode<f64, f64>;

/// Derivatives by places: of an edge by its far end, of a cell by its mid-lines, of a bend by the second difference.
type Gradients = AtNode<DVec3, [DVec3; 2]>;

impl Residuals {
    fn squared(&self) -> f64 {
        let [a, b] = self.edges;
        let [c, d] = self.bends;
        a * a + b * b + c * c + d * d + self.cell * self.cell
    }
}

/// Sets `all`, one value per node of `cols` columns, to `of(i, j)`.
fn at_nodes<T: Send>(all: &mut [T], cols: usize, of: impl Fn(usize, usize) -> T + Sync) {
    all.par_chunks_mut(cols).enumerate().with_min_len((PARALLEL_LENGTH / cols).max(1)).for_each(|(j, row)| {
        row.iter_mut().enumerate().for_each(|(i, x)| *x = of(i, j));
    });
}

/// The sum of `of` over all indices, in pieces that do not depend on the number of threads.
fn sum(count: usize, of: impl Fn(usize) -> f64 + Sync) -> f64 {
    let piece = |first: usize| (first..(first + PARALLEL_LENGTH).min(count)).map(&of).sum::<f64>();
    let pieces: Vec<f64> =
        (0..count.div_ceil(PARALLEL_LENGTH)).into_par_iter().map(|n| piece(n * PARALLEL_LENGTH)).collect();
    pieces.iter().sum()
}

/// The residuals of a net and their derivatives.
struct Terms<'a> {
    net: &'a Net<'a>,
    squareness: f64,
    /// Angles between edges shrink with the cells, so that the weight of bends grows with their number.
    bend_weight: f64,
    /// Mean length of the edges of every row, and of every column.
    means: [Vec<f64>; 2],
}

impl<'a> Terms<'a> {
    fn new(net: &'a Net<'a>, params: &GridParams) -> Terms<'a> {
        let (cols, rows) = (net.cols, net.rows);
        let mean = |first: usize, stride: usize, count: usize| {
            let node = |k: usize| net.points[first + k * stride];
            (0..count).map(|k| node(k).distance(node(k + 1))).sum::<f64>() / count as f64
        };
        Terms {
            net,
            squareness: params.squareness,
            bend_weight: params.fairness * (cols - 1).max(rows - 1) as f64 / MEANT_CELLS,
            means: [
                (0..rows).map(|j| mean(j * cols, 1, cols - 1)).collect(),
                (0..cols).map(|i| mean(i, cols, rows - 1)).collect(),
            ],
        }
    }

    #[inline(always)]
    fn at(&self, i: usize, j: usize) -> (Residuals, Gradients) {
        let net = self.net;
        let k = j * net.cols + i;
        let mut found = (Residuals::default(), Gradients::default());
        if i + 1 == net.cols || j + 1 == net.rows {
            return found;
        }
        (found.0.cell, found.1.cell) = self.cell(k);
        for (d, (stride, mean, inner)) in
            [(1, self.means[0][j], j > 0), (net.cols, self.means[1][i], i > 0)].into_iter().enumerate()
        {
            if inner {
                let edge = net.points[k + stride] - net.points[k];
                let length = edge.length();
                found.0.edges[d] = length / mean - 1.0;
                found.1.edges[d] = edge / (length * mean).max(f64::MIN_POSITIVE);
            }
            if i > 0 && j > 0 {
                (found.0.bends[d], found.1.bends[d]) = bend(net, k, stride, self.bend_weight);
            }
        }
        found
    }

    /// The cell above and to the right of node `k`.
    fn cell(&self, k: usize) -> (f64, [DVec3; 2]) {
        let (e, f) = midlines(&self.net.points, self.net.cols, k);
        let (angle, cos, sin) = off_square(e, f);
        let (residual, slope) = angle_residual(angle, self.squareness);
        let (le, lf) = (e.length().max(f64::MIN_POSITIVE), f.length().max(f64::MIN_POSITIVE));
        let by_cos = slope / sin;
        (residual, [(f / lf - e / le * cos) * (by_cos / le), (e / le - f / lf * cos) * (by_cos / lf)])
    }

    fn energy(&self) -> f64 {
        let cols = self.net.cols;
        sum(self.net.points.len(), |k| self.at(k % cols, k / cols).0.squared())
    }
}

/// The linearised energy by moves of the nodes.
struct System {
    cols: usize,
    rows: usize,
    /// Tangents of every node, one cell long; zero on the boundary, which thereby stays.
    tangents: Vec<[DVec3; 2]>,
    residuals: Vec<Residuals>,
    gradients: Vec<Gradients>,
}

impl System {
    fn new(terms: &Terms) -> System {
        let net = terms.net;
        let (cols, rows) = (net.cols, net.rows);
        let count = cols * rows;
        let mut system = System {
            cols,
            rows,
            tangents: vec![[DVec3::ZERO; 2]; count],
            residuals: vec![Residuals::default(); count],
            gradients: vec![Gradients::default(); count],
        };
        at_nodes(&mut system.tangents, cols, |i, j| {
            let k = j * cols + i;
            let step = |stride: usize| (net.points[k + stride] - net.points[k - stride]) / 2.0;
            if net.is_inner(k) { [step(1), step(cols)] } else { [DVec3::ZERO; 2] }
        });
        at_nodes(&mut system.residuals, cols, |i, j| terms.at(i, j).0);
        at_nodes(&mut system.gradients, cols, |i, j| terms.at(i, j).1);
        system
    }

    /// The energy of the net, as [`Terms::energy`] sums it up.
    fn energy(&self) -> f64 {
        sum(self.residuals.len(), |k| self.residuals[k].squared())
    }

    /// Calls `part` with every residual that inner node `k` has a part in, and its derivative by the place of the node.
    #[inline(always)]
    fn parts(&self, k: usize, residuals: &[Residuals], mut part: impl FnMut(f64, DVec3)) {
        let (g, r) = (&self.gradients, residuals);
        for (d, stride) in [1, self.cols].into_iter().enumerate() {
            let (before, after) = (k - stride, k + stride);
            part(r[before].edges[d], g[before].edges[d]);
            part(r[k].edges[d], -g[k].edges[d]);
            part(r[before].bends[d], g[before].bends[d]);
            part(r[k].bends[d], g[k].bends[d] * -2.0);
            part(r[after].bends[d], g[after].bends[d]);
        }
        let (left, below) = (k - 1, k - self.cols);
        for (c, along, across) in [(k, -0.5, -0.5), (left, 0.5, -0.5), (below - 1, 0.5, 0.5), (below, -0.5, 0.5)] {
            part(r[c].cell, g[c].cell[0] * along + g[c].cell[1] * across);
        }
    }

    fn is_inner(&self, i: usize, j: usize) -> bool {
        i > 0 && j > 0 && i + 1 < self.cols && j + 1 < self.rows
    }

    /// `Jᵀ r`.
    fn transpose(&self, r: &[Residuals], out: &mut [DVec2]) {
        at_nodes(out, self.cols, |i, j| {
            let mut force = DVec3::ZERO;
            let k = j * self.cols + i;
            if self.is_inner(i, j) {
                self.parts(k, r, |r, g| force += g * r);
            }
            self.along_tangents(k, force)
        });
    }

    fn along_tangents(&self, k: usize, g: DVec3) -> DVec2 {
        let [u, v] = self.tangents[k];
        DVec2::new(u.dot(g), v.dot(g))
    }

    /// `J x`, the edges of each curve without their mean: a curve may grow or shrink as a whole.
    /// * `moves` - room for the moves of the nodes in space
    fn apply(&self, x: &[DVec2], moves: &mut [DVec3], out: &mut [Residuals]) {
        let (cols, rows) = (self.cols, self.rows);
        at_nodes(moves, cols, |i, j| {
            let k = j * cols + i;
            let [u, v] = self.tangents[k];
            u * x[k].x + v * x[k].y
        });
        let moves = &*moves;
        at_nodes(out, cols, |i, j| {
            let mut r = Residuals::default();
            if i + 1 == cols || j + 1 == rows {
                return r;
            }
            let k = j * cols + i;
            let g = &self.gradients[k];
            let (e, f) = midlines(moves, cols, k);
            r.cell = g.cell[0].dot(e) + g.cell[1].dot(f);
            for (d, stride) in [1, cols].into_iter().enumerate() {
                r.edges[d] = g.edges[d].dot(moves[k + stride] - moves[k]);
                if i > 0 && j > 0 {
                    r.bends[d] = g.bends[d].dot(moves[k + stride] + moves[k - stride] - moves[k] * 2.0);
                }
            }
            r
        });
        let mut columns = vec![0.0; cols];
        for row in out.chunks_mut(cols) {
            let mean = row.iter().map(|r| r.edges[0]).sum::<f64>() / (cols - 1) as f64;
            for (r, column) in row.iter_mut().zip(&mut columns) {
                r.edges[0] -= mean;
                *column += r.edges[1] / (rows - 1) as f64;
            }
        }
        for row in out.chunks_mut(cols) {
            row.iter_mut().zip(&columns).for_each(|(r, mean)| r.edges[1] -= mean);
        }
    }

    /// The inverse of the 2 x 2 blocks of `JᵀJ + damping`, as its three entries.
    fn preconditioner(&self, damping: f64) -> Vec<[f64; 3]> {
        let mut inverse = vec![[0.0; 3]; self.cols * self.rows];
        at_nodes(&mut inverse, self.cols, |i, j| {
            let [mut a, mut b, mut c] = [damping, 0.0, damping];
            if self.is_inner(i, j) {
                let k = j * self.cols + i;
                self.parts(k, &self.residuals, |_, g| {
                    let g = self.along_tangents(k, g);
                    (a, b, c) = (a + g.x * g.x, b + g.x * g.y, c + g.y * g.y);
                });
            }
            let det = (a * c - b * b).max(f64::MIN_POSITIVE);
            [c / det, -b / det, a / det]
        });
        inverse
    }

    /// Moves that lower the linearised energy: conjugate gradients, preconditioned by the 2 x 2 blocks.
    fn solve(&self, damping: f64, steps: usize, observer: &dyn Observer) -> Result<Vec<DVec2>, Cancelled> {
        let count = self.cols * self.rows;
        let inverse = self.preconditioner(damping);
        let precondition = |r: DVec2, [a, b, c]: [f64; 3]| DVec2::new(a * r.x + b * r.y, b * r.x + c * r.y);
        let (mut r, mut q) = (vec![DVec2::ZERO; count], vec![DVec2::ZERO; count]);
        let (mut moves, mut changes) = (vec![DVec3::ZERO; count], vec![Residuals::default(); count]);
        self.transpose(&self.residuals, &mut r);
        r.iter_mut().for_each(|r| *r = -*r);
        let mut x = vec![DVec2::ZERO; count];
        let mut p: Vec<DVec2> = r.iter().zip(&inverse).map(|(r, m)| precondition(*r, *m)).collect();
        let mut rz = sum(count, |k| r[k].dot(p[k]));
        let first = rz;
        for _ in 0..steps {
            observer.check()?;
            if rz <= CG_REST * first {
                break;
            }
            self.apply(&p, &mut moves, &mut changes);
            self.transpose(&changes, &mut q);
            let alpha = rz / sum(count, |k| p[k].dot(q[k] + damping * p[k]));
            for k in 0..count {
                x[k] += alpha * p[k];
                r[k] -= alpha * (q[k] + damping * p[k]);
            }
            let next = sum(count, |k| r[k].dot(precondition(r[k], inverse[k])));
            let beta = next / rz;
            rz = next;
            for k in 0..count {
                p[k] = precondition(r[k], inverse[k]) + beta * p[k];
            }
        }
        Ok(x)
    }
}
