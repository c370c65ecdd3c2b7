//! What single places of a patch may lose for the sake of its seams.
//!
//! A surface lies in the hull of its control points: where none of them moves by more than a length, the surface does not
//! either. So each control point gets a length by how far the fit misses around it, and a weight that rises while it moves
//! by more: the multiplier of the condition `move <= length`. What a place cannot afford is left to the other side of the
//! seam, or to the angle there; the rest of the seam goes on.

use super::Surface;
use super::basis::{BasisRows, uniform_parameters};
use super::ring::Condensed;
use glam::DVec3;

/// Exponents of the ratio of a move to what it may be in the change of its weight, above 1 and below. A move falls with a power
/// of its weight between 0, where the seams have the say, and 1, and with twice that where neighbours are raised, too: the
/// first is fast for all of these, and what it goes too far the second takes back without going too far again.
const EXPONENTS: [f64; 2] = [1.5, 0.5];
/// Largest factor by which a weight changes at once: what is linearised holds in part only.
const MOST_CHANGE: f64 = 9.0;
/// Ratio of a move to what it may be that counts as kept: weights settle in the limit only.
const KEPT: f64 = 1.25;

/// The outer control points of a patch, as [`Condensed::outer`] numbers them.
pub(crate) struct Places {
    /// For each the squared move that it may make.
    allowed: Vec<f64>,
    /// How much its move weighs against that of the fit alone; 1 or more.
    pub weights: Vec<f64>,
}

impl Places {
    /// * `squares` - squared distances of the nodes of a grid from `surface`, of which `cols` stand in a row
    /// * `allowed` - the squared move for the mean squared distance around a control point
    pub fn new(
        surface: &Surface,
        squares: &[f64],
        cols: usize,
        condensed: &Condensed,
        allowed: impl Fn(f64) -> f64,
    ) -> Places {
        let rows = |knots: &[f64], count: usize| BasisRows::new(knots, &uniform_parameters(count), 0);
        let (along_u, along_v) = (rows(&surface.knots_u, cols), rows(&surface.knots_v, squares.len() / cols));
        let mut sums = vec![[0.0; 2]; surface.control.len()];
        for (k, &square) in squares.iter().enumerate() {
            let (i, j) = (k % cols, k / cols);
            for (b, wv) in along_v.weights[j].iter().enumerate() {
                for (a, wu) in along_u.weights[i].iter().enumerate() {
                    let sum = &mut sums[(along_v.first[j] + b) * surface.cols + along_u.first[i] + a];
                    *sum = [sum[0] + wu * wv * square, sum[1] + wu * wv];
                }
            }
        }
        let one = |&c: &usize| allowed(sums[c][0] / sums[c][1].max(f64::MIN_POSITIVE));
        let allowed: Vec<f64> = condensed.outer.iter().map(one).collect();
        let weights = vec![1.0; allowed.len()];
        Places { allowed, weights }
    }

    /// True if no control point moved by more than it may.
    pub fn keep(&self, moves: &[DVec3]) -> bool {
        self.allowed.iter().zip(moves).all(|(allowed, way)| way.length_squared() <= KEPT * KEPT * allowed)
    }

    /// Changes the weights by how far the control points moved.
    pub fn weigh(&mut self, moves: &[DVec3]) {
        for ((weight, allowed), way) in self.weights.iter_mut().zip(&self.allowed).zip(moves) {
            let square = way.length_squared() / allowed;
            let change = square.powf(EXPONENTS[usize::from(square < 1.0)] / 2.0);
            *weight = (*weight * change.clamp(1.0 / MOST_CHANGE, MOST_CHANGE)).max(1.0);
        }
    }

    /// Forgets the weights.
    pub fn reset(&mut self) {
        self.weights.fill(1.0);
    }
}
