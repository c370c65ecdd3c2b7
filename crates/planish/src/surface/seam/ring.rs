//! What a move of the outer two rings of control points costs a fit, the inside following as least squares has it.
//!
//! The normal matrix of a patch is the Kronecker product of those of its directions. Eliminating the inside leaves a
//! matrix over the outer rings (its Schur complement), the same for all patches with as many nodes, control points and
//! knots, and for every coordinate.

use crate::surface::fit::Direction;
use rayon::prelude::*;

/// Rings that stay outside: a cubic's derivative across its boundary depends on two.
const RINGS: usize = 2;

/// The normal matrix of the outer rings.
pub(crate) struct Condensed {
    /// Indices of their control points in the net, rising.
    pub outer: Vec<usize>,
    /// Square, symmetric, row-major.
    matrix: Vec<f64>,
}

impl Condensed {
    pub fn new(along_u: &Direction, along_v: &Direction) -> Condensed {
        let (m, n) = (along_u.control(), along_v.control());
        let is_inside = |k: usize, count: usize| k >= RINGS && k + RINGS < count;
        let outer: Vec<usize> = (0..m * n).filter(|&c| !(is_inside(c % m, m) && is_inside(c / m, n))).collect();
        let (inner_m, inner_n) = (m - 2 * RINGS, n - 2 * RINGS);
        let at = |c: usize| (c % m, c / m);
        let row = |r: usize| -> Vec<f64> {
            let (i, j) = at(outer[r]);
            // How the inside answers to a unit move of this control point.
            let mut answer = vec![0.0; inner_m * inner_n];
            for l in along_v.near(j).filter(|&l| is_inside(l, n)) {
                for k in along_u.near(i).filter(|&k| is_inside(k, m)) {
                    answer[(l - RINGS) * inner_m + k - RINGS] = along_v.gram(j, l) * along_u.gram(i, k);
                }
            }
            if !answer.is_empty() {
                along_v.factor(RINGS).solve(&mut answer);
                answer.chunks_exact_mut(inner_m).for_each(|row| along_u.factor(RINGS).solve(row));
            }
            let entry = |&c: &usize| -> f64 {
                let (a, b) = at(c);
                let mut sum = along_v.gram(j, b) * along_u.gram(i, a);
                for l in along_v.near(b).filter(|&l| is_inside(l, n)) {
                    for k in along_u.near(a).filter(|&k| is_inside(k, m)) {
                        let coupling = along_v.gram(b, l) * along_u.gram(a, k);
                        sum -= coupling * answer[(l - RINGS) * inner_m + k - RINGS];
                    }
                }
                sum
            };
            outer[..=r].iter().map(entry).collect()
        };
        let rows: Vec<Vec<f64>> = (0..outer.len()).into_par_iter().map(row).collect();
        let size = outer.len();
        let mut matrix = vec![0.0; size * size];
        for (r, row) in rows.iter().enumerate() {
            for (c, &value) in row.iter().enumerate() {
                matrix[r * size + c] = value;
                matrix[c * size + r] = value;
            }
        }
        Condensed { outer, matrix }
    }

    /// One row, in the order of `outer`.
    pub fn row(&self, r: usize) -> &[f64] {
        &self.matrix[r * self.outer.len()..][..self.outer.len()]
    }
}
