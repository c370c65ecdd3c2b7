//! Where a surface turns over against the grid that it was fitted to.
//!
//! A spline fitted to rough data may swing back on itself between its nodes. That shows in its normal,
//! which there points against the mean normal of the grid around.
//!
//! See `docs/methods/surfaces.md`, "Folds".

use super::Surface;
use super::basis::{Knots, basis_at, span_samples};
use crate::grid::Grid;
use glam::DVec3;

/// Samples per knot span: the normal of a cubic span turns over at most a few times.
const SPAN_SAMPLES: usize = 4;
/// Knot spans to each side over which the grid's normal is averaged: what a surface can follow.
const NORMAL_SPANS: f64 = 1.0;
/// Cosine between the two normals below which a place counts as folded: the mean normal leads and lags the surface
/// on tight bends, but never by a right angle.
const FOLD_COSINE: f64 = 0.0;
/// Cosine below which a surface's normal is not believed when its seams are to follow it.
pub(super) const CREDIBLE: f64 = 0.5;
/// Relative length of `S_u x S_v` below which there is no normal: corners with an angle of 0 or 180 degrees.
const FLAT: f64 = 1e-6;

/// Number of samples at which a surface points against the grid that it was fitted to; four per knot span and
/// direction are looked at. 0 for a surface that does not fold.
pub fn folds(surface: &Surface, grid: &Grid) -> usize {
    let means = MeanNormals::new(grid, [surface.cols, surface.rows]);
    let [us, vs] =
        [&surface.knots_u, &surface.knots_v].map(|list| span_samples(&Knots::of(list).breaks(), SPAN_SAMPLES));
    let mut count = 0;
    for (b, &v) in vs.iter().enumerate() {
        let (j, bv) = basis_at(&surface.knots_v, v);
        let narrow = |order: usize| -> Vec<DVec3> {
            let row = |k: usize| &surface.control[(j + k) * surface.cols..(j + k + 1) * surface.cols];
            let (rows, w) = ([row(0), row(1), row(2), row(3)], bv[order]);
            (0..surface.cols).map(|i| (0..4).map(|k| rows[k][i] * w[k]).sum()).collect()
        };
        let (at, by) = (narrow(0), narrow(1));
        for (a, &u) in us.iter().enumerate() {
            if (a == 0 || a + 1 == us.len()) && (b == 0 || b + 1 == vs.len()) {
                continue;
            }
            let (i, bu) = basis_at(&surface.knots_u, u);
            let sum = |row: &[DVec3], w: &[f64; 4]| -> DVec3 { (0..4).map(|k| row[i + k] * w[k]).sum() };
            let (du, dv) = (sum(&at, &bu[1]), sum(&by, &bu[0]));
            let area = du.cross(dv);
            if area.length() <= FLAT * du.length() * dv.length() {
                continue;
            }
            if area.dot(means.at(u, v)) < FOLD_COSINE * area.length() {
                count += 1;
            }
        }
    }
    count
}

/// Mean normals of a grid: sums of the area vectors of all cells left of and below a node.
pub(crate) struct MeanNormals {
    cols: usize,
    rows: usize,
    reach: [usize; 2],
    sums: Vec<DVec3>,
}

impl MeanNormals {
    /// Of a grid that a surface with `control` points along `u` and `v` was fitted to.
    pub fn new(grid: &Grid, control: [usize; 2]) -> MeanNormals {
        let (rows, cols) = (grid.rows, grid.cols);
        let mut sums = vec![DVec3::ZERO; rows * cols];
        for j in 1..rows {
            let mut row = DVec3::ZERO;
            for i in 1..cols {
                let at = |i: usize, j: usize| grid.points[j * cols + i];
                row += (at(i, j) - at(i - 1, j - 1)).cross(at(i - 1, j) - at(i, j - 1));
                sums[j * cols + i] = sums[(j - 1) * cols + i] + row;
            }
        }
        let reach =
            |count: usize, control: usize| (NORMAL_SPANS * (count - 1) as f64 / (control - 3) as f64).ceil() as usize;
        MeanNormals { cols, rows, reach: [reach(cols, control[0]), reach(rows, control[1])], sums }
    }

    /// The unit normal of a surface's `area` vector at `(u, v)`, or the mean normal there if that says otherwise.
    pub fn mend(&self, area: DVec3, u: f64, v: f64) -> DVec3 {
        let (normal, mean) = (area.normalize_or_zero(), self.at(u, v));
        if mean != DVec3::ZERO && normal.dot(mean) < CREDIBLE { mean } else { normal }
    }

    /// Unit normal with which the grid comes to the place `(u, v)` of side `side`: the mean normals of two strips beside
    /// it, each half a knot span deep and two long, continued to the side as a line.
    pub fn beside(&self, side: usize, u: f64, v: f64) -> DVec3 {
        let (count, t) = if side.is_multiple_of(2) { (self.cols, u) } else { (self.rows, v) };
        let depth = if side.is_multiple_of(2) { self.rows } else { self.cols };
        let [along, across] = if side.is_multiple_of(2) { self.reach } else { [self.reach[1], self.reach[0]] };
        let k = (t * (count - 1) as f64).round() as usize;
        let (a, b) = (k.saturating_sub(along), (k + along).min(count - 1));
        let half = across.div_ceil(2).min(depth.saturating_sub(1)).max(1);
        let strip = |from: usize, to: usize| {
            let (from, to) = (from.min(depth - 1), to.min(depth - 1));
            let (from, to) = if side == 1 || side == 2 { (depth - 1 - to, depth - 1 - from) } else { (from, to) };
            match side.is_multiple_of(2) {
                true => self.sum([a, b], [from, to]),
                false => self.sum([from, to], [a, b]),
            }
            .normalize_or_zero()
        };
        let (near, far) = (strip(0, half), strip(half, 2 * half));
        let continued = if far == DVec3::ZERO { near } else { near * 1.5 - far * 0.5 };
        continued.normalize_or(near)
    }

    /// Nodes that lie within a knot span across side `side`.
    pub fn reach(&self, side: usize) -> usize {
        let (reach, count) =
            if side.is_multiple_of(2) { (self.reach[1], self.rows) } else { (self.reach[0], self.cols) };
        reach.min(count - 1)
    }

    /// Sum of the area vectors of the cells within a range of nodes along `u` and one along `v`.
    fn sum(&self, [a, b]: [usize; 2], [c, d]: [usize; 2]) -> DVec3 {
        let at = |i: usize, j: usize| self.sums[j * self.cols + i];
        at(b, d) - at(a, d) - at(b, c) + at(a, c)
    }

    /// Unit normal of the cells within a knot span of the place `(u, v)`; zero where they cancel out.
    pub fn at(&self, u: f64, v: f64) -> DVec3 {
        let range = |t: f64, count: usize, reach: usize| {
            let k = (t * (count - 1) as f64).round() as usize;
            (k.saturating_sub(reach), (k + reach).min(count - 1))
        };
        let ((a, b), (c, d)) = (range(u, self.cols, self.reach[0]), range(v, self.rows, self.reach[1]));
        self.sum([a, b], [c, d]).normalize_or_zero()
    }
}
