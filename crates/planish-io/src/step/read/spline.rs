//! B-splines of any degree, rational or not, as STEP has them: values and first derivatives.
//!
//! Cox and de Boor's recursion; Piegl and Tiller, *The NURBS Book*, 2nd ed., eq. 2.5, 2.7 and 4.8.

use glam::{DVec3, DVec4};

/// Highest degree that is read: what CAD kernels take.
pub(super) const MOST_DEGREE: usize = 25;

/// Knots and degree along one direction.
#[derive(Clone, Debug)]
pub(super) struct Basis {
    pub degree: usize,
    pub knots: Vec<f64>,
}

/// Functions that are not zero somewhere: the index of the first, their values and derivatives.
struct Row {
    first: usize,
    values: [[f64; MOST_DEGREE + 1]; 2],
}

impl Basis {
    /// `None` if the knots do not rise, or are not as many as so many control points need.
    pub fn new(degree: usize, knots: Vec<f64>, control: usize) -> Option<Basis> {
        let fits = (1..=MOST_DEGREE).contains(&degree) && control > degree && knots.len() == control + degree + 1;
        let rise = knots.windows(2).all(|w| w[0] <= w[1]) && fits && knots[degree] < knots[control];
        rise.then_some(Basis { degree, knots })
    }

    fn control(&self) -> usize {
        self.knots.len() - self.degree - 1
    }

    /// The range of the parameter.
    pub fn range(&self) -> [f64; 2] {
        [self.knots[self.degree], self.knots[self.control()]]
    }

    /// Distinct knots within the range.
    pub fn breaks(&self) -> Vec<f64> {
        let mut breaks = self.knots[self.degree..=self.control()].to_vec();
        breaks.dedup();
        breaks
    }

    fn row(&self, t: f64) -> Row {
        let (p, n, knots) = (self.degree, self.control(), &self.knots);
        let [from, to] = self.range();
        let t = t.clamp(from, to);
        let span = knots.partition_point(|&k| k <= t).clamp(p + 1, n) - 1;
        let mut values = [[0.0; MOST_DEGREE + 1]; 2];
        values[0][0] = 1.0;
        let over = |a: f64, b: f64| if b > 0.0 { a / b } else { 0.0 };
        for degree in 1..=p {
            let lower = values[0];
            let mut next = [0.0; MOST_DEGREE + 1];
            let mut slopes = [0.0; MOST_DEGREE + 1];
            for k in 0..degree {
                // Function k of the lower degree reaches from knot span + 1 - degree + k to span + 1 + k.
                let (left, right) = (knots[span + 1 + k - degree], knots[span + 1 + k]);
                let share = over(lower[k], right - left);
                next[k] += (right - t) * share;
                next[k + 1] += (t - left) * share;
                slopes[k] -= degree as f64 * share;
                slopes[k + 1] += degree as f64 * share;
            }
            values = [next, slopes];
        }
        Row { first: span - p, values }
    }
}

/// A place and its derivatives.
fn projected(point: DVec4, slope: DVec4) -> (DVec3, DVec3) {
    let place = point.truncate() / point.w;
    (place, (slope.truncate() - place * slope.w) / point.w)
}

/// A curve; control points times their weights, weight last.
#[derive(Clone, Debug)]
pub(super) struct SplineCurve {
    pub basis: Basis,
    pub control: Vec<DVec4>,
}

impl SplineCurve {
    /// Place and derivative.
    pub fn at(&self, t: f64) -> (DVec3, DVec3) {
        let row = self.basis.row(t);
        let sum =
            |order: usize| (0..=self.basis.degree).map(|k| self.control[row.first + k] * row.values[order][k]).sum();
        projected(sum(0), sum(1))
    }
}

/// A surface; control points as those of a curve, those along `u` for the first `v`, then for the next.
#[derive(Clone, Debug)]
pub(super) struct SplineSurface {
    pub basis: [Basis; 2],
    pub control: Vec<DVec4>,
}

impl SplineSurface {
    pub fn cols(&self) -> usize {
        self.basis[0].control()
    }

    /// Place and derivatives along `u` and `v`.
    pub fn at(&self, [u, v]: [f64; 2]) -> (DVec3, [DVec3; 2]) {
        let (along, across) = (self.basis[0].row(u), self.basis[1].row(v));
        let mut sums = [DVec4::ZERO; 3];
        for j in 0..=self.basis[1].degree {
            let from = (across.first + j) * self.cols() + along.first;
            let row = &self.control[from..=from + self.basis[0].degree];
            let sum = |order: usize| row.iter().zip(&along.values[order]).map(|(c, w)| *c * *w).sum::<DVec4>();
            let (here, slope) = (sum(0), sum(1));
            sums[0] += here * across.values[0][j];
            sums[1] += slope * across.values[0][j];
            sums[2] += here * across.values[1][j];
        }
        let (place, along) = projected(sums[0], sums[1]);
        (place, [along, projected(sums[0], sums[2]).1])
    }

    /// True if the first and the last row of control points across this direction are the same: the surface is closed along it.
    pub fn is_closed(&self, axis: usize, tolerance: f64) -> bool {
        let (cols, rows) = (self.cols(), self.control.len() / self.cols());
        let pair = |k: usize| match axis {
            0 => [self.control[k * cols], self.control[k * cols + cols - 1]],
            _ => [self.control[k], self.control[(rows - 1) * cols + k]],
        };
        (0..if axis == 0 { rows } else { cols }).all(|k| {
            let [a, b] = pair(k).map(|c| c.truncate() / c.w);
            a.distance(b) <= tolerance
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rational_quadratic_is_a_quarter_of_a_circle_with_its_tangent() {
        let w = 0.5f64.sqrt();
        let control = vec![DVec4::new(1.0, 0.0, 0.0, 1.0), DVec4::new(w, w, 0.0, w), DVec4::new(0.0, 1.0, 0.0, 1.0)];
        let basis = Basis::new(2, vec![0.0, 0.0, 0.0, 2.0, 2.0, 2.0], 3).unwrap();
        let curve = SplineCurve { basis, control };
        for t in [0.0, 0.3, 1.0, 1.7, 2.0] {
            let (p, d) = curve.at(t);
            assert!((p.length() - 1.0).abs() < 1e-15 && p.dot(d).abs() < 1e-15, "{p} {d}");
            let [a, b] = [-1e-6, 1e-6].map(|h| curve.at(t + h).0);
            assert!(t == 0.0 || t == 2.0 || ((b - a) / 2e-6).distance(d) < 1e-9);
        }
    }

    #[test]
    fn a_polynomial_of_degree_3_by_1_is_reproduced_between_inner_knots() {
        // Blossoms of (u^3, u v, v).
        let knots = [0.0, 0.0, 0.0, 0.0, 0.4, 0.7, 1.0, 1.0, 1.0, 1.0];
        let mut control = Vec::new();
        for v in [0.0, 1.0] {
            for k in 0..6 {
                let t = &knots[k + 1..k + 4];
                let mean = t.iter().sum::<f64>() / 3.0;
                control.push(DVec4::new(t.iter().product(), mean * v, v, 1.0));
            }
        }
        let basis = [Basis::new(3, knots.to_vec(), 6).unwrap(), Basis::new(1, vec![0.0, 0.0, 1.0, 1.0], 2).unwrap()];
        let surface = SplineSurface { basis, control };
        for [u, v] in [[0.0, 0.0], [0.35, 0.2], [0.4, 0.6], [0.93, 1.0], [1.0, 0.5]] {
            let (p, [du, dv]) = surface.at([u, v]);
            assert!(p.distance(DVec3::new(u * u * u, u * v, v)) < 1e-14, "{p}");
            assert!(
                du.distance(DVec3::new(3.0 * u * u, v, 0.0)) < 1e-13 && dv.distance(DVec3::new(0.0, u, 1.0)) < 1e-13
            );
        }
        assert!(!surface.is_closed(0, 1e-9) && Basis::new(2, vec![0.0, 0.0, 1.0, 1.0], 2).is_none());
    }
}
