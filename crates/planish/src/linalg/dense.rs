//! Small dense systems by Gaussian elimination with pivots (Golub and Van Loan, *Matrix Computations*, §3.4).

/// Pivots below this share of the largest entry count as zero: the rest of the digits are rounding.
const PIVOT: f64 = 1e-13;

/// Solves `a x = b` for `columns` right-hand sides (Gauss, partial pivoting).
/// * `a` - `(n, n)` row-major
/// * `b` - `(n, columns)` row-major; holds `x` afterwards
///
/// Returns false if the matrix is singular to working precision.
pub fn solve_dense(a: &mut [f64], b: &mut [f64], n: usize, columns: usize) -> bool {
    let scale = a.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    for k in 0..n {
        let pivot = (k..n).max_by(|&i, &j| a[i * n + k].abs().total_cmp(&a[j * n + k].abs())).unwrap_or(k);
        let is_regular = a[pivot * n + k].abs() > PIVOT * scale;
        if !is_regular {
            return false;
        }
        if pivot != k {
            for j in 0..n {
                a.swap(k * n + j, pivot * n + j);
            }
            for j in 0..columns {
                b.swap(k * columns + j, pivot * columns + j);
            }
        }
        for i in k + 1..n {
            let f = a[i * n + k] / a[k * n + k];
            if f != 0.0 {
                for j in k..n {
                    a[i * n + j] -= f * a[k * n + j];
                }
                for j in 0..columns {
                    b[i * columns + j] -= f * b[k * columns + j];
                }
            }
        }
    }
    for k in (0..n).rev() {
        for c in 0..columns {
            let known: f64 = (k + 1..n).map(|j| a[k * n + j] * b[j * columns + c]).sum();
            b[k * columns + c] = (b[k * columns + c] - known) / a[k * n + k];
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_system_of_3_with_a_zero_pivot_and_2_right_sides_is_solved_within_1e_14() {
        let matrix = [0.0, 2.0, 1.0, 1.0, 1.0, 0.0, 3.0, 0.0, 1.0];
        let x = [1.0, -1.0, 2.0, 0.5, 3.0, 4.0];
        let mut b: Vec<f64> = (0..6).map(|r| (0..3).map(|k| matrix[r / 2 * 3 + k] * x[k * 2 + r % 2]).sum()).collect();
        assert!(solve_dense(&mut matrix.clone(), &mut b, 3, 2));
        assert!(b.iter().zip(x).all(|(a, b)| (a - b).abs() < 1e-14));
        assert!(!solve_dense(&mut [1.0, 2.0, 2.0, 4.0], &mut [1.0, 2.0], 2, 1));
    }
}
