//! The system: what moves cost the fit and what is left of the angles, minimised together by Gauss-Newton.

use super::bend::Side;
use super::motion::{FIXED, Motion, holds, motions, terms};
use super::params::{BENT_DEG, StitchParams};
use super::ring::Condensed;
use super::sums::Sums;
use super::wish::{FIRST_WEIGHT, Wish, wishes};
use super::work::{Filled, Work, shape};
use crate::linalg::SparsePattern;
use crate::observe::{Cancelled, Observer};
use crate::surface::fit::{solve_inside, surface_of};
use crate::surface::sides::side_len;
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
    /// For each of `wishes` the samples that are turned back before anything moves.
    turned_back: Vec<usize>,
    /// For each patch the squared move that it can afford, times its nodes.
    afford: Vec<f64>,
    /// Where the entries of the normal equations lie: holds, patches and seams, one after the other.
    pattern: Arc<SparsePattern>,
    /// Those of holds and patches, which stay as they are.
    fit_values: Vec<f64>,
}

impl<'a> System<'a> {
    pub fn new(
        work: &'a Work<'a>,
        filled: &'a [Filled],
        curves: &[Vec<DVec3>],
        params: &StitchParams,
        observer: &dyn Observer,
    ) -> Result<System<'a>, FitError> {
        let shapes: BTreeMap<_, _> = (0..filled.len()).map(|p| (shape(work, p), p)).collect();
        let one = |(shape, p): (_, usize)| {
            let [along_u, along_v] = work.along(p);
            (shape, Arc::new(Condensed::new(along_u, along_v)))
        };
        let condensed: BTreeMap<_, Arc<Condensed>> = shapes.into_iter().map(one).collect();
        let condensed: Vec<Arc<Condensed>> = (0..filled.len()).map(|p| condensed[&shape(work, p)].clone()).collect();
        let (unknowns, motions) = motions(work, filled, curves);
        let nets: Vec<Vec<DVec3>> = filled.iter().map(|f| f.surface.control.clone()).collect();
        let afford: Vec<f64> = (0..filled.len()).map(|p| work.afford(p)).collect();
        let fits: Vec<Sums> =
            (0..filled.len()).into_par_iter().map(|p| fit_sums(&condensed[p], &motions[p], afford[p])).collect();
        let wishes = wishes(work, curves, params);
        let turned_back = wishes.par_iter().map(|wish| wish.turned_back(&nets, &work.means)).collect();
        let turned: Vec<Sums> = wishes.iter().map(|wish| turned(wish, &motions)).collect();
        let places = (0..unknowns).map(|k| (k, k)).chain(fits.iter().chain(&turned).flat_map(Sums::places));
        let pattern = SparsePattern::watched(unknowns, places.collect(), &|| observer.cancelled()).ok_or(Cancelled)?;
        let pattern = Arc::new(pattern.map_err(|_| FitError::Unsolvable { unknowns })?);
        let holds = holds(filled, unknowns, &motions).into_iter().map(|hold| HOLD * hold);
        let fit_values = holds.chain(fits.iter().flat_map(|sums| sums.lower.iter().copied())).collect();
        Ok(System {
            work,
            filled,
            condensed,
            unknowns,
            motions,
            wishes,
            nets,
            turned_back,
            afford,
            pattern,
            fit_values,
        })
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
        let [along_u, along_v] = self.work.along(p);
        let from = &self.filled[p].surface.control;
        let none = vec![DVec3::ZERO; from.len()];
        let mut moves: Vec<DVec3> = self.nets[p].iter().zip(from).map(|(to, from)| *to - *from).collect();
        solve_inside(&mut moves, &none, along_u, along_v, 2);
        self.work.loss(p, &moves) / self.afford[p]
    }

    fn costs(&self) -> Vec<f64> {
        (0..self.nets.len()).into_par_iter().map(|p| self.cost(p)).collect()
    }

    /// Squared move of the whole over what it may lose.
    fn spent(&self, costs: &[f64]) -> f64 {
        let shares = &self.work.shares;
        let may: f64 = (0..self.nets.len()).filter(|&p| self.counts(p)).map(|p| shares[p] * self.afford[p]).sum();
        let lost: f64 = costs.iter().zip(&self.afford).map(|(cost, afford)| cost * afford).sum();
        if lost > 0.0 { lost / may } else { 0.0 }
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
            let costs = self.costs();
            let found: Vec<(f64, f64)> =
                self.wishes.par_iter().map(|w| w.angles(&self.nets, &self.work.means)).collect();
            let mut raised = false;
            let spent = self.spent(&costs) >= 1.0;
            for (wish, (most, squares)) in self.wishes.iter_mut().zip(found) {
                let rms = (squares / wish.samples.len() as f64).sqrt();
                let missed = most > wish.tolerance || rms > RMS_SHARE * wish.tolerance;
                // A seam that turns far may fold its patches over; it does not get more than they can afford.
                let bound = if spent || wish.aims { 1.0 } else { LOCAL };
                let is_bent = most > BENT_DEG.to_radians();
                let share = |p: usize| if is_bent { self.work.shares[p] } else { self.work.share };
                let affords = |s: &Side| costs[s.patch] < bound * share(s.patch);
                let helps = wish.weight < 1.0 || most.max(rms) < HELPS * wish.last;
                if missed && helps && wish.weight < wish.ceiling && wish.sides.iter().all(affords) {
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
        // The last raises may have cost more than there was: patches that lost more than their share give some back.
        for _ in 0..ROUNDS {
            let costs = self.costs();
            if self.spent(&costs) <= 1.0 {
                break;
            }
            observer.check()?;
            let shares = &self.work.shares;
            for wish in self.wishes.iter_mut().filter(|w| w.sides.iter().any(|s| costs[s.patch] > shares[s.patch])) {
                wish.weight /= RAISE.sqrt();
            }
            self.step(observer)?;
        }
        Ok(())
    }

    /// One round of Gauss-Newton.
    fn step(&mut self, observer: &dyn Observer) -> Result<(), FitError> {
        let forces: Vec<_> = (0..self.nets.len()).into_par_iter().map(|p| self.fit_forces(p)).collect();
        let seams: Vec<Sums> = self.wishes.par_iter().map(|w| self.seam_sums(w)).collect();
        let mut rhs = vec![0.0; self.unknowns];
        for (k, force) in forces.into_iter().flatten().chain(seams.iter().flat_map(Sums::right)) {
            rhs[k] += force;
        }
        let seams = seams.iter().flat_map(|sums| &sums.lower);
        let values = self.fit_values.iter().chain(seams).copied().collect();
        let factor = self.pattern.factor_watched(values, &|| observer.cancelled()).ok_or(Cancelled)?;
        factor.map_err(|_| FitError::Unsolvable { unknowns: self.unknowns })?.solve(&mut rhs);
        for (net, motions) in self.nets.iter_mut().zip(&self.motions) {
            for (place, motion) in net.iter_mut().zip(motions) {
                *place = terms(motion).fold(*place, |at, (k, way)| at + way * rhs[k]);
            }
        }
        Ok(())
    }

    /// What the fit of a patch adds to the right side.
    fn fit_forces(&self, p: usize) -> Vec<(usize, f64)> {
        let (condensed, motions, moves) = (&self.condensed[p], &self.motions[p], self.moves(p));
        let free = condensed.outer.iter().enumerate().filter(|(_, c)| motions[**c] != FIXED);
        let row = |(r, &c): (usize, &usize)| {
            let weighed = condensed.row(r).iter().zip(&moves).map(|(k, m)| *m * *k);
            let force = weighed.sum::<DVec3>() / self.afford[p];
            terms(&motions[c]).map(move |(k, way)| (k, -way.dot(force)))
        };
        free.flat_map(row).collect()
    }

    /// What the angles along a seam add.
    fn seam_sums(&self, wish: &Wish) -> Sums {
        let mut sums = turned(wish, &self.motions);
        let scale = wish.weight / 2.0 / (wish.samples.len() as f64 * wish.tolerance.powi(2));
        let turns = |s: usize| match wish.aims {
            true => wish.aims(&self.nets, &self.work.means, s),
            false => wish.turn(&self.nets, &self.work.means, s).into_iter().collect(),
        };
        for turn in (0..wish.samples.len()).flat_map(turns).filter(|t| scale > 0.0 && t.trust > 0.0) {
            let weight = scale * turn.trust;
            let moved = turn
                .gradient
                .iter()
                .flat_map(|&(p, c, gradient)| terms(&self.motions[p][c]).map(move |(k, way)| (k, gradient.dot(way))));
            let row: Vec<(usize, f64)> = moved.map(|(k, x)| (sums.rank(k), x)).collect();
            for &(a, x) in &row {
                sums.add_right(a, -weight * x * turn.angle);
                row.iter().filter(|(b, _)| *b <= a).for_each(|&(b, y)| sums.add(a, b, weight * x * y));
            }
        }
        sums
    }

    /// For each patch whether it lies beside a seam that is turned back at more places than before anything moved.
    pub fn beside_turned_back(&self) -> Vec<bool> {
        let is_worse = |(wish, before): (&Wish, &usize)| wish.turned_back(&self.nets, &self.work.means) > *before;
        let worse: Vec<bool> = self.wishes.par_iter().zip(&self.turned_back).map(is_worse).collect();
        let mut beside = vec![false; self.nets.len()];
        for (wish, _) in self.wishes.iter().zip(worse).filter(|(_, worse)| *worse) {
            wish.sides.iter().for_each(|side| beside[side.patch] = true);
        }
        beside
    }

    /// Lowers the weights around some patches, and starts anew; false if these are as low as they get.
    pub fn ease(&mut self, patches: &[usize]) -> bool {
        let mut lowered = false;
        for wish in self.wishes.iter_mut().filter(|w| w.sides.iter().any(|s| patches.contains(&s.patch))) {
            let ceiling = (wish.weight.min(1.0) * EASE).max(LEAST_WEIGHT);
            lowered |= ceiling < wish.ceiling;
            wish.ceiling = ceiling;
        }
        if !lowered {
            return false;
        }
        for wish in &mut self.wishes {
            (wish.weight, wish.last) = (FIRST_WEIGHT.min(wish.ceiling), f64::INFINITY);
        }
        self.nets = self.filled.iter().map(|f| f.surface.control.clone()).collect();
        true
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

/// What the squared moves of a patch add, over what it can afford.
fn fit_sums(condensed: &Condensed, motions: &[Motion], afford: f64) -> Sums {
    let moved = |&c: &usize| terms(&motions[c]);
    let mut sums = Sums::new(condensed.outer.iter().flat_map(moved).map(|(k, _)| k).collect());
    let ranked: Vec<Vec<(usize, DVec3)>> = condensed
        .outer
        .iter()
        .map(|c| moved(c).map(|(k, way)| (sums.rank(k), way / afford.sqrt())).collect())
        .collect();
    for (r, own) in ranked.iter().enumerate() {
        for &(a, way) in own {
            for (others, k) in ranked.iter().zip(condensed.row(r)) {
                for &(b, other) in others.iter().filter(|(b, _)| *b <= a) {
                    sums.add(a, b, k * way.dot(other));
                }
            }
        }
    }
    sums
}

/// Sums, empty yet, of all that turns the planes beside a seam.
fn turned(wish: &Wish, motions: &[Vec<Motion>]) -> Sums {
    let rows = |side: &Side| -> Vec<usize> {
        let along = 0..side_len(side.rows, side.cols, side.side);
        let nodes = along.flat_map(|i| [side.node(i, 0), side.node(i, 1)]);
        nodes.flat_map(|c| terms(&motions[side.patch][c])).map(|(k, _)| k).collect()
    };
    Sums::new(wish.sides.iter().flat_map(rows).collect())
}
