//! What points cost under a surface joined of sheets, many points at once.
//!
//! Sums have a fixed number of lanes, as in `points` (`docs/decisions/0014-pulp.md`). A sum that passes a limit is
//! given up before it is complete.

use super::points::{BLOCK, LANES, lanes};
use pulp::{Arch, Simd, WithSimd};

/// Residuals count up to this many noise levels.
pub(crate) const RESIDUAL_LIMIT: f64 = 3.0;

/// Squares of distances in noise levels, each at most the square of [`RESIDUAL_LIMIT`]; zeros, which cost nothing, fill the
/// last lanes.
pub(crate) fn capped(residuals: &[f64]) -> Vec<f64> {
    filled(residuals.iter().map(|r| cap(r * r)), residuals.len())
}

/// Every so many of the distances; zeros, which cost nothing, fill the last lanes.
pub(crate) fn thinned(residuals: &[f64], step: usize) -> Vec<f64> {
    filled(residuals.iter().step_by(step).copied(), residuals.len().div_ceil(step))
}

/// A row of `count` values, then zeros to the end of its lanes.
fn filled(values: impl Iterator<Item = f64>, count: usize) -> Vec<f64> {
    let mut row = Vec::with_capacity(count.next_multiple_of(LANES));
    row.extend(values);
    row.resize(count.next_multiple_of(LANES), 0.0);
    row
}

#[inline(always)]
fn cap(square: f64) -> f64 {
    if square < RESIDUAL_LIMIT * RESIDUAL_LIMIT { square } else { RESIDUAL_LIMIT * RESIDUAL_LIMIT }
}

/// Sum over all points of the least of their [`capped`] squares; or something above `limit`, if it is.
pub(crate) fn nearest_cost(rows: &[&[f64]], limit: f64) -> f64 {
    Arch::new().dispatch(Nearest { rows, limit })
}

/// How the distances to a sheet are joined to those before, each times its sign.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Join {
    /// The minimum.
    Least(f64),
    /// The maximum.
    Greatest(f64),
}

/// Sum over all points of the squares of joined distances, each at most the square of [`RESIDUAL_LIMIT`]; or something above
/// `limit`, if it is.
/// * `rows` - distances to each sheet in noise levels; how the first is joined is of no meaning
pub(crate) fn joined_cost(rows: &[(&[f64], Join)], limit: f64) -> f64 {
    Arch::new().dispatch(Joined { rows, limit })
}

/// Sum over all points of the squares of joined distances, each at most the square of [`RESIDUAL_LIMIT`], and of what belongs
/// to the sheets that decide at them.
/// * `rows` - distances to each sheet in noise levels, and what belongs to it
/// * `concave` - bit k: sheet k is joined by the minimum, else by the maximum
pub(crate) fn decided_cost(rows: &[(&[f64], f64)], concave: u8) -> (f64, f64) {
    Arch::new().dispatch(Decided { rows, concave })
}

struct Nearest<'a> {
    rows: &'a [&'a [f64]],
    limit: f64,
}

impl WithSimd for Nearest<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> f64 {
        let mut sums = [0.0; LANES];
        let n = self.rows[0].len();
        for block in (0..n).step_by(2 * BLOCK) {
            for first in (block..n.min(block + 2 * BLOCK)).step_by(LANES) {
                let mut v = lanes(self.rows[0], first);
                for row in &self.rows[1..] {
                    let r = lanes(row, first);
                    (0..LANES).for_each(|l| v[l] = if r[l] < v[l] { r[l] } else { v[l] });
                }
                (0..LANES).for_each(|l| sums[l] += v[l]);
            }
            let sum = sums.iter().sum();
            if sum > self.limit {
                return sum;
            }
        }
        sums.iter().sum()
    }
}

struct Joined<'a> {
    rows: &'a [(&'a [f64], Join)],
    limit: f64,
}

impl WithSimd for Joined<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> f64 {
        let mut sums = [0.0; LANES];
        let n = self.rows[0].0.len();
        for block in (0..n).step_by(BLOCK) {
            for first in (block..n.min(block + BLOCK)).step_by(LANES) {
                // Places past the end count nothing.
                let mut v = lanes(self.rows[0].0, first);
                for (row, join) in &self.rows[1..] {
                    let r = lanes(row, first);
                    match join {
                        Join::Least(s) => {
                            (0..LANES).for_each(|l| v[l] = if s * r[l] < v[l] { s * r[l] } else { v[l] });
                        }
                        Join::Greatest(s) => {
                            (0..LANES).for_each(|l| v[l] = if s * r[l] > v[l] { s * r[l] } else { v[l] });
                        }
                    }
                }
                (0..LANES).for_each(|l| sums[l] += cap(v[l] * v[l]));
            }
            let sum = sums.iter().sum();
            if sum > self.limit {
                return sum;
            }
        }
        sums.iter().sum()
    }
}

struct Decided<'a> {
    rows: &'a [(&'a [f64], f64)],
    concave: u8,
}

impl WithSimd for Decided<'_> {
    type Output = (f64, f64);

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> (f64, f64) {
        let (mut costs, mut shares) = ([0.0; LANES], [0.0; LANES]);
        let n = self.rows[0].0.len();
        for first in (0..n).step_by(LANES) {
            let (mut v, mut own) = (lanes(self.rows[0].0, first), [self.rows[0].1; LANES]);
            for (k, (row, share)) in self.rows.iter().enumerate().skip(1) {
                let r = lanes(row, first);
                let least = self.concave >> k & 1 == 1;
                for l in 0..LANES {
                    let takes = if least { r[l] < v[l] } else { r[l] >= v[l] };
                    own[l] = if takes { *share } else { own[l] };
                    v[l] = if takes { r[l] } else { v[l] };
                }
            }
            let count = LANES.min(n - first);
            own[count..].fill(0.0);
            for l in 0..LANES {
                costs[l] += cap(v[l] * v[l]);
                shares[l] += own[l];
            }
        }
        (costs.iter().sum(), shares.iter().sum())
    }
}

/// How many points lie above both of two sheets: their feet on the farther one are part of the surface, or no more
/// than `on` off it.
/// * `rows` - distances to each sheet in noise levels, and its sign
/// * `turn` - cosine between the normals
/// * `least` - the sheets are joined by the minimum, else by the maximum
pub(crate) fn folded(rows: [(&[f64], f64); 2], turn: f64, least: bool, on: f64) -> usize {
    Arch::new().dispatch(Folded { rows, turn, side: if least { -1.0 } else { 1.0 }, on })
}

struct Folded<'a> {
    rows: [(&'a [f64], f64); 2],
    turn: f64,
    side: f64,
    on: f64,
}

impl WithSimd for Folded<'_> {
    type Output = usize;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> usize {
        let [(a, s), (b, t)] = self.rows;
        let mut count = 0u64;
        for (x, y) in a.iter().zip(b) {
            let (x, y) = (s * x, t * y);
            let foot = if y.abs() < x.abs() { y - x * self.turn } else { x - y * self.turn };
            count += u64::from(self.side * foot < self.on);
        }
        count as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::local::nest;
    use crate::geom::random;

    fn unit(seed: u64, i: usize) -> f64 {
        random::unit(seed, i as u64) - 0.5
    }

    #[test]
    fn joined_distances_cost_what_maxima_minima_and_nearest_do() {
        let row = |seed: u64| (0..45).map(|i| 9.0 * unit(seed, i)).collect::<Vec<f64>>();
        let rows = [row(5), row(6), row(7)];
        let [a, b, c] = [0, 1, 2].map(|k| &rows[k][..]);
        let cost = |v: f64| (v * v).min(RESIDUAL_LIMIT * RESIDUAL_LIMIT);
        let nested: f64 = (0..45).map(|i| cost(a[i].max(-b[i]).min(c[i]))).sum();
        let rows = [(a, Join::Greatest(1.0)), (b, Join::Greatest(-1.0)), (c, Join::Least(1.0))];
        assert!((joined_cost(&rows, f64::INFINITY) - nested).abs() < 1e-12);
        assert!(joined_cost(&rows, 0.5 * nested) > 0.5 * nested);
        let nearest: f64 = (0..45).map(|i| cost(a[i].abs().min(b[i].abs()))).sum();
        let squares = [capped(a), capped(b)];
        assert!((nearest_cost(&[&squares[0], &squares[1]], f64::INFINITY) - nearest).abs() < 1e-12);
        let (costs, shares) = decided_cost(&[(a, 1.0), (b, 10.0), (c, 100.0)], 0b100);
        let decided: Vec<usize> = (0..45).map(|i| nest::joined([a[i], b[i], c[i]], 0b100).0).collect();
        let bare: f64 = (0..45).map(|i| cost(a[i].max(b[i]).min(c[i]))).sum();
        assert!((costs - bare).abs() < 1e-12);
        assert_eq!(shares, decided.iter().map(|&k| [1.0, 10.0, 100.0][k]).sum::<f64>());
    }

    #[test]
    fn points_above_two_sheets_are_those_whose_foot_on_the_farther_one_is_surface() {
        let row = |seed: u64| (0..45).map(|i| 3.0 * unit(seed, i)).collect::<Vec<f64>>();
        let (a, b, turn) = (row(8), row(9), -0.9);
        for least in [false, true] {
            let above = |(x, y): (&f64, &f64)| {
                let y = -y;
                let foot = if y.abs() < x.abs() { y - x * turn } else { x - y * turn };
                let joined = if least { foot.min(0.0) } else { foot.max(0.0) };
                joined.abs() < 0.25
            };
            let count = a.iter().zip(&b).filter(|&p| above(p)).count();
            assert_eq!(folded([(&a, 1.0), (&b, -1.0)], turn, least, 0.25), count);
        }
    }
}
