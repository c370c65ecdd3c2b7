//! A grid of points in a chart at one resolution, and the moves that keep it free of folds.
//!
//! [K98] §5.5, spring points; here they move in a chart (`docs/methods/grids.md`).

pub(crate) mod catch;
pub(crate) mod even;
pub(crate) mod fold;
pub(crate) mod settle;
pub(crate) mod springs;

use super::chart::Chart;
use super::chart::locate::{Spot, orientation};
use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// Halvings of a point's move before it is given up for this round.
const HALVINGS: usize = 4;

/// Points that one task looks after at least.
pub const PARALLEL_LENGTH: usize = 2048;

/// `cols x rows` points of a chart, row-major; the boundary is fixed.
#[derive(Clone)]
pub struct Net<'a> {
    pub chart: &'a Chart,
    pub cols: usize,
    pub rows: usize,
    /// Places in the square.
    pub uv: Vec<DVec2>,
    /// The same places as spots of the chart.
    pub spots: Vec<Spot>,
    /// The same places as positions.
    pub points: Vec<DVec3>,
}

impl<'a> Net<'a> {
    /// The net with its points at `uv`.
    pub fn new(chart: &'a Chart, cols: usize, rows: usize, uv: Vec<DVec2>) -> Net<'a> {
        let mut net = Net { chart, cols, rows, uv, spots: Vec::with_capacity(cols * rows), points: Vec::new() };
        for k in 0..cols * rows {
            let hint = match k {
                0 => 0,
                _ if k % cols == 0 => net.spots[k - cols].triangle,
                _ => net.spots[k - 1].triangle,
            };
            net.spots.push(chart.locate(net.uv[k], hint));
        }
        net.points = net.spots.iter().map(|&s| chart.position(s)).collect();
        net
    }

    /// The regular net of the square.
    pub fn regular(chart: &'a Chart, cols: usize, rows: usize) -> Net<'a> {
        let at = |k: usize, n: usize| k as f64 / (n - 1) as f64;
        let uv = (0..cols * rows).map(|k| DVec2::new(at(k % cols, cols), at(k / cols, rows))).collect();
        Net::new(chart, cols, rows, uv)
    }

    /// The net with another number of points, bilinear between its own. Falls back to the regular net in the rare
    /// case that the new cells, where they straddle old ones, turn over.
    pub fn resampled(&self, cols: usize, rows: usize) -> Net<'a> {
        let cell = |k: usize, n: usize, m: usize| {
            // Exact where the new line is an old one.
            let whole = k * (m - 1) / (n - 1);
            let rest = (k * (m - 1) % (n - 1)) as f64 / (n - 1) as f64;
            if whole + 1 < m { (whole, rest) } else { (m - 2, 1.0) }
        };
        let mut uv = Vec::with_capacity(cols * rows);
        for j in 0..rows {
            let (y, t) = cell(j, rows, self.rows);
            for i in 0..cols {
                let (x, s) = cell(i, cols, self.cols);
                let at = |x: usize, y: usize| self.uv[y * self.cols + x];
                let (low, high) = (at(x, y).lerp(at(x + 1, y), s), at(x, y + 1).lerp(at(x + 1, y + 1), s));
                let mut p = low.lerp(high, t);
                if i == 0 || i + 1 == cols {
                    p = DVec2::new((i > 0) as u8 as f64, j as f64 / (rows - 1) as f64);
                } else if j == 0 || j + 1 == rows {
                    p = DVec2::new(i as f64 / (cols - 1) as f64, (j > 0) as u8 as f64);
                }
                uv.push(p);
            }
        }
        if (0..(cols - 1) * (rows - 1)).any(|c| turns_over(&uv, cols, c)) {
            smooth_turned(&mut uv, cols, rows);
        }
        if (0..(cols - 1) * (rows - 1)).any(|c| turns_over(&uv, cols, c)) {
            return Net::regular(self.chart, cols, rows);
        }
        Net::new(self.chart, cols, rows, uv)
    }

    /// True for a point that may move.
    pub fn is_inner(&self, k: usize) -> bool {
        let (i, j) = (k % self.cols, k / self.cols);
        i > 0 && j > 0 && i + 1 < self.cols && j + 1 < self.rows
    }

    /// Moves every inner point by `by(k, fraction)` (fraction 1 first), halving the moves around cells that would
    /// turn over in the square (or, if `untwisted`, get twisted on the surface) until none does. Returns the moved net.
    pub fn moved(&self, untwisted: bool, by: &(dyn Fn(usize, f64) -> Spot + Sync)) -> Net<'a> {
        let count = self.cols * self.rows;
        let mut spots = self.spots.clone();
        let mut uv = self.uv.clone();
        let mut halved = vec![0usize; count];
        let mut points = self.points.clone();
        let place = |k: usize, halvings: usize, spots: &mut [Spot], uv: &mut [DVec2], points: &mut [DVec3]| {
            if halvings > HALVINGS {
                (spots[k], uv[k], points[k]) = (self.spots[k], self.uv[k], self.points[k]);
            } else {
                spots[k] = by(k, 0.5f64.powi(halvings as i32));
                uv[k] = self.chart.uv_of(spots[k]);
                points[k] = self.chart.position(spots[k]);
            }
        };
        let first: Vec<Spot> = (0..count)
            .into_par_iter()
            .with_min_len(PARALLEL_LENGTH)
            .map(|k| if self.is_inner(k) { by(k, 1.0) } else { self.spots[k] })
            .collect();
        for (k, &spot) in first.iter().enumerate().filter(|(k, _)| self.is_inner(*k)) {
            (spots[k], uv[k], points[k]) = (spot, self.chart.uv_of(spot), self.chart.position(spot));
        }
        let cells = (self.cols - 1) * (self.rows - 1);
        let turned = |c: usize, uv: &[DVec2], points: &[DVec3]| {
            turns_over(uv, self.cols, c)
                || (untwisted && is_twisted(points, self.cols, c) && !is_twisted(&self.points, self.cols, c))
        };
        let mut suspects: Vec<usize> = (0..cells).collect();
        loop {
            let bad: Vec<usize> =
                (suspects.into_par_iter().with_min_len(PARALLEL_LENGTH)).filter(|&c| turned(c, &uv, &points)).collect();
            if bad.is_empty() {
                break;
            }
            let mut corners: Vec<usize> = bad.iter().flat_map(|&c| cell_corners(self.cols, c)).collect();
            corners.sort_unstable();
            corners.dedup();
            suspects = Vec::new();
            let mut any = false;
            for k in corners {
                if self.is_inner(k) && halved[k] <= HALVINGS {
                    any = true;
                    halved[k] += 1;
                    place(k, halved[k], &mut spots, &mut uv, &mut points);
                }
                let (i, j) = (k % self.cols, k / self.cols);
                for y in j.saturating_sub(1)..(j + 1).min(self.rows - 1) {
                    for x in i.saturating_sub(1)..(i + 1).min(self.cols - 1) {
                        suspects.push(y * (self.cols - 1) + x);
                    }
                }
            }
            if !any {
                // All its corners are back where they were: the cell was so before.
                break;
            }
            suspects.sort_unstable();
            suspects.dedup();
        }
        Net { chart: self.chart, cols: self.cols, rows: self.rows, uv, spots, points }
    }
}

/// Indices of the four corners of cell `c`, counter-clockwise.
pub fn cell_corners(cols: usize, c: usize) -> [usize; 4] {
    let k = c / (cols - 1) * cols + c % (cols - 1);
    [k, k + 1, k + 1 + cols, k + cols]
}

/// True if one of the four corner triangles of a cell is not counter-clockwise in the square (exact).
pub fn turns_over(uv: &[DVec2], cols: usize, c: usize) -> bool {
    let q = cell_corners(cols, c).map(|k| uv[k]);
    (0..4).any(|k| orientation(q[k], q[(k + 1) % 4], q[(k + 2) % 4]) <= 0.0)
}

/// True if one of the four corner triangles of a cell points against the cell's own area vector.
fn is_twisted(points: &[DVec3], cols: usize, c: usize) -> bool {
    let q = cell_corners(cols, c).map(|k| points[k]);
    let normal = (q[2] - q[0]).cross(q[3] - q[1]);
    (0..4).any(|k| (q[(k + 1) % 4] - q[k]).cross(q[(k + 3) % 4] - q[k]).dot(normal) <= 0.0)
}

/// Draws the corners of turned cells towards the mean of their neighbours, in the square.
pub fn smooth_turned(uv: &mut [DVec2], cols: usize, rows: usize) {
    const SWEEPS: usize = 100;
    for _ in 0..SWEEPS {
        let bad: Vec<usize> = (0..(cols - 1) * (rows - 1)).filter(|&c| turns_over(uv, cols, c)).collect();
        if bad.is_empty() {
            return;
        }
        for k in bad.into_iter().flat_map(|c| cell_corners(cols, c)) {
            let (i, j) = (k % cols, k / cols);
            if i > 0 && j > 0 && i + 1 < cols && j + 1 < rows {
                uv[k] = (uv[k - 1] + uv[k + 1] + uv[k - cols] + uv[k + cols]) / 4.0;
            }
        }
    }
}
