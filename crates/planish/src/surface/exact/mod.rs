//! Exact seams: one tangent plane along every smooth seam, to a thousandth of a degree.
//!
//! 1. gluing functions from the corners - `star`      2. what is unknown, and the equations of the seams - `rows`
//! 3. the fit under these equations - `system`
//!
//! See `docs/methods/surfaces.md`, "Exact seams".

mod rows;
mod star;
mod system;

use super::basis::uniform_parameters;
use super::fold::folds;
use super::seam::miss::{Misses, farthest};
use super::sides::{check, check_grids, diagonal};
use super::{FitError, StitchParams, Surface, edges_in_seams, measure_seams};
use crate::grid::Grid;
use crate::network::Network;
use crate::observe::{Observer, Part};
use glam::DVec3;
use rayon::prelude::*;
use rows::{Row, Seam, Shared, conditions, wishes};
use star::{Gluing, gluings};
use system::{Fit, System};

/// How stiff the conditions are in each round, in weights of a control point. At first corners may still turn towards what the fit
/// wants, and the gluing functions follow.
const STIFF: [f64; 5] = [1e1, 1e3, 1e5, 1e7, 1e9];
/// Rounds after which conditions are to hold: from then on the first is the last in which no seam bends by more than [`GOAL_DEG`].
/// What an equation holds by a small factor alone, the slope of `a` or `b`, costs the fit much and the angle little: to take
/// the angles of a ball with corners of 3, 4 and 5 patches from 2.5e-4 degrees to rounding took its distances from 5 to 49 times those of plain fits.
const FIRM: usize = 3;
/// Largest angle that is left, degrees: half of what exact seams are said to keep.
const GOAL_DEG: f64 = 5e-4;
/// Steps of conjugate gradients until the multipliers are renewed, and how often that is in a round. Steps of the same number
/// without conjugate directions left a ball of six patches 2.3 times as far off, and balls with corners of 3 to 8 patches up to 17 %.
const STEPS: usize = 10;
const TURNS: usize = 2;
/// Steps at most until the conditions are kept to [`EXACT`], a share of the diagonal: rounding.
const SETTLING: usize = 20;
const EXACT: f64 = 1e-13;
/// How often seams beside patches that turn over or lie too far off are given up.
const TRIALS: usize = 6;

/// How often the farthest place of the fit, or its tolerance, a place may be off.
const FAR: f64 = 4.0;

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
/// pointed keep their angle as nearly as a weight can hold it, and so do the seams of patches that would turn over or lie far off
/// their grids. Corners at sharp curves and borders stay where they are; patches without exact seams around them stay, bit for
/// bit.
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
    let before: Vec<usize> = surfaces.par_iter().zip(grids).map(|(s, g)| folds(s, g)).collect();
    let far = FAR * misses.most.max(params.tolerance);
    let task = Task { fit, surfaces, uses, misses, smooth, tolerance: params.angle_tolerance.to_radians() };
    let mut targets = grids.to_vec();
    let mut given_up = vec![0usize; surfaces.len()];
    for trial in 0..TRIALS {
        let part = Part::new(observer, trial as f64 / TRIALS as f64, 1.0 / TRIALS as f64);
        let Some((made, seams)) = task.solved(&given_up, &targets, &part)? else { break };
        let is_bad = |p: &usize| folds(&made[*p], &grids[*p]) > before[*p] || farthest(&made[*p], &grids[*p]) > far;
        let bad: Vec<usize> = (0..made.len()).into_par_iter().filter(is_bad).collect();
        if bad.is_empty() {
            observer.progress(1.0);
            let (exact, kept) = wanted.into_iter().partition(|&c| seams[c as usize] == Seam::Exact);
            return Ok(Exact { surfaces: made, seams: exact, kept });
        }
        for p in bad {
            // Once its seams are only weighed, the patch itself is what it was.
            if given_up[p] > 0 {
                targets[p].points = nodes_of(&surfaces[p], &grids[p]);
            }
            given_up[p] += 1;
        }
    }
    observer.progress(1.0);
    Ok(Exact { surfaces: surfaces.to_vec(), seams: Vec::new(), kept: wanted })
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

/// The points of a surface at the parameters of the nodes of a grid.
fn nodes_of(surface: &Surface, grid: &Grid) -> Vec<DVec3> {
    surface.sample(&uniform_parameters(grid.cols), &uniform_parameters(grid.rows), [0, 0])
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
}

/// Surfaces, and the states of all seams.
type Solved = (Vec<Surface>, Vec<Seam>);

impl Task<'_> {
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
        wished.retain(|row| !row.terms.is_empty());
        (held, wished)
    }

    /// The surfaces and the states of all seams; `None` if no seam can be exact.
    /// * `given_up` - for each patch how often it was bad: seams within that many patches of it are weighed
    fn solved(
        &self,
        given_up: &[usize],
        targets: &[Grid],
        observer: &dyn Observer,
    ) -> Result<Option<Solved>, FitError> {
        let network = self.fit.network;
        let (mut glued, seams) = self.start(given_up);

        if !seams.contains(&Seam::Exact) {
            return Ok(None);
        }
        let shared = Shared::new(network, self.surfaces, &seams);
        let mut system = System::new(&self.fit, &shared, targets, self.surfaces);
        let exact_below = EXACT * diagonal(self.fit.grids);
        for (round, stiff) in STIFF.into_iter().enumerate() {
            if round > 0 {
                let renewed = gluings(network, &system.surfaces, &|c| seams[c] == Seam::Exact);
                glued.iter_mut().zip(renewed).for_each(|(old, new)| *old = new.or(old.take()));
            }
            let (conditions, wishes) = self.rows(&seams, &glued, &shared);
            system.renew(conditions, wishes);
            let factor = system.factor(stiff, observer)?;
            for _ in 0..TURNS {
                system.descend(&factor, STEPS, observer)?;
            }
            for _ in 0..if round + 1 < FIRM { 0 } else { SETTLING } {
                observer.check()?;
                if system.settle(&factor) < exact_below {
                    break;
                }
            }
            observer.progress((round + 1) as f64 / STIFF.len() as f64);
            if round + 1 >= FIRM && most_bent(network, &system.surfaces, &seams, observer)? <= GOAL_DEG {
                break;
            }
        }
        Ok(Some((system.surfaces, seams)))
    }

    /// The first gluing functions, and which seams have some.
    fn start(&self, given_up: &[usize]) -> (Vec<Option<Gluing>>, Vec<Seam>) {
        let network = self.fit.network;
        let is_beside = |c: usize| self.uses[c].iter().any(|&(p, _)| given_up[p as usize] > 0);
        let mut seams: Vec<Seam> = (0..self.smooth.len())
            .map(|c| match self.smooth[c] {
                true if is_beside(c) => Seam::Weighed,
                true => Seam::Exact,
                false => Seam::None,
            })
            .collect();
        loop {
            let found = gluings(network, self.surfaces, &|c| seams[c] == Seam::Exact);
            let mut is_done = true;
            for (seam, found) in seams.iter_mut().zip(&found) {
                if *seam == Seam::Exact && found.is_none() {
                    (*seam, is_done) = (Seam::Weighed, false);
                }
            }
            if is_done {
                return (found, seams);
            }
        }
    }
}
