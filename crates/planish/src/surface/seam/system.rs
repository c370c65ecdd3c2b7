//! The system: what moves cost the fit and what is left of the angles, minimised together by Gauss-Newton.

use super::motion::{Motion, holds, motions, terms};
use super::params::StitchParams;
use super::ring::Condensed;
use super::sums::{Sums, Terms};
use super::wish::{FIRST_WEIGHT, Turn, Wish, wishes};
use super::work::{Filled, Work, shape};
use crate::linalg::SparseCholesky;
use crate::observe::{Cancelled, Observer};
use crate::surface::fit::{solve_inside, surface_of};
use crate::surface::{FitError, Surface};
use glam::DVec3;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Rounds of Gauss-Newton without a raised weight that settle the system, and all rounds. The first round after a raise may
/// overshoot, the next doubles the digits.
const SETTLING_ROUNDS: usize = 2;
const ROUNDS: usize = 20;
/// Weight that seams around a folded patch keep at least: a hundredth of the first.
const LEAST_WEIGHT: f64 = 1e-5;
/// What a seam's weight is raised by while it misses the tolerance.
const RAISE: f64 = 3.0;
/// From weight 1 on a raise has to bring the angle of a seam below this share of what it was, or it is the last.
const HELPS: f64 = 0.95;
/// Share of the tolerance that the RMS of the angle along a seam may have.
const RMS_SHARE: f64 = 0.4;
/// How often its share of the loss a single patch may lose while the whole has not lost its own.
const LOCAL: f64 = 2.0;
/// What the weights around a folded patch are lowered by, and how often.
const EASE: f64 = 0.1;
/// What a round's move as long as the way to the next row of control points costs: turns beyond what is linearised take
/// several rounds.
const HOLD: f64 = 1.0;
/// Largest angle along a seam that is linearised, radians; above, both sides turn towards the mean of their normals.
const AIMED: f64 = 0.1;

/// The system: what is unknown, what is asked, and where it stands.
pub(crate) struct System<'a> {
    work: &'a Work<'a>,
    filled: &'a [Filled],
    condensed: Vec<Arc<Condensed>>,
    unknowns: usize,
    motions: Vec<Vec<Motion>>,
    wishes: Vec<Wish>,
    nets: Vec<Vec<DVec3>>,
    /// For each patch the squared move that it can afford, times its nodes.
    afford: Vec<f64>,
    share: f64,
    /// For each unknown one over the square of the move that is as long as the way to the next row of control points.
    holds: Vec<f64>,
}

impl<'a> System<'a> {
    pub fn new(work: &'a Work<'a>, filled: &'a [Filled], curves: &[Vec<DVec3>], params: &StitchParams) -> System<'a> {
        let shapes: BTreeMap<_, _> = (0..filled.len()).map(|p| (shape(work, p), p)).collect();
        let one = |(shape, p): (_, usize)| {
            let [along_u, along_v] = work.along(p);
            (shape, Arc::new(Condensed::new(along_u, along_v)))
        };
        let condensed: BTreeMap<_, Arc<Condensed>> = shapes.into_iter().map(one).collect();
        let condensed: Vec<Arc<Condensed>> = (0..filled.len()).map(|p| condensed[&shape(work, p)].clone()).collect();
        let (unknowns, motions) = motions(work, filled, curves);
        let nets = filled.iter().map(|f| f.surface.control.clone()).collect();
        let afford = (0..filled.len()).map(|p| work.afford(p)).collect();
        let share = (1.0 + params.fit_loss).powi(2) - 1.0;
        let holds = holds(filled, unknowns, &motions);
        let wishes = wishes(work, curves, params);
        System { work, filled, condensed, unknowns, motions, wishes, nets, afford, share, holds }
    }

    /// Moves of the outer control points of a patch.
    fn moves(&self, p: usize) -> Vec<DVec3> {
        let from = &self.filled[p].surface.control;
        self.condensed[p].outer.iter().map(|&c| self.nets[p][c] - from[c]).collect()
    }

    /// True if what a patch loses is held against what it can afford.
    fn counts(&self, p: usize) -> bool {
        !self.work.held[p] && self.work.rounded[p].is_none()
    }

    /// Squared move of a patch over what it can afford.
    fn cost(&self, p: usize) -> f64 {
        if !self.counts(p) {
            return 0.0;
        }
        let condensed = &self.condensed[p];
        let moves = self.moves(p);
        let row = |r: usize| moves[r].dot(condensed.row(r).iter().zip(&moves).map(|(k, m)| *m * *k).sum());
        (0..moves.len()).map(row).sum::<f64>() / self.afford[p]
    }

    /// Squared move of the whole over what it can afford.
    fn spent(&self) -> f64 {
        let costs: Vec<f64> = (0..self.nets.len()).into_par_iter().map(|p| self.cost(p) * self.afford[p]).collect();
        let afford: f64 = (0..self.nets.len()).filter(|&p| self.counts(p)).map(|p| self.afford[p]).sum();
        if afford > 0.0 { costs.iter().sum::<f64>() / afford } else { 0.0 }
    }

    /// Solves until all seams meet the tolerance or none can be raised further.
    pub fn settle(&mut self, observer: &dyn Observer) -> Result<(), FitError> {
        if self.unknowns == 0 {
            return Ok(());
        }
        let mut settled = 0;
        for _ in 0..ROUNDS {
            observer.check()?;
            for wish in &mut self.wishes {
                wish.aims = wish.own.is_empty() && wish.angles(&self.nets, &self.work.means).0 > AIMED;
            }
            self.step(observer)?;
            let costs: Vec<f64> = (0..self.nets.len()).into_par_iter().map(|p| self.cost(p)).collect();
            let found: Vec<(f64, f64)> =
                self.wishes.par_iter().map(|w| w.angles(&self.nets, &self.work.means)).collect();
            let mut raised = false;
            let spent = self.spent() >= self.share;
            for (wish, (most, squares)) in self.wishes.iter_mut().zip(found) {
                let rms = (squares / wish.samples.len() as f64).sqrt();
                let missed = most > wish.tolerance || rms > RMS_SHARE * wish.tolerance;
                // A seam that turns far may fold its patches over; it does not get more than they can afford.
                let bound = if spent {
                    0.0
                } else if wish.aims {
                    self.share
                } else {
                    LOCAL * self.share
                };
                let helps = wish.weight < 1.0 || most.max(rms) < HELPS * wish.last;
                if missed && helps && wish.weight < wish.ceiling && wish.sides.iter().all(|s| costs[s.patch] < bound) {
                    wish.weight = (wish.weight * RAISE).min(wish.ceiling);
                    wish.last = most.max(rms);
                    raised = true;
                }
            }
            settled = if raised { 0 } else { settled + 1 };
            if settled == SETTLING_ROUNDS {
                break;
            }
        }
        // The last raises may have cost more than there was.
        for _ in 0..ROUNDS {
            if self.spent() <= self.share {
                break;
            }
            observer.check()?;
            for wish in &mut self.wishes {
                wish.weight /= RAISE.sqrt();
            }
            self.step(observer)?;
        }
        Ok(())
    }

    /// One round of Gauss-Newton.
    fn step(&mut self, observer: &dyn Observer) -> Result<(), FitError> {
        let patches: Vec<Terms> = (0..self.nets.len()).into_par_iter().map(|p| self.fit_terms(p)).collect();
        let seams: Vec<Terms> = self.wishes.par_iter().map(|w| self.seam_terms(w)).collect();
        let mut lower = Vec::new();
        let mut rhs = vec![0.0; self.unknowns];
        for (k, hold) in self.holds.iter().enumerate() {
            lower.push((k, k, HOLD * hold));
        }
        for (matrix, side) in patches.into_iter().chain(seams) {
            lower.extend(matrix);
            side.into_iter().for_each(|(k, value)| rhs[k] += value);
        }
        let unknowns = self.unknowns;
        let factor = SparseCholesky::factor_watched(unknowns, lower, &|| observer.cancelled()).ok_or(Cancelled)?;
        let factor = factor.map_err(|_| FitError::Unsolvable { unknowns })?;
        factor.solve(&mut rhs);
        for (net, motions) in self.nets.iter_mut().zip(&self.motions) {
            for (place, motion) in net.iter_mut().zip(motions) {
                *place = terms(motion).fold(*place, |at, (k, way)| at + way * rhs[k]);
            }
        }
        Ok(())
    }

    /// The part of the normal equations that one patch adds.
    fn fit_terms(&self, p: usize) -> Terms {
        let (condensed, motions) = (&self.condensed[p], &self.motions[p]);
        let all = condensed.outer.iter().flat_map(|&c| terms(&motions[c])).map(|(k, _)| k);
        let mut sums = Sums::new(all.collect());
        let ranked: Vec<Vec<(usize, DVec3)>> = condensed
            .outer
            .iter()
            .map(|&c| terms(&motions[c]).map(|(k, way)| (sums.rank(k), way / self.afford[p].sqrt())).collect())
            .collect();
        let moves: Vec<DVec3> = self.moves(p).into_iter().map(|m| m / self.afford[p].sqrt()).collect();
        let mut row = Vec::new();
        for (r, own) in ranked.iter().enumerate().filter(|(_, own)| !own.is_empty()) {
            row.clear();
            row.extend_from_slice(condensed.row(r));
            let force: DVec3 = moves.iter().zip(&row).map(|(m, k)| *m * *k).sum();
            for &(a, way) in own {
                sums.rhs[a] -= way.dot(force);
                for (others, k) in ranked.iter().zip(&row) {
                    for &(b, other) in others.iter().filter(|(b, _)| *b <= a) {
                        sums.add(a, b, k * way.dot(other));
                    }
                }
            }
        }
        sums.done()
    }

    fn seam_terms(&self, wish: &Wish) -> Terms {
        let scale = wish.weight / 2.0 / (wish.samples.len() as f64 * wish.tolerance.powi(2));
        let turns = |s: usize| match wish.aims {
            true => wish.aims(&self.nets, &self.work.means, s),
            false => wish.turn(&self.nets, &self.work.means, s).into_iter().collect(),
        };
        let turns: Vec<Turn> = match scale > 0.0 {
            true => (0..wish.samples.len()).flat_map(turns).filter(|t| t.trust > 0.0).collect(),
            false => Vec::new(),
        };
        let rows: Vec<Vec<(usize, f64)>> = turns
            .iter()
            .map(|turn| {
                let parts = turn.gradient.iter();
                parts
                    .flat_map(|&(p, c, gradient)| {
                        terms(&self.motions[p][c]).map(move |(k, way)| (k, gradient.dot(way)))
                    })
                    .collect()
            })
            .collect();
        let mut sums = Sums::new(rows.iter().flatten().map(|&(k, _)| k).collect());
        for (turn, row) in turns.iter().zip(&rows) {
            let weight = scale * turn.trust;
            let row: Vec<(usize, f64)> = row.iter().map(|&(k, x)| (sums.rank(k), x)).collect();
            for &(a, x) in &row {
                sums.rhs[a] -= weight * x * turn.angle;
                row.iter().filter(|(b, _)| *b <= a).for_each(|&(b, y)| sums.add(a, b, weight * x * y));
            }
        }
        sums.done()
    }

    /// Lowers the weights around some patches, and starts there anew.
    pub fn ease(&mut self, patches: &[usize]) {
        for wish in self.wishes.iter_mut().filter(|w| w.sides.iter().any(|s| patches.contains(&s.patch))) {
            wish.ceiling = (wish.weight.min(1.0) * EASE).max(LEAST_WEIGHT);
        }
        for wish in &mut self.wishes {
            (wish.weight, wish.last) = (FIRST_WEIGHT.min(wish.ceiling), f64::INFINITY);
        }
        self.nets = self.filled.iter().map(|f| f.surface.control.clone()).collect();
    }

    /// The surface of a patch with its inside fitted again.
    pub fn surface(&self, p: usize) -> Surface {
        if self.work.held[p] {
            return self.work.before[p].clone();
        }
        let [along_u, along_v] = self.work.along(p);
        let mut net = self.nets[p].clone();
        solve_inside(&mut net, &self.filled[p].projection, along_u, along_v, 2);
        surface_of(net, along_u, along_v)
    }
}
