//! Smooth seams: one system of least squares over the outer control points of the whole network.
//!
//! [K98] Krishnamurthy, *Fitting Smooth Surfaces to Dense Polygon Meshes*, §8.1.3.
//!
//! Unknown are the moves, along the normal, of the control points on smooth seams and in the ring beside all sides, and of
//! corners with smooth seams all around; the inside follows as the fit has it. What they cost the fit and what is left of
//! the angles is minimised together:
//!
//! ```text
//! sum over patches  (RMS of the move / miss)^2  +  sum over seams  weight (RMS angle / tolerance)^2
//! ```
//!
//! The bends of moves cost as they do in the fit, or seams would have waves beside them. The angle is linearised
//! (Gauss-Newton) and the weight of a seam is raised while it misses the tolerance and its patches can afford it. Seams on
//! edges that were not found stay sharp unless a person calls them smooth (`meet`). Control points next to a corner move as
//! one plane. Departs from [K98], which moves every control point of a seam onto the line between its neighbours: around
//! corners of other than four patches that cannot be.

use super::miss::farthest;
use super::params::StitchParams;
use super::system::System;
use super::work::Work;
use crate::grid::Grid;
use crate::network::{Network, Patch};
use crate::observe::Observer;
use crate::surface::fold::folds;
use crate::surface::{FitError, Surface};
use rayon::prelude::*;

/// How often the weights around patches that fold, alone or with a neighbour, or lie too far off somewhere, are lowered.
const EASINGS: usize = 4;
/// Passes in which patches that turned over get their curves back: neighbours may turn over in turn.
const REVERTS: usize = 3;

/// Gives the patches on both sides of every smooth seam one tangent plane along it, to the tolerance of the angle where the fit
/// can afford it, and those on both sides of a feature seam the slopes of their grids.
///
/// * `grids` - those that `surfaces` were fitted to
/// * `surfaces` - as [`super::fit_network`] returns them
///
/// Corners inside smooth seams move along their normals, all others stay where they are, and seams stay without gaps; control
/// points near seams move and all others are fitted again for that. A network without seams comes back as it is.
///
/// # Errors
/// Lists that do not fit the network or each other, knots that differ along a chord, or the observer's wish.
///
/// Source: [K98] §8.1.3.
pub fn stitch(
    network: &Network,
    grids: &[Grid],
    surfaces: &[Surface],
    params: &StitchParams,
    observer: &dyn Observer,
) -> Result<Vec<Surface>, FitError> {
    solved(network, grids, [surfaces, surfaces], vec![false; surfaces.len()], params, observer)
}

/// As [`stitch`] after an edit that changed some patches: solved for these and for those that share a corner with one of
/// them; all others keep their surfaces, bit for bit, and what meets them is smoothed against these.
///
/// * `surfaces` - as [`crate::surface::fit_network`] returns them
/// * `before` - as this or [`stitch`] made them last; with other numbers of control points all is solved
/// * `changed` - numbers of the patches whose fit is new
///
/// Equal to [`stitch`] to the bit if every patch is changed or shares a corner with one that is.
/// # Errors
/// As [`stitch`].
pub fn stitch_near(
    network: &Network,
    grids: &[Grid],
    (surfaces, before): (&[Surface], &[Surface]),
    changed: &[usize],
    params: &StitchParams,
    observer: &dyn Observer,
) -> Result<Vec<Surface>, FitError> {
    let alike = |(a, b): (&Surface, &Surface)| a.knots_u == b.knots_u && a.knots_v == b.knots_v;
    if before.len() != surfaces.len() || !surfaces.iter().zip(before).all(alike) {
        return stitch(network, grids, surfaces, params, observer);
    }
    if changed.is_empty() {
        return Ok(before.to_vec());
    }
    let corners =
        |p: &Patch| p.sides.map(|side| network.curves[side.curve as usize].corners[usize::from(side.reversed)]);
    let mut touched = vec![false; network.corners.len()];
    for &p in changed {
        corners(&network.patches[p]).iter().for_each(|&c| touched[c as usize] = true);
    }
    let held = network.patches.iter().map(|p| !corners(p).iter().any(|&c| touched[c as usize])).collect();
    solved(network, grids, [surfaces, before], held, params, observer)
}

fn solved(
    network: &Network,
    grids: &[Grid],
    [surfaces, stay]: [&[Surface]; 2],
    held: Vec<bool>,
    params: &StitchParams,
    observer: &dyn Observer,
) -> Result<Vec<Surface>, FitError> {
    params.check()?;
    if held.len() != network.patches.len() {
        let (found, wanted) = (held.len(), network.patches.len());
        return Err(FitError::Count { what: "surfaces", found, wanted });
    }
    let Some(work) = Work::new(network, grids, surfaces, stay, held, params)? else {
        return Ok(surfaces.to_vec());
    };
    observer.check()?;
    let before: Vec<usize> = surfaces.par_iter().zip(grids).map(|(s, g)| folds(s, g)).collect();
    // No place may be farther off than the farthest of the fit and, on top, the same share of it as moves have of all misses.
    let allowed = (1.0 + work.share.sqrt()) * work.misses.most;
    let mut curves = work.curves();
    let mut filled = work.filled(&curves, observer)?;
    // What a person wants rounded goes as far off as that takes.
    let is_rounded = |c: usize| work.uses[c].iter().any(|&(p, _)| work.rounded[p as usize].is_some());
    for _ in 0..REVERTS {
        let is_folded = |p: usize| folds(&filled[p].surface, &grids[p]) > before[p];
        let is_far = |p: usize| farthest(&filled[p].surface, &grids[p]) > allowed;
        let worse: Vec<(usize, bool)> =
            work.free().map(|p| (p, is_folded(p))).filter(|&(p, folded)| folded || is_far(p)).collect();
        let mut is_done = true;
        // A patch that the planes at its corners turn over, or take far off, keeps its curves.
        for (p, folded) in worse {
            for c in network.patches[p].sides.map(|side| side.curve as usize) {
                if (folded || !is_rounded(c)) && curves[c] != work.fitted[c] {
                    // Those of patches that stay are so already.
                    curves[c].clone_from(&work.fitted[c]);
                    is_done = false;
                }
            }
        }
        if is_done {
            break;
        }
        filled = work.filled(&curves, observer)?;
    }
    observer.progress(0.2);
    let allowed: Vec<f64> =
        (0..filled.len()).into_par_iter().map(|p| farthest(&filled[p].surface, &grids[p]).max(allowed)).collect();
    let mut system = System::new(&work, &filled, &curves, params, observer)?;
    for easing in 0..=EASINGS {
        system.settle(observer)?;
        let made: Vec<Surface> = (0..filled.len()).into_par_iter().map(|p| system.surface(p)).collect();
        let turned_back = system.beside_turned_back();
        let is_worse = |&p: &usize| {
            let is_far = work.rounded[p].is_none() && farthest(&made[p], &grids[p]) > allowed[p];
            is_far || turned_back[p] || folds(&made[p], &grids[p]) > before[p]
        };
        let worse: Vec<usize> = work.free().filter(is_worse).collect();
        observer.progress(0.2 + 0.8 * (easing + 1) as f64 / (EASINGS + 1) as f64);
        if worse.is_empty() || easing == EASINGS || !system.ease(&worse) {
            observer.progress(1.0);
            return Ok(made);
        }
    }
    unreachable!("the last easing returns")
}
