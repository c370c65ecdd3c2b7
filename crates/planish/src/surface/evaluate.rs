//! Points and derivatives of a surface: one place at a time, or a whole grid separably.

use super::Surface;
use super::basis::{BasisRows, basis_at};
use glam::DVec3;

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
        for b in 0..4 {
            let row = &self.control[(j + b) * self.cols + i..][..4];
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
        let along_u = BasisRows::new(&self.knots_u, us, order[0]);
        let along_v = BasisRows::new(&self.knots_v, vs, order[1]);
        let mut out = Vec::with_capacity(us.len() * vs.len());
        each_row(self, &along_u, &along_v, |row| out.extend_from_slice(row));
        out
    }
}

/// Calls `visit` with one row of surface points after another.
pub(crate) fn each_row(surface: &Surface, along_u: &BasisRows, along_v: &BasisRows, mut visit: impl FnMut(&[DVec3])) {
    let width = along_u.len();
    let mut narrow = Vec::with_capacity(surface.rows * width);
    for row in surface.control.chunks_exact(surface.cols) {
        for (&first, w) in along_u.first.iter().zip(&along_u.weights) {
            let c = &row[first..first + 4];
            narrow.push(c[0] * w[0] + c[1] * w[1] + c[2] * w[2] + c[3] * w[3]);
        }
    }
    let mut line = vec![DVec3::ZERO; width];
    for (&first, w) in along_v.first.iter().zip(&along_v.weights) {
        let rows: [&[DVec3]; 4] = std::array::from_fn(|b| &narrow[(first + b) * width..(first + b + 1) * width]);
        for (i, out) in line.iter_mut().enumerate() {
            *out = rows[0][i] * w[0] + rows[1][i] * w[1] + rows[2][i] * w[2] + rows[3][i] * w[3];
        }
        visit(&line);
    }
}
