//! The chance that a noisy point is of each sheet of a nesting.
//!
//! A point of the surface with normal noise in all directions lies around a half-plane of it with density `phi(d)
//! Phi(t)`: `d` the distance across the sheet, `t` that of its foot from where the sheet ends, both in noise levels.
//! Which sheet decides at the noisy point is another question: beside an edge noise moves the points of one face that
//! lie high to the other, and the faces, each fitted to what is left, meet at too sharp an angle. See
//! `docs/methods/samples.md`, section 6.

use crate::cloud::local::joints::RESIDUAL_LIMIT;
use crate::cloud::local::nest::{self, MOST_NESTED};
use glam::DVec3;

/// Sheets whose angle has a lesser sine than this do not meet.
const PARALLEL_SINE: f64 = 1e-3;

/// A sheet that a point may be of.
#[derive(Clone, Copy, Debug, Default)]
struct Chance {
    sheet: usize,
    /// Squared distance.
    square: f64,
    /// Share of the noise that leaves the foot on the sheet.
    inside: f64,
}

/// A nesting as points see it.
pub(crate) struct Chances<'a> {
    /// Signed distance of every point to each sheet, in noise levels.
    rows: Vec<&'a [f64]>,
    /// Cosines between the normals of the sheets, and what a distance to one sheet counts along another.
    turn: [[f64; MOST_NESTED]; MOST_NESTED],
    stretch: [[f64; MOST_NESTED]; MOST_NESTED],
    concave: u8,
}

impl<'a> Chances<'a> {
    /// * `sheets` - signed distance of every point in noise levels, and unit normal of the sheet in the middle of the points
    /// * `concave` - bit k: sheet k is joined by the minimum, else by the maximum
    pub fn new(sheets: impl Iterator<Item = (&'a [f64], DVec3)>, concave: u8) -> Chances<'a> {
        let (rows, normals): (Vec<&[f64]>, Vec<DVec3>) = sheets.unzip();
        let mut turn = [[0.0; MOST_NESTED]; MOST_NESTED];
        for (row, a) in turn.iter_mut().zip(&normals) {
            row.iter_mut().zip(&normals).for_each(|(turn, b)| *turn = a.dot(*b));
        }
        let stretch = turn.map(|row| row.map(|c| 1.0 / (1.0 - c * c).max(PARALLEL_SINE * PARALLEL_SINE).sqrt()));
        Chances { rows, turn, stretch, concave }
    }

    /// How far inside of sheet `k` the foot on it lies of a point with these distances.
    fn inside(&self, k: usize, at: &[f64; MOST_NESTED]) -> f64 {
        let is_least = |j: usize| self.concave >> j & 1 == 1;
        let foot = |j: usize| at[j] - at[k] * self.turn[j][k];
        let mut inside = f64::INFINITY;
        if k > 0 {
            let (own, before) = nest::joined((0..k).map(foot), self.concave);
            inside = if is_least(k) { before } else { -before } * self.stretch[own][k];
        }
        for j in k + 1..self.rows.len() {
            inside = inside.min(if is_least(j) { foot(j) } else { -foot(j) } * self.stretch[j][k]);
        }
        inside
    }

    /// The sheets that point `q` may be of.
    fn of(&self, q: usize) -> ([Chance; MOST_NESTED], usize) {
        let mut at = [0.0; MOST_NESTED];
        at.iter_mut().zip(&self.rows).for_each(|(a, row)| *a = row[q]);
        let (mut found, mut count) = ([Chance::default(); MOST_NESTED], 0);
        let near = |k: &usize| at[*k].abs() < RESIDUAL_LIMIT;
        if (0..self.rows.len()).filter(near).count() < 2 {
            // Far from edges the sheet that decides has the point.
            let (k, d) = nest::joined(at[..self.rows.len()].iter().copied(), self.concave);
            found[0] = Chance { sheet: k, square: d * d, inside: 1.0 };
            return (found, usize::from(d.abs() < RESIDUAL_LIMIT));
        }
        for k in (0..self.rows.len()).filter(near) {
            let inside = self.inside(k, &at);
            if inside > -RESIDUAL_LIMIT {
                let inside = if inside < RESIDUAL_LIMIT { below(inside) } else { 1.0 };
                found[count] = Chance { sheet: k, square: at[k] * at[k], inside };
                count += 1;
            }
        }
        (found, count)
    }

    /// For each sheet the chance that each point is of it; zero for points of none.
    pub fn shares(&self) -> Vec<Vec<f64>> {
        let count = self.rows[0].len();
        let mut shares = vec![vec![0.0; count]; self.rows.len()];
        for (q, (found, n)) in (0..count).map(|q| self.of(q)).enumerate() {
            match found[..n] {
                [] => {}
                [one] => shares[one.sheet][q] = 1.0,
                ref several => {
                    let least = several.iter().map(|c| c.square).fold(f64::INFINITY, f64::min);
                    let density = |c: &Chance| (0.5 * (least - c.square)).exp() * c.inside;
                    let all: f64 = several.iter().map(density).sum();
                    several.iter().for_each(|c| shares[c.sheet][q] = density(c) / all);
                }
            }
        }
        shares
    }
}

/// Share of normal noise below `x` levels; Abramowitz and Stegun 7.1.26, to 1e-7.
fn below(x: f64) -> f64 {
    let z = x.abs() / std::f64::consts::SQRT_2;
    let t = 1.0 / (1.0 + 0.327_591_1 * z);
    let series = [1.061_405_429, -1.453_152_027, 1.421_413_741, -0.284_496_736, 0.254_829_592];
    let tail = 0.5 * series.iter().fold(0.0, |sum, c| (sum + c) * t) * (-z * z).exp();
    if x > 0.0 { 1.0 - tail } else { tail }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::random;

    /// Points of two half-planes that meet in the y axis, up to 20 noise levels from it, the second turned down by `angle`:
    /// distances to both, and how far inside of the first each is.
    fn edge(angle: f64, count: u64) -> ([Vec<f64>; 2], [DVec3; 2], Vec<f64>) {
        let (s, c) = angle.sin_cos();
        let normals = [DVec3::Z, DVec3::new(s, 0.0, c)];
        let (mut rows, mut along) = ([Vec::new(), Vec::new()], Vec::new());
        for i in 0..count {
            let r = |k: u64| random::unit(31, 8 * i + k);
            let noise = DVec3::from_array([0, 1, 2].map(|k| random::normal(r(2 + 2 * k), r(3 + 2 * k))));
            let way = if r(0) < 0.5 { DVec3::NEG_X } else { DVec3::new(c, 0.0, -s) };
            let p = 20.0 * r(1) * way + noise;
            rows.iter_mut().zip(normals).for_each(|(row, n)| row.push(n.dot(p)));
            along.push(-p.x);
        }
        (rows, normals, along)
    }

    /// Slope in degrees of the line through weighted heights.
    fn slope(weights: &[f64], x: &[f64], y: &[f64]) -> f64 {
        let sum = |f: &dyn Fn(usize) -> f64| (0..x.len()).map(|i| weights[i] * f(i)).sum::<f64>();
        let n = sum(&|_| 1.0);
        let (mx, my) = (sum(&|i| x[i]) / n, sum(&|i| y[i]) / n);
        (sum(&|i| (x[i] - mx) * (y[i] - my)) / sum(&|i| (x[i] - mx).powi(2))).atan().to_degrees()
    }

    #[test]
    fn a_face_beside_an_edge_fitted_to_its_shares_is_not_tilted_but_to_the_points_at_which_it_decides() {
        for (angle, concave) in [(90.0f64, false), (90.0, true), (45.0, false), (120.0, true)] {
            let (mut rows, mut normals, along) = edge(angle.to_radians(), 400_000);
            if concave {
                rows.iter_mut().flatten().for_each(|d| *d = -*d);
                normals = normals.map(|n| -n);
            }
            let sheets = || rows.iter().map(|r| &r[..]).zip(normals);
            let near = |shares: Vec<f64>| -> Vec<f64> {
                shares.into_iter().zip(&along).map(|(w, x)| if *x < 10.0 { w } else { 0.0 }).collect()
            };
            let [first, second] = &rows;
            let by_share = near(Chances::new(sheets(), u8::from(concave) << 1).shares().swap_remove(0));
            let decides = |(a, b): (&f64, &f64)| ((*a < *b) == concave && a.abs() < RESIDUAL_LIMIT) as u8 as f64;
            let by_side = near(first.iter().zip(second).map(decides).collect());
            let tilts = [by_share, by_side].map(|w| slope(&w, &along, first).abs());
            assert!(tilts[0] < 0.1 && tilts[1] > 0.5, "{angle} {concave}: {tilts:?}");
        }
    }

    #[test]
    fn a_point_on_an_edge_is_half_of_each_face_and_one_that_noise_does_not_reach_of_none() {
        let normals = [DVec3::Z, DVec3::X];
        // On the edge, above the first face, above the second one where the first has ended, deep inside.
        let rows = [[0.0, 1.5, 0.0, -3.5], [0.0, -9.0, 9.0, -3.5]];
        let shares = Chances::new(rows.iter().map(|r| &r[..]).zip(normals), 0).shares();
        assert_eq!(shares, [[0.5, 1.0, 0.0, 0.0], [0.5, 0.0, 0.0, 0.0]]);
        assert!((below(1.0) - 0.841_344_746).abs() < 2e-7 && (below(-2.0) - 0.022_750_132).abs() < 2e-7);
    }
}
