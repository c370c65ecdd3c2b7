//! Fits a whole network without gaps.
//!
//! [K98] Krishnamurthy, *Fitting Smooth Surfaces to Dense Polygon Meshes*, §6.2 and §8.1.3.
//!
//! Departs from [K98]: instead of averaging the boundary control points of neighbours after the fit, each curve of
//! the network is fitted once, from corner to corner, and both patches fit their inside for it. So seams are
//! exact, and no patch pays for its neighbour.

use super::basis::Knots;
use super::fit::{Direction, Directions, project, solve_inside, surface_of};
use super::fold::folds;
use super::params::{FitParams, Resolution};
use super::quality::heights;
use super::resolution::Plan;
use super::sides::{check_grids, curve_nodes, node, side_len};
use super::{FitError, Surface};
use crate::grid::Grid;
use crate::network::{Network, Patch};
use crate::observe::Observer;
use glam::DVec3;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Rounds that may raise the counts after the first choice: the fixed boundaries cost little, so that two do.
const COUNT_ROUNDS: usize = 3;

/// Weights of the smoothing that folded patches get, one after the other until they are open: from a tenth of what
/// the nodes weigh to a surface that is all but the blend of its boundary curves, which stay.
pub(super) const SMOOTHING: [f64; 4] = [0.1, 1.0, 10.0, 100.0];

/// For each curve how many times the tolerance a patch misses along its chord with as many control points as the grids carry,
/// and 0 if all keep it: where it is more, only finer grids help.
///
/// # Errors
/// As [`fit_network`].
pub fn starved(
    network: &Network,
    grids: &[Grid],
    params: &FitParams,
    observer: &dyn Observer,
) -> Result<Vec<f64>, FitError> {
    let nodes = check_grids(network, grids)?;
    params.check()?;
    Ok(Plan::new(network, grids, &nodes, params, params.allowed(grids), observer)?.excess())
}

/// Fits one surface to each grid of a network; neighbours share their boundary control points bit for bit.
///
/// * `grids` - one per patch, their boundary nodes the same on both sides of a curve
///
/// # Errors
/// Grids that do not fit the network or each other, more control points than nodes, or the observer's wish.
///
/// Source: [K98] §6.2.
pub fn fit_network(
    network: &Network,
    grids: &[Grid],
    params: &FitParams,
    observer: &dyn Observer,
) -> Result<Vec<Surface>, FitError> {
    let nodes = check_grids(network, grids)?;
    params.check()?;
    let allowed = params.allowed(grids);
    let mut plan = Plan::new(network, grids, &nodes, params, allowed, observer)?;
    let mut knots = plan.knots();
    let mut smoothing = vec![params.smoothing; grids.len()];
    let fit = |knots: &[Knots], smoothing: &[f64]| {
        fit_knots(network, grids, &nodes, knots, (params.smoothing, smoothing), observer)
    };
    let mut surfaces = fit(&knots, &smoothing)?;
    if matches!(params.resolution, Resolution::Tolerance(_)) {
        for _ in 0..COUNT_ROUNDS {
            // On a flat face a surface is as near as can be, and may still turn over within the face.
            let is_short =
                |(s, g): (&Surface, &Grid)| params.tolerance_of.of(&heights(s, g)) > allowed || folds(s, g) > 0;
            let short: Vec<bool> = surfaces.par_iter().zip(grids).map(is_short).collect();
            let patches = network.patches.iter().zip(&short).filter(|(_, short)| **short);
            if !plan.refine(patches.flat_map(|(patch, _)| patch.sides.map(|side| side.curve as usize))) {
                break;
            }
            let finer = plan.knots();
            let control = |patch: &Patch| [0, 1].map(|k| finer[patch.sides[k].curve as usize].control());
            let all: usize = network.patches.iter().map(|patch| control(patch).iter().product::<usize>()).sum();
            if params.max_control.is_some_and(|most| all > most) {
                break;
            }
            knots = finer;
            surfaces = fit(&knots, &smoothing)?;
        }
    }
    let folded =
        |surfaces: &[Surface]| -> Vec<usize> { surfaces.par_iter().zip(grids).map(|(s, g)| folds(s, g)).collect() };
    let mut counted = folded(&surfaces);
    for weight in SMOOTHING.into_iter().filter(|&w| w > params.smoothing) {
        if counted.iter().all(|&n| n == 0) {
            break;
        }
        let trial: Vec<f64> = smoothing.iter().zip(&counted).map(|(&s, &n)| if n > 0 { weight } else { s }).collect();
        let found = folded(&fit(&knots, &trial)?);
        // A fold that smoothing does not at least halve is the grid's own, and the detail would be lost for nothing.
        for p in 0..grids.len() {
            if counted[p] > 0 && 2 * found[p] <= counted[p] {
                smoothing[p] = weight;
            }
        }
        surfaces = fit(&knots, &smoothing)?;
        counted = folded(&surfaces);
    }
    Ok(surfaces)
}

/// Fits with known counts of nodes and knots along the curves, a smoothing for all curves and one for the inside
/// of each patch: a folded patch does not bend the curves of its neighbours, which would fold in turn.
fn fit_knots(
    network: &Network,
    grids: &[Grid],
    nodes: &[usize],
    knots: &[Knots],
    (curve_smoothing, smoothing): (f64, &[f64]),
    observer: &dyn Observer,
) -> Result<Vec<Surface>, FitError> {
    let used = (0..nodes.len()).filter(|&c| nodes[c] > 0).map(|c| (nodes[c], knots[c].clone()));
    let directions = Directions::new(used)?;
    let uses = network.uses();
    let curves: Vec<Result<Vec<DVec3>, FitError>> = curve_nodes(network, &uses, grids)
        .into_par_iter()
        .enumerate()
        .map(|(c, nodes)| {
            Ok(match nodes.len() {
                0 => Vec::new(),
                n if curve_smoothing == 0.0 => fit_curve(&nodes, directions.get(n, &knots[c])),
                n => fit_curve(&nodes, &directions.get(n, &knots[c]).smoothed(curve_smoothing)?),
            })
        })
        .collect();
    let curves = curves.into_iter().collect::<Result<Vec<_>, _>>()?;
    let done = AtomicUsize::new(0);
    let surfaces: Vec<Result<Surface, FitError>> = network
        .patches
        .par_iter()
        .zip(grids)
        .zip(smoothing)
        .map(|((patch, grid), &smoothing)| {
            observer.check()?;
            let [along_u, along_v] = patch_directions(patch, grid, &directions, knots);
            let projection = project(&grid.points, along_u, along_v);
            let net = if smoothing > 0.0 {
                fill(patch, &curves, &projection, &along_u.smoothed(smoothing)?, &along_v.smoothed(smoothing)?)
            } else {
                fill(patch, &curves, &projection, along_u, along_v)
            };
            observer.progress((done.fetch_add(1, Ordering::Relaxed) + 1) as f64 / grids.len() as f64);
            Ok(surface_of(net, along_u, along_v))
        })
        .collect();
    surfaces.into_iter().collect()
}

/// The directions along `u` and `v` of a patch.
pub(crate) fn patch_directions<'a>(
    patch: &Patch,
    grid: &Grid,
    directions: &'a Directions,
    knots: &[Knots],
) -> [&'a Direction; 2] {
    let along = |side: usize, nodes: usize| {
        let side = patch.sides[side];
        let knots = &knots[side.curve as usize];
        if side.reversed { directions.get(nodes, &knots.reversed()) } else { directions.get(nodes, knots) }
    };
    [along(0, grid.cols), along(1, grid.rows)]
}

/// A curve through the first and the last node, as near as it can to the others.
pub(super) fn fit_curve(nodes: &[DVec3], direction: &Direction) -> Vec<DVec3> {
    let mut net = vec![DVec3::ZERO; direction.control()];
    net[0] = nodes[0];
    *net.last_mut().expect("at least 4 control points") = nodes[nodes.len() - 1];
    direction.fit_curve(nodes.iter().copied(), &mut net, 1);
    net
}

/// The net of a patch with its boundary from `curves` and its inside fitted for that.
pub(crate) fn fill(
    patch: &Patch,
    curves: &[Vec<DVec3>],
    projection: &[DVec3],
    along_u: &Direction,
    along_v: &Direction,
) -> Vec<DVec3> {
    let (rows, cols) = (along_v.control(), along_u.control());
    let mut net = vec![DVec3::ZERO; rows * cols];
    for (k, side) in patch.sides.iter().enumerate() {
        let curve = &curves[side.curve as usize];
        let n = side_len(rows, cols, k);
        for i in 0..n {
            net[node(rows, cols, k, i, 0)] = curve[if side.reversed { n - 1 - i } else { i }];
        }
    }
    solve_inside(&mut net, projection, along_u, along_v, 1);
    net
}
