//! Exact seams: one tangent plane along every smooth seam, to a thousandth of a degree.
//!
//! 1. gluing functions from the corners - `star`      2. what is unknown, and the equations of the seams - `rows`
//! 3. the fit under these equations - `system`
//!
//! See `docs/methods/surfaces.md`, "Exact seams".

mod rows;
mod star;
mod system;

use super::fold::folds;
use super::seam::miss::{Misses, farthest};
use super::sides::{check, check_grids, diagonal, place};
use super::{FitError, SeamQuality, StitchParams, Surface, edges_in_seams, measure_seams};
use crate::grid::Grid;
use crate::network::Network;
use crate::observe::{Observer, Part};
use rayon::prelude::*;
use rows::{Row, Seam, Shared, conditions, wishes};
use star::{Gluing, gluings};
use std::collections::BTreeMap;
use system::{Fit, System};

/// How stiff the conditions are in each round, in weights of a control point. At first corners may still turn towards what the fit
/// wants, and the gluing functions follow.
const STIFF: [f64; 5] = [1e1, 1e3, 1e5, 1e7, 1e9];
/// Rounds after which conditions are to hold: from then on the first is the last in which no seam bends by more than [`GOAL_DEG`].
/// What an equation holds by a small factor alone, the slope of `a` or `b`, costs the fit much and the angle little: to take
/// the angles of a ball with corners of 3, 4 and 5 patches from 2.5e-4 degrees to rounding took its distances from 5 to 49 times those of plain fits.
const FIRST_FIRM_ROUND: usize = 3;
/// Largest angle of an exact seam, degrees: far above rounding, far below what any receiver tells from nothing.
pub const EXACT_DEG: f64 = 1e-3;
/// Largest angle that is left, degrees.
const GOAL_DEG: f64 = EXACT_DEG / 2.0;
/// Steps of conjugate gradients until the multipliers are renewed, and how often that is in a round. Steps of the same number
/// without conjugate directions left a ball of six patches 2.3 times as far off, and balls with corners of 3 to 8 patches up to 17 %.
const GRADIENT_STEPS: usize = 10;
const MULTIPLIER_STEPS: usize = 2;
/// Steps at most until the conditions are kept to [`KEPT`], a share of the diagonal: rounding.
const MOST_SETTLINGS: usize = 20;
const KEPT: f64 = 1e-13;
/// How often what is left of a part is solved again; one with bad patches in the last trial stays as it was.
const MOST_TRIALS: usize = 8;
/// How many times as far as before, beside the tolerance, a weighed seam may bend anywhere.
const MORE_BENT: f64 = 1.1;
/// How often the farthest place of the fit, or its tolerance, a place may be off.
const FAR_TO_FARTHEST: f64 = 4.0;

/// Surfaces with exact seams.
#[derive(Clone, Debug, PartialEq)]
pub struct Exact {
    /// One per patch.
    pub surfaces: Vec<Surface>,
    /// Curves of exact seams, rising.
    pub seams: Vec<u32>,
    /// Curves of smooth seams that could not be made exact and keep their angle, rising.
    pub kept: Vec<u32>,
}

/// Gives the patches on both sides of every smooth seam one tangent plane along it, to a thousandth of a degree.
///
/// * `grids` - those that `surfaces` were fitted to
/// * `surfaces` - as [`super::stitch`] returns them, with double knots along the seams ([`super::Continuity::G1Exact`])
///
/// Seams on edges ([`super::edges_in_seams`]), with simple knots or of one knot span, and those at corners where a patch is flat or
/// pointed keep their angle as nearly as a weight can hold it. Patches that would turn over or lie far off their grids, and those beside
/// a seam that would bend more than before, stay with their boundaries, bit for bit, and the others are solved again. So do patches
/// without exact seams around them. Corners at sharp curves and borders stay where they are.
///
/// # Errors
/// Lists that do not fit the network or each other, knots that differ along a chord, or the observer's wish.
///
/// Source: Collin, Sangalli, Takacs 2016 (linear gluing functions).
pub fn exact(
    network: &Network,
    grids: &[Grid],
    surfaces: &[Surface],
    params: &StitchParams,
    observer: &dyn Observer,
) -> Result<Exact, FitError> {
    params.check()?;
    let counts = check_grids(network, grids)?;
    let shapes: Vec<_> = surfaces.iter().map(|s| (s.rows, s.cols, s.control.len())).collect();
    check(network, "surfaces", &shapes)?;
    surfaces.iter().try_for_each(Surface::check)?;
    let uses = network.uses();
    let mut smooth: Vec<bool> =
        (0..uses.len()).map(|c| uses[c].len() == 2 && network.curves[c].kind.is_smooth()).collect();
    let wanted: Vec<u32> = (0..uses.len()).filter(|&c| smooth[c]).map(|c| c as u32).collect();
    edges_in_seams(network, grids, surfaces).iter().for_each(|edge| smooth[edge.curve as usize] = false);
    let fit = Fit::new(network, grids, surfaces, &counts, (params.smoothing, &|c| !smooth[c]))?;
    let misses = Misses::new(surfaces, grids);
    let folds = surfaces.par_iter().zip(grids).map(|(s, g)| folds(s, g)).collect();
    let far = FAR_TO_FARTHEST * misses.most.max(params.tolerance);
    let tolerance = params.angle_tolerance.to_radians();
    let bends = measure_seams(network, surfaces, observer)?;
    let task = Task { fit, surfaces, uses, misses, smooth, tolerance, folds, far, bends };
    let (surfaces, is_exact) = task.run(observer)?;
    observer.progress(1.0);
    let (seams, kept) = wanted.into_iter().partition(|&c| is_exact[c as usize]);
    Ok(Exact { surfaces, seams, kept })
}

/// The largest angle along exact seams, degrees, bounded between samples.
fn most_bent(
    network: &Network,
    surfaces: &[Surface],
    seams: &[Seam],
    observer: &dyn Observer,
) -> Result<f64, FitError> {
    let all = measure_seams(network, surfaces, observer)?;
    let exact = all.iter().filter(|s| seams[s.curve as usize] == Seam::Exact);
    Ok(exact.map(|s| s.angle_max_deg.max(s.regular_angle_bound_deg.unwrap_or(0.0))).fold(0.0, f64::max))
}

/// What all trials share.
struct Task<'a> {
    fit: Fit<'a>,
    /// Where everything begins.
    surfaces: &'a [Surface],
    uses: Vec<Vec<(u32, u8)>>,
    misses: Misses,
    /// For each curve whether its seam is to be exact.
    smooth: Vec<bool>,
    /// Of the angle of weighed seams, radians.
    tolerance: f64,
    /// How often each surface is turned over to begin with.
    folds: Vec<usize>,
    /// How far from its grid a surface may be anywhere.
    far: f64,
    /// The angles of all seams to begin with.
    bends: Vec<SeamQuality>,
}

/// A part with exact seams.
struct Solved {
    surfaces: Vec<Surface>,
    /// The states of all seams.
    seams: Vec<Seam>,
    shared: Shared,
}

impl Task<'_> {
    /// All surfaces, and for each curve whether its seam is exact.
    ///
    /// Bad patches are held as they were, from the third trial on with those around them, and what is left of their part is solved
    /// again.
    fn run(&self, observer: &dyn Observer) -> Result<(Vec<Surface>, Vec<bool>), FitError> {
        let mut made = self.surfaces.to_vec();
        let mut is_exact = vec![false; self.smooth.len()];
        let mut held = vec![false; made.len()];
        let mut parts = self.parts(&self.smooth, &held);
        for trial in 0..MOST_TRIALS {
            let share = 1.0 / (MOST_TRIALS * parts.len().max(1)) as f64;
            let mut left = Vec::new();
            for (i, wanted) in parts.iter().enumerate() {
                let part = Part::new(observer, trial as f64 / MOST_TRIALS as f64 + i as f64 * share, share);
                let Some(solved) = self.solved(wanted, &held, &part)? else { continue };
                let bad = self.bad(&solved, observer)?;
                if bad.is_empty() {
                    (0..made.len())
                        .filter(|&p| solved.shared.has(p))
                        .for_each(|p| made[p] = solved.surfaces[p].clone());
                    solved.seams.iter().zip(&mut is_exact).for_each(|(seam, is)| *is |= *seam == Seam::Exact);
                    continue;
                }
                self.around(bad, trial / 2).into_iter().for_each(|p| held[p] |= solved.shared.has(p));
                let goes_on: Vec<bool> = solved.seams.iter().map(|seam| *seam == Seam::Exact).collect();
                left.extend(self.parts(&goes_on, &held));
            }
            parts = left;
        }
        Ok((made, is_exact))
    }

    /// Patches of a part that turn over or lie far off their grids, and those beside weighed seams that bend more than they did, rising.
    fn bad(&self, solved: &Solved, observer: &dyn Observer) -> Result<Vec<usize>, FitError> {
        let is_bad = |p: &usize| {
            let (surface, grid) = (&solved.surfaces[*p], &self.fit.grids[*p]);
            folds(surface, grid) > self.folds[*p] || farthest(surface, grid) > self.far
        };
        let all = (0..self.surfaces.len()).into_par_iter();
        let mut bad: Vec<usize> = all.filter(|&p| solved.shared.has(p)).filter(is_bad).collect();
        let bends = measure_seams(self.fit.network, &solved.surfaces, observer)?;
        for (seam, before) in bends.iter().zip(&self.bends) {
            let most = before.regular_angle_max_deg * MORE_BENT + self.tolerance.to_degrees();
            if solved.seams[seam.curve as usize] == Seam::Weighed && seam.regular_angle_max_deg > most {
                let both = self.uses[seam.curve as usize].iter().map(|&(p, _)| p as usize);
                bad.extend(both.filter(|&p| solved.shared.has(p)));
            }
        }
        bad.sort_unstable();
        bad.dedup();
        Ok(bad)
    }

    /// These patches, and those within so many patches of them.
    fn around(&self, mut patches: Vec<usize>, rings: usize) -> Vec<usize> {
        for _ in 0..rings {
            let sides = |p: usize| self.fit.network.patches[p].sides;
            let beside = patches.iter().flat_map(|&p| sides(p)).flat_map(|side| &self.uses[side.curve as usize]);
            patches = beside.map(|&(p, _)| p as usize).collect();
            patches.sort_unstable();
            patches.dedup();
        }
        patches
    }

    /// Parts the exact ones among `wanted` seams into those that can be solved by themselves.
    /// * `held` - patches that stay as they are, and whose seams are not exact
    fn parts(&self, wanted: &[bool], held: &[bool]) -> Vec<Vec<bool>> {
        let (_, seams) = self.start(wanted, held);
        let shared = Shared::new(self.fit.network, self.surfaces, &seams, held);
        let pair = |c: usize| [0, 1].map(|k| self.uses[c][k].0 as usize);
        let labels = shared.parts((0..seams.len()).filter(|&c| seams[c] == Seam::Weighed).map(pair));
        let mut parts: BTreeMap<usize, Vec<bool>> = BTreeMap::new();
        for c in (0..seams.len()).filter(|&c| seams[c] == Seam::Exact) {
            parts.entry(labels[pair(c)[0]]).or_insert_with(|| vec![false; seams.len()])[c] = true;
        }
        parts.into_values().collect()
    }

    /// Conditions along exact seams, and wishes along weighed ones.
    fn rows(&self, seams: &[Seam], glued: &[Option<Gluing>], shared: &Shared) -> (Vec<Row>, Vec<Row>) {
        let network = self.fit.network;
        let (mut held, mut wished) = (Vec::new(), Vec::new());
        for (c, gluing) in glued.iter().enumerate() {
            let uses = &self.uses[c];
            match (seams[c], gluing) {
                (Seam::Exact, Some(gluing)) => held.extend(conditions(network, self.surfaces, uses, gluing, shared)),
                (Seam::Weighed, _) => {
                    // The tolerance all along costs what its patches can afford.
                    let afford: f64 = uses.iter().map(|&(p, _)| self.misses.afford_all(p as usize)).sum();
                    let cost = afford / 2.0 / self.tolerance.powi(2);
                    wished.extend(wishes(network, self.surfaces, uses, cost, shared));
                }
                _ => {}
            }
        }
        held.retain(|row| !row.terms.is_empty());
        wished.retain(|row| !row.terms.is_empty());
        (held, wished)
    }

    /// The patches at `wanted` seams and around them; `None` if no seam can be exact.
    fn solved(&self, wanted: &[bool], held: &[bool], observer: &dyn Observer) -> Result<Option<Solved>, FitError> {
        let network = self.fit.network;
        let (mut glued, seams) = self.start(wanted, held);
        if !seams.contains(&Seam::Exact) {
            return Ok(None);
        }
        let shared = Shared::new(network, self.surfaces, &seams, held);
        let mut system = System::new(&self.fit, &shared, self.surfaces);
        let exact_below = KEPT * diagonal(self.fit.grids);
        for (round, stiff) in STIFF.into_iter().enumerate() {
            if round > 0 {
                let renewed = gluings(network, &system.surfaces, &|c| seams[c] == Seam::Exact);
                glued.iter_mut().zip(renewed).for_each(|(old, new)| *old = new.or(old.take()));
            }
            let (conditions, wishes) = self.rows(&seams, &glued, &shared);
            system.renew(conditions, wishes);
            let factor = system.factor(stiff, observer)?;
            for _ in 0..MULTIPLIER_STEPS {
                system.descend(&factor, GRADIENT_STEPS, observer)?;
            }
            for _ in 0..if round + 1 < FIRST_FIRM_ROUND { 0 } else { MOST_SETTLINGS } {
                observer.check()?;
                if system.settle(&factor) < exact_below {
                    break;
                }
            }
            observer.progress((round + 1) as f64 / STIFF.len() as f64);
            if round + 1 >= FIRST_FIRM_ROUND && most_bent(network, &system.surfaces, &seams, observer)? <= GOAL_DEG {
                break;
            }
        }
        let surfaces = system.surfaces;
        Ok(Some(Solved { surfaces, seams, shared }))
    }

    /// The first gluing functions, and which seams have some.
    /// * `wanted`, `held` - as [`Task::parts`] has them
    fn start(&self, wanted: &[bool], held: &[bool]) -> (Vec<Option<Gluing>>, Vec<Seam>) {
        let network = self.fit.network;
        let is_beside = |c: usize| self.uses[c].iter().any(|&(p, _)| held[p as usize]);
        let mut seams: Vec<Seam> = (0..self.smooth.len())
            .map(|c| match self.smooth[c] {
                true if wanted[c] && !is_beside(c) => Seam::Exact,
                true => Seam::Weighed,
                false => Seam::None,
            })
            .collect();
        let mut stays = vec![false; network.corners.len()];
        for p in (0..held.len()).filter(|&p| held[p]) {
            (0..4).for_each(|k| stays[network.corner(p, k) as usize] = true);
        }
        loop {
            let found = gluings(network, self.surfaces, &|c| seams[c] == Seam::Exact);
            let mut is_done = true;
            for (c, (seam, found)) in seams.iter_mut().zip(&found).enumerate() {
                let ends = self.fit.network.curves[c].corners;
                let is_even = || (0..2).all(|e| !stays[ends[e] as usize] || self.is_even(c, e));
                if *seam == Seam::Exact && (found.is_none() || !is_even()) {
                    (*seam, is_done) = (Seam::Weighed, false);
                }
            }
            if is_done {
                return (found, seams);
            }
        }
    }

    /// True if both patches at a seam have one normal at its end `e` as they stand.
    fn is_even(&self, curve: usize, e: usize) -> bool {
        let normal = |k: usize| {
            let (p, side) = self.uses[curve][k];
            let reversed = self.fit.network.patches[p as usize].sides[side as usize].reversed;
            let (u, v) = place(side as usize, reversed, e as f64);
            self.surfaces[p as usize].jet(u, v).area_vector().normalize_or_zero()
        };
        let (m, n) = (normal(0), normal(1));
        m.dot(n) > 0.0 && m.cross(n).length() <= GOAL_DEG.to_radians()
    }
}
