//! Even spacing: points of a snake put at equal distances along the surface between those that are fixed.
//!
//! Fairness pulls points of a rough surface together, and F_arc of [K98] eq. 3.15 acts on chords: over an edge or a
//! ridge equal chords are unequal ways. So the points are put at equal arc length on the curve. Their neighbours are
//! then joined anew, which cuts the corners of the curve and leaves them a little uneven; again, until they are even.
//! A round cannot lengthen the curve but for other ways around a tip; where that keeps points apart, the step that
//! fits is looked for from point to point.

use super::super::CurveError;
use super::super::chain::{SurfaceCurve, sample};
use super::super::strip::connect;
use super::Snake;
use crate::geom::{is_positive, polyline};
use crate::mesh::FacePoint;
use crate::observe::Observer;

/// Points whose distances along the surface differ from even by more than this are moved.
const UNEVEN: f64 = 0.02;
/// Rounds of putting at equal arc length; a few are the rule.
const EVEN_ROUNDS: usize = 24;
/// Halvings of the bracket of a step, and of the way to the next point.
const HALVINGS: usize = 24;

impl Snake<'_> {
    /// Greatest deviation of the distances of neighbours, measured along the surface, from even, as a fraction: over all
    /// stretches between points that cannot move.
    /// # Errors
    /// `NoWay` if the mesh is not the one that the curve was made on.
    pub fn unevenness(&self) -> Result<f64, CurveError> {
        let mut worst = 0.0f64;
        for stretch in self.stretches() {
            let places: Vec<FacePoint> = stretch.iter().map(|&i| self.points[i]).collect();
            worst = worst.max(uneven(&self.joined(&places)?.1));
        }
        Ok(worst)
    }

    /// Puts the moving points of every stretch between fixed ones at equal distances along the surface.
    pub(super) fn even_out(&mut self, observer: &dyn Observer) -> Result<(), CurveError> {
        for stretch in self.stretches() {
            observer.check()?;
            let places: Vec<FacePoint> = stretch.iter().map(|&i| self.points[i]).collect();
            let even = self.evened(places, observer)?;
            for (&i, &place) in stretch.iter().zip(&even).skip(1).take(stretch.len() - 2) {
                if self.points[i] != place {
                    self.move_to(i, place);
                }
            }
        }
        Ok(())
    }

    /// Runs of points whose inner ones move, with the two at their ends; a closed curve that is free all around is one
    /// from its start to its start.
    fn stretches(&self) -> Vec<Vec<usize>> {
        let n = self.points.len();
        let start = (0..n).find(|&i| !self.moves(i)).unwrap_or(0);
        let segments = if self.closed { n } else { n - 1 - start };
        let (mut out, mut stretch) = (Vec::new(), vec![start]);
        for k in 1..=segments {
            let i = (start + k) % n;
            stretch.push(i);
            if !self.moves(i) || k == segments {
                if stretch.len() > 2 {
                    out.push(std::mem::take(&mut stretch));
                }
                stretch = vec![i];
            }
        }
        out
    }

    /// The way through places, and the lengths of its pieces from one to the next.
    fn joined(&self, places: &[FacePoint]) -> Result<(Vec<FacePoint>, Vec<f64>), CurveError> {
        let (mut chain, mut lengths) = (vec![places[0]], Vec::with_capacity(places.len()));
        for w in places.windows(2) {
            let way = connect(self.mesh, self.adjacency, w[0], w[1])?;
            lengths.push(polyline::length(way.iter().map(|p| p.position(self.mesh))));
            chain.extend_from_slice(&way[1..]);
        }
        Ok((chain, lengths))
    }

    /// The places with their inner ones even.
    fn evened(&self, places: Vec<FacePoint>, observer: &dyn Observer) -> Result<Vec<FacePoint>, CurveError> {
        let count = places.len();
        let mut best = (f64::INFINITY, places.clone(), Vec::new());
        let mut places = places;
        for _ in 0..EVEN_ROUNDS {
            let (chain, lengths) = self.joined(&places)?;
            let off = uneven(&lengths);
            if off < best.0 {
                best = (off, places, chain.clone());
            }
            if off <= UNEVEN {
                return Ok(best.1);
            }
            places = sample(self.mesh, self.adjacency, &chain, count);
        }
        let (off, kept, chain) = best;
        match self.stepped(&chain, count, observer)? {
            Some((reached, places)) if reached < off => Ok(places),
            _ => Ok(kept),
        }
    }

    /// `count` places on a chain, each the same way from the one before it; how uneven they are, and the places.
    fn stepped(
        &self,
        chain: &[FacePoint],
        count: usize,
        observer: &dyn Observer,
    ) -> Result<Option<(f64, Vec<FacePoint>)>, CurveError> {
        let length = SurfaceCurve::open(chain.to_vec()).length(self.mesh);
        // A fine sampling of the chain stands for it.
        const FINE: usize = 32;
        let fine = sample(self.mesh, self.adjacency, chain, FINE * (count - 1) + 1);
        let between = |i: f64| -> FacePoint {
            let k = (i as usize).min(fine.len() - 2);
            super::super::chain::between(self.mesh, self.adjacency, &fine[k], &fine[k + 1], i - k as f64)
        };
        let way = |a: FacePoint, b: FacePoint| self.joined(&[a, b]).map(|x| x.1[0]);
        let end = (fine.len() - 1) as f64;
        let mut best: Option<(f64, Vec<FacePoint>)> = None;
        let (mut low, mut high) = (0.0, 2.0 * length / (count - 1) as f64);
        for _ in 0..HALVINGS {
            observer.check()?;
            let step = (low + high) / 2.0;
            let (mut places, mut at) = (vec![fine[0]], 0.0);
            let mut beyond = false;
            for _ in 1..count - 1 {
                let from = places[places.len() - 1];
                // The first of the fine places that is too far, then halving.
                let mut far = at;
                while far < end && way(from, between(far))? < step {
                    far = (far + FINE as f64 / 4.0).min(end);
                }
                if far >= end && way(from, between(end))? < step {
                    beyond = true;
                    break;
                }
                let (mut a, mut b) = (at, far);
                for _ in 0..HALVINGS {
                    let m = (a + b) / 2.0;
                    if way(from, between(m))? < step { a = m } else { b = m }
                }
                at = (a + b) / 2.0;
                places.push(between(at));
            }
            if beyond {
                high = step;
                continue;
            }
            let rest = way(places[places.len() - 1], fine[fine.len() - 1])?;
            places.push(fine[fine.len() - 1]);
            let off = uneven(&self.joined(&places)?.1);
            if best.as_ref().is_none_or(|b| off < b.0) {
                best = Some((off, places));
            }
            if off <= UNEVEN {
                break;
            }
            if rest > step { low = step } else { high = step }
        }
        Ok(best)
    }
}

/// Greatest deviation of lengths from their mean, as a fraction.
fn uneven(lengths: &[f64]) -> f64 {
    let mean = lengths.iter().sum::<f64>() / lengths.len().max(1) as f64;
    if !is_positive(mean) {
        return 0.0;
    }
    lengths.iter().map(|l| (l / mean - 1.0).abs()).fold(0.0, f64::max)
}
