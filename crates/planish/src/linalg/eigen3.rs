//! Eigenvalues of symmetric 3 x 3 matrices.
//!
//! Jacobi 1846; the rotation as in Golub and Van Loan, *Matrix Computations*, 4th edition, §8.5.

use glam::{DMat3, DVec3};

/// What lies beside the diagonal is nothing below this part of the diagonal: far below rounding, as each sweep squares it.
const DIAGONAL: f64 = 1e-18;
/// Sweeps at most; six are enough but for entries of very unlike size.
const SWEEPS: usize = 16;

/// Eigenvalues, rising, and unit eigenvectors of a symmetric matrix.
pub(crate) fn eigen3(m: DMat3) -> ([f64; 3], [DVec3; 3]) {
    let mut on = [m.x_axis.x, m.y_axis.y, m.z_axis.z];
    // Beside the diagonal, each named by the third axis.
    let mut off = [m.y_axis.z, m.x_axis.z, m.x_axis.y];
    let mut v = [DVec3::X, DVec3::Y, DVec3::Z];
    let size = |x: &[f64; 3]| x[0].abs() + x[1].abs() + x[2].abs();
    for _ in 0..SWEEPS {
        if size(&off) <= DIAGONAL * size(&on) {
            break;
        }
        for (p, q, r) in [(0, 1, 2), (0, 2, 1), (1, 2, 0)] {
            let apq = off[r];
            if apq == 0.0 {
                continue;
            }
            let theta = (on[q] - on[p]) / (2.0 * apq);
            let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
            let c = 1.0 / (t * t + 1.0).sqrt();
            let s = t * c;
            (on[p], on[q], off[r]) = (on[p] - t * apq, on[q] + t * apq, 0.0);
            (off[q], off[p]) = (c * off[q] - s * off[p], s * off[q] + c * off[p]);
            (v[p], v[q]) = (v[p] * c - v[q] * s, v[p] * s + v[q] * c);
        }
    }
    let mut order = [0, 1, 2];
    order.sort_by(|&i, &j| on[i].total_cmp(&on[j]));
    (order.map(|i| on[i]), order.map(|i| v[i]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eigenvectors_of_a_3_by_3_matrix_reproduce_it_within_1e_14() {
        let m = DMat3::from_cols_array(&[4.0, 1.0, -2.0, 1.0, 3.0, 0.5, -2.0, 0.5, 1.0]);
        let (values, vectors) = eigen3(m);
        assert!(values[0] <= values[1] && values[1] <= values[2]);
        let again = (0..3).map(|k| {
            let v = vectors[k];
            DMat3::from_cols(v * v.x, v * v.y, v * v.z) * values[k]
        });
        assert!(again.sum::<DMat3>().abs_diff_eq(m, 1e-14));
    }

    #[test]
    fn a_matrix_whose_entries_differ_by_1e12_has_orthogonal_eigenvectors_within_1e_15() {
        let m = DMat3::from_cols_array(&[1e12, 1.0, 1e3, 1.0, 1e-6, 1e-3, 1e3, 1e-3, 1.0]);
        let (values, v) = eigen3(m);
        for k in 0..3 {
            assert!((v[k].length() - 1.0).abs() < 1e-15 && v[k].dot(v[(k + 1) % 3]).abs() < 1e-15);
            assert!((m * v[k] - v[k] * values[k]).length() < 1e-15 * 1e12);
        }
    }
}
