//! Fits of one sheet to weighted points: both families of quadrics and the choice between them.
//!
//! [X03] §4.1, §6.2; [T91] Taubin, *Estimation of Planar Curves, Surfaces and Nonplanar Space Curves Defined by
//! Implicit Equations*, 1991: the normalisation of family B.
//! 1. frame: smallest eigenvector of the covariance, then the gradient of the height field
//! 2. family A: a plane or a height-field quadric; family B: a general quadric by inverse iteration
//!    (with the Hermite term of fitted neighbours, `guides`)
//! 3. choice by AICc on first-order distances; robust weights from the residuals, then again from 1.
//!
//! Departs from [X03]: the singular vector of the algebraic distance is biased and changes under rigid motion, so family
//! B takes Taubin's constraint; family B is asked only where the next term of a height field (order four) would show in
//! the residual. The weights of a fit are flat in the middle (1 - t^4): a bell wastes half of the points, and
//! smoothness comes from the blend. [X03] mixes models that are close; one is chosen here, since the blend of
//! neighbouring fits mixes them anyway.

use super::guides::{self, Guide};
use super::moments::Moments;
use super::points::{Points, weighted_squares};
use crate::cloud::Quadric;
use crate::linalg::{eigen3, small_cholesky};
use glam::DVec3;

/// Points closer to zero than this many noise levels keep their weight (Tukey's biweight, 95 % efficiency).
const TUKEY: f64 = 4.685;
/// Family B is tried when the fourth-order term of the height field is above this share of the residual.
const ORDER_FOUR_SHARE: f64 = 0.2;
/// A general quadric has one sheet in its ball if its gradient varies by less than its own length; else it may be a
/// hyperbola that takes both faces of an edge.
const ONE_SHEET: f64 = 1.0;
/// Fewest points of effective weight: two more than the six parameters of a height field.
pub(crate) const FEWEST: f64 = 8.0;

/// Right-handed orthonormal axes with `n` along the surface normal.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    pub u: DVec3,
    pub v: DVec3,
    pub n: DVec3,
}

impl Frame {
    pub(crate) fn of(n: DVec3) -> Frame {
        // The axis farthest from n gives the steadiest tangent; ties go to the first.
        let a = n.abs();
        let axis = if a.x <= a.y && a.x <= a.z {
            DVec3::X
        } else if a.y <= a.z {
            DVec3::Y
        } else {
            DVec3::Z
        };
        let u = axis.cross(n).normalize();
        Frame { u, v: n.cross(u), n }
    }

    /// Frame of the plane of least squared distances.
    pub(crate) fn of_moments(m: &Moments) -> Frame {
        let (_, rows) = eigen3(m.covariance());
        Frame::of(DVec3::from_array(rows[0]))
    }
}

/// Coefficients of a height field in its frame: n = a uu + b uv + c vv + d u + e v + f.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Height {
    pub frame: Frame,
    pub c: [f64; 6],
}

impl Height {
    #[inline]
    pub(crate) fn residual(&self, y: DVec3) -> f64 {
        let (u, v) = (self.frame.u.dot(y), self.frame.v.dot(y));
        let c = &self.c;
        self.frame.n.dot(y) - (u * (c[0] * u + c[1] * v + c[3]) + v * (c[2] * v + c[4]) + c[5])
    }

    /// As coefficients of a quadric in local coordinates.
    pub(crate) fn implicit(&self) -> [f64; 10] {
        let t = directions(&self.frame);
        let mut a = t[0];
        for k in 0..6 {
            for i in 0..10 {
                a[i] -= self.c[k] * t[k + 1][i];
            }
        }
        a
    }

    /// The frame whose normal is the gradient at the foot of the origin.
    fn tilted(&self) -> Frame {
        Frame::of((self.frame.n - self.c[3] * self.frame.u - self.c[4] * self.frame.v).normalize())
    }
}

/// Coefficients of n, uu, uv, vv, u, v, 1 as quadrics.
fn directions(f: &Frame) -> [[f64; 10]; 7] {
    let product = |a: DVec3, b: DVec3| {
        [
            a.x * b.x,
            a.x * b.y + a.y * b.x,
            a.x * b.z + a.z * b.x,
            a.y * b.y,
            a.y * b.z + a.z * b.y,
            a.z * b.z,
            0.0,
            0.0,
            0.0,
            0.0,
        ]
    };
    let linear = |a: DVec3| [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, a.x, a.y, a.z, 0.0];
    let mut one = [0.0; 10];
    one[9] = 1.0;
    [linear(f.n), product(f.u, f.u), product(f.u, f.v), product(f.v, f.v), linear(f.u), linear(f.v), one]
}

/// Least-squares height field in a frame. `None` if the points do not determine one.
pub(crate) fn height(matrix: &[[f64; 10]; 10], frame: Frame) -> Option<Height> {
    let t = directions(&frame);
    let mut g = [[0.0; 6]; 6];
    let mut b = [0.0; 6];
    let mut image = [[0.0; 10]; 7];
    for k in 0..7 {
        for i in 0..10 {
            if t[k][i] != 0.0 {
                for j in 0..10 {
                    image[k][j] += t[k][i] * matrix[i][j];
                }
            }
        }
    }
    let dot = |a: &[f64; 10], b: &[f64; 10]| (0..10).map(|i| a[i] * b[i]).sum::<f64>();
    for i in 0..6 {
        b[i] = dot(&image[0], &t[i + 1]);
        for j in 0..=i {
            g[i][j] = dot(&image[i + 1], &t[j + 1]);
        }
    }
    ridge(&mut g);
    small_cholesky::solve(&mut g, &mut b).then_some(Height { frame, c: b })
}

/// A height field in the frame of the points, once more in the frame of its own gradient.
pub(crate) fn framed_height(matrix: &[[f64; 10]; 10], start: Frame) -> Option<Height> {
    let first = height(matrix, start)?;
    // Below six degrees the frame makes no difference to a height field that shows.
    if first.c[3].hypot(first.c[4]) < 0.1 {
        return Some(first);
    }
    height(matrix, first.tilted())
}

/// The plane of least squared offsets along the normal of a frame.
fn plane(m: &Moments, frame: Frame) -> [f64; 10] {
    let mut a = [0.0; 10];
    [a[6], a[7], a[8]] = frame.n.to_array();
    a[9] = -m.mean().dot(frame.n);
    a
}

/// A relative ridge at the level of rounding: collinear points leave directions without data.
fn ridge<const N: usize>(g: &mut [[f64; N]; N]) {
    for i in 0..N {
        g[i][i] += 1e-13 * g[i][i] + 1e-300;
    }
}

/// The general quadric of least squared values under Taubin's constraint, near the quadric `start`.
pub(crate) fn general(m: &Moments, guides: &[Guide], start: &[f64; 10]) -> Option<[f64; 10]> {
    let mut matrix = m.matrix();
    guides::add(guides, &mut matrix);
    let n = m.gradient_matrix();
    let trace: f64 = (0..10).map(|i| matrix[i][i]).sum();
    for i in 0..10 {
        // On exact data the matrix is singular at the answer; the shift keeps the factor and moves nothing else.
        matrix[i][i] += 1e-14 * trace;
    }
    if !small_cholesky::factor(&mut matrix) {
        return None;
    }
    let mut a = *start;
    // Inverse iteration gains the ratio of the two least eigenvalues each time.
    for _ in 0..4 {
        let mut b = [0.0; 10];
        for i in 0..10 {
            b[i] = (0..10).map(|j| n[i][j] * a[j]).sum();
        }
        small_cholesky::substitute(&matrix, &mut b);
        let norm = b.iter().map(|x| x * x).sum::<f64>().sqrt();
        if !(norm > 0.0) || !norm.is_finite() {
            return None;
        }
        a = b.map(|x| x / norm);
    }
    Some(a)
}

/// One fitted sheet.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sheet {
    pub quadric: Quadric,
    /// Root of the weighted mean of squared first-order distances, corrected for the parameters; world units.
    pub rms: f64,
    /// Parameters of the model: 3 plane, 6 height field, 9 general quadric.
    pub parameters: f64,
}

/// What a sheet is fitted to, in local coordinates around `center` with unit `scale`.
#[derive(Clone, Copy)]
pub(crate) struct Ball<'a> {
    pub center: DVec3,
    pub scale: f64,
    pub points: &'a Points,
    /// Weight of every point.
    pub weights: &'a [f64],
    pub guides: &'a [Guide],
    /// Standard deviation of the points.
    pub noise: f64,
}

/// Fits a sheet.
///
/// * `start` - a first guess, whose residuals give the first robust weights
/// * `rounds` - how often the weights follow the fit
pub(crate) fn sheet(ball: &Ball, start: &Quadric, rounds: usize) -> Option<Sheet> {
    let Ball { center, scale, points, noise, .. } = *ball;
    let mut model = localized(start, center, scale);
    let (mut weights, mut distances) = (ball.weights.to_vec(), Vec::new());
    let mut last = None;
    for _ in 0..rounds {
        points.distances(&model, &mut distances);
        for ((w, own), d) in weights.iter_mut().zip(ball.weights).zip(&distances) {
            *w = own * tukey(d / noise);
        }
        let m = points.moments(&weights);
        if m.weight() < FEWEST {
            return None;
        }
        let felt = Ball { weights: &weights, guides: &guides::heeded(ball.guides, &model, noise), ..*ball };
        let frame = Frame::of(model.value(m.mean()).1.normalize_or(DVec3::Z));
        let chosen = choose(&m, &felt, frame, &mut distances)?;
        model = Quadric { center: DVec3::ZERO, scale: 1.0, a: chosen.0 };
        last = Some((chosen, m.weight()));
    }
    let ((a, parameters, rss), weight) = last?;
    let quadric = Quadric { center, scale, a };
    let freedom = (weight - parameters).max(1.0);
    Some(Sheet { quadric, rms: (rss / freedom).sqrt() * scale, parameters })
}

/// A quadric in other local coordinates.
pub(crate) fn localized(q: &Quadric, center: DVec3, scale: f64) -> Quadric {
    Quadric { center: (q.center - center) / scale, scale: q.scale / scale, a: q.a }
}

/// The model of least AICc: coefficients, parameters and weighted sum of squared distances of the points.
///
/// The score counts the guides, too: a model whose gradient disagrees with the normals around is worth less ([X03] §6.2).
fn choose(m: &Moments, felt: &Ball, frame: Frame, distances: &mut Vec<f64>) -> Option<([f64; 10], f64, f64)> {
    let Ball { points, weights, guides, noise, .. } = *felt;
    let mut squared = |a: &[f64; 10]| {
        let model = Quadric { center: DVec3::ZERO, scale: 1.0, a: *a };
        points.distances(&model, distances);
        (weighted_squares(weights, distances), guides::squares(guides, &model))
    };
    let matrix = m.matrix();
    let curved = framed_height(&matrix, frame)?;
    let n = m.weight();
    let flat = plane(m, Frame::of_moments(m));
    let all = n + guides::weight(guides);
    let score = |rss: (f64, f64), p: f64| {
        all * ((rss.0 + rss.1) / all).max(1e-30).ln() + 2.0 * p * all / (all - p - 1.0).max(0.5)
    };
    let a = curved.implicit();
    let rss = squared(&a);
    let mut best = (a, 6.0, rss);
    let bend = curved.c[0].abs().max(curved.c[2].abs()) * 2.0;
    let reach = points.reach();
    let order_four = bend.powi(3) * reach.powi(4) / 8.0;
    if n > 12.0
        && order_four > ORDER_FOUR_SHARE * (rss.0 / n).sqrt().min(noise)
        && let Some(b) = general(m, guides, &a)
    {
        let general_rss = squared(&b);
        // A general quadric may have come out inside out; the sign of the height field is kept.
        let q = Quadric { center: DVec3::ZERO, scale: 1.0, a: b };
        if score(general_rss, 9.0) < score(rss, 6.0) && q.variation(m.mean(), reach) < ONE_SHEET {
            let along = q.value(m.mean()).1.dot(curved.frame.n);
            best = (if along < 0.0 { b.map(|x| -x) } else { b }, 9.0, general_rss);
        }
    }
    let flat_rss = squared(&flat);
    if score(flat_rss, 3.0) < score(best.2, best.1) {
        best = (flat, 3.0, flat_rss);
    }
    let (model, parameters, (rss, _)) = best;
    Some((model, parameters, rss))
}

/// Tukey's biweight of a residual in noise levels.
#[inline]
pub(crate) fn tukey(t: f64) -> f64 {
    let s = (t / TUKEY) * (t / TUKEY);
    if s < 1.0 { (1.0 - s) * (1.0 - s) } else { 0.0 }
}

/// Weight of a point at squared distance `t2` of the support (1 at its rim).
#[inline]
pub(crate) fn kernel(t2: f64) -> f64 {
    (1.0 - t2 * t2).max(0.0)
}
