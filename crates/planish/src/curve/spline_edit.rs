//! Editing a surface curve through a B-spline curve in space.
//!
//! [K98] §3.3.2 and 3.3.3: a uniform cubic B-spline with N control vertices is fitted to the places (least squares,
//! parameters by chord length); moved control vertices or edit points carry the surface curve along by CurveAttract.
//! Departs from [K98]: the spline of an open curve is clamped and keeps its ends, since other curves meet there.

use super::CurveError;
use super::attract::{attract, sample_polyline};
use super::chain::SurfaceCurve;
use crate::linalg::solve_dense;
use crate::mesh::{Adjacency, TriMesh};
use glam::DVec3;

/// Points of the spline per control vertex when it is drawn or sampled.
const DRAWN: usize = 24;

/// A uniform cubic B-spline curve in space over the parameters 0 to 1.
#[derive(Clone, Debug, PartialEq)]
pub struct SplineEdit {
    /// Control vertices, world units.
    pub control: Vec<DVec3>,
    /// True for a periodic spline.
    pub closed: bool,
}

impl SplineEdit {
    /// Fits a spline with `count` control vertices to the places of `curve`. Fewer control vertices make a smoother
    /// curve.
    /// # Errors
    /// `TooFewPoints` for less than four control vertices or fewer places than control vertices.
    /// Source: [K98] §3.3.2.
    pub fn fit(mesh: &TriMesh, curve: &SurfaceCurve, count: usize) -> Result<SplineEdit, CurveError> {
        curve.check(mesh)?;
        let at = curve.positions(mesh);
        if count < 4 {
            return Err(CurveError::TooFewPoints { found: count, needed: 4 });
        }
        if at.len() < count {
            return Err(CurveError::TooFewPoints { found: at.len(), needed: count });
        }
        let parameters = chord_lengths(&at, curve.closed);
        let (first, last) = (at[0], at[at.len() - 1]);
        // Unknown: all control vertices, without the two ends of an open curve.
        let (skip, unknowns) = if curve.closed { (0, count) } else { (1, count - 2) };
        let mut matrix = vec![0.0; unknowns * unknowns];
        let mut rhs = vec![0.0; 3 * unknowns];
        for (&t, &p) in parameters.iter().zip(&at) {
            let (k, b) = basis(count, curve.closed, t);
            let mut rest = p;
            let mut mine: Vec<(usize, f64)> = Vec::with_capacity(4);
            for (i, &w) in b.iter().enumerate() {
                let j = (k + i) % count;
                if !curve.closed && j == 0 {
                    rest -= first * w;
                } else if !curve.closed && j + 1 == count {
                    rest -= last * w;
                } else {
                    mine.push((j - skip, w));
                }
            }
            for &(i, w) in &mine {
                for &(j, v) in &mine {
                    matrix[i * unknowns + j] += w * v;
                }
                for (c, x) in rest.to_array().into_iter().enumerate() {
                    rhs[3 * i + c] += w * x;
                }
            }
        }
        // Where places cluster a span may stay empty: the spline then takes the mean of the neighbours.
        let mean = (0..unknowns).map(|i| matrix[i * unknowns + i]).sum::<f64>() / unknowns as f64;
        let slack = EMPTY_SPAN * mean;
        for i in 0..unknowns {
            let Some((a, b)) = neighbours(i, unknowns, curve.closed) else { continue };
            for (p, x) in [(i, 2.0), (a, -1.0), (b, -1.0)] {
                for (q, y) in [(i, 2.0), (a, -1.0), (b, -1.0)] {
                    matrix[p * unknowns + q] += slack * x * y;
                }
            }
        }
        if !solve_dense(&mut matrix, &mut rhs, unknowns, 3) {
            return Err(CurveError::TooFewPoints { found: at.len(), needed: 2 * count });
        }
        let mut control: Vec<DVec3> = rhs.chunks_exact(3).map(DVec3::from_slice).collect();
        if !curve.closed {
            control.insert(0, first);
            control.push(last);
        }
        Ok(SplineEdit { control, closed: curve.closed })
    }

    /// Position at parameter `t`, 0 to 1.
    pub fn position(&self, t: f64) -> DVec3 {
        let n = self.control.len();
        let (k, b) = basis(n, self.closed, t);
        (0..4).map(|i| self.control[(k + i) % n] * b[i]).sum()
    }

    /// The spline as a polyline; a closed one ends where it starts.
    pub fn polyline(&self) -> Vec<DVec3> {
        let steps = DRAWN * self.control.len();
        (0..=steps).map(|k| self.position(k as f64 / steps as f64)).collect()
    }

    /// Moves control vertex `index` to `to`.
    /// # Errors
    /// `NoSuchPart`.
    pub fn move_control(&mut self, index: usize, to: DVec3) -> Result<(), CurveError> {
        let count = self.control.len();
        *self.control.get_mut(index).ok_or(CurveError::NoSuchPart { what: "control vertex", index, count })? = to;
        Ok(())
    }

    /// Moves the point at parameter `t` to `to`, by the least change of the control vertices; those at the ends of
    /// an open curve stay.
    pub fn move_edit_point(&mut self, t: f64, to: DVec3) {
        let n = self.control.len();
        let (k, mut b) = basis(n, self.closed, t);
        let miss = to - self.position(t);
        for (i, w) in b.iter_mut().enumerate() {
            let j = (k + i) % n;
            if !self.closed && (j == 0 || j + 1 == n) {
                *w = 0.0;
            }
        }
        let square: f64 = b.iter().map(|w| w * w).sum();
        if square > 0.0 {
            for (i, w) in b.iter().enumerate() {
                self.control[(k + i) % n] += miss * (w / square);
            }
        }
    }

    /// The surface curve drawn to the spline: attractors sampled by arc length, one per place of `curve`. The ends of
    /// an open curve stay.
    /// Source: [K98] §3.3.1.
    pub fn carry(&self, mesh: &TriMesh, adjacency: &Adjacency, curve: &SurfaceCurve) -> SurfaceCurve {
        let n = curve.points.len();
        let mut attractors = sample_polyline(&self.polyline(), n + self.closed as usize);
        attractors.truncate(n);
        let mut points = attract(mesh, adjacency, &curve.points, &attractors);
        if !curve.closed && n > 1 {
            (points[0], points[n - 1]) = (curve.points[0], curve.points[n - 1]);
        }
        SurfaceCurve { points, closed: curve.closed }
    }
}

/// Weight, against the mean of the system, that a control vertex without places gets towards its neighbours.
const EMPTY_SPAN: f64 = 1e-9;

fn neighbours(i: usize, n: usize, closed: bool) -> Option<(usize, usize)> {
    if closed {
        return Some(((i + n - 1) % n, (i + 1) % n));
    }
    (i > 0 && i + 1 < n).then(|| (i - 1, i + 1))
}

/// Parameters of points by chord length, 0 to 1; those of a closed curve stop before 1.
fn chord_lengths(at: &[DVec3], closed: bool) -> Vec<f64> {
    let mut sums = vec![0.0];
    for w in at.windows(2) {
        sums.push(sums[sums.len() - 1] + w[0].distance(w[1]));
    }
    let wrap = if closed { at[at.len() - 1].distance(at[0]) } else { 0.0 };
    let total = (sums[sums.len() - 1] + wrap).max(f64::MIN_POSITIVE);
    sums.into_iter().map(|s| s / total).collect()
}

/// First control vertex (modulo their number) and the four basis functions at `t`.
fn basis(count: usize, closed: bool, t: f64) -> (usize, [f64; 4]) {
    let spans = if closed { count } else { count - 3 };
    let x = if closed { t.rem_euclid(1.0) } else { t.clamp(0.0, 1.0) } * spans as f64;
    let span = (x as usize).min(spans - 1);
    let knot = |i: isize| {
        let i = i as f64;
        if closed { i } else { i.clamp(0.0, spans as f64) }
    };
    // Cox and de Boor, the four functions that are not zero on the span.
    let mut b = [1.0, 0.0, 0.0, 0.0];
    let s = span as isize;
    for degree in 1..4isize {
        let mut next = [0.0; 4];
        for i in 0..degree {
            let (left, right) = (knot(s + 1 + i - degree), knot(s + 1 + i));
            let w = (right - x) / (right - left);
            next[i as usize] += b[i as usize] * w;
            next[i as usize + 1] += b[i as usize] * (1.0 - w);
        }
        b = next;
    }
    (span, b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::FacePoint;
    use crate::synthetic::shapes;

    #[test]
    fn basis_functions_sum_to_1_and_a_clamped_spline_ends_at_its_end_vertices() {
        for closed in [false, true] {
            for k in 0..=50 {
                let (_, b) = basis(9, closed, k as f64 / 50.0);
                assert!((b.iter().sum::<f64>() - 1.0).abs() < 1e-14 && b.iter().all(|w| *w >= -1e-15));
            }
        }
        let control: Vec<DVec3> = (0..7).map(|k| DVec3::new(k as f64, (k * k % 5) as f64, 0.0)).collect();
        let spline = SplineEdit { control: control.clone(), closed: false };
        assert!(spline.position(0.0).distance(control[0]) < 1e-14);
        assert!(spline.position(1.0).distance(control[6]) < 1e-14);
    }

    #[test]
    fn an_edit_point_goes_where_it_is_put_and_the_ends_stay_within_1e_12() {
        let mesh = shapes::rectangle(4.0, 2.0, 40, 20);
        let face = |k: usize| FacePoint { face: (20 + 40 * 10 + 2 * k) as u32, bary: [0.3, 0.3, 0.4] };
        let curve = SurfaceCurve::open((0..30).map(face).collect());
        let mut spline = SplineEdit::fit(&mesh, &curve, 8).unwrap();
        let ends = [spline.position(0.0), spline.position(1.0)];
        let to = spline.position(0.4) + DVec3::new(0.02, 0.3, 0.1);
        spline.move_edit_point(0.4, to);
        assert!(spline.position(0.4).distance(to) < 1e-12);
        assert!(spline.position(0.0).distance(ends[0]) < 1e-12 && spline.position(1.0).distance(ends[1]) < 1e-12);
    }
}
