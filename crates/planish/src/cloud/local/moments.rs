//! Sums over a neighbourhood from which every local fit follows.
//!
//! The monomials of degree up to four in local coordinates hold the normal equations of both families of quadrics in
//! any frame: the height-field fit is the minimum of the same quadratic form over seven of its ten directions. One
//! pass over the points serves every frame and both families.
//!
//! Normal equations of [X03] §4.1 and §6.2.

use glam::{DMat3, DVec3};

/// Number of monomials of degree up to four.
pub(crate) const COUNT: usize = 35;
/// Of those of degree up to three, which come first.
pub(crate) const CUBIC_COUNT: usize = 20;

/// Exponents of the ten monomials of degree up to two, in the order of the coefficients of a quadric.
const QUADRATIC: [[usize; 3]; 10] =
    [[2, 0, 0], [1, 1, 0], [1, 0, 1], [0, 2, 0], [0, 1, 1], [0, 0, 2], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0]];

/// Exponents of all, in the order in which [`monomials`] computes them.
const ALL: [[usize; 3]; COUNT] = [
    [0, 0, 0],
    [1, 0, 0],
    [0, 1, 0],
    [0, 0, 1],
    [2, 0, 0],
    [1, 1, 0],
    [1, 0, 1],
    [0, 2, 0],
    [0, 1, 1],
    [0, 0, 2],
    [3, 0, 0],
    [2, 1, 0],
    [2, 0, 1],
    [1, 2, 0],
    [1, 1, 1],
    [1, 0, 2],
    [0, 3, 0],
    [0, 2, 1],
    [0, 1, 2],
    [0, 0, 3],
    [4, 0, 0],
    [3, 1, 0],
    [3, 0, 1],
    [2, 2, 0],
    [2, 1, 1],
    [2, 0, 2],
    [1, 3, 0],
    [1, 2, 1],
    [1, 1, 2],
    [1, 0, 3],
    [0, 4, 0],
    [0, 3, 1],
    [0, 2, 2],
    [0, 1, 3],
    [0, 0, 4],
];

/// Where the product of two of the ten monomials stands among all.
const PRODUCT: [[usize; 10]; 10] = products();

/// For each monomial but the first the one before it that it is a multiple of, and the axis of the other factor.
pub(crate) const PARENTS: [(usize, usize); COUNT] = parents();

const fn parents() -> [(usize, usize); COUNT] {
    let mut table = [(0, 0); COUNT];
    let mut k = 1;
    while k < COUNT {
        let mut j = 0;
        while j < k {
            let mut axis = 0;
            while axis < 3 {
                let mut e = ALL[j];
                e[axis] += 1;
                if e[0] == ALL[k][0] && e[1] == ALL[k][1] && e[2] == ALL[k][2] {
                    table[k] = (j, axis);
                }
                axis += 1;
            }
            j += 1;
        }
        k += 1;
    }
    table
}

const fn products() -> [[usize; 10]; 10] {
    let mut table = [[0; 10]; 10];
    let mut i = 0;
    while i < 10 {
        let mut j = 0;
        while j < 10 {
            let mut k = 0;
            while k < COUNT {
                let (a, b, c) = (QUADRATIC[i], QUADRATIC[j], ALL[k]);
                if a[0] + b[0] == c[0] && a[1] + b[1] == c[1] && a[2] + b[2] == c[2] {
                    table[i][j] = k;
                }
                k += 1;
            }
            j += 1;
        }
        i += 1;
    }
    table
}

/// Weighted sums of the monomials.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moments(pub [f64; COUNT]);

impl Moments {
    pub(crate) const ZERO: Moments = Moments([0.0; COUNT]);

    /// Adds a point in local coordinates.
    #[inline]
    pub(crate) fn add(&mut self, y: DVec3, weight: f64) {
        self.0.iter_mut().zip(&monomials(y)).for_each(|(sum, m)| *sum += weight * m);
    }

    /// Adds the sums over other points.
    pub(crate) fn join(&mut self, other: &Moments) {
        self.0.iter_mut().zip(&other.0).for_each(|(a, b)| *a += b);
    }

    /// Sum of the weights.
    pub(crate) fn weight(&self) -> f64 {
        self.0[0]
    }

    /// Mean of the points.
    pub(crate) fn mean(&self) -> DVec3 {
        DVec3::new(self.0[1], self.0[2], self.0[3]) / self.0[0]
    }

    /// Covariance of the points.
    pub(crate) fn covariance(&self) -> DMat3 {
        let m = self.mean();
        let [xx, xy, xz, yy, yz, zz] = [4, 5, 6, 7, 8, 9].map(|k| self.0[k] / self.0[0]);
        let (xx, xy, xz) = (xx - m.x * m.x, xy - m.x * m.y, xz - m.x * m.z);
        let (yy, yz, zz) = (yy - m.y * m.y, yz - m.y * m.z, zz - m.z * m.z);
        DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz])
    }

    /// The 10 x 10 matrix of products of the monomials of a quadric: `a^T M a` is the sum of squared values.
    pub(crate) fn matrix(&self) -> [[f64; 10]; 10] {
        let mut m = [[0.0; 10]; 10];
        for i in 0..10 {
            for j in 0..10 {
                m[i][j] = self.0[PRODUCT[i][j]];
            }
        }
        m
    }

    /// The matrix N of Taubin's normalisation: `a^T N a` is the sum of squared gradients.
    pub(crate) fn gradient_matrix(&self) -> [[f64; 10]; 10] {
        let mut n = [[0.0; 10]; 10];
        for axis in 0..3 {
            // The derivative of the ten monomials along the axis, each a multiple of x, y, z or 1.
            let mut rows = [(0.0, 0usize); 10];
            for (k, e) in QUADRATIC.iter().enumerate() {
                if e[axis] == 0 {
                    continue;
                }
                let mut rest = *e;
                rest[axis] -= 1;
                let at = ALL.iter().take(4).position(|a| *a == rest).unwrap_or(0);
                rows[k] = (e[axis] as f64, at);
            }
            for i in 0..10 {
                if rows[i].0 == 0.0 {
                    continue;
                }
                for j in 0..10 {
                    if rows[j].0 != 0.0 {
                        n[i][j] += rows[i].0 * rows[j].0 * self.linear(rows[i].1, rows[j].1);
                    }
                }
            }
        }
        n
    }

    /// Sum of the product of two of (1, x, y, z).
    fn linear(&self, i: usize, j: usize) -> f64 {
        const TABLE: [[usize; 4]; 4] = [[0, 1, 2, 3], [1, 4, 5, 6], [2, 5, 7, 8], [3, 6, 8, 9]];
        self.0[TABLE[i][j]]
    }
}

#[inline]
fn monomials(y: DVec3) -> [f64; COUNT] {
    let DVec3 { x, y, z } = y;
    let (xx, xy, xz, yy, yz, zz) = (x * x, x * y, x * z, y * y, y * z, z * z);
    [
        1.0,
        x,
        y,
        z,
        xx,
        xy,
        xz,
        yy,
        yz,
        zz,
        x * xx,
        x * xy,
        x * xz,
        x * yy,
        x * yz,
        x * zz,
        y * yy,
        y * yz,
        y * zz,
        z * zz,
        xx * xx,
        xx * xy,
        xx * xz,
        xx * yy,
        xx * yz,
        xx * zz,
        xy * yy,
        xy * yz,
        xy * zz,
        xz * zz,
        yy * yy,
        yy * yz,
        yy * zz,
        yz * zz,
        zz * zz,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_matrices_are_sums_of_squared_values_and_gradients_within_1e_12() {
        let points = [DVec3::new(0.3, -0.5, 0.8), DVec3::new(-0.7, 0.2, 0.1), DVec3::new(0.9, 0.4, -0.6)];
        let a = [0.3, -0.5, 0.2, 0.9, 0.4, -0.6, 0.1, 0.7, -0.3, 0.05];
        let q = crate::cloud::Quadric { center: DVec3::ZERO, scale: 1.0, a };
        let mut sums = Moments::ZERO;
        points.iter().for_each(|&p| sums.add(p, 2.0));
        let form =
            |m: [[f64; 10]; 10]| -> f64 { (0..10).flat_map(|i| (0..10).map(move |j| a[i] * m[i][j] * a[j])).sum() };
        let values: f64 = points.iter().map(|&p| 2.0 * q.value(p).0.powi(2)).sum();
        let gradients: f64 = points.iter().map(|&p| 2.0 * q.value(p).1.length_squared()).sum();
        assert!((form(sums.matrix()) - values).abs() < 1e-12);
        assert!((form(sums.gradient_matrix()) - gradients).abs() < 1e-12);
    }
}
