//! Points and derivatives of a surface: one place at a time, or a whole grid separably.
//!
//! Tensor-product B-splines of [K98] §4.2.2; derivatives by the rows of `basis`.

use super::basis::{BasisRows, basis_at};
use super::{FitError, Surface};
use glam::DVec3;
use rayon::prelude::*;

/// A point of a surface and its derivatives by `u` and `v`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Jet {
    /// Position.
    pub point: DVec3,
    /// First derivative by `u`.
    pub u: DVec3,
    /// First derivative by `v`.
    pub v: DVec3,
    /// Second derivative by `u`.
    pub uu: DVec3,
    /// Mixed derivative.
    pub uv: DVec3,
    /// Second derivative by `v`.
    pub vv: DVec3,
}

impl Jet {
    /// `S_u x S_v`: not normalised, points outside.
    pub fn area_vector(&self) -> DVec3 {
        self.u.cross(self.v)
    }

    /// Principal curvatures by the unit normal `n`, the larger one first; `None` where `S_u x S_v = 0`.
    pub fn curvatures(&self) -> Option<[f64; 2]> {
        let area = self.area_vector();
        let det = area.length_squared();
        let n = area.try_normalize()?;
        let (e, f, g) = (self.u.dot(self.u), self.u.dot(self.v), self.v.dot(self.v));
        let (l, m, k) = (self.uu.dot(n), self.uv.dot(n), self.vv.dot(n));
        let mean = (e * k - 2.0 * f * m + g * l) / (2.0 * det);
        let gauss = (l * k - m * m) / det;
        let root = (mean * mean - gauss).max(0.0).sqrt();
        Some([mean + root, mean - root])
    }
}

impl Surface {
    /// Checks what evaluation relies on: at least `4 x 4` finite control points and clamped knots that rise from
    /// 0 to 1, as many as they must be. Surfaces that come from outside want this before anything else.
    ///
    /// # Errors
    /// [`FitError::Malformed`] with the first thing that is wrong.
    pub fn check(&self) -> Result<(), FitError> {
        let knots_are_bad = |knots: &[f64], control: usize| {
            knots.len() != control + 4
                || knots[..4] != [0.0; 4]
                || knots[control..] != [1.0; 4]
                || !knots.windows(2).all(|k| k[0] <= k[1])
        };
        let what = if self.rows < 4 || self.cols < 4 {
            "it has fewer than 4 x 4 control points"
        } else if self.control.len() != self.rows * self.cols {
            "its control points are not rows x columns"
        } else if self.control.iter().any(|p| !p.is_finite()) {
            "a control point is not finite"
        } else if knots_are_bad(&self.knots_u, self.cols) || knots_are_bad(&self.knots_v, self.rows) {
            "its knots are not clamped and rising from 0 to 1"
        } else {
            return Ok(());
        };
        Err(FitError::Malformed { what })
    }

    /// Control point `(i, j)`, `i` along `u`.
    pub fn at(&self, i: usize, j: usize) -> DVec3 {
        self.control[j * self.cols + i]
    }

    /// The point at `(u, v)`, each clamped to `[0, 1]`.
    pub fn point(&self, u: f64, v: f64) -> DVec3 {
        self.jet(u, v).point
    }

    /// Point and derivatives at `(u, v)`, each clamped to `[0, 1]`.
    pub fn jet(&self, u: f64, v: f64) -> Jet {
        let (i, bu) = basis_at(&self.knots_u, u);
        let (j, bv) = basis_at(&self.knots_v, v);
        let mut jet = Jet::default();
        for (b, row) in self.control[j * self.cols..].chunks(self.cols).take(4).enumerate() {
            let row = &row[i..][..4];
            let sum = |w: &[f64; 4]| row[0] * w[0] + row[1] * w[1] + row[2] * w[2] + row[3] * w[3];
            let (p, d, dd) = (sum(&bu[0]), sum(&bu[1]), sum(&bu[2]));
            jet.point += p * bv[0][b];
            jet.u += d * bv[0][b];
            jet.v += p * bv[1][b];
            jet.uu += dd * bv[0][b];
            jet.uv += d * bv[1][b];
            jet.vv += p * bv[2][b];
        }
        jet
    }

    /// The surface, or a derivative of it, at all pairs of parameters: row-major, `us` along a row.
    ///
    /// * `order` - derivatives by `u` and by `v`, each 0, 1 or 2
    pub fn sample(&self, us: &[f64], vs: &[f64], order: [usize; 2]) -> Vec<DVec3> {
        let along_u = [BasisRows::new(&self.knots_u, us, order[0])];
        let sampler = RowSampler::new(self, &along_u);
        let mut out = vec![DVec3::ZERO; us.len() * vs.len()];
        out.par_chunks_mut(us.len().max(1)).zip(vs).for_each(|(row, &v)| {
            let narrow = sampler.narrow(v, order[1]);
            row.iter_mut().enumerate().for_each(|(i, p)| *p = sampler.node(&narrow, i, 0));
        });
        out
    }
}

/// One row of a grid at a time: the control rows summed up for a `v`, then evaluated along `u`.
pub(crate) struct RowSampler<'a> {
    surface: &'a Surface,
    along_u: &'a [BasisRows],
}

impl<'a> RowSampler<'a> {
    /// `along_u[d]` are the rows of the basis for the `d`-th derivative by `u`.
    pub fn new(surface: &'a Surface, along_u: &'a [BasisRows]) -> RowSampler<'a> {
        RowSampler { surface, along_u }
    }

    /// The control rows summed up for the derivative of this order by `v`.
    pub fn narrow(&self, v: f64, order: usize) -> Vec<DVec3> {
        let (first, basis) = basis_at(&self.surface.knots_v, v);
        let (cols, w) = (self.surface.cols, basis[order]);
        let row = |b: usize| &self.surface.control[(first + b) * cols..(first + b + 1) * cols];
        let rows = [row(0), row(1), row(2), row(3)];
        (0..cols).map(|i| rows[0][i] * w[0] + rows[1][i] * w[1] + rows[2][i] * w[2] + rows[3][i] * w[3]).collect()
    }

    /// Node `i` of the row that `narrow` was made for, for the derivative of this order by `u`.
    pub fn node(&self, narrow: &[DVec3], i: usize, order: usize) -> DVec3 {
        let rows = &self.along_u[order];
        let (c, w) = (&narrow[rows.first[i]..rows.first[i] + 4], &rows.weights[i]);
        c[0] * w[0] + c[1] * w[1] + c[2] * w[2] + c[3] * w[3]
    }
}
