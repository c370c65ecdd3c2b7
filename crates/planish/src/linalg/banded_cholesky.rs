//! Cholesky factorisation of banded symmetric positive definite systems, for right-hand sides of numbers or of points.
//!
//! Golub and Van Loan, *Matrix Computations*, §4.3.

use std::ops::{Mul, MulAssign, SubAssign};

/// Pivots below this fraction of the largest diagonal entry count as zero: the square of the condition
/// that a spline basis keeps (about 1e-6 at worst) is far above it.
const PIVOT: f64 = 1e-14;

/// What a right-hand side is made of: `f64` or a vector of them.
pub trait Entry: Copy + SubAssign + MulAssign<f64> + Mul<f64, Output = Self> {}
impl<T: Copy + SubAssign + MulAssign<f64> + Mul<f64, Output = T>> Entry for T {}

/// A symmetric banded matrix, lower half.
#[derive(Clone, Debug)]
pub struct Banded {
    n: usize,
    band: usize,
    /// Row after row; entry `(i, j)`, `i - band <= j <= i`, at `i * (band + 1) + band + j - i`.
    lower: Vec<f64>,
}

impl Banded {
    /// The zero matrix with `n` rows and `band` diagonals below the main one.
    pub fn zero(n: usize, band: usize) -> Banded {
        Banded { n, band, lower: vec![0.0; n * (band + 1)] }
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.n
    }

    /// True for a matrix without rows.
    pub fn is_empty(&self) -> bool {
        self.n == 0
    }

    /// Adds `value` at `(row, column)`; the transposed entry is meant as well.
    pub fn add(&mut self, row: usize, column: usize, value: f64) {
        let (i, j) = (row.max(column), row.min(column));
        self.lower[i * (self.band + 1) + self.band + j - i] += value;
    }

    /// Entry `(row, column)`; zero outside the band.
    pub fn get(&self, row: usize, column: usize) -> f64 {
        let (i, j) = (row.max(column), row.min(column));
        if i - j > self.band { 0.0 } else { self.lower[i * (self.band + 1) + self.band + j - i] }
    }

    /// The columns that row `i` may be non-zero in.
    pub fn columns(&self, i: usize) -> std::ops::Range<usize> {
        i.saturating_sub(self.band)..(i + self.band + 1).min(self.n)
    }

    /// The rows and columns `range` as a matrix of their own.
    pub fn part(&self, range: std::ops::Range<usize>) -> Banded {
        let mut part = Banded::zero(range.len(), self.band);
        for i in 0..part.n {
            for j in i.saturating_sub(self.band)..=i {
                part.add(i, j, self.get(range.start + i, range.start + j));
            }
        }
        part
    }
}

/// The Cholesky factor of a [`Banded`] matrix: O(n band²) to make, O(n band) to solve with.
#[derive(Clone, Debug)]
pub struct BandedCholesky {
    n: usize,
    band: usize,
    /// As in [`Banded`]; the diagonal holds reciprocals.
    lower: Vec<f64>,
}

impl BandedCholesky {
    /// Factors `matrix`; `None` if it is not positive definite to rounding.
    pub fn factor(matrix: Banded) -> Option<BandedCholesky> {
        let Banded { n, band, mut lower } = matrix;
        let w = band + 1;
        let largest = (0..n).map(|i| lower[i * w + band]).fold(0.0, f64::max);
        for i in 0..n {
            let first = i.saturating_sub(band);
            for j in first..=i {
                let from = first.max(j.saturating_sub(band));
                let mut sum = lower[i * w + band + j - i];
                for k in from..j {
                    sum -= lower[i * w + band + k - i] * lower[j * w + band + k - j];
                }
                if j < i {
                    lower[i * w + band + j - i] = sum * lower[j * w + band];
                } else if sum > PIVOT * largest {
                    lower[i * w + band] = 1.0 / sum.sqrt();
                } else {
                    return None;
                }
            }
        }
        Some(BandedCholesky { n, band, lower })
    }

    /// Solves in place; `rhs` holds one row of `rhs.len() / n` entries per unknown.
    pub fn solve<T: Entry>(&self, rhs: &mut [T]) {
        if self.n == 0 {
            return;
        }
        assert_eq!(rhs.len() % self.n, 0, "right-hand sides of {} unknowns", self.n);
        let (w, width) = (self.band + 1, rhs.len() / self.n);
        for i in 0..self.n {
            let (before, rest) = rhs.split_at_mut(i * width);
            let row = &mut rest[..width];
            for j in i.saturating_sub(self.band)..i {
                let l = self.lower[i * w + self.band + j - i];
                subtract(row, &before[j * width..(j + 1) * width], l);
            }
            scale(row, self.lower[i * w + self.band]);
        }
        for i in (0..self.n).rev() {
            let (before, after) = rhs.split_at_mut((i + 1) * width);
            let row = &mut before[i * width..];
            for j in i + 1..(i + self.band + 1).min(self.n) {
                let l = self.lower[j * w + self.band + i - j];
                subtract(row, &after[(j - i - 1) * width..(j - i) * width], l);
            }
            scale(row, self.lower[i * w + self.band]);
        }
    }
}

fn subtract<T: Entry>(row: &mut [T], other: &[T], factor: f64) {
    for (r, &o) in row.iter_mut().zip(other) {
        *r -= o * factor;
    }
}

fn scale<T: Entry>(row: &mut [T], factor: f64) {
    for r in row {
        *r *= factor;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solves_100_unknowns_of_bandwidth_3_within_1e_12() {
        let n = 100;
        let mut matrix = Banded::zero(n, 3);
        for i in 0..n {
            matrix.add(i, i, 4.0 + (i % 5) as f64);
            for d in 1..=3.min(i) {
                matrix.add(i, i - d, 1.0 / (d as f64 + (i % 3) as f64));
            }
        }
        let want: Vec<f64> = (0..2 * n).map(|i| (i as f64 * 0.7).sin()).collect();
        let mut rhs = vec![0.0; 2 * n];
        for i in 0..n {
            for j in matrix.columns(i) {
                rhs[2 * i] += matrix.get(i, j) * want[2 * j];
                rhs[2 * i + 1] += matrix.get(i, j) * want[2 * j + 1];
            }
        }
        BandedCholesky::factor(matrix).unwrap().solve(&mut rhs);
        for (got, want) in rhs.iter().zip(&want) {
            assert!((got - want).abs() < 1e-12);
        }
    }

    #[test]
    fn a_singular_matrix_has_no_factor() {
        let mut matrix = Banded::zero(2, 1);
        for (i, j) in [(0, 0), (1, 0), (1, 1)] {
            matrix.add(i, j, 1.0);
        }
        assert!(BandedCholesky::factor(matrix).is_none());
    }
}
