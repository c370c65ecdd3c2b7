//! Many points at once: coordinates side by side, so that the processor works on several of them in one instruction.
//!
//! Every sum has a fixed number of lanes, so its bits do not depend on how wide the instructions are.
//!
//! See `docs/decisions/0014-pulp.md`.

use super::height::{Frame, Height};
use super::moments::{COUNT, CUBIC_COUNT, Moments, PARENTS};
use super::weights::kernel;
use crate::cloud::Quadric;
use glam::DVec3;
use pulp::{Arch, Simd, WithSimd};

/// Lanes of a sum.
pub(crate) const LANES: usize = 8;
/// Points whose monomials are in the cache together.
pub(crate) const BLOCK: usize = 64;

/// Points, coordinate by coordinate.
#[derive(Clone, Debug, Default)]
pub(crate) struct Points {
    x: Vec<f64>,
    y: Vec<f64>,
    z: Vec<f64>,
}

impl Points {
    pub(crate) fn with_capacity(count: usize) -> Points {
        let axis = || Vec::with_capacity(count);
        Points { x: axis(), y: axis(), z: axis() }
    }

    pub(crate) fn clear(&mut self) {
        self.x.clear();
        self.y.clear();
        self.z.clear();
    }

    pub(crate) fn push(&mut self, p: DVec3) {
        self.x.push(p.x);
        self.y.push(p.y);
        self.z.push(p.z);
    }

    /// Takes these points instead.
    pub(crate) fn refill(&mut self, points: &[DVec3]) {
        self.clear();
        self.x.extend(points.iter().map(|p| p.x));
        self.y.extend(points.iter().map(|p| p.y));
        self.z.extend(points.iter().map(|p| p.z));
    }

    /// Makes the points local to a ball, and weighs each by its distance along a sheet ([`kernel`]).
    /// * `normal` - that of the sheet
    pub(crate) fn localize(&mut self, center: DVec3, radius: f64, normal: DVec3, weights: &mut Vec<f64>) {
        weights.clear();
        weights.resize(self.len(), 0.0);
        let at = [&mut self.x[..], &mut self.y[..], &mut self.z[..]];
        Arch::new().dispatch(Localize { at, center, radius, normal, weights });
    }

    /// Leaves out the points whose weights are not above `least`, and these weights.
    pub(crate) fn keep_above(&mut self, least: f64, weights: &mut Vec<f64>) {
        let mut kept = 0;
        for i in 0..weights.len() {
            if weights[i] > least {
                (self.x[kept], self.y[kept], self.z[kept]) = (self.x[i], self.y[i], self.z[i]);
                weights[kept] = weights[i];
                kept += 1;
            }
        }
        for axis in [&mut self.x, &mut self.y, &mut self.z, weights] {
            axis.truncate(kept);
        }
    }

    /// Coordinates of all points and distances above the height field, in its frame; `out` is three rows of values.
    pub(crate) fn heights(&self, height: &Height, out: &mut [Vec<f64>; 3]) {
        let rows = out.each_mut().map(|row| {
            row.resize(self.len(), 0.0);
            &mut row[..]
        });
        Arch::new().dispatch(Heights { at: self.columns(), height, out: rows });
    }

    /// Distance of the farthest point from the origin.
    pub(crate) fn reach(&self) -> f64 {
        Arch::new().dispatch(Farthest { at: self.columns() }).sqrt()
    }

    /// Adds the points of another.
    pub(crate) fn append(&mut self, other: &Points) {
        self.x.extend_from_slice(&other.x);
        self.y.extend_from_slice(&other.y);
        self.z.extend_from_slice(&other.z);
    }

    pub(crate) fn len(&self) -> usize {
        self.x.len()
    }

    pub(crate) fn get(&self, i: usize) -> DVec3 {
        DVec3::new(self.x[i], self.y[i], self.z[i])
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = DVec3> + '_ {
        (0..self.len()).map(|i| self.get(i))
    }

    /// First-order signed distance of every point to a quadric, as [`Quadric::distance`], in the units of the points.
    pub(crate) fn distances(&self, q: &Quadric, out: &mut Vec<f64>) {
        self.distances_in(1.0, q, out);
    }

    /// These distances over a noise level.
    pub(crate) fn levels(&self, q: &Quadric, noise: f64) -> Vec<f64> {
        let mut levels = Vec::new();
        self.distances_in(noise, q, &mut levels);
        levels
    }

    fn distances_in(&self, unit: f64, q: &Quadric, out: &mut Vec<f64>) {
        out.resize(self.len(), 0.0);
        Arch::new().dispatch(Distances { at: self.columns(), q, unit, out });
    }

    /// Weighted sums of the monomials.
    pub(crate) fn moments(&self, weights: &[f64]) -> Moments {
        Arch::new().dispatch(Sums { at: self.columns(), weights })
    }

    fn columns(&self) -> [&[f64]; 3] {
        [&self.x, &self.y, &self.z]
    }
}

impl Points {
    /// Every so many of these points.
    pub(crate) fn every(points: &[DVec3], step: usize) -> Points {
        let axis = |of: fn(&DVec3) -> f64| points.iter().step_by(step).map(of).collect();
        Points { x: axis(|p| p.x), y: axis(|p| p.y), z: axis(|p| p.z) }
    }
}

impl FromIterator<DVec3> for Points {
    fn from_iter<T: IntoIterator<Item = DVec3>>(points: T) -> Points {
        let points = points.into_iter();
        let mut all = Points::with_capacity(points.size_hint().1.unwrap_or(0));
        points.for_each(|p| all.push(p));
        all
    }
}

/// Sum of the squares of `values`, each times its weight.
pub(crate) fn weighted_squares(weights: &[f64], values: &[f64]) -> f64 {
    Arch::new().dispatch(Squares { weights, values })
}

/// The lanes of a row from `first` on; places past the end are zero.
#[inline(always)]
pub(crate) fn lanes(row: &[f64], first: usize) -> [f64; LANES] {
    let mut all = [0.0; LANES];
    if let Some(whole) = row.get(first..first + LANES) {
        all.copy_from_slice(whole);
    } else {
        all.iter_mut().zip(&row[first..]).for_each(|(to, from)| *to = *from);
    }
    all
}

struct Distances<'a> {
    at: [&'a [f64]; 3],
    q: &'a Quadric,
    unit: f64,
    out: &'a mut [f64],
}

impl WithSimd for Distances<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let (n, unit, out) = (self.out.len(), self.unit, self.out);
        let [x, y, z] = self.at.map(|c| &c[..n]);
        let (a, c, scale, inverse) = (self.q.a, self.q.center, self.q.scale, 1.0 / self.q.scale);
        if a[..6] == [0.0; 6] {
            // The same bits: the gradient of a plane is the same everywhere.
            let square = a[6] * a[6] + a[7] * a[7] + a[8] * a[8];
            let length = square.sqrt();
            for i in 0..n {
                let (x, y, z) = ((x[i] - c.x) * inverse, (y[i] - c.y) * inverse, (z[i] - c.z) * inverse);
                let d = scale * (a[6] * x + a[7] * y + a[8] * z + a[9]) / length;
                out[i] = if square > 0.0 { d / unit } else { f64::INFINITY };
            }
            return;
        }
        for i in 0..n {
            let (x, y, z) = ((x[i] - c.x) * inverse, (y[i] - c.y) * inverse, (z[i] - c.z) * inverse);
            let (hx, hy, hz) = (a[0] * x + a[1] * y + a[2] * z, a[3] * y + a[4] * z, a[5] * z);
            let gx = a[0] * x + hx + a[6];
            let gy = a[1] * x + a[3] * y + hy + a[7];
            let gz = a[2] * x + a[4] * y + a[5] * z + hz + a[8];
            let f = hx * x + hy * y + hz * z + a[6] * x + a[7] * y + a[8] * z + a[9];
            let square = gx * gx + gy * gy + gz * gz;
            let d = scale * f / square.sqrt();
            out[i] = if square > 0.0 { d / unit } else { f64::INFINITY };
        }
    }
}

struct Localize<'a> {
    at: [&'a mut [f64]; 3],
    center: DVec3,
    radius: f64,
    normal: DVec3,
    weights: &'a mut [f64],
}

impl WithSimd for Localize<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Localize { at: [x, y, z], center: c, radius, normal, weights } = self;
        let n = weights.len();
        let (x, y, z) = (&mut x[..n], &mut y[..n], &mut z[..n]);
        for i in 0..n {
            let p = DVec3::new((x[i] - c.x) / radius, (y[i] - c.y) / radius, (z[i] - c.z) / radius);
            (x[i], y[i], z[i]) = (p.x, p.y, p.z);
            let across = p.dot(normal);
            weights[i] = kernel(p.length_squared() - across * across);
        }
    }
}

struct Farthest<'a> {
    at: [&'a [f64]; 3],
}

impl WithSimd for Farthest<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> f64 {
        let mut most = [0.0; LANES];
        for first in (0..self.at[0].len()).step_by(LANES) {
            let [x, y, z] = self.at.map(|row| lanes(row, first));
            for l in 0..LANES {
                let d2 = x[l] * x[l] + y[l] * y[l] + z[l] * z[l];
                most[l] = if d2 > most[l] { d2 } else { most[l] };
            }
        }
        most.into_iter().fold(0.0, f64::max)
    }
}

struct Heights<'a> {
    at: [&'a [f64]; 3],
    height: &'a Height,
    out: [&'a mut [f64]; 3],
}

impl WithSimd for Heights<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Frame { u: fu, v: fv, n: fn_ } = self.height.frame;
        let c = self.height.c;
        let [u, v, r] = self.out;
        let n = u.len();
        let ([x, y, z], v, r) = (self.at.map(|a| &a[..n]), &mut v[..n], &mut r[..n]);
        for i in 0..n {
            let p = DVec3::new(x[i], y[i], z[i]);
            let (a, b) = (fu.dot(p), fv.dot(p));
            (u[i], v[i]) = (a, b);
            r[i] = fn_.dot(p) - (a * (c[0] * a + c[1] * b + c[3]) + b * (c[2] * b + c[4]) + c[5]);
        }
    }
}

struct Squares<'a> {
    weights: &'a [f64],
    values: &'a [f64],
}

impl WithSimd for Squares<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> f64 {
        let mut lanes = [0.0; LANES];
        let (w, v) = (self.weights.chunks_exact(LANES), self.values.chunks_exact(LANES));
        let rest: f64 = w.remainder().iter().zip(v.remainder()).map(|(w, v)| w * v * v).sum();
        for (w, v) in w.zip(v) {
            for l in 0..LANES {
                lanes[l] += w[l] * v[l] * v[l];
            }
        }
        lanes.iter().sum::<f64>() + rest
    }
}

struct Sums<'a> {
    at: [&'a [f64]; 3],
    weights: &'a [f64],
}

impl WithSimd for Sums<'_> {
    type Output = Moments;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Moments {
        let n = self.weights.len();
        let mut lanes = [[0.0; LANES]; COUNT];
        // No monomial is a multiple of one of degree four.
        let mut column = [[0.0; BLOCK]; CUBIC_COUNT];
        let mut at = [[0.0; BLOCK]; 3];
        for first in (0..n).step_by(BLOCK) {
            let count = BLOCK.min(n - first);
            // Places past the end weigh nothing.
            let whole = count.next_multiple_of(LANES);
            column[0][count..].fill(0.0);
            column[0][..count].copy_from_slice(&self.weights[first..first + count]);
            for (at, of) in at.iter_mut().zip(self.at) {
                at[..count].copy_from_slice(&of[first..first + count]);
            }
            for chunk in column[0][..whole].chunks_exact(LANES) {
                (0..LANES).for_each(|l| lanes[0][l] += chunk[l]);
            }
            for k in 1..CUBIC_COUNT {
                let (before, after) = column.split_at_mut(k);
                let (parent, axis) = PARENTS[k];
                let factors = before[parent][..whole].chunks_exact(LANES).zip(at[axis][..whole].chunks_exact(LANES));
                let mut sums = lanes[k];
                for (own, (parent, axis)) in after[0][..whole].chunks_exact_mut(LANES).zip(factors) {
                    for l in 0..LANES {
                        let product = parent[l] * axis[l];
                        own[l] = product;
                        sums[l] += product;
                    }
                }
                lanes[k] = sums;
            }
            for k in CUBIC_COUNT..COUNT {
                let (parent, axis) = PARENTS[k];
                let factors = column[parent][..whole].chunks_exact(LANES).zip(at[axis][..whole].chunks_exact(LANES));
                let mut sums = lanes[k];
                for (parent, axis) in factors {
                    (0..LANES).for_each(|l| sums[l] += parent[l] * axis[l]);
                }
                lanes[k] = sums;
            }
        }
        Moments(lanes.map(|l| l.iter().sum()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::random;

    fn unit(seed: u64, i: usize) -> f64 {
        random::unit(seed, i as u64) - 0.5
    }

    fn some(count: usize) -> Points {
        (0..count).map(|i| DVec3::new(unit(1, i), unit(2, i), unit(3, i))).collect()
    }

    #[test]
    fn distances_of_0_to_70_points_are_those_of_each_alone_to_1e_14() {
        let a = [0.3, -0.5, 0.2, 0.9, 0.4, -0.6, 0.1, 0.7, -0.3, 0.05];
        let q = Quadric { center: DVec3::new(0.2, -0.1, 0.3), scale: 0.7, a };
        let mut found = Vec::new();
        for count in 0..70 {
            let points = some(count);
            points.distances(&q, &mut found);
            assert_eq!(found.len(), count);
            for (p, d) in points.iter().zip(&found) {
                assert!((d - q.distance(p).0).abs() < 1e-14 * (1.0 + d.abs()), "{d}");
            }
        }
        let plane = Quadric {
            center: DVec3::new(0.2, -0.1, 0.3),
            scale: 0.7,
            a: {
                let mut a = a;
                a[..6].fill(0.0);
                a
            },
        };
        let points = some(70);
        points.distances(&plane, &mut found);
        assert!(points.iter().zip(&found).all(|(p, d)| (d - plane.distance(p).0).abs() < 1e-14));
        // Where the gradient vanishes there is no direction to go.
        let cone = Quadric { center: DVec3::ZERO, scale: 1.0, a: [1.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0] };
        [DVec3::ZERO].into_iter().collect::<Points>().distances(&cone, &mut found);
        assert_eq!(found, [f64::INFINITY]);
    }

    #[test]
    fn sums_over_0_to_150_points_are_those_of_each_after_the_other_to_1e_12() {
        for count in [0, 1, 7, 8, 63, 64, 65, 150] {
            let points = some(count);
            let weights: Vec<f64> = (0..count).map(|i| random::unit(4, i as u64)).collect();
            let mut one = Moments::ZERO;
            points.iter().zip(&weights).for_each(|(p, &w)| one.add(p, w));
            let all = points.moments(&weights);
            assert!(one.0.iter().zip(&all.0).all(|(a, b)| (a - b).abs() < 1e-12), "{count} points");
            let values: Vec<f64> = points.iter().map(|p| p.x).collect();
            assert_eq!(points.reach(), points.iter().map(DVec3::length).fold(0.0, f64::max));
            assert!((weighted_squares(&weights, &values) - one.0[4]).abs() < 1e-12, "{count} points");
        }
    }

    #[test]
    fn points_of_little_weight_leave_in_all_axes() {
        let mut points = some(20);
        let wanted = points.get(7);
        let mut weights: Vec<f64> = (0..20).map(|i| if i == 7 { 0.5 } else { 0.1 }).collect();
        points.keep_above(0.1, &mut weights);
        assert_eq!(points.iter().collect::<Vec<_>>(), [wanted]);
        assert_eq!(weights, [0.5]);
    }

    #[test]
    fn local_points_weights_and_heights_are_those_of_each_alone_to_1e_14() {
        let mut points = some(29);
        let (center, radius, normal) = (DVec3::new(0.1, 0.0, -0.2), 0.8, DVec3::new(0.6, 0.0, 0.8));
        let before: Vec<DVec3> = points.iter().collect();
        let mut weights = Vec::new();
        points.localize(center, radius, normal, &mut weights);
        let height = Height { frame: Frame::of(normal), c: [0.3, -0.5, 0.2, 0.9, 0.4, -0.6] };
        let mut rows = Default::default();
        points.heights(&height, &mut rows);
        for (i, p) in before.into_iter().enumerate() {
            let y = (p - center) / radius;
            assert!(points.get(i).distance(y) < 1e-14);
            assert!((weights[i] - kernel(y.length_squared() - y.dot(normal).powi(2))).abs() < 1e-14);
            let alone = [height.frame.u.dot(y), height.frame.v.dot(y), height.residual(y)];
            assert!((0..3).all(|k| (rows[k][i] - alone[k]).abs() < 1e-14));
        }
    }
}
