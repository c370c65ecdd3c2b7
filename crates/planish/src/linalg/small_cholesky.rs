//! Cholesky factorisation for small systems whose size is known when compiling (Golub and Van Loan, *Matrix Computations*, §4.2).

/// Solves `a x = b` for a symmetric positive definite `a`, whose lower triangle is used and overwritten.
/// Returns false if a pivot is not positive.
pub(crate) fn solve<const N: usize>(a: &mut [[f64; N]; N], b: &mut [f64; N]) -> bool {
    if !factor(a) {
        return false;
    }
    substitute(a, b);
    true
}

/// Cholesky factor in the lower triangle; false if a pivot is not positive.
pub(crate) fn factor<const N: usize>(a: &mut [[f64; N]; N]) -> bool {
    for i in 0..N {
        for j in 0..=i {
            let sum = a[i][..j].iter().zip(&a[j][..j]).fold(a[i][j], |sum, (x, y)| sum - x * y);
            if i == j {
                if sum.is_nan() || sum <= 0.0 {
                    return false;
                }
                a[i][i] = sum.sqrt();
            } else {
                a[i][j] = sum / a[j][j];
            }
        }
    }
    true
}

/// Solves with the factor of [`factor`].
pub(crate) fn substitute<const N: usize>(l: &[[f64; N]; N], b: &mut [f64; N]) {
    for i in 0..N {
        for k in 0..i {
            b[i] -= l[i][k] * b[k];
        }
        b[i] /= l[i][i];
    }
    for i in (0..N).rev() {
        for k in i + 1..N {
            b[i] -= l[k][i] * b[k];
        }
        b[i] /= l[i][i];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::array::from_fn;

    #[test]
    fn cholesky_solves_a_4_by_4_system_within_1e_13_and_refuses_an_indefinite_one() {
        let mut a: [[f64; 4]; 4] = from_fn(|i| from_fn(|j| 1.0 / (i + j + 1) as f64));
        let x = [1.0, -2.0, 3.0, 0.5];
        let mut b = [0, 1, 2, 3].map(|i| (0..4).map(|j| a[i][j] * x[j]).sum());
        assert!(solve(&mut a, &mut b));
        assert!((0..4).all(|i| (b[i] - x[i]).abs() < 1e-11));
        assert!(!factor(&mut [[1.0, 0.0], [0.0, -1.0]]));
    }
}
