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
use super::height::{Frame, framed_height};
use super::moments::Moments;
use super::points::{Points, weighted_squares};
use super::weights::tukey;
use crate::cloud::Quadric;
use crate::linalg::small_cholesky;
use glam::DVec3;

/// Family B is tried when the fourth-order term of the height field is above this share of the residual.
const ORDER_FOUR_SHARE: f64 = 0.2;
/// A general quadric has one sheet in its ball if its gradient varies by less than its own length; else it may be a
/// hyperbola that takes both faces of an edge.
const ONE_SHEET: f64 = 1.0;
/// Fewest points of effective weight: two more than the six parameters of a height field.
pub(crate) const FEWEST_FIT_WEIGHT: f64 = 8.0;

/// The plane of least squared offsets along the normal of a frame.
fn plane(m: &Moments, frame: Frame) -> [f64; 10] {
    let mut a = [0.0; 10];
    [a[6], a[7], a[8]] = frame.n.to_array();
    a[9] = -m.mean().dot(frame.n);
    a
}

/// The general quadric of least squared values under Taubin's constraint, near the quadric `start`.
pub(crate) fn general(m: &Moments, guides: &[Guide], start: &[f64; 10]) -> Option<[f64; 10]> {
    let mut matrix = m.matrix();
    guides::add(guides, &mut matrix);
    let n = m.gradient_matrix();
    let trace: f64 = (0..10).map(|i| matrix[i][i]).sum();
    for (i, row) in matrix.iter_mut().enumerate() {
        // On exact data the matrix is singular at the answer; the shift keeps the factor and moves nothing else.
        row[i] += 1e-14 * trace;
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
        if !(norm > 0.0 && norm.is_finite()) {
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
        if m.weight() < FEWEST_FIT_WEIGHT {
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
